"""Measure every table and figure of the docs anew, one after the other: ``python bench/regenerate.py`` (about an hour).

The paper's figures come from the scripts in ``examples/paper``; their data is stored last. `edmd_long`, `leaving_out`
and the like print their tables.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import docs_data

HERE = Path(__file__).parent
SCRIPTS = (
    "frontier", "edmd_scaling", "edmd_columns", "edmd_long", "leaving_out", "isolation", "first_minute", "driven",
    "bounded", "waves",
)


def main() -> None:
    for name in SCRIPTS:
        print(f"\n{name}\n{'=' * len(name)}", flush=True)
        subprocess.run([sys.executable, str(HERE / f"{name}.py")], check=True)
    subprocess.run([sys.executable, "-m", "bench.stability"], check=True, cwd=HERE.parent)
    for name in docs_data.FEW:
        script = docs_data.PAPER / f"{name.replace('-', '_')}.py"
        picture = docs_data.DATA.parent / f"paper-{name}.png"
        subprocess.run([sys.executable, str(script), "-o", str(picture)], check=True)
    papers = [f"paper-{name}" for name in docs_data.FEW]
    subprocess.run([sys.executable, str(HERE / "docs_data.py"), *papers], check=True)


if __name__ == "__main__":
    main()
