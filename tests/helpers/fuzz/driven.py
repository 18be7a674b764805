"""Seeded soft scenes with driven walls and forces, judged by `bench.reference` in 20 digits.

A scene starts as `scenes.generate` starts that of the same seed, bit for bit, with at most three balls; if it has no
wall, its first body becomes one. Then walls are driven, in every way, at one end or both, soon or late; forces pull.
Sizes follow from the scene: a wall is about as fast as its balls, and turns between a tenth of, and ten times a flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import granular as gr
from bench import reference
from bench.reference.series import fraction
from granular.laws.kinds import checked
from granular.scene.walls.panels import Panels
from tests.helpers.fuzz.judge import FALLS_SHORT, SHIFT, SHIFTS, Verdict, shift
from tests.helpers.fuzz.scenes import Case, _between, _start

MOST = 7
"""Contacts of a scene."""
LOOSE = 1e-6
"""The reference is not believed if with ten digits less it differs from itself by more."""
MOST_GRAZING_ERROR = 3e-8
"""Error of a scene with a touch of rounding: the engine cancels approach speeds up to 2 sqrt(noise / speed) of the
typical speed if forces separate the pair (`contacts.touches_by_rounding`)."""
DOUBLE_SPACING = float(np.finfo(float).eps)
DIGITS = 20
"""Digits of the reference."""
STEPS = 20_000
"""Pieces after which a run is cut off."""


@dataclass(frozen=True)
class Driven:
    """A case whose walls are driven: the scene, a law per pair, and when it begins and ends (s)."""

    case: Case
    scene: gr.Scene
    laws: tuple[Any, ...]
    start: float
    end: float

    def run(self, scene: gr.Scene | None = None, **options: Any) -> gr.Trajectory:
        """Run the engine on it, or on a scene that is nearly this one."""
        options = {"t_end": self.end, "max_steps": STEPS, "engine": "plain"} | options
        return gr.md.simulate(scene or self.scene, self.laws, t_start=self.start, **options)


def generate(seed: int) -> Driven:
    """Return the driven scene of a seed: the first attempt whose laws have series, and in which a contact ends."""
    for attempt in range(200):
        start = _start(np.random.default_rng([seed, attempt]), 3)
        rng = np.random.default_rng([seed, attempt, 1])
        found = _driven(rng, start)
        if found is not None:
            return found
    raise AssertionError(f"seed {seed} gives no driven scene with a contact")


def _driven(rng: Any, case: Case) -> Driven | None:
    """The case with walls, forces, a start and an end; None if its laws have no series, or nothing happens."""
    if math.inf not in (case.mass[0], case.mass[-1]):
        case = case.replace(mass=(math.inf, *case.mass[1:]), velocity=(0.0, *case.velocity[1:]))
    scene, laws = case.scene(), tuple(spec.law() for spec in case.laws)
    if not all(map(_quick, checked(laws, scene))):
        return None
    speed = float(np.ptp(scene.velocity)) or 1.0
    flight = (float(scene.gap.clip(min=0.0).sum()) or float(abs(scene.gap).sum()) or 1e-3 * speed) / speed
    start = float(rng.choice([0.0, 0.37, -3.0, 12.0, 1e3])) if rng.random() < 0.7 else flight * float(rng.normal())
    length = 20.0 * flight
    ends = [_path(rng, speed, flight, start, length) if wall and rng.random() < 0.85 else None
            for wall in scene.is_wall[[0, -1]]]
    if ends == [None, None]:
        return None
    force = None
    if rng.random() < 0.5:
        force = np.where(scene.is_wall, 0.0, scene.mass) * (rng.normal(size=scene.n) * speed / flight)
        force[scene.is_wall] = 0.0
    scene = scene.replace(floor=ends[0], ceiling=ends[1], external_force=force)
    return _ended(rng, Driven(case, scene, laws, start, start + length))


def _quick(law: Any) -> bool:
    """Whether the reference has a series for a law that takes it no minute."""
    form = reference.power_series(law)
    return form is not None and form[1] <= 4.0 and all(fraction(power).denominator <= 4 for power in form[1::2])


def _path(rng: Any, speed: float, flight: float, start: float, length: float) -> Any:
    """How a wall moves: a sine, corners, a spline, or a function."""
    omega, fast = 10.0 ** rng.uniform(-1.0, 1.0) * 2.0 * math.pi / flight, speed * 10.0 ** rng.uniform(-1.5, 0.3)
    kind, phase = int(rng.integers(5)), float(rng.uniform(-6.0, 6.0))
    if kind < 2:
        return gr.walls.Sine(fast / omega, omega / (2.0 * math.pi), phase)
    breaks = start + length * np.concatenate([[-0.01], np.sort(rng.uniform(0.0, 0.5, int(rng.integers(2, 9)))), [1.01]])
    heights = np.cumsum(rng.uniform(-1.0, 1.0, len(breaks)) * fast * np.diff(breaks, prepend=breaks[0]))
    if kind == 2:
        return gr.walls.Piecewise(breaks, [np.diff(heights) / np.diff(breaks), heights[:-1]])
    if kind == 3:
        from scipy.interpolate import PchipInterpolator

        return gr.walls.Piecewise(PchipInterpolator(breaks, heights))
    turn = partial(_swing, start, 0.3 * omega, fast / omega, phase)
    return gr.walls.Motion(turn, 1e-14)


def _swing(start: float, omega: float, size: float, phase: float, t: float) -> float:
    """A beat that swells and fades away."""
    x = omega * (t - start)
    return size * math.sin(x + phase) * math.exp(-0.01 * x * x)


def _ended(rng: Any, one: Driven) -> Driven | None:
    """The scene with an end between two events, after a few contacts; None if there are none."""
    try:
        run = one.run(max_events=int(rng.integers(2, MOST + 1)))
    except ValueError:  # walls that meet, a law beyond the range of numbers
        return None
    log = run.contacts[np.isfinite(run.contacts["t_end"])]
    if len(log) == 0 or run.stats["steps"] >= STEPS:
        return None
    last = float(run.time[-1])
    times = sorted({x for x in (np.concatenate([log["t_begin"], log["t_end"]]) - one.start).tolist() if x > 0.0})
    if not times:  # hits of balls at a thermal wall, at once
        return None
    end = one.start + _between(rng, times, max(last - one.start, times[-1]))
    fitted = gr.scene.places.with_fitted_walls(one.scene, one.start, end)  # both read the panels of a function
    return Driven(one.case, fitted, one.laws, one.start, end)


def judge(one: Driven, digits: int = DIGITS) -> Verdict:
    """Run engine and reference on a scene, and compare pairs, speeds and times of all contacts, and the end.

    Errors are in units of the largest speed times the condition: the response of velocities (the engine's own) to
    relative changes of gaps, velocities and masses.
    """
    run = one.run()
    truth = reference.solve(one.scene, one.laws, t_start=one.start, t_end=one.end, digits=digits)
    if truth.velocity_error >= LOOSE:  # nan: nothing met
        return Verdict("unjudged", f"the reference differs from itself by {truth.velocity_error:.1g}")
    moved = _responses(one, run)
    if moved is None:
        return Verdict("unjudged", "a shift changes the contacts")
    speed = max(_speeds(run).max(initial=0.0), float(np.ptp(run.velocity[-1])))
    condition = max(1.0, moved / speed)
    verdict = Verdict("ok", condition=condition, estimate=float(run.stats["error_estimate"]))
    pairs = [row.pair for row in truth.contacts]
    if sorted(pairs) != sorted(run.contacts["pair"].tolist()):
        return Verdict("short", f"contacts {run.contacts['pair'].tolist()} for {pairs}", math.inf, condition)
    errors = {"velocity": _rates(run) - one.scene.across(np.array([float(v) for v in truth.velocity]))}
    for c in range(one.scene.n_pairs):
        log, rows = run.of(c), truth.of(c)
        for name in ("v_in", "v_out"):
            got, wanted = (np.diff(log[name]).ravel(), np.array([_closing(getattr(row, name)) for row in rows]))
            if (np.isnan(got) != np.isnan(wanted)).any():
                return Verdict("short", f"{name} of pair {c} nan", math.inf, condition)
            errors[f"{name} of pair {c}"] = np.nan_to_num(got - wanted)
    worst = max(errors, key=lambda name: abs(errors[name]).max(initial=0.0))
    verdict.why, verdict.error = worst, float(abs(errors[worst]).max(initial=0.0)) / (speed * condition)
    verdict.final = float(abs(errors["velocity"]).max()) / speed
    books = run.account()
    balance = books["energy"] - books["work"].sum(axis=1) - books["heat"].sum(axis=1) + books["dissipated"]
    motion = 0.5 * float(np.where(one.scene.is_wall, 0.0, one.scene.mass) @ np.max(run.velocity**2, axis=0))
    turned = motion + sum(abs(book).max() for book in books.values())  # a fall's two large parts cancel in the energy
    rounding = 16.0 * DOUBLE_SPACING * one.scene.mass[~one.scene.is_wall].sum() * speed**2  # of a fast wall's impulses
    if abs(balance[-1] - balance[0]) > 1e-12 * turned + rounding:
        verdict.why, verdict.error = "account", float(abs(balance[-1] - balance[0]) / turned)
    verdict.kind = "short" if verdict.error > FALLS_SHORT else "ok"
    if verdict.kind == "short" and verdict.why != "account" and verdict.error <= _path_noise(one) / (speed * condition):
        return Verdict("unjudged", "the path of a wall is not known better")
    return verdict


def _path_noise(one: Driven) -> float:
    """Velocity (m/s) up to which fitted paths are uncertain: their error over half the length of a polynomial.

    A function of late times is rounded: at 1000 s, an ulp of time is 3e-10 of a panel of 4e-4 s, and neighbouring
    panels have velocities that differ by as much.
    """
    panels = [path for path in one.scene.motions if isinstance(path, Panels)]
    return max((path.error / (0.5 * float(np.diff(path.edges).min())) for path in panels), default=0.0)


def _closing(both: Any) -> float:
    return math.nan if both is None else float(both[1] - both[0])


def _rates(run: gr.Trajectory) -> Any:
    """Rates of the gaps at the end."""
    return run.scene.across(run.velocity[-1])


def _speeds(run: gr.Trajectory) -> Any:
    """Relative speeds at which contacts begin and end, pair by pair: of two at once none is the first."""
    log = run.contacts[run.by_pair[0]]
    return np.nan_to_num(abs(np.diff(np.concatenate([log["v_in"], log["v_out"]]))))


def _responses(one: Driven, run: gr.Trajectory) -> float | None:
    """By how much (m/s) speeds respond to relative changes; None if contacts change."""
    rng, worst = np.random.default_rng(1), 0.0
    for _ in range(SHIFTS):
        gap, velocity, mass = (1.0 + 64.0 * change for change in shift(one.case, rng))
        scene = one.scene
        balls = np.where(scene.is_wall, 1.0, mass)
        near = scene.replace(gap=scene.gap * gap, velocity=scene.velocity * velocity, mass=scene.mass * balls,
                             rest_gap=_room(scene, scene.gap * gap))
        other = one.run(near)
        if sorted(other.contacts["pair"]) != sorted(run.contacts["pair"]):
            return None
        both = [np.append(_speeds(x).ravel(), _rates(x)) for x in (run, other)]
        if both[0].shape != both[1].shape:
            return None
        worst = max(worst, float(abs(both[1] - both[0]).max()) / (64.0 * SHIFT))
    return worst


def _room(scene: gr.Scene, gap: Any) -> Any:
    """Gaps at rest of pendula that go with gaps a little different: two walls leave the same room."""
    if scene.rest_gap is None or not scene.is_wall[[0, -1]].all():
        return scene.rest_gap
    return scene.rest_gap * (gap.sum() / scene.gap.sum())


def grazes(one: Driven) -> bool:
    """Whether a contact is so weak that rounding decides whether it takes place."""
    rates = _speeds(one.run()).ravel()
    return bool((rates[rates > 0.0] < 1e-7 * rates.max(initial=0.0)).any())


def judged(seed: int) -> Verdict:
    """The verdict on the scene of a seed."""
    one = generate(seed)
    verdict = judge(one)
    if verdict.kind == "short" and verdict.why != "account":
        if grazes(one) and not MOST_GRAZING_ERROR < verdict.error < math.inf:
            return Verdict("unjudged", "a contact of rounding")
        if math.isinf(verdict.error):
            return judge(one, 2 * DIGITS)  # the reference may have missed a touch of balls that hardly move
    return verdict
