"""Arguments of the command. The options of a scene and of a run come from the signatures and docstrings that have them.

So ``granular compare gas --help`` lists the parameters of `granular.scenes.gas`, with their units and defaults.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

from granular import _check, cases
from granular.cases.case import ENGINES, engine_named
from granular.cases.options import Option, options_of, unknown
from granular.cli.output import json_file

ABOUT = """\
Balls on a line as hard spheres (edmd: event-driven, instantaneous collisions) and as soft spheres (md: Newton's
equation with a contact force). Do the two agree? All numbers are in SI units.

commands, each with its own --help:
  scenes     list the ready-made scenes, or print one as a TOML file
  run        run a scene on one engine
  compare    run a scene on both engines and say where and why they differ
  sweep      solve a scene for all combinations of some parameters
  figure     compute and draw a figure of the paper, or all of them
  frontier   measure the error of every method against its run time, on one scene
  stability  run stiff and extreme cases by every method: right, flagged, or silently wrong?
  page       write the teaching page: both engines live in one HTML file
  view       write an HTML page that plays recorded runs

examples:
  granular scenes                                   the ready-made scenes
  granular scenes three-balls > mine.toml           one of them as a file to change
  granular run bouncing-ball --engine edmd          run one engine
  granular run mine.toml --engine md --dt 1e-7      ... on a scene of your own
  granular compare three-balls --restitution 0.7    both engines on one scene, and where they part
  granular compare three-balls --help               the parameters of that scene
  granular sweep three-balls --over restitution=0.5:1:101 --refine restitution
  granular frontier three-balls --plot out.png      error against run time of every method
  granular page --open                              the teaching page, in the browser
  granular run gas --engine edmd --samples 500 --save gas.npz && granular view gas.npz --open

exit codes: 0 done; 2 misuse, or a file that cannot be read or written; 3 the run came to no proper end (status
unstable: the time step is too long; max_events: the limit on the amount of work); 130 interrupted"""
COMMANDS = dict(re.findall(r"^  (\w+) {2,8}(\w.*)", ABOUT, re.MULTILINE))
HIDDEN = {"t_end", "until", "on_event", "on_progress", "engine", "log", "t_start"}
"""Keyword options of the engines that the command line does not offer; a TOML file's [run] does."""


class Parser(argparse.ArgumentParser):
    """Raises ValueError with one sentence in place of printing usage and leaving."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self.add_argument("--traceback", action="store_true", help="show where an error came from (to report a bug)")

    def error(self, message: str) -> NoReturn:
        raise ValueError(f"{message}; see {self.prog} --help")

    def all_of(self, arguments: Sequence[str]) -> argparse.Namespace:
        """Parse all arguments; the first that is not known is named, with the nearest option."""
        # a negative number such as -1e-4 would be taken for an option, but not behind a space
        spaced = [f" {a}" if re.match(r"-[\d.]", a) else a for a in arguments]
        found, extra = self.parse_known_args(spaced)
        if names := [a.partition("=")[0] for a in extra if a.startswith("-")]:
            raise ValueError(unknown(names, self.flags(), f"option of {self.prog}"))
        if extra:
            raise ValueError(f"{extra[0].strip()!r} is one argument too many; see {self.prog} --help")
        return found

    def flags(self) -> list[str]:
        """All long options, as the help lists them."""
        return sorted(set(re.findall(r"--[a-z][\w-]*", self.format_help())))


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what the command line says: `command`, `target`, and `given`, `run` with the options given."""
    command, *rest = arguments or ["--help"]
    if command.startswith("-"):
        return _top().all_of(arguments or ["--help"])
    if command not in COMMANDS:
        raise ValueError(f"{unknown([command], list(COMMANDS), 'command')}")
    if command == "figure":
        return _figure(rest)
    if command == "stability":
        return _stability(rest)
    if command in ("page", "view"):
        return _page(command, rest)
    target, others = _target(rest)
    options, parser = _options(command, target)
    found = parser.all_of(others)
    if target is None and command != "scenes":
        raise ValueError(f"{command} needs a scene: one of {', '.join(cases.names())}, or a TOML file.")
    values = vars(found)
    for group, members in options.items():
        chosen = {o.name: _collapsed(o, values.pop(o.name)) for o in members if o.name in values}
        values[group] = chosen
    return argparse.Namespace(command=command, target=target, **values)


def _page(command: str, rest: Sequence[str]) -> argparse.Namespace:
    from granular.cli import page, view

    module, usage = {"page": (page, "[SCENE]"), "view": (view, "RUN.npz [RUN2.npz]")}[command]
    usage = f"granular {command} {usage} [-o FILE.html] [--open]"
    parser = Parser(prog=f"granular {command}", description=COMMANDS[command] + ".", usage=usage)
    module.arguments(parser)
    return argparse.Namespace(command=command, **vars(parser.all_of(rest)))


def _top() -> Parser:
    parser = Parser(prog="granular", description=ABOUT, usage=f"granular {{{', '.join(COMMANDS)}}} ... [--help]")
    parser.add_argument("--version", action="version", version=f"granular {_version()}")
    return parser


def _target(rest: Sequence[str]) -> tuple[str | None, list[str]]:
    """Split off the scene's name or TOML file: the first argument, else the first that looks like one."""
    for k, argument in enumerate(rest):
        toml = argument.lower().endswith(".toml")
        if argument in cases.names() or toml or (k == 0 and not argument.startswith("-")):
            if not toml and not os.path.exists(argument):
                _check.choice("scene", argument, cases.names())
            return argument, [*rest[:k], *rest[k + 1 :]]
    return None, list(rest)


def _options(command: str, target: str | None) -> tuple[dict[str, list[Option]], Parser]:
    """The parser of a command with its scene, and the options it offers by group."""
    name = target or ("SCENE" if command in ("scenes", "sweep") else "SCENE|FILE.toml")
    settings = {"description": COMMANDS[command] + ". All numbers are in SI units."}
    if target is None and command != "scenes":
        listed = ", ".join(cases.names())
        settings["epilog"] = f"scenes: {listed}\ngranular {command} SCENE --help lists the parameters of a scene."
    parser = Parser(prog=f"granular {command}" + (f" {target}" if target else ""),
                    usage=f"granular {command} {name}" + " [options]" * (command != "scenes"), **settings)
    if command == "scenes":
        return {}, parser
    of_scene = cases.options(target) if target in cases.names() else []
    if of_scene:
        parser.description = f"{cases.about(str(target))}\n\n{parser.description}"
    _add(parser, f"scene {target}", of_scene)
    of_run = {"run": _run, "compare": _compare, "sweep": _sweep, "frontier": _frontier}[command](parser)
    taken = {o.name for o in of_scene}
    t_end = [o for o in options_of(cases.make) if o.name == "t_end"]
    offered = t_end + [o for o in of_run if o.name not in taken]
    _add(parser, "run", offered)
    return {"given": of_scene, "run": offered}, parser


def _run(parser: Parser) -> list[Option]:
    parser.add_argument("--engine", choices=ENGINES, default="md", help="hard (edmd) or soft (md) spheres; default md")
    parser.add_argument("--save", metavar="FILE.npz", help="write the trajectory and its contact log")
    each = {engine: {o.name: o for o in options_of(engine_named(engine))} for engine in ENGINES}
    merged = []
    for name in dict.fromkeys(name for options in each.values() for name in options if name not in HIDDEN):
        having = [engine for engine in ENGINES if name in each[engine]]
        option = each[having[-1]][name]
        only = "" if len(having) == len(ENGINES) else f"(--engine {having[0]} only) "
        merged.append(Option(name, option.kind, option.default, only + option.about))
    return merged


def _compare(parser: Parser) -> list[Option]:
    from granular.comparison import compare

    parser.add_argument("--plot", metavar="FILE.png", help="draw contacts, forces and world lines of both engines")
    parser.add_argument("--json", metavar="FILE.json", type=json_file,
                        help="write every number of the report; - for standard output")
    return [o for o in options_of(compare) if o.name not in HIDDEN | {"rule"}]


def _sweep(parser: Parser) -> list[Option]:
    from granular.cli import sweep

    sweep.arguments(parser)
    return []


def _frontier(parser: Parser) -> list[Option]:
    from granular.cli import frontier

    frontier.arguments(parser)
    return []


def _figure(rest: Sequence[str]) -> argparse.Namespace:
    from granular.cli import figure

    usage = "granular figure NAME|all [-o DIR]"
    parser = Parser(prog="granular figure", description=COMMANDS["figure"] + ".", usage=usage)
    figure.arguments(parser)
    return argparse.Namespace(command="figure", **vars(parser.all_of(rest)))


def _stability(rest: Sequence[str]) -> argparse.Namespace:
    from granular.cli import stability

    usage = "granular stability [options]"
    parser = Parser(prog="granular stability", description=COMMANDS["stability"], usage=usage)
    stability.arguments(parser)
    return argparse.Namespace(command="stability", **vars(parser.all_of(rest)))


def _add(parser: Parser, title: str, options: Iterable[Option]) -> None:
    group = parser.add_argument_group(title)
    for option in options:
        flag = "--" + option.name.replace("_", "-")
        about = re.sub(r"`+|\*(?=\w+\*)|(?<=\w)\*", "", option.about).replace("%", "%%")
        shown = "" if option.default is None else f" [{_shown(option.default)}]"
        settings: dict[str, Any] = {"dest": option.name, "default": argparse.SUPPRESS, "help": about + shown}
        if option.kind == "bool":
            group.add_argument(flag, action=argparse.BooleanOptionalAction, **settings)
        elif "Sequence" in option.kind:
            group.add_argument(flag, type=_number, nargs="+", metavar="X", **settings)
        else:
            group.add_argument(flag, type=_reader(option.kind), metavar=_metavar(option.kind), **settings)


def _reader(kind: str) -> Callable[[str], Any]:
    return {"int": _whole, "flo": _number}.get(kind[:3], str)


def _metavar(kind: str) -> str:
    return {"int": "N", "flo": "X"}.get(kind[:3], "WORD")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text.strip()!r} is no number") from None


def _whole(text: str) -> int:
    number = _number(text)
    if number != number // 1:  # also true of nan
        raise argparse.ArgumentTypeError(f"{text.strip()!r} is no whole number")
    return int(number)


def _collapsed(option: Option, value: Any) -> Any:
    """One number stays a number where the option takes one or several."""
    return value[0] if isinstance(value, list) and len(value) == 1 and option.kind.startswith("float") else value


def _shown(default: Any) -> str:
    if isinstance(default, tuple):
        return " ".join(_shown(item) for item in default)
    return f"{default:g}" if isinstance(default, float) else str(default)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("granular")
    except PackageNotFoundError:
        return "(not installed)"
