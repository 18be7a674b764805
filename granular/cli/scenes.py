"""`granular scenes`: list the ready-made scenes, or print one as a TOML file.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse

from granular import cases
from granular.cli.parser import case_of

USAGE = "SCENE"


def arguments(parser: argparse.ArgumentParser) -> None:
    """It takes no options."""


def run(given: argparse.Namespace) -> None:
    """List the scenes, or print the one that is named."""
    if given.target is not None:
        print(cases.dumps(case_of(given)), end="")
        return
    width = max(map(len, cases.names()))
    for name in cases.names():
        print(f"{name:{width}}  {cases.about(name)}")
    print("\ngranular compare SCENE --help lists a scene's parameters; granular scenes SCENE prints it as a TOML file.")
