"""Fuzz of soft scenes: the engine beside an independent solver, on stored truths, on live scenes, and (soak) on many.

    pytest tests/located/test_fuzz.py                   46 stored truths and 10 live scenes; of all, a third
    pytest -m soak -k stored_truths                     the other 275
    FUZZ_SCENES=20000 FUZZ_PROGRESS=fuzz pytest -m soak tests/located/test_fuzz.py

The last continues from the files of folder `fuzz`. Delete the file of a case to judge its scenes again. Without
FUZZ_SCENES, 4 000 new scenes are solved, in about 25 minutes of processor time; 20 000 take two hours.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granular as gr
from granular.laws.dashpot import reduced_duration, restitution
from tests.helpers.fuzz import bounded, driven, soak
from tests.helpers.fuzz.arithmetic import DIGITS, DOUBLE
from tests.helpers.fuzz.judge import Verdict, compare, distance, engine, judge, judged_by_roundings, truth
from tests.helpers.fuzz.laws import Rounded, Spec
from tests.helpers.fuzz.scenes import Case, generate
from tests.helpers.fuzz.solver import solve
from tests.helpers.fuzz.stored_truth import Truth, from_json

STORED = json.loads((Path(__file__).parents[1] / "helpers" / "fuzz" / "truths.json").read_text())
LIVE = range(1_000_000, 1_000_010)
FOUND = 20
"""The first so many stored scenes once were wrong; of the others, drawn at random, every twelfth is run often."""
OFTEN = STORED[:FOUND] + STORED[FOUND::12]
SELDOM = [one for k, one in enumerate(STORED[FOUND:]) if k % 12]
MOST_STEPS = 5000
"""The independent solver needs at most 250 for a stored scene."""


@pytest.fixture(autouse=True, scope="module")
def machine_code() -> None:
    """Have the engine's machine code in memory, where it can be, so that it is used for the laws it knows."""
    if find_spec("numba"):
        gr.md.simulate(gr.Scene([1.0, 1.0], [0.0, 0.0], [0.1], [1.0, 0.0]), gr.Hertz(1.0), engine="compiled")


def judged(case: Case, one: Truth, laws: Any = None) -> Verdict:
    """The engine beside a truth, by the scene's condition, and by the roundings of laws that users wrote."""
    verdict = compare(case, one, engine(case, laws=laws, max_steps=MOST_STEPS))
    return judged_by_roundings(case, one, verdict, max_steps=MOST_STEPS)


@pytest.mark.rotating
@pytest.mark.parametrize("scenes", [
    *(pytest.param(OFTEN[k::3], id=str(k)) for k in range(3)),
    *(pytest.param(SELDOM[k::10], marks=pytest.mark.soak, id=f"seldom {k}") for k in range(10)),
])
def test_stored_truths(scenes: list[dict[str, Any]]) -> None:
    """The engine gives the stored numbers to 1e-12 max(1, κ), or the scene is named."""
    short = []
    for stored in scenes:
        case = Case.from_json(stored["case"])
        verdict = judged(case, from_json(case, stored["truth"]))
        if verdict.kind != "ok":
            short.append((stored["seed"], case.names, verdict.why, verdict.error))
    assert not short


@pytest.mark.rotating
@pytest.mark.parametrize("seed", LIVE)
def test_live_scenes(seed: int) -> None:
    """A new scene, solved on the spot by the independent solver, interpreted."""
    case = generate(seed, small=True)
    one = truth(case, shifts=1, compiled=False)
    assert one is not None, "ill-conditioned"
    verdict = judged(case, one)
    assert verdict.kind == "ok", (verdict.why, verdict.error, case)


@pytest.mark.soak
def test_what_the_roundings_of_a_law_make_is_measured() -> None:
    """A ball that falls from the touch on a floor, and comes back to it, by a law that says nothing of itself."""
    stored = next(one for one in STORED if one["seed"] == 95006449)
    case = Case.from_json(stored["case"])
    rounded = [judged(case, from_json(case, stored["truth"]), [Rounded(one.law(), seed) for one in case.laws])
               for seed in range(3)]
    assert all(verdict.kind == "ok" for verdict in rounded)
    assert any(verdict.notes for verdict in rounded)


@pytest.mark.rotating
def test_samples_never_change_the_log() -> None:
    """Rows are read off the pieces; the log has the same bits without them."""
    sampled = [Case.from_json(one["case"]) for one in STORED if "samples" in one["case"]][:4]
    for case in sampled:
        with_rows, without = engine(case), engine(case, samples=None)
        assert with_rows.contacts.tobytes() == without.contacts.tobytes(), case


# walls that are driven, and forces

QUICK, START = [0, 1, 3, 4, 10, 18], [5, 6, 12]
"""Seeds of driven scenes that the reference solves in half a second; and of those that start as others do."""


@pytest.mark.rotating
@pytest.mark.parametrize("seed", QUICK)
def test_driven_scenes_beside_the_reference(seed: int) -> None:
    """Walls of every kind, soon and late, forces: 20 digits judge every speed, and the account."""
    pytest.importorskip("mpmath")
    verdict = driven.judged(seed)
    assert verdict.kind == "ok", (verdict.why, verdict.error)


@pytest.mark.rotating
def test_driven_scenes_start_as_others_do() -> None:
    """Seeds of which both take the first attempt, in all bits."""
    for seed in START:
        one, other = driven.generate(seed).case, generate(seed, small=True)
        assert (one.gap, one.gravity, one.laws, one.mass[1:], one.velocity[1:]) == (
            other.gap, other.gravity, other.laws, other.mass[1:], other.velocity[1:])


BOUNDED = [9, 308, 310, 311, 313, 315, 317, 319, 321, 324, 330]
"""Seeds of rings, thermal walls and pendula that take a fifth of a second."""


@pytest.mark.rotating
@pytest.mark.parametrize("seed", BOUNDED)
def test_bounded_scenes_beside_the_reference(seed: int) -> None:
    """Rings, thermal walls, pendula: 20 digits judge every speed and the account; samples and a stop change no bit."""
    pytest.importorskip("mpmath")
    verdict = bounded.judged(seed)
    assert verdict.kind == "ok", (verdict.why, verdict.error)


# the judge's own solver


def isolated(law: Spec) -> Any:
    """The one contact of masses 1 and 3 that meet at 1 m/s."""
    solution = solve(Case((1.0, 3.0), (0.5,), (1.0, 0.0), 0.0, (law,)), DOUBLE, compiled=False)
    assert (solution.status, len(solution.rows)) == ("quiet", 1)
    return solution.rows[0]


@pytest.mark.parametrize("zeta", [0.01, 1.0, 3.0])
def test_solver_on_dashpot_and_tsuji(zeta: float) -> None:
    row = isolated(Spec("LinearDashpot", (1e4, 2.0 * zeta * math.sqrt(0.75e4))))
    assert row[7] - row[6] == pytest.approx(restitution(zeta), rel=1e-13)
    assert row[3] == pytest.approx(reduced_duration(zeta) / math.sqrt(1e4 / 0.75), rel=1e-13)
    if zeta <= 1.0:
        row = isolated(Spec("TsujiHertz", (1e6, zeta * math.sqrt(5.0))))
        assert row[7] - row[6] == pytest.approx(restitution(zeta), rel=1e-13)


def test_solver_on_hertz() -> None:
    """t_c = 2 · 1.25^(2/5) (2/5) B(2/5, 1/2) (m/k)^(2/5) v^(-1/5), and the peaks by energy."""
    row, m, k = isolated(Spec("Hertz", (1e6,))), 0.75, 1e6
    deepest = (1.25 * m / k) ** 0.4
    beta = math.gamma(0.4) * math.gamma(0.5) / math.gamma(0.9)
    assert row[3] == pytest.approx(0.8 * beta * deepest, rel=1e-13)
    assert row[8] == pytest.approx(deepest, rel=1e-13)
    assert row[9] == pytest.approx(k * deepest**1.5, rel=1e-13)
    assert row[10] == pytest.approx(1.5, rel=1e-13)


@pytest.mark.parametrize(
    ("law", "eps"),
    [
        (Spec("PowerLaw", (1e6, 13 / 12)), 1.0),
        (Spec("PowerLaw", (1e6, 4.5)), 1.0),
        (Spec("PowerLaw", (1e6, 16.0)), 1.0),
        (Spec("WaltonBraun", (1e4, 2e4)), math.sqrt(0.5)),
        (Spec("TwoStiffnesses", (1e4, 4e4, 1e-3)), 1.0),
        (Spec("Stiffening", (1e4, 1e8, 0.0)), 1.0),
        (Spec("Exponential", (1.0, 1e-3)), 1.0),
        (Spec("Hysteresis", (1e4, 1.5, 0.3)), math.sqrt(0.7)),
    ],
    ids=lambda x: x.name if isinstance(x, Spec) else "",
)
def test_solver_on_laws_whose_energy_is_known(law: Spec, eps: float) -> None:
    row = isolated(law)
    assert row[7] - row[6] == pytest.approx(eps, rel=1e-13)


def test_solver_and_engine_take_the_same_law() -> None:
    """The formula by number is the law's own `force`, at random overlaps and rates."""
    from tests.helpers.fuzz.arithmetic import build
    from tests.helpers.fuzz.forces import force
    from tests.helpers.fuzz.laws import NUMBERS

    rng, by_number = np.random.default_rng(0), build(force, DOUBLE, compiled=False)
    seen = set()
    for seed in range(400):
        stored = STORED[seed % len(STORED)]
        case = Case.from_json(stored["case"])
        for spec, pair in zip(case.laws, case.scene().pairs, strict=True):
            law, (kind, a) = spec.law(), spec.by_number(float, math.sqrt, pair.m_eff)
            seen.add(spec.name)
            x, v = float(rng.uniform(0.1, 1.0)), float(rng.normal())
            if spec.name in ("WaltonBraun", "Hysteresis"):
                for top, branch in ((x, 1), (1.3 * x, 0)):
                    wanted = law.force(x, v, pair, top)
                    assert max(0.0, by_number(kind, a, x, v, top, branch)) == pytest.approx(max(0.0, wanted), rel=1e-12)
                continue
            x = a[2] * x * 2.0 if spec.name == "TwoStiffnesses" else a[1] * x if spec.name == "Exponential" else x
            branch = int(x > a[2]) if spec.name == "TwoStiffnesses" else int(v > 0.0)
            size = abs(law.force(x, abs(v), pair))
            got, wanted = by_number(kind, a, x, v, 0.0, branch), law.force(x, v, pair)
            assert got == pytest.approx(wanted, rel=0, abs=1e-12 * size)
    assert seen == NUMBERS.keys()


def test_progress_is_kept_and_resumed(tmp_path: Path) -> None:
    """A batch is written whole; what is written is not run again."""
    asked: list[int] = []

    def judged(seed: int) -> Verdict:
        asked.append(seed)
        if seed == 150:
            raise KeyboardInterrupt
        return Verdict("short", "v_out", 1.0) if seed == 7 else Verdict("ok", final=0.0, estimate=0.0)

    progress = tmp_path / "progress.jsonl"
    with pytest.raises(KeyboardInterrupt):
        soak.run(progress, 0, 250, judged)
    assert len(progress.read_text().splitlines()) == 1
    asked.clear()
    done = soak.run(progress, 0, 250, lambda seed: judged(seed) if seed != 150 else Verdict("unjudged"))
    assert min(asked) == 100
    assert (done.scenes, done.ok, done.unjudged, [one[0] for one in done.short]) == (250, 248, 1, [7])


# the long run


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(2_000_000, 2_000_020))
def test_solver_in_doubles_against_34_digits(seed: int) -> None:
    case = generate(seed, small=True)
    one, better = truth(case), truth(case, DIGITS)
    assert one is not None
    assert better is not None
    what, error = distance(better, one.pairs, one.numbers)
    assert error < 1e-13, what


@dataclass(frozen=True)
class Soaked:
    """Scenes of one generator: how they are judged, their seeds, and the share that need not be judged."""

    judged: Callable[[int], Verdict]
    first: int
    scenes: int
    size: int
    """Scenes of a case. It takes about 60 s: 1 s per driven or bounded scene, 0.36 s per new one, at most 26 s."""
    unjudged: float

    def cases(self) -> list[tuple[int, int]]:
        """First seed and number of scenes of each case."""
        end = self.first + self.scenes
        return [(at, min(self.size, end - at)) for at in range(self.first, end, self.size)]


PROGRESS = Path(os.environ.get("FUZZ_PROGRESS", "fuzz-progress"))
"""Folder with a file per case, so that workers do not share files, and a run can be continued case by case."""
SOAKED = {
    "driven": Soaked(driven.judged, 0, int(os.environ.get("FUZZ_DRIVEN", "500")), 50, 0.05),
    "bounded": Soaked(bounded.judged, 0, int(os.environ.get("FUZZ_BOUNDED", "500")), 50, 0.05),
    "new": Soaked(lambda seed: judge(generate(seed), digits=math.inf), int(os.environ.get("FUZZ_FIRST", "10000000")),
                  int(os.environ.get("FUZZ_SCENES", "4000")), 200, 0.005),
}


@pytest.mark.soak
@pytest.mark.parametrize(("kind", "first", "scenes"), [
    pytest.param(kind, *case, id=f"{kind} {case[0]}") for kind, one in SOAKED.items() for case in one.cases()
])
def test_many_scenes(kind: str, first: int, scenes: int) -> None:
    """Driven walls and forces; rings, thermal walls and pendula; new scenes. None falls short, estimates are honest."""
    PROGRESS.mkdir(exist_ok=True)
    done = soak.run(PROGRESS / f"{kind}-{first}.jsonl", first, scenes, SOAKED[kind].judged)
    assert done.short == []
    assert kind != "new" or done.below == []


@pytest.mark.soak
@pytest.mark.parametrize("kind", SOAKED)
def test_nearly_all_of_many_scenes_are_judged(kind: str) -> None:
    """Over all cases; skipped until their files are there."""
    one, done = SOAKED[kind], soak.Tally()
    for first, scenes in one.cases():
        progress = PROGRESS / f"{kind}-{first}.jsonl"
        if soak.missing(progress, first, scenes):
            pytest.skip(f"the case that begins with seed {first} has not been judged yet")
        done.join(vars(soak.run(progress, first, scenes, one.judged)))
    assert done.scenes == one.scenes
    assert done.refused + done.unjudged <= one.unjudged * one.scenes
    assert kind != "new" or done.beyond <= 0.01 * one.scenes
