"""The light ball on the heavy one: against the exact engine, its own limit m2 → 0, and closed forms by other means."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import adiabatic
from granular.run.trajectory import Status
from tests.helpers.light_balls import SECOND_FLOOR, check_against_limit, dashpots, drop, lighter, upper_contacts

ROWS = json.loads((Path(__file__).parents[1] / "reference" / "icm.json").read_text(encoding="utf-8"))["rows"]


# --- the exact solution ---

@pytest.mark.rotating
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["id"])
def test_reference_inputs_in_the_limit(row):
    r1, r2, gap, g = (float(row[name]) for name in ("R1", "R2", "dh", "g"))
    v = None if row["v0"] is None else float(row["v0"])
    scene = gr.scenes.three_balls((r1, r2), gap, r1 if v else float(row["z1"]), float(row["rho"]), g)
    if v is not None:
        scene = scene.replace(velocity=[0.0, v, v])
    solution = check_against_limit(scene, dashpots(scene, float(row["eps"])))
    assert solution.v10 == pytest.approx(row["v10"], rel=1e-14)
    assert solution.t10 == pytest.approx(row["t10"], rel=1e-14, abs=1e-300)


@pytest.mark.rotating
@pytest.mark.parametrize(("ratio", "from_eps", "largest"), [(10.0, 0.30, 0.0016), (5.0, 0.33, 0.0145)])
def test_counts_and_top_velocity_agree_with_the_exact_engine(ratio, from_eps, largest):
    """Off the jumps: at R1/R2 = 10 these restitutions keep 0.003 away from every jump of the count."""
    scene, worst = drop(ratio), 0.0
    for eps in (e for e in np.arange(from_eps, 1.0, 0.02) if abs(e - 0.794) > 0.008):
        law = dashpots(scene, float(eps))
        solution = adiabatic.contacts(scene, law)
        times, velocity = upper_contacts(scene, law, until=SECOND_FLOOR)
        assert solution.count == len(times), eps
        assert solution.status is Status.until
        worst = max(worst, abs(solution.v2 - velocity[1]) / abs(solution.v10))
    assert 0.5 * largest < worst < largest


def test_one_count_differs_at_a_ratio_of_five():
    scene = drop(5.0)
    law = dashpots(scene, 0.31)
    assert adiabatic.contacts(scene, law).count == 2
    assert len(upper_contacts(scene, law, until=SECOND_FLOOR)[0]) == 3


@pytest.mark.parametrize(("eps", "factor"), [(1.0, 0.3676), (0.85, 1.2814), (0.7, 0.8848), (0.5, 0.1206)])
def test_error_is_of_first_order_in_the_mass_ratio(eps, factor):
    scene = drop()
    law = dashpots(scene, eps)
    solution = adiabatic.contacts(scene, law)
    mu, error = [], []
    for lightness in (2.0**-2, 2.0**-4, 2.0**-6, 2.0**-8):
        light, its_law = lighter(scene, law, lightness)
        _, velocity = upper_contacts(light, its_law, until=SECOND_FLOOR)
        mu.append(light.mass[2] / light.mass[1])
        error.append(abs(solution.v2 - velocity[1]) / abs(solution.v10))
    order = np.polyfit(np.log(mu), np.log(error), 1)[0]
    assert order == pytest.approx(1.0, abs=0.005)
    assert error[-1] / mu[-1] == pytest.approx(factor, rel=1e-3)


# --- what the paper leaves out ---

def overlap_at(scene, law, solution, t):
    """Overlaps of both pairs at a time after the first touch, by the exact engine with a ball of hardly any weight."""
    light, its_law = lighter(scene, law, 2.0**-60)
    return -gr.md.simulate(light, its_law, t_end=solution.t10 + t, engine="plain").gap[-1]


def test_contact_begins_again_at_positive_overlap():
    """A clipped force that turns positive again is a new contact: of the balls, and of the floor."""
    scene = drop(gap=1e-5, height=0.1001)
    law = dashpots(scene, (0.9, 0.1))
    solution = check_against_limit(scene, law)
    assert solution.count == 2
    assert overlap_at(scene, law, solution, solution.contacts[1, 0])[1] > 1e-9
    law = dashpots(scene, (0.2, 0.9), (5e7, 200.0))
    solution = check_against_limit(scene, law)
    assert solution.floor_end < solution.floor_again < 2.0 * solution.floor_end
    assert overlap_at(scene, law, solution, solution.floor_again)[0] > 1e-9


def test_contact_still_running_at_the_second_floor_contact():
    scene = drop(height=0.10001)
    law = dashpots(scene, 0.9, (5e7, 1e3))
    solution = check_against_limit(scene, law)
    assert solution.ongoing
    assert solution.count == 1
    assert solution.floor_end < solution.floor_again < solution.t_f
    exact, velocity = upper_contacts(scene, law, t_end=0.013)
    np.testing.assert_allclose(solution.contacts[0], exact[0], rtol=2e-3)
    assert solution.v2 == pytest.approx(velocity[1], rel=2e-2)


def test_equal_balls_are_no_light_ball():
    """At R1/R2 ≤ 1.06 the real upper ball pushes the lower one back on the floor; this one cannot."""
    scene = drop(1.0)
    law = dashpots(scene, 0.8)
    assert not adiabatic.contacts(scene, law).ongoing
    assert np.isnan(upper_contacts(scene, law, until=SECOND_FLOOR)[0][-1, 1])


@pytest.mark.parametrize(("eps", "count", "status"), [(0.0092, 1, Status.until), (0.009, 2, Status.resting)])
def test_lower_ball_that_never_leaves_the_floor(eps, count, status):
    """Below ε = 0.0091 the first floor contact has no end, in truth as well."""
    scene = drop()
    law = dashpots(scene, eps, (5e7, 1e6))
    solution = adiabatic.contacts(scene, law)
    assert (solution.count, solution.status) == (count, status)
    assert math.isinf(solution.floor_end) == (status is Status.resting)
    assert gr.md.simulate(scene, law, until=SECOND_FLOOR, engine="plain").status is status


def test_both_at_rest_in_the_end():
    scene = drop(gap=1e-6, height=0.10000001)
    solution = check_against_limit(scene, dashpots(scene, 0.3))
    assert solution.status is Status.resting
    assert solution.count == 3
    assert solution.contacts[-1, 1] == solution.t_f == solution.floor_end == math.inf
    assert solution.v1 == solution.v2 == solution.v_rel == 0.0


def test_elastic_light_ball_on_a_moving_wall():
    """ε = 1 and one separate contact: the lower ball is a wall, v2′ = 2 v1 - v2, and it keeps its energy."""
    scene = drop(gap=3e-3)
    solution = check_against_limit(scene, dashpots(scene, 1.0))
    g, impact = scene.gravity, -solution.v10
    assert solution.v1 == pytest.approx(impact - g * (solution.t_f - solution.floor_end), rel=1e-12)
    begin = solution.contacts[0, 0]
    approach = (impact - g * (begin - solution.floor_end)) - (-impact - g * begin)
    assert solution.v_rel == pytest.approx(approach, rel=1e-12)
    assert solution.floor_again - solution.floor_end == pytest.approx(2.0 * impact / g, rel=1e-12)


def test_upper_ball_far_away_has_no_contact():
    scene = drop(gap=5.0)
    solution = adiabatic.contacts(scene, dashpots(scene, 0.5))
    assert (solution.count, solution.contacts.shape, solution.status) == (0, (0, 2), Status.until)
    assert math.isnan(solution.t_f)
    assert math.isnan(solution.v_rel)


@pytest.mark.rotating
def test_random_scenes_equal_the_limit():
    rng = np.random.default_rng(83)
    seen = set()
    for _ in range(30):
        scene = drop(10 ** rng.uniform(0.0, 1.5), rng.choice([0.0, 10 ** rng.uniform(-8, -3)]), 0.32)
        scene = scene.replace(gap=scene.gap - [scene.gap[0], 0.0], gravity=10 ** rng.uniform(-1, 2.5),
                              velocity=np.array([0.0, -1.0, -1.0]) * 10 ** rng.uniform(-2, 1))
        k, zeta = 10 ** rng.uniform(4, 8, 2), rng.choice([0.0, 0.03, 0.3, 1.0, 2.0], 2, p=[0.1, 0.3, 0.3, 0.2, 0.1])
        if zeta[0] == 0.0 or zeta[1] == 0.0:
            scene = scene.replace(gravity=min(scene.gravity, 10.0))
        law = [gr.LinearDashpot(k[c], 2.0 * zeta[c] * math.sqrt(k[c] * scene.mass[c + 1])) for c in (0, 1)]
        solution = adiabatic.contacts(scene, law, max_steps=2000)
        if solution.status is not Status.max_events:
            seen.add(check_against_limit(scene, law, 1e-11, solution).status)
    assert seen == {Status.until, Status.resting}


# --- parts ---

@pytest.mark.rotating
@pytest.mark.parametrize("square", [(4.0, 900.0), (900.0, 4.0), (9.0, 9.0)])
@pytest.mark.parametrize("zeta", [(0.0, 0.0), (0.1, 0.9), (1.0, 1.0), (2.0, 0.1), (0.3, 10.0),
                                  pytest.param((0.3, 40.0), marks=pytest.mark.soak)])
def test_every_type_of_damping_and_resonance(square, zeta):
    scene = drop(3.0, gap=1e-3, height=0.04)
    law = [gr.LinearDashpot(w * m, 2.0 * z * math.sqrt(w) * m)
           for w, z, m in zip(square, zeta, scene.mass[1:], strict=True)]
    assert check_against_limit(scene, law).count >= 1


def test_the_work_limit_is_a_status():
    scene = drop()
    law = dashpots(scene, 0.7)
    full = adiabatic.contacts(scene, law)
    cut = adiabatic.contacts(scene, law, max_steps=full.steps // 3)
    assert cut.status is Status.max_events
    assert 0 < cut.count < full.count
    assert math.isnan(cut.floor_end)


def test_a_floor_that_moves():
    """Only relative velocities count; the floor's own is added in the end."""
    scene = drop().replace(gap=[0.0, 1e-4], velocity=[0.0, -3.0, -3.0])
    law = dashpots(scene, 0.7)
    still = adiabatic.contacts(scene, law)
    moving = adiabatic.contacts(scene.replace(velocity=[0.5, -2.5, -2.5]), law)
    assert moving.v2 == pytest.approx(still.v2 + 0.5, rel=1e-15)
    assert (moving.contacts == still.contacts).all()


def other_scene(**changes):
    return lambda: adiabatic.contacts(drop().replace(**changes), gr.LinearDashpot(5e7))


@pytest.mark.exact
@pytest.mark.parametrize(("make", "message"), [
    (lambda: adiabatic.contacts(3, gr.LinearDashpot(1.0)),
        r"`scene` must be a granular\.Scene, such as granular\.scenes\.three_balls\(\), got 3\."),
    (lambda: adiabatic.contacts(gr.scenes.newtons_cradle(3), gr.LinearDashpot(1.0)),
        r"`scene` must have a floor and two balls, as in granular\.scenes\.three_balls\(\), got Scene\(3 "
        r"balls\)\."),
    (lambda: adiabatic.contacts(drop(), gr.Hertz(1e6)),
        r"The law of pair floor–1 must be linear, such as LinearDashpot, got Hertz\(k=1000000\.0\)\. For other laws "
        r"use granular\.md\."),
    (other_scene(gap=[0.1, -1e-6]), r"`gap\[1\]` must be non-negative, got -1e-06\."),
    (other_scene(gap=[0.1, 1e-6], velocity=[0.0, 0.0, -1.0]),
        r"The lower ball must reach the floor before the balls meet, got gap\[1\] = 1e-06 m closing at 1\.0 m/s\."),
    (other_scene(gravity=0.0), r"The lower ball must fall on the floor, got gap\[0\] = 0\.5 m closing at -0\.0 m/s\."),
    (lambda: adiabatic.contacts(drop(), gr.LinearDashpot(1.0), max_steps=0),
        r"`max_steps` must be an integer.*, got 0"),
])
def test_misuse(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()
