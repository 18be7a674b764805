"""Random boxes of hard balls that merge: at every sample finite, the gaps add up, and energy goes nowhere unseen."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import granular as gr
from granular._engine.kernels import have_numba
from granular.scene.walls import Motion, Piecewise, Sine, Thermal
from tests.helpers import scenes_at_random as random

INF = math.inf
SAMPLES = 20
ROWS = ("position", "velocity", "gap")
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
    return scene, rules, {"t_end": t_end, "samples": SAMPLES, "max_events": 1_000, "engine": "sorted"} | merging


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
    assert result.status in (gr.Status.time, gr.Status.max_events)
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
        if result.rule[c] == gr.ConstantRestitution(1.0) and scene.thermal_walls[wall] is None:
            rows = result.of(c)
            before, after = (rows[name][:, 1 - wall] - scene.velocity[-wall] for name in ("v_in", "v_out"))
            assert np.abs(before + after).max(initial=0.0) < 1e-12 * (size / scene.mass[~scene.is_wall].sum())
    if all(result.rule[c] == gr.ConstantRestitution(1.0) for c in (0, last)):  # so nothing has come to rest on a wall
        given = math.fsum(result.of(0)["impulse"]) - math.fsum(result.of(last)["impulse"])
        assert abs(change - given) < 1e-10 * (size + float(log["impulse"].sum()))


def run(seed, **options):
    scene, rules, given = drawn(seed)
    return scene, gr.edmd.simulate(scene, rules, **given | options)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(60))
def test_a_box_stays_a_box(seed):
    judged(*run(seed))


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(20))
def test_two_thousand_boxes_stay_boxes(batch):
    for seed in range(100 * batch, 100 * (batch + 1)):
        judged(*run(seed))


@pytest.mark.soak
@pytest.mark.skipif(not have_numba(), reason="numba")
def test_boxes_are_compiled_to_the_last_bit():
    compiled = 0
    for seed in range(60):
        scene, rules, given = drawn(seed)
        if all(isinstance(rule, gr.ConstantRestitution) for rule in rules):
            one, other = (gr.edmd.simulate(scene, rules, **given | {"engine": name}) for name in ("sorted", "compiled"))
            assert one.contacts.tobytes() == other.contacts.tobytes()
            assert [getattr(one, x).tobytes() for x in ROWS] == [getattr(other, x).tobytes() for x in ROWS]
            compiled += 1
    assert compiled > 20


# --- what is closed, against fractions

def merged(scene, eps, below, most):
    """The first collisions of a box without gravity and with walls at rest, (time, pair, rate), in fractions.

    Balls that touch without a rate move as one when one of them is hit weakly; walls, and what sticks to them, only
    hold what has hit them weakly itself.
    """
    mass = [Fraction(0) if m == INF else Fraction(m) for m in scene.mass]
    v, gap = list(map(Fraction, scene.velocity)), list(map(Fraction, scene.gap))
    stuck, t, rows, last = [m == 0 for m in mass], Fraction(0), [], len(gap) - 1
    while len(rows) < most:
        rate = [b - a for a, b in pairwise(v)]
        due = [(gap[c] / -rate[c], c) for c in range(last + 1) if rate[c] < 0]
        if not due:
            break
        dt, c = min(due)
        t, gap = t + dt, [d + dt * r for d, r in zip(gap, rate, strict=True)]
        rows.append((t, c, rate[c]))
        if eps[c] < 1.0 and -rate[c] < below:
            b, e = c, c + 1
            while not stuck[b] and not stuck[b - 1] and gap[b - 1] == 0 == rate[b - 1]:
                b -= 1
            while not stuck[e] and not stuck[e + 1] and gap[e] == 0 == rate[e]:
                e += 1
            held = stuck[c] or stuck[c + 1]
            common = sum(m * u for m, u in zip(mass[b : e + 1], v[b : e + 1], strict=True)) / sum(mass[b : e + 1])
            v[b : e + 1], stuck[b : e + 1] = [Fraction(0) if held else common] * (e + 1 - b), [held] * (e + 1 - b)
            continue
        held_by = list(stuck)
        for i in (*range(c, -1, -1), *range(c + 1, last + 2)):  # what stood on what is hit stands no more
            if mass[i] and stuck[i] and (i in (c, c + 1) or stuck_beside(held_by, gap, i, c)):
                stuck[i] = False
        a, z = mass[c], mass[c + 1]
        share = Fraction(0) if a == 0 else Fraction(1) if z == 0 else z / (a + z)
        jump = (1 + Fraction(eps[c])) * rate[c]
        v[c], v[c + 1] = v[c] + share * jump, v[c + 1] - (1 - share) * jump
    return rows


def stuck_beside(stuck, gap, i, c):
    """Whether ball `i` stands on others that lead, all touching, to the pair `c`, on the side away from its wall."""
    up, down = (all(stuck[k] and stuck[k + 1] and gap[k] == 0 for k in side)
                for side in (range(c + 1, len(gap)), range(c)))
    if i > c + 1:
        return not up and all(gap[k] == 0 for k in range(c + 1, i))
    return up and not down and i < c and all(gap[k] == 0 for k in range(i, c))


@pytest.mark.parametrize("seed", range(20))
def test_groups_end_before_walls_as_with_fractions(seed):
    rng = np.random.default_rng(seed)
    n, e = int(rng.integers(2, 6)), float(rng.choice([0.25, 0.5, 0.75]))
    gap = rng.integers(0, 3, n + 1) / 4.0
    velocity = rng.integers(-3, 4, n) * 2.0**-4
    scene = gr.Scene([INF, *[1.0, 2.0, 1.0, 3.0, 1.0][:n], INF], [0.0] * (n + 2), [*gap[:-1], gap[-1] + 0.25],
                     [0.0, *velocity, 0.0])
    eps = [float(rng.choice([1.0, 0.5])), *[e] * (n - 1), float(rng.choice([1.0, 0.5]))]
    log = gr.edmd.simulate(scene, [gr.ConstantRestitution(x) for x in eps], max_events=30, collapse="merge",
                           merge_below=0.08, engine="sorted").contacts
    rows = merged(scene, eps, 0.08, 30)
    seen = [(float(t), c, float(-w)) for t, c, w in rows]
    made = list(zip(log["t_begin"].tolist(), log["pair"].tolist(), (log["v_in"] @ [1.0, -1.0]).tolist(), strict=True))
    assert [c for _, c, _ in made] == [c for _, c, _ in seen][: len(made)]
    assert len(made) == len(seen) or seen[len(made)][2] < 1e-12  # what is left is rounding
    for one, other in zip(made, seen, strict=False):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12)


# --- what was wrong

@pytest.mark.parametrize("floor", [Sine(1e-3, 1.0), Thermal(1.0), None])
def test_a_group_ends_before_an_elastic_ceiling(floor):
    """The ceiling of infinite mass was one of the group: nan beside a driven floor, else balls that stopped dead."""
    h = 2.0**-15
    scene = gr.Scene([INF, 1.0, 1.0, 1.0, INF], [0.0] * 5, [1.0, 0.01, 0.0, 0.0], [0.0, h, h, -h, 0.0], floor=floor)
    rules = [gr.ConstantRestitution(0.9)] * 3 + [gr.ConstantRestitution(1.0)]
    result = gr.edmd.simulate(scene, rules, t_end=350.0, samples=9, collapse="merge", merge_below=1e-4)
    judged(scene, result)
    hit = result.of(3)
    assert len(hit) > 9
    assert (hit["v_out"][:, 0] == -hit["v_in"][:, 0]).all()


def test_noise_of_what_merges_again_and_again_does_not_grow():
    """The group took the largest noise of its balls, and every hit that parted them made it larger: then a ball that
    came at a speed below it was not seen, and the box grew."""
    for seed in (38, 991):
        scene, rules, given = drawn(seed)
        judged(scene, gr.edmd.simulate(scene, rules, **given | {"max_events": 4_000}))


def test_a_gas_that_cools_for_very_long_stays_in_its_box():
    """Noise outlived the speeds by 25 decades: slow balls passed through each other, and 43 m grew to 193 m."""
    rng = np.random.default_rng(0)
    scene = gr.Scene([INF, *[1.0] * 5, INF], [0.0] * 7, [1.0] * 6, [0.0, *rng.normal(size=5), 0.0])
    times = np.r_[0.0, np.logspace(0.0, 80.0, 30)]
    result = gr.edmd.simulate(scene, gr.ConstantRestitution(0.6), t_end=1e81, samples=times, log=False)
    judged(scene, result)
    assert result.energy()[-1] > 0.0


def test_a_gas_that_cools_for_ever_ends_with_the_numbers_of_time():
    scene = gr.Scene([INF, 1.0, 1.0, INF], [0.0] * 4, [0.3, 0.4, 0.3], [0.0, 1.0, -0.7, 0.0])
    result = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), engine="sorted")
    assert result.status is gr.Status.max_events
    assert result.gap[-1].sum() == pytest.approx(1.0, rel=1e-14)
    assert result.message.endswith("the next collision is later than 1.1e+301 s, the latest time of a run")
    assert gr.edmd.resume(result).message == result.message


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(8))
def test_balls_fall_under_forces_as_their_weights_as_under_gravity(seed):
    rng = np.random.default_rng([29, seed])
    n = int(rng.integers(2, 7))
    columns = (10.0 ** rng.uniform(-3, 3, n), rng.uniform(0, 0.1, n), rng.uniform(0, 1e-3, n - 1), rng.normal(size=n))
    g = float(rng.uniform(0.1, 20.0))
    forced, heavy = gr.Scene(*columns, external_force=-g * columns[0]), gr.Scene(*columns, gravity=g)
    assert not forced.closing_acceleration.any()
    for run in (lambda scene: gr.edmd.simulate(scene, gr.ConstantRestitution(0.3), collapse="merge", merge_below=0.05),
                lambda scene: gr.md.simulate(scene, gr.LinearDashpot(1e4, 1.0), t_end=0.5)):
        one, other = map(run, (forced, heavy))
        assert one.contacts["pair"].tolist() == other.contacts["pair"].tolist()
        assert one.contacts["t_begin"] == pytest.approx(other.contacts["t_begin"], rel=1e-9)
