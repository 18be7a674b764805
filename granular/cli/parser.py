"""Arguments of the command. The options of a scene and of a run come from the signatures and docstrings that have them.

So ``granular compare gas --help`` lists the parameters of `granular.scenes.gas`, with their units and defaults.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any, NoReturn

from granular import _check, _files, cases
from granular.cases.options import Option, options_of, unknown

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
            flags = sorted(set(re.findall(r"--[a-z][\w-]*", self.format_help())))
            raise ValueError(unknown(names, flags, f"option of {self.prog}"))
        if extra:
            raise ValueError(f"{extra[0].strip()!r} is one argument too many; see {self.prog} --help")
        return found


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what the command line says: what to `act`, its `target`, and `given`, `run` with the options given.

    A command is a module of its name: `USAGE`, `arguments(parser)`, which returns the options of a run if it offers
    them, and `run(given)`, which returns the exit code. Its usage begins with SCENE if it takes one.
    """
    command, *rest = arguments or ["--help"]
    if command.startswith("-"):
        return _top().all_of(arguments or ["--help"])
    if command not in COMMANDS:
        raise ValueError(unknown([command], list(COMMANDS), "command"))
    module = import_module(f"granular.cli.{command}")
    of_scene = module.USAGE.startswith("SCENE")
    target, others = _target(rest) if of_scene else (None, rest)
    parser = _parser(command, module.USAGE, target, of_scene)
    parameters = cases.options(target) if target in cases.names() and command != "scenes" else []
    if parameters:
        parser.description = f"{cases.about(str(target))}\n\n{parser.description}"
        _add(parser, f"scene {target}", parameters)
    offered = module.arguments(parser)
    if offered is not None:
        taken = {option.name for option in parameters}
        t_end = [option for option in options_of(cases.make) if option.name == "t_end"]
        offered = t_end + [option for option in offered if option.name not in taken]
        _add(parser, "run", offered)
    values = vars(parser.all_of(others))
    if offered is not None and target is None:
        raise ValueError(f"{command} needs a scene: one of {', '.join(cases.names())}, or a TOML file.")
    for group, members in (("given", parameters), ("run", offered or [])):
        values[group] = {o.name: _collapsed(o, values.pop(o.name)) for o in members if o.name in values}
    return argparse.Namespace(act=module.run, target=target, **values)


def case_of(given: argparse.Namespace) -> cases.Case:
    """The case that a command line names."""
    return cases.make(given.target, **given.given) if given.target in cases.names() else cases.load(given.target)


def _top() -> Parser:
    parser = Parser(prog="granular", description=ABOUT, usage=f"granular {{{', '.join(COMMANDS)}}} ... [--help]")
    version = _files.version_of("granular") or "(not installed)"
    parser.add_argument("--version", action="version", version=f"granular {version}")
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


def _parser(command: str, usage: str, target: str | None, of_scene: bool) -> Parser:
    settings = {"prog": f"granular {command}", "description": COMMANDS[command] + "." * (COMMANDS[command][-1] != "?")}
    if of_scene:
        settings["description"] += " All numbers are in SI units."
    if target is not None:
        settings["prog"] += f" {target}"
        usage = " ".join([target, *usage.split()[1:]])
    elif of_scene and command != "scenes":
        listed = ", ".join(cases.names())
        settings["epilog"] = f"scenes: {listed}\ngranular {command} SCENE --help lists the parameters of a scene."
    return Parser(usage=f"granular {command} {usage}", **settings)


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
            kind, metavar = {"int": (_whole, "N"), "flo": (_number, "X")}.get(option.kind[:3], (str, "WORD"))
            group.add_argument(flag, type=kind, metavar=metavar, **settings)


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
