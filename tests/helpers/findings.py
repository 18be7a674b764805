"""Scripts of the gallery's findings as modules, and the numbers that their pages print."""

from importlib import util
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")
FOLDER = Path(__file__).parents[2] / "examples" / "findings"


def script(name):
    """A finding as a module; nothing is drawn."""
    spec = util.spec_from_file_location(f"finding_{name}", FOLDER / f"{name}.py")
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def printed(value, digits):
    """What a page prints with so many digits after the point."""
    return pytest.approx(value, rel=0.0, abs=0.5 * 10.0**-digits)
