"""Relative velocities below their rounding error: a common velocity changes no run, and elastic balls come to rest."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import granular as gr

INF = math.inf
OPTIONS = [
    {"ties": "left"}, {"ties": "right"}, {"ties": "random", "seed": 7}, {"ties": "newton"}, {"ties": "poisson"},
    {"ties": "reflect"}, {"collapse": "merge"}, {"tc": 1e-3}, {"elastic_below": 0.05},
]
COLLISIONS_AT_MOST = 100_000


def bodies(rng, *, equal):
    """Masses, radii, gaps, velocities relative to the walls and gravity of two to six balls beside undriven walls."""
    n, below = int(rng.integers(2, 7)), rng.random() < 0.85
    above = not below or rng.random() < 0.3
    mass = np.ones(n) if equal else rng.uniform(0.2, 3.0, n)
    gap = rng.choice([0.0, 1.0], n + 1, p=[0.35, 0.65]) * rng.uniform(1e-3, 0.2, n + 1)
    gap[0] *= rng.random() < 0.4
    gap[n] += 0.05
    velocity = np.round(rng.normal(size=n) * rng.integers(0, 2, n) * 2.0**20) / 2.0**20  # boosts leave it exact
    velocity[0] *= rng.random() < 0.5
    walls = [[INF] * below, [INF] * above]
    mass = [*walls[0], *mass.tolist(), *walls[1]]
    velocity = [0.0] * below + velocity.tolist() + [0.0] * above
    radius = [0.1 * math.isfinite(m) for m in mass]
    return mass, radius, gap[1 - below : n + above].tolist(), velocity, float(rng.choice([0.0, 1.62, 9.81]))


def scene_of(given, rng, boost):
    mass, radius, gap, velocity, gravity = given
    share = float(rng.choice([0.5, 1.0, 2.0]))
    force = [0.0 if math.isinf(m) else -share * m * gravity for m in mass]
    pushed = {"external_force": force} if gravity > 0.0 and rng.random() < 0.3 else {"gravity": gravity}
    return gr.Scene(mass, radius, gap, [v + boost for v in velocity], **pushed)


def strong_contacts(run):
    """Contacts per pair that are faster than 1e-12 of the fastest impact."""
    closing = run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1]
    return np.bincount(run.contacts["pair"][closing > 1e-12 * closing.max(initial=0.0)], minlength=run.scene.n_pairs)


def solved(given, seed, boost, eps, t_end, options):
    scene = scene_of(given, np.random.default_rng(seed), boost)
    try:
        rule = gr.ConstantRestitution(eps)
        run = gr.edmd.simulate(scene, rule, t_end=t_end, max_events=COLLISIONS_AT_MOST, **options)
    except ValueError as refused:  # a tie rule without an answer
        return str(refused), None
    return run.status, run


def differs(one, other, boost):
    """Whether two runs, of which the other one is boosted, differ by more than rounding."""
    (status, run), (again, moved) = one, other
    if status != again or run is None or moved is None:
        return status != again
    speed = float((run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1]).max(initial=0.0))
    apart = np.abs((moved.velocity[-1] - boost) - run.velocity[-1]).max()
    rounding = 2.0**-50 * abs(boost)
    return bool((strong_contacts(run) != strong_contacts(moved)).any()) or apart > 1e-9 * speed + rounding


def frame_faults(seed):
    """Boosts in which a random scene runs otherwise than at rest, and whether a run misses its end time."""
    rng = np.random.default_rng([47, seed])
    given, eps = bodies(rng, equal=rng.random() < 0.5), float(rng.choice([0.5, 0.8, 1.0, 1.0]))
    options = OPTIONS[rng.integers(len(OPTIONS))]
    if options.get("ties") not in ("newton", "poisson", "reflect") and seed % 8 == 0:
        options = options | {"engine": "compiled"}
    t_end = float(rng.uniform(0.1, 1.0))
    rest, *moved = ((boost, solved(given, [48, seed], boost, eps, t_end, options)) for boost in (0.0, 0.5, 8.0, -3.0))
    missed = [rest[0]] if rest[1][0] is gr.Status.max_events else []
    return missed + [boost for boost, run in moved if differs(rest[1], run, boost)]


@pytest.mark.rotating
@pytest.mark.parametrize("part", range(4))
def test_a_common_velocity_of_all_bodies_changes_no_run(part):
    assert [seed for seed in range(part, 80, 4) if frame_faults(seed)] == []


@pytest.mark.soak
@pytest.mark.parametrize("part", range(20))
def test_a_common_velocity_of_all_bodies_changes_none_of_two_thousand_runs(part):
    assert [seed for seed in range(1000 + part, 3000, 20) if frame_faults(seed)] == []


def flight(height, velocity, gravity, ceiling, time):
    """Height and velocity of a point that bounces elastically between 0 and a ceiling (None: there is none)."""
    x, v, g, left = map(mpmath.mpf, (height, velocity, gravity, time))
    while left > 0:
        if (x == 0 and v < 0) or (x == ceiling and v > 0):
            v = -v
        if v == 0 and (g == 0 or x == 0):
            return x, v
        hits = []
        if g > 0 or v < 0:
            s = mpmath.sqrt(v * v + 2 * g * x)
            hits.append(((v + s) / g if g > 0 else x / -v, mpmath.mpf(0), -s if g > 0 else v))
        if ceiling is not None and v > 0 and v * v > 2 * g * (ceiling - x):
            s = mpmath.sqrt(v * v - 2 * g * (ceiling - x))
            hits.append((2 * (ceiling - x) / (v + s), ceiling, s))
        if not hits or min(hits)[0] >= left:
            return x + v * left - g * left * left / 2, v - g * left
        wait, x, v = min(hits)
        v, left = -v, left - wait
    return x, v


@pytest.mark.parametrize("part", range(4))
def test_equal_elastic_balls_pass_on_their_velocities_as_if_each_were_alone(part):
    """50 digits; a velocity that only just reaches the ceiling has lost half of them, so it is left out."""
    wrong, settled = [], 0
    for seed in range(part, 60, 4):
        rng = np.random.default_rng([49, seed])
        mass, radius, gap, velocity, gravity = bodies(rng, equal=True)
        if not math.isinf(mass[0]):
            continue
        boost, ceiling, n = float(rng.choice([0.0, 0.3, -7.1])), math.isinf(mass[-1]), len(mass) - 1
        options = [o for o in OPTIONS if o.get("ties") not in ("newton", "poisson", "reflect")][rng.integers(6)]
        t_end, balls = float(rng.uniform(0.1, 1.0)), slice(1, n if ceiling else n + 1)
        with mpmath.workdps(50):
            places = [mpmath.fsum(map(mpmath.mpf, gap[:k])) for k in range(1, n + 1)]
            top = places.pop() if ceiling else None
            starts = list(zip(places, velocity[1:], strict=False))
            if ceiling and any(abs(v * v + 2 * gravity * (x - top)) < 1e-6 for x, v in starts):
                continue
            alone = sorted(flight(x, v, gravity, top, t_end) for x, v in starts)
        scene = gr.Scene(mass, radius, gap, [v + boost for v in velocity], gravity)
        run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=t_end, **options)
        speed = max([abs(float(v)) for _, v in alone] + [abs(v) for v in velocity] + [1.0])
        off = np.abs((run.velocity[-1][balls] - boost) - [float(v) for _, v in alone]).max()
        off_height = np.abs(np.cumsum(run.gap[-1])[: len(alone)] - [float(x) for x, _ in alone]).max()
        settled += run.stats.get("settled", 0)
        if run.status is not gr.Status.time or off > 1e-9 * speed or off_height > 1e-9:
            wrong.append(seed)
    assert wrong == []
    assert settled > 0


def test_balls_that_rest_by_rounding_are_counted_and_not_logged():
    scene = gr.Scene([INF, 1.0, 1.0], [0.0, 0.1, 0.1], [0.0, 5e-3], [0.0] * 3, 9.81)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=0.2)
    assert (run.status, len(run.contacts), run.stats["settled"]) == (gr.Status.time, 9, 2)
    closing = run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1]
    assert closing.min() == pytest.approx(math.sqrt(2.0 * 9.81 * 5e-3), rel=1e-12)


def test_balls_without_a_closing_acceleration_collide_however_slowly_they_meet():
    scene = gr.Scene([1.0, 1.0], [0.1, 0.1], [1e-70], [1e-70, 0.0])
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=10.0)
    assert run.velocity[-1].tolist() == [0.0, 1e-70]


def test_a_run_saved_in_the_frame_of_the_scene_is_continued():
    """Earlier releases saved velocities relative to the scene, later ones relative to an undriven wall."""
    scene = gr.Scene([INF, 1.0, 2.0], [0.0, 0.1, 0.1], [0.3, 0.1], [2.0, 2.0, 1.5], 9.81)
    rule = gr.ConstantRestitution(0.7)
    first, whole = (gr.edmd.simulate(scene, rule, t_end=t) for t in (0.2, 0.5))
    earlier = dict(first.state)
    earlier["tally"], earlier["fall_velocity"] = first.state["tally"][:3], first.state["fall_velocity"] + 2.0
    resumed = gr.edmd.resume(replace(first, state=earlier), t_end=0.5)
    assert np.abs(resumed.velocity[-1] - whole.velocity[-1]).max() < 1e-13
