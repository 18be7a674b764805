"""Command `verify`: reference numbers for other codes, and a check of theirs."""

from __future__ import annotations

import argparse
from collections import Counter

from granular._engine import files
from granular._engine.reports import aligned
from granular.app.cli import output
from granular.app.cli.parser import Command
from granular.cases.case import Option
from granular.studies import verification

CHECK_WORDS = "right", "ill-conditioned", "wrong", "missing"
EXIT_RIGHT, EXIT_NOT_RIGHT = 0, 1
"""Exit codes."""
MAX_PRINTED_ANSWERS = 12
"""Maximum number of printed answers, and of printed wrong numbers."""


class Verify(Command):
    """List or write reference cases for other codes, or check their numbers."""

    USAGE = "[CASE] [-o FILE] [--check FILE.csv [--tolerance NUMBER]]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("case", nargs="?", metavar="CASE", help=f"one of {', '.join(verification.names())}")
        parser.add_argument("-o", "--output", metavar="FILE", help="write it: .csv (answers), .json (everything)")
        parser.add_argument("--check", metavar="FILE.csv", help="table written by -o, with the values of another code")
        parser.add_argument("--tolerance", type=float, metavar="NUMBER",
                            help="relative difference that counts as right [every digit that is written]")
        return []

    @staticmethod
    def run(given: argparse.Namespace) -> int:
        if given.case is None:
            if given.output or given.check:
                raise ValueError(f"{'--check' if given.check else '-o'} requires a case: one of "
                                 f"{', '.join(verification.names())}.")
            rows = [[name, verification.case(name)["about"]] for name in verification.names()]
            print(output.fitted(aligned(rows, "<")))
            print(output.fitted("\ngranular verify CASE -o FILE.csv writes a case.\n"
                                "granular verify CASE --check FILE.csv checks your numbers."))
        elif given.check:
            return _checked(given)
        elif given.output:
            verification.write(given.case, given.output)
            print(f"{given.output}: {len(verification.answers(given.case))} answers of {given.case}")
        else:
            _show(given.case)
        return EXIT_RIGHT


def _show(name: str) -> None:
    told, rows = verification.case(name), verification.answers(name)
    lines = [f"{told['about']}\n{told['source']}\n", *(f"- {line}" for line in verification.kit()["conventions"]),
             f"\n{'value':>24} unit  condition  quantity"]
    lines += [f"{one.value:>24} {one.unit:5} {one.condition:<9g}  {one.run}: {one.quantity}"
              for one in rows[:MAX_PRINTED_ANSWERS]]
    if len(rows) > MAX_PRINTED_ANSWERS:
        lines.append(f"… {len(rows) - MAX_PRINTED_ANSWERS} more; granular verify {name} -o FILE.json writes all of "
                     "them, and the set-up.")
    print(output.fitted("\n".join(lines)))


def _checked(given: argparse.Namespace) -> int:
    """Print the result of a check; return `EXIT_NOT_RIGHT` unless all is right."""
    found = verification.check(given.case, given.check, given.tolerance)
    count = Counter(one.word for one in found)
    bad = [one for one in found if one.word in ("wrong", "missing")]
    many = ", ".join(f"{count[word]} {word}" for word in CHECK_WORDS if count[word])
    first = next((one for one in bad if one.word == "wrong"), None)
    print(f"{given.case}: of {len(found)} answers {many}.")
    if first is not None:
        print(output.fitted(
            f"First wrong: {first.answer.run}: {first.answer.quantity}: {files.plain_text(first.theirs)} instead of "
            f"{first.answer.value} {first.answer.unit}, relative difference {first.off:.1e}."))
    for one in [one for one in found if one.word != "right"][:MAX_PRINTED_ANSWERS]:
        off = "" if one.word == "missing" else f" by {one.off:.1e}"
        print(f"  {one.word}{off}: {one.answer.run}: {one.answer.quantity}")
    return EXIT_NOT_RIGHT if bad else EXIT_RIGHT
