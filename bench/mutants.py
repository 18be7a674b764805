"""One-line mutations, and the test files that must detect them.

    python bench/mutants.py            apply each mutation to a copy of the package and run its test files
    python bench/mutants.py 3 17       apply these two mutations only (numbers count from 0)
    python bench/mutants.py --check    check that each mutation can be applied and that its test files exist

The test files of a mutation run until their first failure. A run above `CPU_SECONDS` of processor time counts as a
failure, because a mutation may cause an endless loop. The exit code is 1 if a mutation survives. Run the script before
and after tests are removed or merged. If a mutation survives only afterwards, restore the test that detected it.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

REPO_ROOT = Path(__file__).resolve().parent.parent
CPU_SECONDS = 120
"""Limit of processor time in s for the tests of one mutation."""
HARD_TESTS = "edmd/test_known_results edmd/test_invariants"
TIE_TESTS, COLLAPSE_TESTS = "edmd/test_ties", "edmd/test_collapse edmd/test_balls_that_stick"
SOFT_TESTS, REST_TESTS = "located/test_reference", "located/test_rest"
ISOLATED_TESTS = "located/test_isolated located/test_isolated_scenes"
WALL_TESTS = "scene/test_walls_hits scene/test_walls_path scene/test_walls_ride"
DRIVEN_TESTS = "edmd/test_driven edmd/test_ride edmd/test_driven_runs located/test_driven"
COMPARISON_TESTS = ("comparison/test_error comparison/test_work_of_a_comparison comparison/test_judge "
                    "comparison/test_comparison comparison/test_answer")
MUTANTS = [
    # hard spheres
    ("edmd", "part = pair.closing_acceleration * now - e * w", "part = -e * w", HARD_TESTS),
    (
        "edmd",
        "lower.fall_velocity += pair.low * ((1.0 + e) * w)",
        "lower.fall_velocity += pair.low * ((1.0 - e) * w)",
        HARD_TESTS,
    ),
    ("edmd", "pair.gap = d if d > 0.0 else 0.0\n    return", "pair.gap = d\n    return", HARD_TESTS),
    (
        "edmd",
        "body.fall_velocity -= body.is_free * (run.gravity * shift)",
        "body.fall_velocity -= run.gravity * shift",
        HARD_TESTS,
    ),
    (
        "edmd",
        "if now - pairs[k].last < run.tc:",
        "if now - pairs[k].last > run.tc:",
        TIE_TESTS + " edmd/test_known_results",
    ),
    (
        "edmd",
        "part = upper / (lower + upper)",
        "part = lower / (lower + upper)",
        "edmd/test_collapse edmd/test_balls_that_stick edmd/test_actions",
    ),
    ("edmd", "return count + 3", "return count", COLLAPSE_TESTS),
    (
        "edmd",
        "expansion = [e * p for e, p in zip(eps, compression, strict=True)]",
        "expansion = [p for e, p in zip(eps, compression, strict=True)]",
        TIE_TESTS,
    ),
    ("edmd", "return c - run.pairs if RING and c >= run.pairs else c", "return c", "edmd/test_rings"),
    ("edmd", "body.sway -= change * sine", "body.sway += change * sine", "edmd/test_pendula"),
    # located method
    ("md/located", "push -= field.square * pair.x[n]", "push += field.square * pair.x[n]", "located/test_pendula"),
    (
        "md/located",
        "push = pair.lower * below - pair.inverse * force + pair.upper * above",
        "push = pair.lower * below - pair.inverse * force",
        SOFT_TESTS,
    ),
    (
        "md/located",
        "return shifted_crossing(pair.f, pair.k * wake_gap, span, scratch, -1.0), END",
        "return shifted_crossing(pair.x, pair.k * wake_gap, span, scratch, -1.0), END",
        SOFT_TESTS,
    ),
    ("md/located", "if tau <= block.tau:", "if tau < block.tau and c == lo:", SOFT_TESTS),
    (
        "md/located",
        "scratch, 1.0)\n    return (begins_at, BEGIN) if begins_at < math.inf else (separates_at, PART)",
        "scratch, 1.0)\n    return separates_at, PART",
        SOFT_TESTS + " located/test_corners",
    ),
    (
        "laws",
        "return self.k * xi + self.gamma * xi_dot",
        "return self.k * xi - self.gamma * xi_dot",
        "laws/test_laws md/test_binary",
    ),
    ("md/located", "return t2 * (v + 0.5 * pair.pull * t2), v + pair.pull * t2", "return t2 * v, v", ISOLATED_TESTS),
    (
        "md/located",
        "count_contact(run, pair, isolated,",
        "count_contact(run, pair, True,",
        ISOLATED_TESTS + " located/test_disturbed",
    ),
    (
        "md/located",
        "if island_proof == NOT_YET or can_close(run, pairs, pool, bodies, c):",
        "if island_proof == NOT_YET:",
        REST_TESTS + " located/test_pressed",
    ),
    (
        "md/located",
        "if below >= 0 and (needs_series",
        "if below > 0 and (needs_series",
        SOFT_TESTS + " located/test_ring",
    ),
    # walls
    (
        "scene/walls",
        "return y - math.floor(y), low + rest + (a_low + b_low) + wall.turn_low",
        "return y - math.floor(y), low + rest + wall.turn_low",
        WALL_TESTS,
    ),
    (
        "scene/walls",
        "return v, panel.per * d, panel.per * panel.per * (2.0 * dd)",
        "return v, panel.per * d, panel.per * panel.per * dd",
        WALL_TESTS,
    ),
    (
        "scene/walls",
        "return now.height + s * (drift - 0.5 * pull * s), drift - pull * s",
        "return now.height + s * (drift - 0.5 * pull * s), drift + pull * s",
        WALL_TESTS + " " + DRIVEN_TESTS,
    ),
    ("scene/walls", "d3 = x * d3 + d2", "d3 = x0 * d3 + d2", WALL_TESTS + " " + DRIVEN_TESTS),
    ("scene/walls", "return wall.first, turns + 1.0", "return wall.first, turns", WALL_TESTS),
    (
        "scene/walls",
        "return math.sqrt(-2.0 * (temperature / mass) * math.log(u))",
        "return math.sqrt(-(temperature / mass) * math.log(u))",
        "both_engines/test_heat_flow edmd/test_thermal",
    ),
    (
        "edmd",
        "upper.fall_velocity - (upper.is_free * fallen - upper.force_acceleration * now)",
        "upper.fall_velocity - upper.is_free * fallen",
        DRIVEN_TESTS,
    ),
    ("edmd", "> lower.noise + upper.noise:\n            return w", "< 0.0:\n            return w", DRIVEN_TESTS),
    (
        "edmd",
        "0.5 * (s + w) * transferred",
        "0.5 * (s - w) * transferred",
        "edmd/test_driven edmd/test_ride edmd/test_thermal both_engines/test_heat_flow",
    ),
    (
        "md/located",
        "s.pool[s.pairs[c].slot].pull = s.pairs[c].pull + push",
        "s.pool[s.pairs[c].slot].pull = s.pairs[c].pull",
        DRIVEN_TESTS,
    ),
    # comparison of two runs
    (
        "comparison/outcome.py",
        'order = np.lexsort((run.contacts["t_end"][rows].repeat(2), key))',
        'order = np.argsort(key, kind="stable")',
        COMPARISON_TESTS,
    ),
    ("comparison/outcome.py", 'log["impulse"] / run.scene.pairs.m_eff[log["pair"]]', "approach(run)", COMPARISON_TESTS),
    ("comparison/outcome.py", "of_ball[scene.is_wall] = count", "pass", COMPARISON_TESTS),
    (
        "comparison/align.py",
        'kept = nth < max_counts[run.contacts["pair"]]',
        'kept = nth <= max_counts[run.contacts["pair"]]',
        COMPARISON_TESTS,
    ),
    (
        "comparison/align.py",
        "delay = isolated_duration(pair, speed) + np.fmin(",
        "delay = 0.0 * np.fmin(",
        COMPARISON_TESTS,
    ),
    (
        "comparison",
        "    if not error <= ERROR_LIMIT:\n        no_overlap",
        "    if error > 0.1:\n        no_overlap",
        COMPARISON_TESTS,
    ),
    (
        "comparison/measures.py",
        "return -after / before if before != 0.0",
        "return after / before if before != 0.0",
        COMPARISON_TESTS,
    ),
    (
        "md/isolation.py",
        'return float(run.stats["isolated"] / run.stats["contacts"])',
        "return 1.0",
        "both_engines/test_fronts",
    ),
    # oblique impacts and contact lists
    ("md", "/ law.pair.m_eff - spin * spin / r**3", "/ law.pair.m_eff - spin * spin / r**2", "md/test_oblique"),
    ("md", "xi if deepest is None else deepest)", "xi)", "md/test_oblique"),
    ("studies", "pause < 0.0, np.zeros", "pause <= 0.0, np.zeros", "studies/test_contacts"),
    ("studies", "[(group * n + stop) * 2, (group * n + start) * 2 + 1]",
     "[(group * n + stop) * 2 + 1, (group * n + start) * 2]", "studies/test_contacts"),
    ("studies", "by_end[np.roll(running, 1) % n]", "by_end[running % n]", "studies/test_contacts"),
    ("studies", "is_open = label[first] != label[second]", "is_open = label[first] < 0", "studies/test_contacts"),
    ("studies", "kept = np.sort(order[np.append(True, ~again)])", "kept = np.sort(order)",
     "studies/test_contact_files"),
    ("studies", "edge[frame[row] + n_seen]", "edge[frame[row]] + n_seen", "studies/test_contact_snapshots"),
]


def source_file(package: Path, place: str, old: str) -> Path:
    """File of the package, at or below `place`, that contains the text `old` once."""
    files = sorted((package / place).rglob("*.py")) or [package / place]
    found = [file for file in files for _ in range(file.read_text(encoding="utf-8").count(old))]
    if len(found) != 1:
        raise ValueError(f"{old!r} must occur once in granular/{place}, got {len(found)} times.")
    return found[0]


def checked_files() -> list[Path]:
    """Source file of every mutation.

    Raises
    ------
    ValueError
        If a text does not occur exactly once, or a test file does not exist.
    """
    named = {name for *_, tests in MUTANTS for name in tests.split()}
    if lost := sorted(name for name in named if not (REPO_ROOT / "tests" / f"{name}.py").is_file()):
        raise ValueError(f"test files that do not exist: {', '.join(lost)}.")
    return [source_file(REPO_ROOT / "granular", place, old) for place, old, *_ in MUTANTS]


def failing_test(copy: Path, place: str, old: str, new: str, tests: str) -> str:
    """Apply one mutation to a copy of the repository, and restore the file.

    Return the first test that fails, or an empty string if all tests pass.
    """
    file = source_file(copy / "granular", place, old)
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(old, new), encoding="utf-8")
    try:
        return first_failure(copy, [f"tests/{name}.py" for name in tests.split()])
    finally:
        shutil.copy2(REPO_ROOT / file.relative_to(copy), file)  # keeps the time stamp, on which numba's cache depends


def limit_cpu_time() -> None:
    """Limit the processor time of this process."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))


def first_failure(copy: Path, files: list[str]) -> str:
    """First test that fails in the given files, or an empty string."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *files]
    run = subprocess.run(command, cwd=copy, env=os.environ | {"PYTHONPATH": str(copy)}, check=False,
                         capture_output=True, text=True, preexec_fn=limit_cpu_time)
    if run.returncode < 0:
        return f"ended by signal {-run.returncode}: limit of processor time, or a crash"
    if run.returncode > 2:
        raise RuntimeError(f"no tests were run:\n{run.stdout}{run.stderr}")
    failed = [line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0] if run.returncode else ""


def main(numbers: list[int]) -> int:
    """Print one line per mutation, and return 1 if a mutation survives."""
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("granular", "tests", "docs", "examples", "bench"):
            shutil.copytree(REPO_ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(REPO_ROOT / "pyproject.toml", copy)
        for number in numbers or range(len(MUTANTS)):
            place, old, _, tests = MUTANTS[number]
            failure = failing_test(copy, *MUTANTS[number])
            survivors += not failure
            print(f"{number:3} {place:22} {failure or f'SURVIVED: {old} ({tests})'}", flush=True)
    print(f"{survivors} survived")
    return int(survivors > 0)


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        print("\n".join(map(str, checked_files())))
    else:
        sys.exit(main([int(text) for text in sys.argv[1:]]))
