"""What outcomes answer to, against many digits, closed forms, and each other."""

import json
import math
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import granular as gr
from granular.comparison.outcome import order
from granular.studies.sweeps.results import RESULTS
from tests.helpers import slopes_judged

BASE = {"restitution": 0.47161184434617386, "k0": -0.090383271761978587, "k1": 0.033030260394309959,
        "m1": 0.089938689133708453, "m2": -0.03258567776603971, "gap": -0.11418653828802672,
        "gravity": 0.14599421671320871}
"""∂v_rel′/∂ln p of the base scene by the series of `bench.reference`, 34 digits; v_rel′ is this:"""
V_REL = 0.1772824106910799050307819
SPEEDS = ("v_rel[1]", "v_final")
ROWS = slopes_judged.rows()


def base(restitution=0.7, k0=5e7, k1=5e7, m1=1.2e3 * math.pi * 1e-3, m2=1.2e3 * math.pi * 1e-6, gap=1e-4, gravity=9.81):
    """The paper's two balls and floor, of 900 kg/m³."""
    scene = gr.Scene([math.inf, m1, m2], [0.0, 0.1, 0.01], [0.5, gap], [0.0] * 3, gravity)
    each = zip((k0, k1), scene.pairs, strict=True)
    laws = [gr.LinearDashpot.from_restitution(restitution, k, pair) for k, pair in each]
    return gr.Case(scene, laws, until=gr.until.contact(0, 2))


@pytest.fixture(scope="module")
def found():
    return gr.sensitivity(base, "v_rel[1]", list(BASE), {"restitution": 0.01, "gap": "5%"})


def test_seven_gradients_of_the_base_scene(found):
    slopes = found.gradient["v_rel[1]"]
    assert found.value["v_rel[1]"] == pytest.approx(V_REL, rel=1e-14)
    for name, truth in BASE.items():
        assert slopes[name] == pytest.approx(truth, abs=1e-10), name
        assert abs(slopes[name] - truth) <= 10.0 * found.error["v_rel[1]"][name] <= 1e-9, name


def test_sum_rules(found):
    """A larger unit of mass is nothing new; of time, from rest, all speeds are slower."""
    by = found.gradient["v_rel[1]"]
    assert by["k0"] + by["k1"] + by["m1"] + by["m2"] == pytest.approx(0.0, abs=1e-10)
    assert by["k0"] + by["k1"] + by["gravity"] == pytest.approx(0.5 * V_REL, abs=1e-10)


def test_condition_and_spread(found):
    by = found.gradient["v_rel[1]"]
    assert found.condition["v_rel[1]"] == pytest.approx(sum(map(abs, BASE.values())) / V_REL, rel=1e-9)
    expected = math.hypot(by["restitution"] * 0.01 / 0.7, by["gap"] * 0.05)
    assert found.sides["v_rel[1]"].keys() <= {"restitution", "gap"}
    if not found.sides["v_rel[1]"]:
        assert found.spread["v_rel[1]"] == pytest.approx(expected, rel=1e-12)


def test_both_sides_where_a_contact_more_or_less_is_within_the_uncertainty():
    wide = gr.sensitivity(base, "v_rel[1]", "restitution", {"restitution": 0.1})
    low, high = wide.sides["v_rel[1]"]["restitution"]
    one, other = (gr.md.simulate(c.scene, c.law, until=c.until).of(1)["v_out"][-1] for c in (base(0.6), base(0.8)))
    assert (low, high) == pytest.approx((one[1] - one[0], other[1] - other[0]), abs=1e-12)
    assert wide.spread["v_rel[1]"] == pytest.approx(max(abs(low - V_REL), abs(high - V_REL)), rel=1e-12)
    assert "Within restitution = 0.7 ± 0.1 the order of contacts changes: v_rel[1] is " in str(wide)


def test_the_border_from_three_contacts_to_four():
    near = gr.sensitivity(base, "v_rel[1]", "restitution", restitution=0.75)
    low, high = near.border["restitution"]
    assert high == pytest.approx(0.7981583625225836833, abs=2e-6)
    assert low < 0.75
    assert f"Nearest changes of a contact count: restitution = {low:.6g} below, 0.79815" in str(near)
    assert json.loads(json.dumps(near.to_dict()))["border"]["restitution"] == [low, high]


def test_hard_spheres_by_hand():
    """Two free balls: v′ = (1 + ε) m₀ v/(m₀ + m₁) of the one that is hit."""
    scene, m, eps = gr.Scene([2.0, 3.0], [0.1, 0.1], [1.0], [1.5, 0.0]), 2.0 * 3.0 / 5.0, 0.8
    out = gr.sensitivity(gr.Case(scene, None, gr.ConstantRestitution(eps), t_end=5.0), "hard_v_final[1]")
    by = out.gradient["hard_v_final[1]"]
    v = (1.0 + eps) * 2.0 * 1.5 / 5.0
    truth = {"mass[0]": v * m / 2.0, "mass[1]": -v * m / 2.0, "rule.restitution": v * eps / (1.0 + eps),
             "velocity[0]": v, "velocity[1]": 1.0 - (1.0 + eps) * 2.0 / 5.0, "gap[0]": 0.0, "t_end": 0.0}
    assert {name: by[name] for name in truth} == pytest.approx(truth, abs=1e-11)
    assert "law" not in " ".join(by)


def test_a_negative_parameter_and_one_that_is_zero():
    """∂/∂p; the second adds nothing to the condition number."""
    scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [1.0], [0.0, -2.0])
    out = gr.sensitivity(gr.Case(scene, gr.LinearDashpot(1e6), t_end=2.0), "v_final")
    np.testing.assert_allclose(out.gradient["v_final"]["velocity[0]"], [0.0, 1.0], atol=1e-10)
    np.testing.assert_allclose(out.gradient["v_final"]["velocity[1]"], [1.0, 0.0], atol=1e-10)
    assert out.condition["v_final"][0] == pytest.approx(0.5 + 0.5 + 1.0, abs=1e-9)  # two masses, a velocity
    assert out.condition["v_final"][1] == pytest.approx(0.5 + 0.5, abs=1e-9)  # its value is 0: of the impact, 2 m/s


def test_one_sided_where_the_other_side_is_refused_or_another_scene():
    """ε = 1 can only fall; a gap of 0 only grow, and of hard spheres hit in turn nothing changes by that."""
    found = [gr.sensitivity(base, "v_rel[1]", "restitution", restitution=1.0 - d) for d in (0.0, 1e-5, 1e-4)]
    elastic, near, far = (one.gradient["v_rel[1]"]["restitution"] for one in found)
    assert elastic == pytest.approx((10.0 * near - far) / 9.0, rel=1e-4)
    row = gr.Scene([1.0] * 3, [0.05] * 3, [0.01, 0.0], [1.0, 0.0, 0.0])
    out = gr.sensitivity(gr.Case(row, None, gr.ConstantRestitution(0.9), t_end=1.0), "hard_v_final", "gap[1]")
    assert out.gradient["hard_v_final"]["gap[1]"].tolist() == [0.0, 0.0, 0.0]


def test_what_is_not_given_is_said():
    """Beside touching balls a velocity more or less is another scene; a run that is cut has no end."""
    row = gr.Case(gr.Scene([1.0] * 3, [0.05] * 3, [0.01, 0.0], [1.0, 0.0, 0.0]), gr.LinearDashpot(1e6), t_end=1.0)
    out = gr.sensitivity(row, "v_final", ["velocity[1]", "mass[1]"])
    assert np.isnan(out.gradient["v_final"]["velocity[1]"]).all()
    assert np.isfinite(out.gradient["v_final"]["mass[1]"]).all()
    assert out.why == {"velocity[1]": "the order of contacts differs just below and just above it"}
    assert ("No derivative with respect to velocity[1]: the order of contacts differs just below and just above it."
            in str(out))
    assert "–" in str(out)
    cut = gr.Case(row.scene, row.law, t_end=1.0, run={"max_events": 1})
    assert gr.sensitivity(cut, "v_final", "mass[1]").why == {
        "mass[1]": "runs at neighbouring values are refused or do not end properly"}


def test_draws_of_thermal_walls_are_held_fixed():
    wall = gr.walls.Thermal(1.0)
    scene = gr.Scene([math.inf, 1.0, math.inf], [0.0] * 3, [0.5, 0.5], [0.0, 1.0, 0.0], floor=wall, ceiling=wall)
    case = gr.Case(scene, None, gr.ConstantRestitution(1.0), t_end=0.7)
    out = gr.sensitivity(case, "hard_v_final", "ceiling.temperature")
    assert out.gradient["hard_v_final"]["ceiling.temperature"][1] == pytest.approx(
        0.5 * out.value["hard_v_final"][1], rel=1e-9)  # it leaves with a speed that goes like √T
    assert "Draws of thermal walls are held fixed." in str(out)


def test_any_executor_gives_the_same_bits():
    here = gr.sensitivity("three-balls", SPEEDS, ["gap", "gravity"])
    for pool in (ProcessPoolExecutor(1), ThreadPoolExecutor(2)):
        with pool as executor:
            there = gr.sensitivity("three-balls", SPEEDS, ["gap", "gravity"], executor=executor)
        assert there.to_dict() == here.to_dict()


def test_names_of_files_cases_and_words_for_all_alike(tmp_path):
    (tmp_path / "two.toml").write_text(gr.cases.dumps(gr.cases.make("three-balls")), encoding="utf-8")
    case = base()
    case = gr.Case(case.scene, gr.LinearDashpot(5e7, 100.0), until=case.until)
    both = gr.Case(case.scene, [gr.LinearDashpot(5e7, 100.0)] * 2, until=case.until)
    one, two = (gr.sensitivity(c, "v_rel[1]", ["law.k"]).gradient["v_rel[1]"]["law.k"] for c in (case, both))
    assert one == two
    split = gr.sensitivity(both, "v_rel[1]", ["law[0].k", "law[1].k"]).gradient["v_rel[1]"]
    assert sum(split.values()) == pytest.approx(one, abs=1e-9)
    toml = gr.sensitivity(tmp_path / "two.toml", "v_rel[1]", "gap[1]").gradient["v_rel[1]"]["gap[1]"]
    assert toml == pytest.approx(BASE["gap"], abs=1e-9)


def test_a_function_of_ones_own_and_how_it_is_shown():
    def kinetic(case):
        """Energy at the end in J."""
        return float(case.simulate("md").energy()[-1])

    out = gr.sensitivity("three-balls", [kinetic], "restitution")
    assert repr(out).startswith("Sensitivity: three-balls: kinetic = ")
    assert "∂/∂ ln restitution" in str(out)
    assert out._repr_html_().startswith("<div><b>three-balls: kinetic")
    assert out.line.startswith("sensitivity: kinetic = ")
    nothing = gr.sensitivity(gr.Scene([1.0, 1.0], [0.0] * 2, [1.0], [0.0, 1.0]), "v_rel", "mass[0]", law=gr.Hertz(1e6))
    assert str(nothing).startswith("Scene(2 balls): no outcome has all its derivatives")


def test_mistakes_are_one_sentence_each():
    for given, kind, sentence in [
        ({"results": "contacts"}, ValueError, "`results` must be continuous outcomes, got 'contacts', an integer, "
         "which has no derivative. To find where the number of contacts changes, use granular.sweep(..., refine=)."),
        ({"results": []}, ValueError, "`results` must be a name such as 'v_rel', or several, got an empty list."),
        ({"results": "v_rel[7]"}, ValueError, "`results` must be one of v_rel[0], v_rel[1], v_rel, got 'v_rel[7]'"),
        ({"results": "speed"}, ValueError, "`results` must be a known name, got 'speed'. Known names: contacts, "),
        ({"over": []}, ValueError, "`over` must have at least one parameter, such as "),
        ({"over": "radii"}, ValueError, "The parameter radii must have one value, got 2 different ones. Give it one "
         "value, or name one entry, such as radii[0], radii[1]."),
        ({"over": "law"}, ValueError, "The parameter law is not a number that can vary continuously. Name another "
         "parameter, such as radii[0], radii[1], gap."),
        ({"over": "restitusion"}, TypeError, "three-balls has no parameter `restitusion`; did you mean `restitution`?"),
        ({"uncertainty": {"gap": "much"}}, TypeError, "The uncertainty of gap must be a single number, got 'much'. "
         "Write 1 % as '1%'."),
        ({"uncertainty": -0.1}, ValueError, "The uncertainty of radii[0] must be a finite number of at least 0, got "
                                            "-0.1."),
        ({"executor": 3}, TypeError, "`executor` must be an object with submit(), such as a ProcessPoolExecutor "),
        ({"gap": -1.0, "results": "hard_v_final"}, ValueError, "`gap[1]` must be at least minus the sum of both "
                                                               "radii, got -1.0"),
    ]:
        with pytest.raises(kind) as mistake:
            gr.sensitivity("three-balls", **given)
        assert str(mistake.value).startswith(sentence), str(mistake.value)


def test_the_command(granular, tmp_path):
    code, out, err = granular("sensitivity three-balls --result v_rel[1] --over restitution --uncertainty 1% --border")
    assert (code, err) == (0, "")
    assert all(part in out for part in ("spread", "0.00471612", "0.798159 above"))
    assert granular(f"sensitivity three-balls --over gap --uncertainty gap=5% --json {tmp_path}/out.json")[0] == 0
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["uncertainty"] == {"gap": 0.05 * 1e-4}
    said = granular("sensitivity three-balls --result contacts")[2]
    assert "`results` must be continuous outcomes, got 'contacts', an integer, which has no derivative" in said


def test_the_order_of_contacts_is_a_result():
    """It is the same for scenes that are alike, and another where a contact is added."""
    runs = {eps: gr.md.simulate(c.scene, c.law, until=c.until) for eps in (0.75, 0.7501, 0.81) for c in [base(eps)]}
    assert order(runs[0.75]) == order(runs[0.7501]) != order(runs[0.81])
    assert RESULTS["order"].dim == ""


# random scenes, against solvers of many digits


def judged(some):
    numbers = np.concatenate([slopes_judged.judged(row) for row in some])
    given = ~np.isnan(numbers[:, 0])
    error, estimate, condition = numbers[given].T
    assert (error <= 1e-8 * condition).all()
    return len(numbers), (~given).sum(), (error > 10.0 * estimate).sum()


@pytest.mark.rotating
def test_random_scenes_against_many_digits():
    count, missing, low = judged([row for row in ROWS if row["truth"]][::16])
    assert count > 15
    assert max(missing, low) <= 0.1 * count


@pytest.mark.soak
def test_all_random_scenes_against_many_digits():
    count, missing, low = judged([row for row in ROWS if row["truth"]])
    assert max(missing, low) <= 0.05 * count


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(20))
def test_the_truths_are_what_the_solvers_say(batch):
    for row in ROWS[batch::20]:
        case, hard, _ = slopes_judged.question(row["kind"], row["seed"], row["t_end"])
        given = gr.sensitivity(case, row["result"], row["name"]).parameters[row["name"]]
        anew = slopes_judged.reference(case, hard, row["name"], given)
        assert (anew is None) is (row["truth"] is None)
        if anew is not None:
            np.testing.assert_allclose(anew, row["truth"], rtol=1e-9, atol=1e-9)


def test_what_all_pairs_share_is_one_parameter_of_a_scene_of_ones_own_too():
    scene = gr.scenes.three_balls(gap=1e-3)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    own = gr.Case(scene, law, until=gr.until.contact(0, 2))
    both = [gr.sensitivity(case, "v_rel[1]", over=["restitution", "gap"], **more)
            for case, more in ((own, {}), ("three-balls", {"gap": 1e-3, "restitution": 0.7}))]
    here, there = (found.gradient["v_rel[1]"] for found in both)
    assert here == pytest.approx(there, rel=1e-9)
    assert here["restitution"] > 1.0


def test_an_uncertainty_beyond_what_a_scene_may_have_is_no_warning():
    """Both ends are refused: not given, and neither is the spread."""
    found = gr.sensitivity("three-balls", "v_rel[1]", "restitution", {"restitution": 3.0})
    assert math.isnan(found.spread["v_rel[1]"])
    assert np.isnan(found.sides["v_rel[1]"]["restitution"]).all()
