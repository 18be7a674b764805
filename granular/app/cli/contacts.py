"""Command `contacts`: analyse contacts of a 3-D run of another program."""

from __future__ import annotations

import argparse

from granular.app.cli import output
from granular.app.cli.parser import Command
from granular.cases.case import Option
from granular.studies import contacts


class ContactList(Command):
    """Estimate from a contact list whether means of a 3-D run agree with hard spheres."""

    USAGE = "FILE [--time-step NUMBER] [--diameter NUMBER] [options]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("file", metavar="FILE", help="dump local of LAMMPS (tracker or pair/local), or CSV file")
        parser.add_argument("--time-step", type=float, metavar="NUMBER", help="time step in s, required for LAMMPS")
        parser.add_argument("--diameter", type=float, metavar="NUMBER", help="diameter of all particles in m")
        parser.add_argument("--particles", type=int, metavar="NUMBER",
                            help="number of particles [all particles with a contact]")
        parser.add_argument("--columns", metavar="NAMES", help="names of all columns of a LAMMPS file, in quotes")
        output.add_outputs(parser, json="write all numbers")
        return []

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        if parsed.file.lower().endswith(".csv"):
            for option in ("time_step", "columns"):
                if getattr(parsed, option) is not None:
                    raise ValueError(f"--{option.replace('_', '-')} must be left out for a CSV file, which contains "
                                     "times in s and names of columns.")
            given = contacts.read_csv(parsed.file)
            if parsed.diameter is not None:
                given.setdefault("distance", parsed.diameter)
        elif parsed.time_step is None:
            raise ValueError("contacts requires --time-step for a dump of LAMMPS, whose times are numbers of steps.")
        else:
            given = contacts.read_lammps(
                parsed.file, parsed.time_step, diameter=parsed.diameter, columns=parsed.columns)
        output.write_report(contacts.analyse(**given, particles=parsed.particles), parsed)
