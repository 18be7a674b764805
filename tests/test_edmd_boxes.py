"""Random boxes of hard balls that merge: at every sample finite, the gaps add up, and energy goes nowhere unseen."""

import math
from pathlib import Path

import numpy as np
import pytest
import scenes_at_random as random
from scipy.interpolate import CubicHermiteSpline

import granular as gr
from granular._kernels import have_numba
from granular.walls import Motion, Piecewise, Sine, Thermal

INF = math.inf
SAMPLES = 20
BELOW = (None, 0.5, 1e-2, 1e-4, 1e-8)
"""Speeds below which balls merge, in units of those that they are given; None is the default."""


def box(rng):
    """Two to eight balls between two walls or on a ring: a scene, and an end time."""
    n, ring = int(rng.integers(2, 9)), rng.random() < 0.1
    mass = [1.0] * n if rng.random() < 0.4 else random.masses(rng, n, 3.0)
    velocity = rng.normal(size=n)
    if rng.random() < 0.5:  # numbers of few digits meet in the same place, with the same speed
        velocity = np.round(4.0 * velocity) * 2.0 ** rng.integers(-15, 1, n)
    gap = rng.uniform(0.1, 1.0, n if ring else n + 1) * (rng.random(n if ring else n + 1) < 0.8)
    if not gap.any():
        gap[-1] = 0.5
    t_end = float(10.0 ** rng.uniform(0.0, 2.5))
    if ring:
        return gr.Scene(mass, [0.0] * n, gap, velocity, ring=True), t_end
    below, above = wall(rng, t_end, 0), wall(rng, t_end, 1, 0.3)
    force = np.r_[0.0, rng.normal(size=n) * mass, 0.0] if rng.random() < 0.2 else None
    return gr.Scene([INF, *mass, INF], [0.0] * (n + 2), gap, [below[1], *velocity, above[1]],
                    float(rng.choice([0.0, 0.0, 1.0])), external_force=force, floor=below[0], ceiling=above[0]), t_end


def wall(rng, t_end, side, share=1.0):
    """What drives a wall, if anything does, and its constant speed."""
    way = int(rng.integers(6)) if rng.random() < share else 0
    away = float(rng.uniform(-1.0, 0.3)) * (1.0 - 2.0 * side) * 0.3 / t_end
    sine = Sine(float(rng.choice([1e-3, 1e-2])), float(10.0 ** rng.uniform(-0.5, 0.5)), float(rng.uniform(0.0, 6.0)))
    breaks = np.linspace(0.0, 1.001 * t_end, 4)
    cubic = CubicHermiteSpline(breaks, *(rng.normal(size=(2, 4)) * [[1e-2], [1e-2 / t_end]]))
    slow = Sine(1e-2, 3.0 / t_end, sine.phase)
    made = (None, None, sine, Piecewise(cubic), Motion(slow.displacement), Thermal(float(np.exp(rng.normal())), 3))
    return made[way], away if way == 1 else 0.0


def laws(rng, scene):
    """A rule for each pair, one for all but, perhaps, elastic walls."""
    sort, n = int(rng.integers(8)), scene.n_pairs
    if sort == 0:
        return [gr.ConstantRestitution(0.0)] * n
    if sort == 1:
        return [gr.ConstantRestitution(e) for e in rng.uniform(0.2, 1.0, n)]
    if sort == 2:
        rule = gr.ThorntonRestitution(0.05)
    elif sort == 3:
        rule = gr.restitution_of(gr.ViscoelasticHertz(1e6, 30.0))
    elif sort == 4:
        rule = slower
    else:
        rule = gr.ConstantRestitution(float(rng.choice([0.3, 0.6, 0.9, 0.98])))
    rules, elastic = [rule] * n, gr.ConstantRestitution(1.0)
    for c in (0, n - 1):
        if rng.random() < 0.5 and not scene.ring:
            rules[c] = elastic
    return rules


def slower(speed, pair):
    """A rule as a user writes it."""
    return 1.0 / (1.0 + speed)


def drawn(seed):
    """A box, its rules, and the options of a run."""
    rng = np.random.default_rng(seed)
    scene, t_end = box(rng)
    rules, below = laws(rng, scene), BELOW[int(rng.integers(len(BELOW)))]
    merging = {} if isinstance(rules[0], gr.ConstantRestitution) and max(
        getattr(r, "restitution", 1.0) for r in rules) == 0.0 else {"collapse": "merge", "merge_below": below}
    return scene, rules, {"t_end": t_end, "samples": SAMPLES, "max_events": 10_000, "engine": "sorted"} | merging


def stands(scene, body, time):
    """Where a wall is at times, by the formula of its motion."""
    moved = np.zeros(len(time))
    motion = scene.floor if body == 0 else scene.ceiling
    if motion is not None and not isinstance(motion, Thermal):
        moved = np.array([motion.displacement(t) for t in time])
    return float(scene.velocity[body]) * time + (moved - moved[0])


def room(scene, time):
    """The sum of the gaps at times."""
    closed = math.fsum(scene.gap)
    return np.full(len(time), closed) if scene.ring else closed + stands(scene, -1, time) - stands(scene, 0, time)


def judged(scene, result):
    """Raise where a run is not sound at a sample: not finite, gaps that do not add up, energy from nowhere."""
    rows = np.hstack([result.position, result.velocity, result.gap])
    assert np.isfinite(rows).all()
    assert (result.gap >= 0.0).all()
    size = float(np.abs(result.position).max() + scene.gap.sum())
    off = np.abs(result.gap.sum(axis=1) - room(scene, result.time)).max()
    assert off < 1e-12 * size, off / size
    energy = result.energy()
    most = np.abs(energy).max() + 0.5 * float(scene.mass[~scene.is_wall] @ scene.velocity[~scene.is_wall] ** 2)
    if result.ledger is not None:
        account = result.account()
        left = energy - account["work"].sum(axis=1) - account["heat"].sum(axis=1) + account["dissipated"]
        most += sum(np.abs(account[name]).max() for name in ("work", "heat", "dissipated"))
        assert np.abs(left - left[0]).max() < 1e-11 * most
        assert np.diff(account["dissipated"]).min() > -1e-12 * most
    elif not scene.velocity[scene.is_wall].any():
        assert np.diff(energy).max(initial=0.0) < 1e-12 * most
    if scene.gravity == 0.0 and scene.external_force is None and not scene.driven:
        momentum_is_handed_on(scene, result)


def momentum_is_handed_on(scene, result):
    """Raise where elastic walls take energy in their own frame, or give less momentum than the balls have got."""
    log, last = result.contacts, scene.n_pairs - 1
    size = float(np.abs(result.velocity).max() + np.abs(scene.velocity).max()) * scene.mass[~scene.is_wall].sum()
    change = result.momentum()[-1] - result.momentum()[0]
    if scene.ring:
        assert abs(change) < 1e-12 * size
        return
    for c, wall in ((0, 0), (last, 1)):
        if result.rule[c] == gr.ConstantRestitution(1.0) and scene.heat[wall] is None:
            rows = result.of(c)
            before, after = (rows[name][:, 1 - wall] - scene.velocity[-wall] for name in ("v_in", "v_out"))
            assert np.abs(before + after).max(initial=0.0) < 1e-12 * (size / scene.mass[~scene.is_wall].sum())
    if all(result.rule[c] == gr.ConstantRestitution(1.0) for c in (0, last)):  # so nothing has come to rest on a wall
        given = math.fsum(result.of(0)["impulse"]) - math.fsum(result.of(last)["impulse"])
        assert abs(change - given) < 1e-10 * (size + float(log["impulse"].sum()))


def run(seed, **options):
    scene, rules, given = drawn(seed)
    return scene, gr.edmd.simulate(scene, rules, **given | options)


@pytest.mark.parametrize("seed", range(60))
def test_a_box_stays_a_box(seed):
    judged(*run(seed))
