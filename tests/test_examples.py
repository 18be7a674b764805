"""Each example runs in a process of its own, without a display, says what it should and draws its picture."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"
SAYS = {
    "three_balls": "contacts of the two balls: 1 hard, 4 soft",
    "kerwin_stack": "balls   formula",
    "newtons_cradle": "hard, newton   [-0.333  0.667  0.667]",
    "hertz_chain": "exponent of the wave's speed: 0.200",
    "cooling_gas": "hard spheres:",
    "bouncing_on_a_plate": "Γ = 1.525: period 1 of hard spheres, 2 of soft ones",
    "where_edmd_breaks": "ε = 0.9: gaps below",
    "your_own_law": "ε = 0.",
    "your_own_rule": "ε = 0.",
    "error_against_run_time": "located",
    "sweep_on_a_pool": "same bits: True",
    "sweep_on_dask": "same bits: True",
}


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_runs(path, tmp_path):
    pytest.importorskip("matplotlib")
    if path.stem.startswith("sweep") or path.stem.startswith("where"):
        pytest.importorskip("xarray")
    if path.stem == "sweep_on_dask" and find_spec("distributed") is None:
        pytest.skip("dask is not installed")
    if path.stem == "error_against_run_time" and find_spec("granular.workprecision") is None:
        pytest.skip("this version has no gr.frontier")
    environment = os.environ | {"MPLBACKEND": "Agg", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run([sys.executable, str(path)], capture_output=True, encoding="utf-8", cwd=tmp_path,
                          env=environment, timeout=300, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert SAYS[path.stem] in done.stdout
    assert path.stem == "sweep_on_dask" or (tmp_path / f"{path.stem}.png").stat().st_size > 10_000
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 40
