"""The examples in docstrings: each module that has some is run by doctest."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

import granular as gr

PACKAGE = Path(gr.__file__).parent
MODULES = sorted(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
                 for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))
PUBLIC = ["compare", "sweep", "ensemble", "sensitivity", "threshold", "frontier", "stability", "edmd.simulate",
          "md.simulate"]


@pytest.mark.rotating
@pytest.mark.parametrize("name", MODULES)
def test_examples_of_a_module_print_what_they_show(name):
    if name.startswith("granular.studies.sweeps"):
        pytest.importorskip("xarray")
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted > 0
    assert found.failed == 0


@pytest.mark.parametrize("name", PUBLIC)
def test_public_functions_have_an_example(name):
    function = gr
    for part in name.split("."):
        function = getattr(function, part)
    assert ">>> " in function.__doc__
