"""The independent reference: against published-in-advance numbers, closed forms, and its own error estimate."""

import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from bench import reference
from bench.reference import taylor
from bench.reference.series import Power, first_rise, fraction, product_term
from granular.laws import resolve
from granular.laws.kinds import resolved
from granular.studies.reference import solve, solve_with
from granular.studies.reference_events import Run, first_rise_of_parabola
from granular.studies.reference_walls import value

mpmath = pytest.importorskip("mpmath")
pytestmark = pytest.mark.rotating  # tests of what tests compare with
NUMBERS = json.loads((Path(__file__).parents[1] / "reference" / "chains.json").read_text())
MP = mpmath.MPContext()
MP.dps = 40


def chain_of(case):
    wall = [math.inf] if case["floor"] else []
    mass = wall + case["mass"]
    velocity = [0.0] * len(wall) + case["velocity"]
    scene = gr.Scene(mass, np.zeros(len(mass)), case["gap"], velocity, gravity=case["gravity"])
    kind = gr.LinearDashpot if case["p"] == 1.0 else lambda k, gamma: gr.Hertz(k)
    law = [kind(k, gamma) for k, gamma in zip(case["k"], case["gamma"], strict=True)]
    ends = {"separated": {"until": gr.until.separated()}, "second_floor": {"until": gr.until.contact(0, 2)}}
    return scene, law, ends.get(case["status"], {"t_end": 1.001 * case["t_final"]})


def final_velocities(scene, solved, t):
    """Velocity of each ball at time `t`, from the last contact it took part in and free fall."""
    final = [MP.mpf(v) for v in scene.velocity]
    when = [MP.mpf(0)] * scene.n
    for row in solved.contacts:
        for body, v in zip((row.pair, row.pair + 1), row.v_out, strict=True):
            if row.t_end > when[body]:
                when[body], final[body] = row.t_end, MP.mpf(v) - MP.mpf(scene.gravity) * (MP.mpf(t) - row.t_end)
    return [v for v, wall in zip(final, scene.is_wall, strict=True) if not wall]


@pytest.mark.parametrize("case", NUMBERS["chains"], ids=lambda case: case["id"])
def test_chains_agree_with_two_other_solvers(case):
    scene, law, end = chain_of(case)
    forms = [resolve(one, pair).form for one, pair in zip(law, scene.pairs, strict=True)]
    solved = taylor.solve(scene, forms, end.get("until"), end.get("t_end"), 22)
    for pair, rows in case["contacts"].items():
        got = [(float(row.t_begin), float(row.t_end)) for row in solved.of(int(pair))]
        np.testing.assert_allclose(got, rows, rtol=1e-15, atol=1e-18)
    t = max(row.t_end for row in solved.contacts)
    wanted = [MP.mpf(v) for v in case["v_final"]]
    error = [abs(a - b) for a, b in zip(final_velocities(scene, solved, t), wanted, strict=True)]
    assert max(error) < 1e-15


def three_balls(law):
    scene = gr.scenes.three_balls()
    return scene, [law(pair) for pair in scene.pairs], {"until": gr.until.contact(0, 2)}


def test_base_scene_of_the_paper():
    scene, law, end = three_balls(lambda pair: gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair))
    solved = reference.solve(scene, law, **end)
    wanted, upper = NUMBERS["three_balls"], solved.of(1)
    assert (len(upper), len(solved.of(0)), solved.status) == (4, 1, "until")
    assert float(upper[-1].v_out[1] - upper[-1].v_out[0]) == pytest.approx(wanted["v_rel"], abs=1e-15)
    touch = solved.of(0)[0].t_begin
    got = [(float(row.t_begin - touch), float(row.t_end - touch)) for row in upper]
    np.testing.assert_allclose(got, wanted["contacts"], rtol=1e-15)
    assert solved.velocity_error < 1e-30
    assert "34 digits" in solved.solver


@pytest.mark.parametrize("eps", [0.9, 0.3])
def test_isolated_dashpot_and_tsuji_have_their_closed_form(eps):
    scene = gr.Scene([1.0, 3.0], [0.0, 0.0], [0.0], [1.0, 0.0])
    for law in (gr.LinearDashpot.from_restitution(eps, 1e6, scene.pairs[0]), gr.TsujiHertz.from_restitution(eps, 1e9)):
        v = reference.solve(scene, law, digits=20).contacts[0].v_out
        assert float(v[1] - v[0]) == pytest.approx(eps, rel=4e-15)


def test_elastic_powers_conserve_energy_and_momentum_to_their_digits():
    for exponent in (1.0, 1.25, 2.0):
        scene = gr.Scene([1.0, 2.0, 0.5], [0.0] * 3, [1e-4, 1e-4], [1.0, 0.0, -1.0])
        solved = reference.solve(scene, gr.PowerLaw(1e8, exponent), digits=24)
        v, m = final_velocities(scene, solved, 0.0), [MP.mpf(x) for x in scene.mass]
        assert abs(sum(a * b for a, b in zip(m, v, strict=True)) - MP.mpf("0.5")) < 1e-20
        assert abs(sum(a * b * b for a, b in zip(m, v, strict=True)) - MP.mpf("1.5")) < 1e-20


def test_the_estimate_covers_the_error_of_the_cheaper_solution():
    scene, law, end = three_balls(lambda pair: gr.ViscoelasticHertz.from_restitution(0.7, 3.13, k=1e9, pair=pair))
    solved = reference.solve(scene, law, **end, digits=24)
    soft = gr.md.simulate(scene, law, **end)
    assert solved.velocity_error < 1e-15
    got = soft.of(1)[-1]["v_out"]
    assert max(abs(float(a - b)) for a, b in zip(solved.of(1)[-1].v_out, got, strict=True)) < 1e-12


def test_the_solution_in_doubles_is_closer_than_it_says():
    scene, law, end = three_balls(lambda pair: gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair))
    truth, solved = reference.solve(scene, law, **end, digits=24), solve(scene, law, **end)
    off = reference.distance(solved, truth)
    assert off[0] < solved.velocity_error < 1.5e-10
    assert off[1] < solved.time_error < 1.5e-10
    assert off[0] < 2e-12


def test_a_law_without_series_is_solved_by_restarts():
    scene, law, end = three_balls(lambda pair: gr.WaltonBraun(5e7, 1e8))
    solved = reference.solve(scene, law, **end)
    soft = gr.md.simulate(scene, law, **end)
    assert "DOP853" in solved.solver
    assert 0.0 < solved.velocity_error < 1e-9
    assert [row.pair for row in solved.contacts] == soft.contacts["pair"].tolist()
    error = np.abs([row.v_out for row in solved.of(1)] - soft.of(1)["v_out"]).max()
    assert error < 20.0 * solved.velocity_error * solved.impact_speed


@pytest.mark.parametrize("method", ["DOP853", "LSODA", "Radau"])
def test_restarts_agree_with_the_series(method):
    scene, law, end = three_balls(lambda pair: gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair))
    solved = reference.solve(scene, law, **end, digits=20)
    again, evaluations = solve_with(scene, resolved(law, scene), end["until"], None, method, 1e-9)
    assert max(reference.distance(again, solved)) < 1e-6
    assert evaluations > 100


def test_a_pile_at_rest_begins_its_contacts_at_once():
    scene = gr.Scene([math.inf, 1.0, 1.0], [0.0] * 3, [0.0, 0.0], [0.0] * 3, gravity=9.81)
    solved = reference.solve(scene, gr.LinearDashpot(1e4, 100.0), t_end=0.02, digits=20)
    assert [(row.pair, float(row.t_begin), row.t_end) for row in solved.contacts] == [(0, 0.0, None), (1, 0.0, None)]
    assert (solved.status, solved.t_stop) == ("time", 0.02)


def test_overlap_at_the_start_and_quiet_end():
    scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [-1e-3], [0.0, 0.0])
    solved = reference.solve(scene, gr.LinearDashpot(1e6), digits=20)
    assert solved.status == "quiet"
    assert float(solved.contacts[0].t_end) == pytest.approx(0.5 * math.pi * math.sqrt(0.5 / 1e6), rel=1e-15)


@pytest.mark.parametrize(("law", "eps", "rounding"), [
    (gr.TsujiHertz.from_restitution(0.9, 1e9), 0.9, 1e-15), (gr.PowerLaw(1e8, 23 / 12), 1.0, 0.0),
])
@pytest.mark.parametrize("digits", [10, 20])
def test_a_force_in_a_high_root_of_the_overlap_takes_few_steps(law, eps, rounding, digits):
    scene = gr.Scene([1.0, 3.0], [0.0, 0.0], [1e-4], [1.0, 0.0])
    motion = taylor.Taylor(scene, [resolve(law, scene.pairs[0]).form], digits)
    solved = Run(motion, None, None).solve("")
    assert motion.steps < 50
    lower, upper = solved.contacts[0].v_out
    assert abs(upper - lower - eps) < 10.0 ** (2 - digits) + rounding


# series

def test_powers_and_products_of_series():
    x = [MP.zero, MP.zero, MP.mpf(3), MP.mpf(1), MP.mpf(-2), *[MP.zero] * 8]
    power = Power(MP, x, MP.mpf(3) / 2, 2)
    root = [power.term(n) for n in range(11)]
    square = [product_term(MP, root, root, n) for n in range(11)]
    cube = [sum(x[i] * x[j] * x[n - i - j] for i in range(n + 1) for j in range(n - i + 1)) for n in range(11)]
    assert max(abs(a - b) for a, b in zip(square, cube, strict=True)) < 1e-35


@pytest.mark.parametrize("roots", [(0.5,), (0.3, 0.3000001, 0.9), (0.25, 0.75, 1.5), (1e-9, 0.5, 0.6)])
def test_first_rise_of_a_polynomial_with_known_roots(roots):
    p = [MP.mpf(1)]
    for root in roots:
        p = [b - MP.mpf(root) * a for a, b in zip([*p, MP.zero], [MP.zero, *p], strict=True)]
    rising = [root for k, root in enumerate(roots) if (len(roots) - k) % 2 == 1]
    if len(roots) % 2 == 0:
        p, rising = [-a for a in p], list(roots[::2])
    assert abs(first_rise(MP, p, MP.mpf(1)) - MP.mpf(rising[0])) < 1e-30
    assert abs(value(p, MP.mpf(rising[0]))) < 1e-38


def test_no_rise_where_there_is_none():
    assert first_rise(MP, [MP.mpf(-1), MP.mpf(2), MP.mpf(-1.0000001)], MP.mpf(2)) is None
    assert first_rise(MP, [MP.zero, MP.mpf(-1), MP.mpf(0.4)], MP.mpf(2)) is None
    assert first_rise_of_parabola(math, (-1.0, 1.0, -1.0)) is None
    assert first_rise_of_parabola(math, (-1.0, 3.0, -2.0)) == 0.5
    assert first_rise_of_parabola(math, (0.0, -3.0, 1.0)) == 3.0
    assert first_rise_of_parabola(math, (0.0, 1.0, 1.0)) == 0.0


def test_exponents_are_simple_fractions():
    assert fraction(1.25) == Fraction(5, 4)
    assert fraction(1.0 / 3.0) == Fraction(1, 3)
    with pytest.raises(ValueError, match="must be a fraction with a denominator of at most 12"):
        fraction(math.pi)


def test_misuse_is_one_sentence(monkeypatch):
    scene, law, _ = three_balls(lambda pair: gr.LinearDashpot(5e7))
    with pytest.raises(ValueError, match=r"`digits` must be an integer of at least 20, got 5"):
        reference.solve(scene, law, digits=5)
    monkeypatch.setattr("bench.reference.taylor.MAX_STEPS", 3)
    with pytest.raises(ValueError, match=r"`t_end` must be given.*after 3 steps"):
        reference.solve(scene, law)
