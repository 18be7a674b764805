"""Seeded soft scenes on rings, beside thermal walls, of pendula.

A scene starts as `scenes.generate` starts that of the same seed, bit for bit, with at most five balls; then the line is
closed, its walls are heated (one of two may be driven in place of that), or its balls are hung. They are judged by
`bench.reference` in 20 digits, as driven ones are; and by themselves: samples, runs that go on, momentum,
the sum of the gaps, a ring that is turned and boosted.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import granular as gr
from granular.laws.kinds import checked
from tests.helpers.fuzz.driven import Driven, _ended, _path, _quick, _rates, grazes, judge
from tests.helpers.fuzz.judge import Verdict
from tests.helpers.fuzz.scenes import Case, _start

RING, HEAT, HUNG = range(3)


def generate(seed: int) -> Driven:
    """Return the bounded scene of a seed: the first attempt whose laws have series, and in which a contact ends."""
    for attempt in range(200):
        start = _start(np.random.default_rng([seed, attempt]), 5)
        found = _bounded(np.random.default_rng([seed, attempt, 2]), start, seed % 3)
        if found is not None:
            return found
    raise AssertionError(f"seed {seed} gives no bounded scene with a contact")


def _bounded(rng: Any, case: Case, kind: int) -> Driven | None:
    """The case as a scene of that kind, with a start and an end; None if laws have no series, or nothing happens."""
    case = case.replace(gravity=case.gravity if kind == HEAT else 0.0)
    if kind == RING:
        case = _closed(rng, case)
    elif kind == HEAT and math.inf not in (case.mass[0], case.mass[-1]):
        case = case.replace(mass=(math.inf, *case.mass[1:]), velocity=(0.0, *case.velocity[1:]))
    elif kind == HUNG:
        still = [0.0 if math.isinf(m) else v for m, v in zip(case.mass, case.velocity, strict=True)]
        case = case.replace(velocity=tuple(still))
    if case is None or not np.isfinite(case.mass).any():
        return None
    gap = np.array(case.gap)
    if kind == HEAT:
        for c, body in ((0, 0), (-1, -1)):
            gap[c] = max(gap[c], 0.0) if math.isinf(case.mass[body]) else gap[c]
    if kind == HEAT and len(gap) > 1 and any((end <= 0.0).all() for end in (gap[:2], gap[-2:])):
        return None  # a hit and an onset at once: which is first, and so with what speed the other begins, is open
    case = case.replace(gap=tuple(gap.tolist()))
    mass, velocity = np.array(case.mass), np.array(case.velocity)
    scene = gr.Scene(mass, np.zeros(len(mass)), gap, velocity, case.gravity, ring=kind == RING)
    laws = tuple(spec.law() for spec in case.laws)
    if not all(map(_quick, checked(laws, scene))):
        return None
    speed = float(np.ptp(velocity[np.isfinite(mass)])) or 1.0
    flight = (float(gap.clip(min=0.0).sum()) or float(abs(gap).sum()) or 1e-3 * speed) / speed
    start = float(rng.choice([0.0, 0.37, -3.0, 12.0, 1e3])) if rng.random() < 0.6 else flight * float(rng.normal())
    length = 20.0 * flight
    force = None
    if kind != HUNG and rng.random() < 0.4:
        balls = np.where(np.isinf(mass), 0.0, mass)
        force = balls * rng.normal(size=len(mass)) * speed / flight
    try:
        if kind == HEAT:
            ends = [_heat(rng, mass, speed, (flight, start, length)) if wall else None
                    for wall in scene.is_wall[[0, -1]]]
            scene = scene.replace(floor=ends[0], ceiling=ends[1], external_force=force)
            if not scene.heated:
                return None
        elif kind == HUNG:
            scene = _hung(rng, scene, flight)
        else:
            scene = scene.replace(external_force=force)
    except ValueError:  # pendula that have no room
        return None
    return _ended(rng, Driven(case, scene, laws, start, start + length))


def _closed(rng: Any, case: Case) -> Any:
    """The case without its walls, and closed."""
    balls = [i for i, m in enumerate(case.mass) if math.isfinite(m)]
    if len(balls) < 2:
        return None
    low, high = balls[0], balls[-1] + 1
    around = float(rng.choice([0.0, 1.0])) * float(np.mean(np.abs(case.gap))) * float(rng.exponential())
    gap, laws = case.gap[low : high - 1], case.laws[low : high - 1]
    return case.replace(mass=case.mass[low:high], velocity=case.velocity[low:high], gap=(*gap, around),
                        laws=(*laws, laws[int(rng.integers(len(laws)))]))


def _heat(rng: Any, mass: Any, speed: float, times: tuple[float, float, float]) -> Any:
    """A wall as hot as its balls, or much hotter or colder; or a driven one."""
    if rng.random() < 0.15:
        return _path(rng, speed, *times)
    light = float(mass[np.isfinite(mass)].min())
    return gr.walls.Thermal(light * speed**2 * 10.0 ** rng.uniform(-2.5, 1.0), int(rng.integers(2**40)))


def _hung(rng: Any, scene: gr.Scene, flight: float) -> gr.Scene:
    """The balls of a scene as pendula, near to where they rest or far from it."""
    omega = 10.0 ** rng.uniform(-1.0, 1.0) / flight
    rest = scene.gap.clip(min=0.0) * rng.uniform(0.0, 2.0, scene.n_pairs) * (rng.random(scene.n_pairs) < 0.7)
    if scene.is_wall.all(where=[True, *[False] * (scene.n - 2), True]):
        rest = (rest + 1e-3 * abs(scene.gap)) * (scene.gap.sum() / (rest + 1e-3 * abs(scene.gap)).sum())
    origin = 0.0 if rng.random() < 0.3 else float(rng.normal()) * abs(scene.gap).sum()
    return scene.replace(pendulum=omega, rest_gap=rest, origin=origin)


# engines against themselves


def complaints(one: Driven, condition: float) -> list[str]:
    """What is not as it must be among runs of the engine alone."""
    run, out = one.run(), list[str]()
    times = np.linspace(one.start, one.end, 7)
    sampled = one.run(samples=times)
    if run.contacts.tobytes() != sampled.contacts.tobytes():
        out.append("samples change bits")
    for where in (0.37, 0.81):
        part = one.run(t_end=one.start + where * (one.end - one.start))
        rest = gr.md.resume(part, t_end=one.end, engine="plain")
        if not _same(run, rest):
            out.append(f"resumed at {where}: other bits")
    speed = float(abs(run.velocity).max()) or 1.0
    if one.scene.ring:
        momentum = run.velocity @ one.scene.mass
        force = 0.0 if one.scene.external_force is None else one.scene.external_force.sum()
        off = momentum[-1] - momentum[0] - force * (one.end - one.start)
        if abs(off) > 1e-13 * (one.scene.mass.sum() * speed + abs(force) * (abs(one.start) + abs(one.end))):
            out.append(f"momentum {off}")
        off = run.gap.sum(axis=1) - one.scene.gap.sum()
        if abs(off).max() > 1e-13 * abs(run.gap).sum(axis=1).max():
            out.append(f"room {off}")
        turned = _turned(one, speed).run()
        off = abs(np.roll(turned.velocity[-1], 1) - speed - run.velocity[-1]).max()
        if len(turned.contacts) != len(run.contacts) or off > 1e-11 * speed * condition:
            out.append(f"turned and boosted {off}")
    if run.status is not gr.Status.time or not np.isfinite(run.velocity).all():
        out.append(f"status {run.status}")
    return out


def _turned(one: Driven, speed: float) -> Driven:
    """A ring whose numbers begin with the next ball, and that moves along."""
    scene, laws = one.scene, one.laws
    force = None if scene.external_force is None else np.roll(scene.external_force, -1)
    turned = gr.Scene(*(np.roll(a, -1) for a in (scene.mass, scene.radius, scene.gap, scene.velocity + speed)),
                      external_force=force, ring=True)
    return Driven(one.case, turned, (*laws[1:], laws[0]), one.start, one.end)


def _same(one: gr.Trajectory, other: gr.Trajectory) -> bool:
    """Whether two runs end in the same bits."""
    return one.velocity[-1].tobytes() == other.velocity[-1].tobytes() and one.gap[-1].tobytes() == (
        other.gap[-1].tobytes())


def _doubtful(one: Driven, verdict: Verdict) -> bool:
    """Whether a gap smaller than any rounding of an overlap changes as much: balls that lose nothing and were pressed
    together from rest come back to a touch at rest."""
    run, moved = one.run(), 0.0
    if len(run.contacts) == 0 or math.isinf(verdict.error):
        return False
    for part in (1e-18, 1e-16):
        near = one.scene.replace(gap=one.scene.gap + part * float(run.contacts["xi_max"].max()))
        moved = max(moved, float(abs(_rates(one.run(near)) - _rates(run)).max()))
    return moved > 0.1 * verdict.error * verdict.condition * float(abs(run.velocity).max())


def judged(seed: int) -> Verdict:
    """The verdict on the soft scene of a seed."""
    one = generate(seed)
    verdict = judge(one)
    if verdict.kind == "short" and (grazes(one) or _doubtful(one, verdict)):
        return Verdict("unjudged", "a contact of rounding")
    if verdict.kind == "ok":
        wrong = complaints(one, verdict.condition)
        if wrong:
            return Verdict("short", "; ".join(wrong), math.inf, verdict.condition)
    return verdict
