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
    "verify": "verify:Verify", "warm": "installation:Warm", "info": "installation:Info",
}
"""Location of each command: a module of this package, and its `Command`."""
PROGRAM_DESCRIPTION = """\
Balls on a line as hard spheres (edmd: event-driven, instantaneous collisions)
and as soft spheres (md: Newton's equation with a contact force), and whether
the two models agree. All numbers are in SI units."""
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
"""Options of the engines that only the table [run] of a TOML file offers."""


class Command:
    """A command. Its docstring is its description, in one line."""

    USAGE = "SCENE|FILE.toml [options]"
    """Arguments, as printed in the help text."""
    TITLE = "run"
    """Heading of its options."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        """Add its own options, and return the options that come from a signature."""
        return []

    @staticmethod
    def run(given: argparse.Namespace) -> list[Trajectory] | int | None:
        """Run the command.

        Returns an exit code, or runs whose status decides the exit code, or None.
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
    """Parse the arguments.

    The result has the function `act` of the command, its `target`, and the given options of the scene (`given`) and of
    the run (`run`).
    """
    # a negative number such as -1e-4 would be taken for an option, but not behind a space
    command, *rest = [f" {word}" if re.match(r"-[\d.]", word) else word for word in arguments] or ["--help"]
    top = Parser(prog="granular", description=PROGRAM_DESCRIPTION, epilog=PROGRAM_EXAMPLES)
    top.add_argument("--version", action="version", version=f"granular {VERSION}")
    commands = top.add_subparsers(title="commands, each with its own --help", metavar="COMMAND", required=True)
    if command.startswith("-"):
        for name in COMMAND_CLASSES:
            commands.add_parser(name, help=_about(_command(name)).rstrip("."))
        top.parse_args([command])
    check.known([command], COMMAND_CLASSES, "command")
    chosen = _command(command)
    of_scene = chosen.USAGE.startswith("SCENE")
    target, rest = _target(rest) if of_scene else (None, rest)
    parser = commands.add_parser(command, **_settings(command, chosen, target))
    parameters = cases.options(target) if target in cases.names() and command != "scenes" else []
    _add(parser, f"scene {target}", parameters)
    offered = [option for option in chosen.arguments(parser) if option.name not in {p.name for p in parameters}]
    _add(parser, chosen.TITLE, offered)
    found, extra = top.parse_known_args([command, *rest])
    flags = sorted(set(re.findall(r"--[a-z][\w-]*", parser.format_help()))) if extra else []
    check.known([word.partition("=")[0] for word in extra if word[:1] == "-"], flags, "option")
    if extra:
        raise ValueError(f"unexpected argument {extra[0].strip()!r}; see {parser.prog} --help")
    if of_scene and command != "scenes" and target is None:
        raise ValueError(f"{command} requires a scene or a TOML file. Known scenes: {', '.join(cases.names())}.")
    return argparse.Namespace(**vars(found) | {
        "act": chosen.run, "target": target, "given": _given(parameters, found), "run": _given(offered, found)})


def case_of(given: argparse.Namespace) -> cases.Case:
    """Return the case that a command line names."""
    case = cases.load(given.target) if is_file(given.target) else cases.make(given.target, **given.given)
    words = getattr(given, "until", None)
    if words is None:
        return case
    condition = words[0] if words[0] == UNTIL_SEPARATED else dict(word for word in words if word != UNTIL_SEPARATED)
    return replace(case, until=stop_condition(condition, case.scene))


def offer_until(parser: argparse.ArgumentParser) -> None:
    """Add the option --until."""
    parser.add_argument("--until", nargs="+", metavar="NAME=VALUE",
                        type=lambda text: UNTIL_SEPARATED if text.strip() == UNTIL_SEPARATED else _entry(text),
                        help="stop the run there: pair=0 nth=2 (a contact); type=force pair=0 above=1e3; type=speed "
                             "ball=2 above=1.5; type=position ball=2 above=0.8 (or below=); separated")


def teller(target: str | None) -> Callable[[str], None]:
    """Return a function that prints once per place that a scene runs Python code."""
    places: set[str] = set()

    def tell(place: str) -> None:
        if place not in places:
            places.add(place)
            print(f"granular: {target!r} names Python code: running {place!r}", file=sys.stderr)

    return tell


def offered(function: Callable[..., Any], *names: str) -> list[Option]:
    """Return options of a run: its end, and options of a function.

    They are the options with the given names, or all but `HIDDEN_OPTIONS`.
    """
    end = [option for option in options_of(cases.make) if option.name == "t_end"]
    return end + [option for option in options_of(function)
                  if (option.name in names if names else option.name not in HIDDEN_OPTIONS)]


def _target(rest: Sequence[str]) -> tuple[str | None, list[str]]:
    """Split off the scene or TOML file: the first argument, or one that looks like it."""
    for k, word in enumerate(rest):
        if (k == 0 and not word.startswith("-")) or word in cases.names() or word.lower().endswith(".toml"):
            if not is_file(word):
                check.choice("scene", word, cases.names())
            return word, [*rest[:k], *rest[k + 1 :]]
    return None, list(rest)


def _command(name: str) -> type[Command]:
    module, _, word = COMMAND_CLASSES[name].partition(":")
    command: type[Command] = getattr(import_module(f"granular.app.cli.{module}"), word)
    return command


def _about(command: type[Command]) -> str:
    """Return the description of a command with a small first letter."""
    about = str(command.__doc__)
    return about[0].lower() + about[1:]


def _settings(command: str, chosen: type[Command], target: str | None) -> dict[str, Any]:
    """Return the argparse settings of a command, for a scene if `target` is given."""
    description, usage = _about(chosen), chosen.USAGE
    settings = {"prog": f"granular {command}"}
    if usage.startswith("SCENE"):
        description += " All numbers are in SI units."
        listed = ", ".join(cases.names())
        settings["epilog"] = output.fitted(
            f"scenes: {listed}\ngranular {command} SCENE --help lists the parameters of a scene.")
    if target is not None:
        settings = {"prog": f"granular {command} {target}"}
        usage = " ".join([target, *usage.split()[1:]])
        if target in cases.names():
            description = f"{cases.about(target)}\n\n{description}"
    return settings | {"usage": f"granular {command} {usage}", "description": output.fitted(description)}


def _add(parser: argparse.ArgumentParser, title: str, options: Iterable[Option]) -> None:
    group = parser.add_argument_group(title)
    for option in options:
        about = re.sub(r"`+|\*(?=\w+\*)|(?<=\w)\*", "", option.about).replace("%", "%%")
        shown = "" if option.default is None else f" [{_shown(option.default)}]"
        group.add_argument("--" + option.name.replace("_", "-"), dest=option.name, default=argparse.SUPPRESS,
                           help=about + shown, **_reading(option.kind))


def _reading(kind: str) -> dict[str, Any]:
    """Return argparse settings for a parameter with this annotation."""
    ways: dict[str, dict[str, Any]] = {
        "bool$": {"action": argparse.BooleanOptionalAction},
        ".*Sequence\\[str\\]": {"nargs": "+", "metavar": "WORD"},
        ".*Sequence": {"type": _number, "nargs": "+", "metavar": "X"},
        "Any$": {"type": _entry, "nargs": "+", "metavar": "NAME=VALUE"},
        "int \\| str": {"type": lambda text: text if text.isalpha() else _whole(text), "metavar": "N|WORD"},
        "int": {"type": _whole, "metavar": "N"},
        "float": {"type": _number, "metavar": "X"},
        "": {"metavar": "WORD"},
    }
    return next(how for start, how in ways.items() if re.match(start, kind))


def _given(options: Iterable[Option], found: argparse.Namespace) -> dict[str, Any]:
    """Return the options that are given, by name."""
    return {one.name: _meant(one.kind, getattr(found, one.name)) for one in options if one.name in found}


def _meant(kind: str, value: Any) -> Any:
    """Return one number of a list of one, or the table of NAME=VALUE entries."""
    if kind == "Any":
        return dict(value)
    return value[0] if kind.startswith("float") and isinstance(value, list) and len(value) == 1 else value


def _entry(text: str) -> tuple[str, float | str]:
    name, equals, value = text.strip().partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"must be NAME=VALUE, such as type=Sine, got {text.strip()!r}")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text.strip()!r}") from None


def _whole(text: str) -> int:
    number = _number(text)
    if number != number // 1:  # also true of nan
        raise argparse.ArgumentTypeError(f"must be an integer, got {text.strip()!r}")
    return int(number)


def _shown(default: Any) -> str:
    if isinstance(default, (list, tuple)):
        return " ".join(map(_shown, default))
    return f"{default:g}" if isinstance(default, float) else str(default)
