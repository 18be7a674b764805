"""Compare the results of two versions of the package bit by bit.

`python bench/same_bits.py REF` runs the same random scenes in this working tree and in the commit REF, each in its own
process, through public functions only. The scenes cover hard spheres, the located method, fixed steps, and functions
built on these engines. Every time, velocity, gap, force, row of the contact log, status, message and counter is
compared. For each family the table lists the numbers of identical runs, of runs that differ by rounding only, and of
other runs, with their seeds. Rounding means up to 1e-9 relative to the largest entry of the array. Exceptions are
counted too and must not occur, because the same exception in both trees would count as identical. REF is unpacked into
the temporary folder and kept there with its compiled kernels. The exit code is 1 if a run differs or raises.
"""

from __future__ import annotations

import argparse
import io
import math
import os
import pickle
import re
import subprocess
import sys
import tarfile
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from same_bits_cases import PLAIN_FAMILIES, compared_values
from same_bits_special import SPECIAL_FAMILIES

REPO_ROOT = Path(__file__).resolve().parent.parent
ROUNDING_LIMIT = 1e-9
FAMILIES = PLAIN_FAMILIES | SPECIAL_FAMILIES
RAISED_KEY = "raised"
NUMBER_PATTERN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|nan|inf")


def run_outcome(run: Callable[[], Any]) -> dict[str, Any]:
    """Values of a run by name, or the exception that it raises."""
    try:
        got = run()
    except Exception as error:
        return {RAISED_KEY: f"{type(error).__name__}: {error}"}
    if hasattr(got, "contacts") and hasattr(got, "stats"):
        got = compared_values(got)
    return got if isinstance(got, dict) else {"value": got}


def results(only: list[str], seeds: int) -> list[tuple[str, int, dict[str, Any]]]:
    """Outcomes of all cases, in order."""
    warnings.simplefilter("ignore")
    return [(family, seed, {name: _plain(value) for name, value in run_outcome(run).items()})
            for name in only for family, seed, run in FAMILIES[name](seeds)]


def _plain(value: Any) -> Any:
    """Value in a form that every process can unpickle."""
    if value is None or isinstance(value, str):
        return value
    array = np.asarray(value)
    return array if array.dtype.kind in "biuf" else repr(value)


def results_of_tree(tree: Path, given: Any) -> Any:
    """Results computed with the package of `tree` in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "results"
        subprocess.run([sys.executable, __file__, "--into", str(file), "--seeds", str(given.seeds), "--only",
                        *given.only], check=True, env=os.environ | {"PYTHONPATH": str(tree)})
        return pickle.loads(file.read_bytes())


def unpacked_tree(ref: str) -> Path:
    """Folder with the package of commit `ref`, unpacked once and kept."""
    parsed = subprocess.run(["git", "rev-parse", ref], check=True, capture_output=True, text=True, cwd=REPO_ROOT)
    folder = Path(tempfile.gettempdir()) / f"granular-{parsed.stdout.strip()[:12]}"
    if not folder.exists():
        packed = subprocess.run(["git", "archive", ref, "granular"], check=True, capture_output=True, cwd=REPO_ROOT)
        with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
            archive.extractall(folder, filter="data")
    return folder


def difference(a: Any, b: Any) -> float:
    """0 for bitwise identical values, the largest relative difference, or inf.

    Strings that differ only in their numbers are compared by these numbers.
    """
    if isinstance(a, str) and isinstance(b, str):
        if a == b:
            return 0.0
        # the texts without their numbers must be equal
        if NUMBER_PATTERN.sub("#", a) != NUMBER_PATTERN.sub("#", b):
            return math.inf
        pairs = zip((m[0] for m in NUMBER_PATTERN.finditer(a)), (m[0] for m in NUMBER_PATTERN.finditer(b)), strict=True)
        return max(difference(np.array(float(x)), np.array(float(y))) for x, y in pairs)
    if a is None or b is None or isinstance(a, str) or isinstance(b, str):
        return 0.0 if a is b else math.inf
    if a.dtype != b.dtype or a.shape != b.shape:
        return math.inf
    if a.tobytes() == b.tobytes():
        return 0.0
    if a.dtype.kind != "f" or (np.isfinite(a) != np.isfinite(b)).any():
        return math.inf
    return float(np.nanmax(abs(a - b)) / max(np.nanmax(abs(a)), np.nanmax(abs(b)), 1e-300))


@dataclass
class FamilyRow:
    """Counts of identical and different runs of a family."""

    same: int = 0
    rounding: int = 0
    largest: float = 0.0
    different: list[str] = field(default_factory=list)
    raised: list[str] = field(default_factory=list)

    def add(self, seed: int, here: dict[str, Any], there: dict[str, Any]) -> None:
        """Add the outcomes of one run in both trees."""
        if errors := [one[RAISED_KEY] for one in (here, there) if RAISED_KEY in one]:
            self.raised.append(f"seed {seed} raised {errors[0]}")
        distances = {name: difference(here.get(name), there.get(name)) for name in here | there}
        worst = max(distances.values())
        if worst == 0.0:
            self.same += 1
        elif worst <= ROUNDING_LIMIT:
            self.rounding += 1
            self.largest = max(self.largest, worst)
        else:
            names = " ".join(name for name, x in distances.items() if x > ROUNDING_LIMIT)
            self.different.append(f"seed {seed}: {names}")


def main() -> int:
    """Run both trees, print the table and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ref", nargs="?", default="HEAD", metavar="REF", help="commit to compare with [%(default)s]")
    parser.add_argument("--only", nargs="+", choices=FAMILIES, default=list(FAMILIES), help="families to run [all]")
    parser.add_argument("--seeds", type=int, default=20, help="seeds per family [%(default)s]")
    parser.add_argument("--into", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.into:
        Path(given.into).write_bytes(pickle.dumps(results(given.only, given.seeds)))
        return 0
    table: dict[str, FamilyRow] = {}
    here, there = results_of_tree(REPO_ROOT, given), results_of_tree(unpacked_tree(given.ref), given)
    for (family, seed, ours), (_, _, theirs) in zip(here, there, strict=True):
        table.setdefault(family, FamilyRow()).add(seed, ours, theirs)
    print(f"{'family':36}{'same':>7}{'rounding':>10}{'largest':>10}{'different':>11}{'raised':>8}")
    for family, row in table.items():
        print(f"{family:36}{row.same:7}{row.rounding:10}{row.largest:10.1e}{len(row.different):11}{len(row.raised):8}")
        for one in row.different[:5] + row.raised[:5]:
            print(f"    {one}")
    return int(any(row.different or row.raised for row in table.values()))


if __name__ == "__main__":
    sys.exit(main())
