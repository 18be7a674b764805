"""Recompute every table and figure of the documentation, in about an hour.

    python bench/regenerate.py

The paper's figures come from the scripts in ``examples/paper``, and their data are stored last. `edmd_long`,
`leaving_out` and similar scripts print their tables.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import docs_data

BENCH_FOLDER = Path(__file__).parent
SCRIPT_NAMES = (
    "frontier", "edmd_scaling", "edmd_columns", "edmd_long", "leaving_out", "isolation", "driven", "bounded",
    "waves", "oblique",
)


def main() -> None:
    """Run all scripts."""
    for name in SCRIPT_NAMES:
        print(f"\n{name}\n{'=' * len(name)}", flush=True)
        subprocess.run([sys.executable, str(BENCH_FOLDER / f"{name}.py")], check=True)
    subprocess.run([sys.executable, "-m", "bench.stability"], check=True, cwd=BENCH_FOLDER.parent)
    subprocess.run([sys.executable, "docs/extensions/start_page.py"], check=True, cwd=BENCH_FOLDER.parent)
    for name in docs_data.PAPER_POINTS:
        script = docs_data.PAPER_FOLDER / f"{name.replace('-', '_')}.py"
        picture = docs_data.DATA_FOLDER.parent / f"paper-{name}.png"
        subprocess.run([sys.executable, str(script), "-o", str(picture)], check=True)
    papers = [f"paper-{name}" for name in docs_data.PAPER_POINTS]
    subprocess.run([sys.executable, str(BENCH_FOLDER / "docs_data.py"), *papers], check=True)


if __name__ == "__main__":
    main()
