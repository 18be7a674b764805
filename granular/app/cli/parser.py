"""Command-line parser. Options come from signatures and docstrings.

``granular compare gas --help`` lists the parameters of `granular.scenes.gas`, for example, with units and defaults.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any, NoReturn

from granular import cases
from granular._engine import check
from granular._engine.package import VERSION
from granular.app.cli import output
from granular.cases.case import CASE_ARGUMENTS, Option, options_of
from granular.cases.ready import is_file
from granular.cases.toml import stop_condition
from granular.run.trajectory import Trajectory

COMMAND_CLASSES = {
    "scenes": "one_scene:Scenes", "run": "one_scene:Run", "compare": "one_scene:Compare", "sweep": "sweep:Sweep",
    "threshold": "one_scene:Threshold", "frontier": "one_scene:Frontier", "stability": "one_scene:Stability",
    "sensitivity": "sweep:Sensitivity", "ensemble": "sweep:Ensemble", "page": "pages:Page", "view": "pages:View",
    "contacts": "contacts:ContactList",
    "verify": "verify:Verify", "warm": "installation:Warm", "info": "installation:Info",
}
"""Location of each command: a module of this package, and its `Command`."""
PROGRAM_DESCRIPTION = """\
Simulate balls on a line as hard spheres (edmd: event-driven, instantaneous
collisions) and as soft spheres (md: Newton's equation with a contact force),
and report whether the two models agree. All numbers are in SI units."""
PROGRAM_EXAMPLES = """\
examples:
  granular compare three-balls --restitution 0.7  both engines on one scene
  granular compare three-balls --help             parameters of this scene
  granular scenes                                 ready-made scenes
  granular scenes three-balls > mine.toml         one of them as a file to edit
  granular run bouncing-ball --engine edmd        hard spheres only
  granular run mine.toml --engine md --dt 1e-7    soft spheres, your own scene
  granular sweep three-balls --over restitution=0.5:1:101 --refine restitution
  granular sweep mine.toml --over gap[1]=1e-6:1e-2:41:log
  granular threshold three-balls --over gap       minimum gap for hard spheres
  granular sensitivity three-balls                derivatives and uncertainties
  granular ensemble gas --vary seed --draws 200   means over random gases
  granular frontier three-balls --plot out.png    error against run time
  granular stability three-balls                  stiff and extreme variants
  granular page --open                            teaching page in the browser
  granular run gas --engine edmd --samples 500 --save gas.npz
  granular view gas.npz --open                    play a recorded run
  granular verify touching-cradle --check my.csv  check numbers of another code
  granular contacts seen.local --time-step 1e-6   contacts of a LAMMPS run
  granular warm                                   compile all kernels now
  granular info                                   versions, for bug reports

exit codes:
  0    success
  1    verify found a wrong or missing number
  2    misuse, or a file that cannot be read or written
  3    the run did not end properly: unstable (the time step is too long),
       broken (the final state is invalid), max_events (limit on the work)
  130  interrupted
  143  ended by SIGTERM"""
UNTIL_SEPARATED = "separated"
HIDDEN_OPTIONS = CASE_ARGUMENTS | {"engine", "log", "t_start", "watch"}
"""Options of the engines that the command line does not offer.

They can be set in the table [run] of a TOML file.
"""


class Command:
    """Base class of all commands. The docstring of a command is its description."""

    USAGE = "SCENE|FILE.toml [options]"
    """Arguments, as printed in the help text."""
    TITLE = "run"
    """Heading of its options."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        """Add the command's own options, and return the options from signatures."""
        return []

    @staticmethod
    def run(parsed: argparse.Namespace) -> list[Trajectory] | int | None:
        """Run the command.

        Returns
        -------
        list of Trajectory, int or None
            Runs whose status determines the exit code, or an exit code. None is a success.
        """
        raise NotImplementedError


class Parser(argparse.ArgumentParser):
    """Parser that raises `ValueError` with one sentence instead of exiting."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self.add_argument("--traceback", action="store_true", help="show where an error came from (to report a bug)")

    def _print_message(self, message: str, file: object = None) -> None:
        print(message, end="", flush=True)  # argparse ignores write errors, such as a full disk

    def error(self, message: str) -> NoReturn:
        raise ValueError(f"{message}; see {self.prog} --help")


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the arguments of the command line.

    Returns
    -------
    argparse.Namespace
        It has the function `act` that runs the command, the scene or file `target`, and the options of the command. The
        dictionary `scene_options` has the options of the scene, and `run_options` all other options that come from a
        signature.
    """
    # argparse would read a negative number such as -1e-4 as an option; a leading space prevents this
    command, *rest = [f" {word}" if re.match(r"-[\d.]", word) else word for word in arguments] or ["--help"]
    top = Parser(prog="granular", description=PROGRAM_DESCRIPTION, epilog=PROGRAM_EXAMPLES)
    top.add_argument("--version", action="version", version=f"granular {VERSION}")
    commands = top.add_subparsers(title="commands, each with its own --help", metavar="COMMAND", required=True)
    if command.startswith("-"):
        for name in COMMAND_CLASSES:
            commands.add_parser(name, help=_description(_load_command(name)).rstrip("."))
        top.parse_args([command])
    check.known_names([command], COMMAND_CLASSES, "command")
    command_class = _load_command(command)
    of_scene = command_class.USAGE.startswith("SCENE")
    target, rest = _split_target(rest) if of_scene else (None, rest)
    parser = commands.add_parser(command, **_parser_settings(command, command_class, target))
    parameters = cases.options(target) if target in cases.names() and command != "scenes" else []
    _add_options(parser, f"scene {target}", parameters)
    run_options = [option for option in command_class.arguments(parser)
                   if option.name not in {p.name for p in parameters}]
    _add_options(parser, command_class.TITLE, run_options)
    parsed, unknown = top.parse_known_args([command, *rest])
    flags = sorted(set(re.findall(r"--[a-z][\w-]*", parser.format_help()))) if unknown else []
    check.known_names([word.partition("=")[0] for word in unknown if word[:1] == "-"], flags, "option")
    if unknown:
        raise ValueError(f"unexpected argument {unknown[0].strip()!r}; see {parser.prog} --help")
    if of_scene and command != "scenes" and target is None:
        raise ValueError(f"{command} requires a scene or a TOML file. Known scenes: {', '.join(cases.names())}.")
    return argparse.Namespace(**vars(parsed) | {
        "act": command_class.run, "target": target, "scene_options": _given_options(parameters, parsed),
        "run_options": _given_options(run_options, parsed)})


def case_of(parsed: argparse.Namespace) -> cases.Case:
    """Return the case that the parsed arguments describe."""
    case = cases.load(parsed.target) if is_file(parsed.target) else cases.make(parsed.target, **parsed.scene_options)
    words = getattr(parsed, "until", None)
    if words is None:
        return case
    condition = words[0] if words[0] == UNTIL_SEPARATED else dict(word for word in words if word != UNTIL_SEPARATED)
    return replace(case, until=stop_condition(condition, case.scene))


def add_until_option(parser: argparse.ArgumentParser, force: bool = True) -> None:
    """Add the option --until. `force` states whether a contact force can end the run."""
    of_force = "type=force pair=0 above=1e3 (N, soft spheres only); " if force else ""
    parser.add_argument("--until", nargs="+", metavar="NAME=VALUE",
                        type=lambda text: UNTIL_SEPARATED if text.strip() == UNTIL_SEPARATED else _parse_entry(text),
                        help=f"stop condition: pair=0 nth=2 (a contact); {of_force}type=speed "
                             "ball=2 above=1.5 (m/s); type=position ball=2 above=0.8 (m; or below=); separated")


def code_notice_printer(target: str | None) -> Callable[[str], None]:
    """Return a function that reports that a scene runs Python code.

    The function prints each place in the code once.
    """
    places: set[str] = set()

    def print_once(place: str) -> None:
        if place not in places:
            places.add(place)
            print(f"granular: {target!r} names Python code: running {place!r}", file=sys.stderr)

    return print_once


def options_from(function: Callable[..., Any], *names: str) -> list[Option]:
    """Return the options of a run: t_end, and parameters of a function.

    The parameters are those with the given names. Without names they are all parameters except `HIDDEN_OPTIONS`.
    """
    end = [option for option in options_of(cases.make) if option.name == "t_end"]
    return end + [option for option in options_of(function)
                  if (option.name in names if names else option.name not in HIDDEN_OPTIONS)]


def _split_target(rest: Sequence[str]) -> tuple[str | None, list[str]]:
    """Split the scene or TOML file off the arguments, and return it and the rest.

    It is the first argument, the name of a ready-made scene, or a name that ends in .toml.
    """
    for k, word in enumerate(rest):
        if (k == 0 and not word.startswith("-")) or word in cases.names() or word.lower().endswith(".toml"):
            if not is_file(word):
                check.choice("scene", word, cases.names())
            return word, [*rest[:k], *rest[k + 1 :]]
    return None, list(rest)


def _load_command(name: str) -> type[Command]:
    module, _, word = COMMAND_CLASSES[name].partition(":")
    command: type[Command] = getattr(import_module(f"granular.app.cli.{module}"), word)
    return command


def _description(command: type[Command]) -> str:
    """Description of a command, beginning with a lower-case letter."""
    about = str(command.__doc__)
    return about[0].lower() + about[1:]


def _parser_settings(command: str, command_class: type[Command], target: str | None) -> dict[str, Any]:
    """Return the argparse settings of a command, for a scene if `target` is given."""
    description, usage = _description(command_class), command_class.USAGE
    settings = {"prog": f"granular {command}"}
    if usage.startswith("SCENE"):
        description += " All numbers are in SI units."
        listed = ", ".join(cases.names())
        settings["epilog"] = output.wrap_text(
            f"scenes: {listed}\ngranular {command} SCENE --help lists the parameters of a scene.")
    if target is not None:
        settings = {"prog": f"granular {command} {target}"}
        usage = " ".join([target, *usage.split()[1:]])
        if target in cases.names():
            description = f"{cases.about(target)}\n\n{description}"
    return settings | {"usage": f"granular {command} {usage}", "description": output.wrap_text(description)}


def _add_options(parser: argparse.ArgumentParser, title: str, options: Iterable[Option]) -> None:
    """Add options to a parser, as a group with the given title."""
    group = parser.add_argument_group(title)
    for option in options:
        about = re.sub(r"`+|\*(?=\w+\*)|(?<=\w)\*", "", option.about).replace("%", "%%")
        about = re.sub(r'(\w+)="(\w+)"', r"--\1 \2", about)
        about = re.sub(r"(?<=\d) (?=\d{3}\b)", "\u00a0", about)  # keeps 1 000 000 on one line
        has_default = option.default is not None and "efault" not in about  # a text can state the default itself
        shown = f" [{_default_text(option.default)}]" if has_default else ""
        group.add_argument("--" + option.name.replace("_", "-"), dest=option.name, default=argparse.SUPPRESS,
                           help=about + shown, **_argparse_settings(option.kind))


def _argparse_settings(kind: str) -> dict[str, Any]:
    """Return the argparse settings for a parameter with the annotation `kind`."""
    settings: dict[str, dict[str, Any]] = {
        "bool$": {"action": argparse.BooleanOptionalAction},
        ".*Sequence\\[str\\]": {"nargs": "+", "metavar": "WORD"},
        ".*Sequence": {"type": _parse_number, "nargs": "+", "metavar": "X"},
        "Any$": {"type": _parse_entry, "nargs": "+", "metavar": "NAME=VALUE"},
        "int \\| str": {"type": lambda text: text if text.isalpha() else _parse_integer(text), "metavar": "N|WORD"},
        "int": {"type": _parse_integer, "metavar": "N"},
        "float": {"type": _parse_number, "metavar": "X"},
        "": {"metavar": "WORD"},
    }
    return next(setting for start, setting in settings.items() if re.match(start, kind))


def _given_options(options: Iterable[Option], parsed: argparse.Namespace) -> dict[str, Any]:
    """Return the values of those options that the command line contains, by name."""
    return {option.name: _converted_value(option.kind, getattr(parsed, option.name))
            for option in options if option.name in parsed}


def _converted_value(kind: str, value: Any) -> Any:
    """Convert a parsed value to the type of its parameter.

    A list of NAME=VALUE entries becomes a dictionary. A list of one number becomes the number if the annotation
    permits it.
    """
    if kind == "Any":
        return dict(value)
    return value[0] if kind.startswith("float") and isinstance(value, list) and len(value) == 1 else value


def _parse_entry(text: str) -> tuple[str, float | str]:
    """Return name and value (float or string) of an entry NAME=VALUE."""
    name, equals, value = text.strip().partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"must be NAME=VALUE, such as type=Sine, got {text.strip()!r}")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _parse_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text.strip()!r}") from None


def _parse_integer(text: str) -> int:
    number = _parse_number(text)
    if number != number // 1:  # also true of nan
        raise argparse.ArgumentTypeError(f"must be an integer, got {text.strip()!r}")
    return int(number)


def _default_text(default: Any) -> str:
    if isinstance(default, (list, tuple)):
        return " ".join(map(_default_text, default))
    return f"{default:g}" if isinstance(default, float) else str(default)
