"""Forty one-line mistakes, and the test files that have to find them: ``python bench/mutants.py [NUMBER ...]``.

Each is made in a copy of the package, and the test files named for it run until the first failure; the table says which
mutants are killed, exit code 1 if one is not. Run it before and after tests are taken out or put together: what no
test kills any more has to come back.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HARD, TIES, LOOK = "test_edmd test_edmd_invariants", "test_edmd_ties", "test_edmd_collapse"
SOFT, ALONE, REST = "test_located_reference test_located_twin", "test_isolated", "test_located_rest"
WALL, SHAKEN = "test_walls", "test_edmd_driven test_located_driven"
JUDGE = "test_judge test_error test_comparison"
MUTANTS = [
    # hard spheres
    ("edmd/motion.py", "part = pair.pull * now - e * w", "part = -e * w", HARD),
    ("edmd/motion.py", "lower.u += pair.low * ((1.0 + e) * w)", "lower.u += pair.low * ((1.0 - e) * w)", HARD),
    ("edmd/motion.py", "pair.gap = d if d > 0.0 else 0.0", "pair.gap = d", HARD),
    ("edmd/motion.py", "body.u -= body.falls * (run.gravity * shift)", "body.u -= run.gravity * shift", HARD),
    ("edmd/collision.py", "if now - pairs[k].last < run.tc:", "if now - pairs[k].last > run.tc:", TIES + " test_edmd"),
    ("edmd/collision.py", "part = upper / (lower + upper)", "part = lower / (lower + upper)",
     "test_edmd_collapse test_edmd_actions"),
    ("edmd/collision.py", "return count + 3", "return count", LOOK),
    ("edmd/ties.py", "back = [e * p for e, p in zip(eps, compression, strict=True)]",
     "back = [p for e, p in zip(eps, compression, strict=True)]", TIES),
    ("edmd/ring.py", "return c if c < run.pairs else c - run.pairs", "return c", "test_edmd_bounded"),
    ("edmd/hanging.py", "body.sway -= change * math.sin(body.omega * now)",
     "body.sway += change * math.sin(body.omega * now)", "test_edmd_bounded"),
    # the located method
    ("md/located/series.py", "push -= walls.square * pair.x[n]", "push += walls.square * pair.x[n]",
     "test_located_pendula"),
    ("md/located/series.py", "push = pair.lower * below - pair.inverse * force + pair.upper * above",
     "push = pair.lower * below - pair.inverse * force", SOFT),
    ("md/located/events.py", "return shifted(pair.f, pair.k * asleep, span, work, -1.0), END",
     "return shifted(pair.x, pair.k * asleep, span, work, -1.0), END", SOFT),
    ("md/located/events.py", "if tau <= block.tau:", "if tau < block.tau and c == lo:", SOFT),
    ("md/located/events.py", "return (again, BEGIN) if again < math.inf else (parts, PART)", "return parts, PART",
     SOFT + " test_located_corners"),
    ("laws/dashpot.py", "return self.k * xi + self.gamma * xi_dot", "return self.k * xi - self.gamma * xi_dot",
     "test_laws test_binary"),
    ("md/located/isolated.py", "return t2 * (v + 0.5 * pair.pull * t2), v + pair.pull * t2",
     "return t2 * v, v", ALONE),
    ("md/located/isolated.py", "count(run, pair, isolated,", "count(run, pair, True,", ALONE + " test_disturbed"),
    ("md/located/resting.py", "if found == NOT_YET or closes(run, pairs, pool, bodies, c):",
     "if found == NOT_YET:", REST + " test_located_pressed"),
    ("md/located/islands.py", "if below >= 0 and (pushes", "if below > 0 and (pushes", SOFT + " test_located_ring"),
    # walls
    ("walls/path.py", "return y - math.floor(y), low + rest + (a_low + b_low) + wall.turn_low",
     "return y - math.floor(y), low + rest + wall.turn_low", WALL),
    ("walls/path.py", "return v, panel.per * d, panel.per * panel.per * (2.0 * dd)",
     "return v, panel.per * d, panel.per * panel.per * dd", WALL),
    ("walls/gap.py", "f = height + s * (drift - 0.5 * pull * s) - m", "f = height + s * (drift - 0.5 * pull * s) + m",
     WALL + " " + SHAKEN),
    ("walls/gap.py", "d3 = x * d3 + d2", "d3 = x0 * d3 + d2", WALL + " " + SHAKEN),
    ("walls/hits.py", "return (wall.first, turns + 1.0) if wall.periodic else (-1, turns)",
     "return wall.first, turns + 1.0", WALL),
    ("walls/thermal.py", "return math.sqrt(-2.0 * (temperature / mass) * math.log(u))",
     "return math.sqrt(-(temperature / mass) * math.log(u))", "test_heat_flow test_walls"),
    ("edmd/driven.py", "upper.u - (upper.falls * fallen - upper.push * now)", "upper.u - upper.falls * fallen", SHAKEN),
    ("edmd/driven.py", "return min(w, 0.0)", "return w", SHAKEN),
    ("edmd/driven_event.py", "0.5 * (s + w) * given", "0.5 * (s - w) * given",
     "test_edmd_driven test_edmd_bounded test_heat_flow"),
    ("md/located/driven.py", "s.pool[s.pairs[c].slot].pull = s.pairs[c].pull + push",
     "s.pool[s.pairs[c].slot].pull = s.pairs[c].pull", SHAKEN),
    # what is said of two runs
    ("outcome.py", 'order = np.argsort(rank, kind="stable")', "order = np.arange(len(rank))", JUDGE),
    ("outcome.py", 'log["impulse"] / run.scene.pairs.m_eff[log["pair"]]', "approach(run)", JUDGE),
    ("outcome.py", "begins[1:] &= ~met[:-1]", "begins[1:] &= met[:-1]", JUDGE),
    ("outcome.py", "of_ball[scene.is_wall] = count", "pass", JUDGE),
    ("outcome.py", "fastest > weight[c] * still", "fastest > -1.0", JUDGE),
    ("end_time.py", 'kept = nth < most[run.contacts["pair"]]', 'kept = nth <= most[run.contacts["pair"]]', JUDGE),
    ("end_time.py", "late = alone(pair, speed) + np.fmin(", "late = 0.0 * np.fmin(", JUDGE),
    ("comparison/answer.py", "    if not error <= SAME:\n        alone", "    if error > 0.1:\n        alone", JUDGE),
    ("measures.py", "return -after / before if before != 0.0", "return after / before if before != 0.0", JUDGE),
    ("isolation.py", 'return float(run.stats["isolated"] / run.stats["contacts"])', "return 1.0", "test_certificate"),
]


def killed(file: str, old: str, new: str, tests: str) -> str:
    """Make one mistake in a copy of the package; return what failed first, nothing if all tests pass."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("granular", "tests", "docs", "examples"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        path = copy / "granular" / file
        text = path.read_text()
        if text.count(old) != 1:
            raise ValueError(f"{file} has {text.count(old)} times {old!r}: one is needed.")
        path.write_text(text.replace(old, new))
        files = [f"tests/{name}.py" for name in tests.split()]
        run = subprocess.run([sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *files],
                             capture_output=True, text=True, cwd=copy, check=False,
                             env=os.environ | {"PYTHONPATH": str(copy)})
    failed = [line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0] if failed else ""


def main(numbers: list[int]) -> int:
    """Print one line for each mutant, as it is done."""
    alive = 0
    for number in numbers or range(len(MUTANTS)):
        file, old, _, tests = MUTANTS[number]
        by = killed(*MUTANTS[number])
        alive += not by
        print(f"{number:3} {file:28} {by or f'ALIVE: {old} ({tests})'}", flush=True)
    print(f"{alive} alive")
    return int(alive > 0)


if __name__ == "__main__":
    sys.exit(main([int(text) for text in sys.argv[1:]]))
