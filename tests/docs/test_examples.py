"""Each example runs without a display, says what it should and draws its picture; some as processes of their own."""

import os
import runpy
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
SAYS = {
    "three_balls": "contacts of the two balls: 1 hard, 4 soft",
    "kerwin_stack": "balls   formula",
    "newtons_cradle": "hard, newton   [-0.333  0.667  0.667]",
    "hertz_chain": "exponent of the wave speed: 0.200",
    "cooling_gas": "hard spheres:",
    "bouncing_on_a_plate": "Γ = 1.525: period 1 of hard spheres, 2 of soft spheres",
    "where_edmd_breaks": "ε = 0.9: gaps below",
    "your_own_law": "ε = 0.",
    "your_own_rule": "ε = 0.",
    "error_against_run_time": "located",
    "sweep_on_a_pool": "bitwise identical: True",
    "sweep_on_dask": "bitwise identical: True",
    "from_scratch": "granular.compare gives the same results.",
}
WITHOUT_FIGURE = ("sweep_on_dask", "from_scratch")
LINES = {"from_scratch": 140}
"""Longest examples. The other examples have at most 40 lines."""

AS_PROCESSES = ("sweep_on_a_pool", "sweep_on_dask")
"""What a user types; to start one takes a second."""


@pytest.mark.rotating
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_runs(path, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    if path.stem.startswith("sweep") or path.stem.startswith("where"):
        pytest.importorskip("xarray")
    if path.stem == "sweep_on_dask" and find_spec("distributed") is None:
        pytest.skip("dask is not installed")
    if path.stem == "error_against_run_time" and find_spec("granular.studies.frontiers") is None:
        pytest.skip("this version has no gr.frontier")
    monkeypatch.chdir(tmp_path)
    said = (as_process if path.stem in AS_PROCESSES else here)(path, monkeypatch, capsys)
    assert SAYS[path.stem] in said
    assert path.stem in WITHOUT_FIGURE or (tmp_path / f"{path.stem}.png").stat().st_size > 10_000
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LINES.get(path.stem, 40)


def as_process(path, *_):
    """What an example prints that is run as a script; from an empty cache, each process of a pool would compile."""
    environment = os.environ | {"MPLBACKEND": "Agg", "PYTHONIOENCODING": "utf-8", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, str(path)], capture_output=True, encoding="utf-8",
                          env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def here(path, monkeypatch, capsys):
    """What an example prints that is run in this process, interpreted where it would compile for half a minute."""
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    for module in ("granular._engine.kernels", "granular.edmd.simulation"):
        monkeypatch.setattr(f"{module}.missing_compiler_reason", lambda: "it would take longer than the example")
    runpy.run_path(str(path), run_name="__main__")
    plt.close("all")
    return capsys.readouterr().out
