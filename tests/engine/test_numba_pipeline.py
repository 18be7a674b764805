"""The fast compiler pipeline: each of its overrides may fail, and other versions of numba may lack what it needs.

In every case kernels are compiled by numba's default pipeline, with bitwise identical results and one warning.
"""

import math
import os
import subprocess
import sys
import types
import warnings
import zipfile
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

from granular._engine import kernels
from granular._engine.compiler_state import REFERENCE_WORDS, ByReference, Mode, by_reference, numba_version
from granular._engine.kernels import compiled, have_numba, kernel

pytestmark = pytest.mark.skipif(not have_numba(), reason="numba is not installed")

Fields = namedtuple("Fields", "first second")


class Arrays(ByReference, Fields):
    _plain = Fields


def lowest(x):
    return math.sqrt(x) / 3.0


def middle(arrays, i):
    arrays.second[i] += lowest(arrays.first[i])
    return arrays.second[i]


def highest(arrays, room):
    total = 0.0
    for i in range(len(arrays.first)):
        total += middle(by_reference(Fields(arrays.first, arrays.second), room), i) + lowest(float(i))
    return total


def toy():
    """A new kernel of three levels with a tuple of arrays, which nothing has compiled yet."""
    scope = dict(globals())
    for function in (lowest, middle, highest):
        scope[function.__name__] = kernel(types.FunctionType(function.__code__, scope))
    return scope["highest"]


def result(function):
    arrays = Arrays(np.arange(5.0), np.full(5, 0.1))
    return function(arrays, np.zeros(REFERENCE_WORDS, np.int64)), *arrays.second


@pytest.fixture
def pipeline(monkeypatch, tmp_path):
    """The fast pipeline with an empty cache, whatever the version of numba."""
    pipeline = pytest.importorskip("granular._engine.numba_pipeline")
    kernels.load_numba()
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(Mode, "fast", True)
    return pipeline


def run_twice():
    """Results and number of warnings of a toy kernel, compiled and called twice."""
    function = toy()
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        found = [result(compiled(function)) for _ in range(2)]
    assert found == [result(function)] * 2
    return sum(warning.category is RuntimeWarning for warning in seen)


def test_the_fast_pipeline_compiles_a_toy_kernel_without_a_warning(pipeline):
    assert run_twice() == 0
    assert Mode.fast


PLACES = (
    "Part.finalize", "Part.set_env", "Part.codegen", "Whole.add_linking_library", "caching_context",
    "PartCompiler.define_pipelines", "WholeCompiler.define_pipelines", "DefaultPassBuilder", "Reference.__init__",
    "ReferenceAttribute.generic_resolve", "field_pointer", "cgutils", "ByReference.write_addresses",
)
ERRORS = AttributeError, TypeError


@pytest.mark.rotating
@pytest.mark.parametrize(("place", "error"), [
    pytest.param(place, error, marks=[pytest.mark.soak] * ((i + j) % 2))  # by turns, the other error in the soak
    for i, place in enumerate(PLACES) for j, error in enumerate(ERRORS)
])
def test_a_broken_override_switches_to_the_default_pipeline_with_one_warning(place, error, pipeline, monkeypatch):
    def broken(*values, **named):
        raise error("broken")

    holder, _, name = place.rpartition(".")
    assert hasattr(getattr(pipeline, holder) if holder else pipeline, name)
    value = property(broken) if name in ("codegen", "set_env") else broken
    value = types.SimpleNamespace() if name == "cgutils" else staticmethod(broken) if name[0] == "w" else value
    monkeypatch.setattr(getattr(pipeline, holder) if holder else pipeline, name, value)
    assert run_twice() == 1
    assert not Mode.fast
    assert run_twice() == 0  # the whole process has switched


def test_a_pipeline_that_cannot_be_imported_is_replaced_with_one_warning(pipeline, monkeypatch):
    monkeypatch.setitem(sys.modules, "granular._engine.numba_pipeline", None)
    monkeypatch.setattr(Mode, "fast", None)
    monkeypatch.setattr(kernels, "TESTED_NUMBA", (numba_version(),))
    assert run_twice() == 1
    assert not Mode.fast


def test_an_unknown_version_uses_the_default_pipeline_without_importing_the_fast_one(tmp_path):
    program = """
import sys
from granular._engine import kernels
kernels.TESTED_NUMBA = ()
from tests.engine import test_numba_pipeline as toys
assert toys.run_twice() == 0
assert toys.Mode.fast is False
assert "granular._engine.numba_pipeline" not in sys.modules
"""
    path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, sys.path)])
    subprocess.run([sys.executable, "-c", program], check=True,
                   env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": path})


def test_both_pipelines_have_their_own_files_in_the_cache(pipeline, monkeypatch, tmp_path):
    for fast in (True, False):
        monkeypatch.setattr(Mode, "fast", fast)
        result(compiled(toy()))
    assert len({path.name for path in tmp_path.rglob("*.nbi") if "highest" in path.name}) == 2


def test_the_version_of_the_pipeline_changes_with_its_text_and_is_never_0(tmp_path):
    package = Path(kernels.__file__).parents[1]
    found = set()
    for end in ("", "# other"):
        archive = tmp_path / f"granular{len(end)}.zip"
        with zipfile.ZipFile(archive, "w") as packed:
            for path in package.rglob("*.py"):
                text = path.read_text(encoding="utf-8") + end * (path.name == "numba_pipeline.py")
                packed.writestr(path.relative_to(package.parent).as_posix(), text)
        program = ("import sys; sys.path.insert(0, sys.argv[1]); from granular._engine import kernels; "
                   "print(kernels.version())")
        made = subprocess.run([sys.executable, "-c", program, archive], capture_output=True, text=True, check=True)
        found.add(int(made.stdout))
    assert len(found) == 2
    assert kernels.version() in found
    assert 0 not in found
