"""From which value of a parameter on may a scene be event-driven?"""

import json
import math

import numpy as np
import pytest

import granular as gr

SPEED = math.sqrt(2.0 * 9.81 * 0.5)
"""m/s, of the ready-made three balls at the floor."""


def isolated(case):
    """Independent of the stop at the first disturbance: count all contacts of the whole run."""
    stats = case.simulate("md").stats
    return stats["isolated"] == stats["contacts"]


@pytest.mark.parametrize(("restitution", "stiffness"), [(1.0, 5e7), (0.9, 5e7), (0.6, 1e6), (0.8, 1e8)])
def test_three_balls_in_the_gap_against_the_closed_estimate(restitution, stiffness):
    """The lower ball is back where it touched the floor after t_c and the run-off γ/k; the upper one must not be there.

    It has fallen by v T + g T²/2; weight makes the floor contact longer by a share of about g/(ω₀ v).
    """
    between = (1e-5, 1e-1)
    found = gr.threshold("three-balls", "gap", between, within=1e-4, restitution=restitution, stiffness=stiffness)
    case = gr.cases.make("three-balls", restitution=restitution, stiffness=stiffness)
    law = case.law[0]
    duration = gr.binary.collision(law, case.scene.pairs[0], SPEED).duration + law.gamma / law.k
    fall = SPEED * duration + 0.5 * 9.81 * duration**2
    weight = 9.81 / (math.sqrt(law.k / case.scene.mass[1]) * SPEED)
    (crossing,) = found.crossings
    assert (crossing.low.verdict, crossing.high.verdict) == ("fails", "holds")
    assert fall * (1.0 - 2e-4) < crossing.value < fall * (1.0 + 2.0 * weight)
    assert found.holds == ((crossing.high.value, 1e-1),)


def test_three_balls_in_the_gap_against_a_dense_scan():
    found = gr.threshold("three-balls", points=10, restitution=0.9, within=0.001)
    gaps = np.linspace(2e-3, 3.5e-3, 61)
    dense = [isolated(gr.cases.make("three-balls", gap=gap, restitution=0.9)) for gap in gaps.tolist()]
    (crossing,) = found.crossings
    assert dense == [gap > crossing.value for gap in gaps.tolist()]
    assert crossing.high.value - crossing.low.value <= 0.001 * crossing.high.value


def two_hits(gap, k=1e4, mass=1.0):
    """A heavy ball that is hit from both sides at 1 m/s, from below after 1 s, from above after the gap in m."""
    scene = gr.Scene([mass, 1e9, mass], [0.0] * 3, [1.0, gap], [1.0, 0.0, -1.0])
    return gr.Case(scene, gr.LinearDashpot(k), about="two hits")


def test_windows_are_found_from_both_sides():
    found = gr.threshold(two_hits, "gap", (0.5, 2.0), points=40, within=1e-6)
    lasts = math.pi / math.sqrt(1e4)
    assert [(c.low.verdict, c.high.verdict) for c in found.crossings] == [("holds", "fails"), ("fails", "holds")]
    assert [c.value for c in found.crossings] == pytest.approx([1.0 - lasts, 1.0 + lasts], rel=2e-6)
    (_, last), (first, _) = found.holds
    down, up = math.floor(last * 1e8) / 1e8, math.ceil(first * 1e7) / 1e7  # to eight digits, rounded to the safe side
    assert found.sentence == (f"Every contact is isolated up to gap = {down:.8g} and from gap = {up:.8g} upwards "
                              "(scanned from 0.5 to 2).")
    (inside,) = found.fails
    again = gr.threshold(two_hits(1.0), "gap[1]", inside, points=5, spacing="linear")
    assert again.holds == ()
    assert again.sentence.startswith("Nowhere is every contact isolated: gap[1] from 0.96")


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(2, 6))
def test_random_scenes_against_whole_runs(seed):
    def case(k):
        return gr.Case(gr.scenes.gas(6, seed=seed), gr.LinearDashpot(k), t_end=100.0)

    found = gr.threshold(case, "k", (1e1, 1e5), points=30, within=1e-3)
    assert [isolated(case(one.value)) for one in found.values] == [one.verdict == "holds" for one in found.values]
    assert len(found.holds) + len(found.fails) == len(found.crossings) + 1
    assert len(found.crossings) == (3 if seed == 5 else 1)  # with seed 5 a window in between


def test_error_is_that_of_compare_and_sweep():
    pytest.importorskip("xarray")
    found = gr.threshold("three-balls", criterion="error", error=0.02, points=8, restitution=0.9)
    swept = gr.sweep("three-balls", {"gap": [one.value for one in found.values]}, "error", restitution=0.9)["error"]
    assert [one.measure for one in found.values] == swept.values.tolist()
    assert [one.verdict == "holds" for one in found.values] == (swept.values <= 0.02).tolist()
    assert found.sentence.startswith("The error of hard spheres is at most 0.02 of the fastest impact from gap = 0.00")


def limited(gap):
    """Three balls; close ones are given up after one contact."""
    case = gr.cases.make("three-balls", gap=gap)
    return gr.Case(case.scene, case.law, until=case.until, run={"max_events": 1 if gap < 1e-4 else 1000})


def test_what_ends_by_a_limit_is_undecided():
    found = gr.threshold(limited, "gap", points=9)
    assert found.values[0].verdict == "undecided"
    assert found.undecided[0][1] == pytest.approx(1e-4, rel=0.01)
    assert "Undecided up to gap = 9.9" in found.sentence
    assert "max_events" in found.sentence
    assert found.holds[0][0] == gr.threshold("three-balls", points=9).holds[0][0]
    never = gr.threshold(limited, "gap", (1e-6, 1e-5), points=3)
    assert never.sentence.startswith("Undecided everywhere from gap = 1e-06 to 1e-05; at gap = 1e-06: max_events")


def test_refused_values_are_undecided_and_all_of_them_a_mistake():
    found = gr.threshold("three-balls", "height", (0.05, 0.6), points=4, spacing="linear", gap=1e-2)
    assert found.undecided[0][0] == 0.05
    assert found.undecided[0][1] == pytest.approx(0.1, rel=0.02)
    with pytest.raises(ValueError, match="height"):
        gr.threshold("three-balls", "height", (0.01, 0.05), points=4)
    with pytest.raises(ValueError, match=r"`disturbed` must be 'resolve' for method 'verlet', got 'stop'\. Use "
                                         r"method='located'\."):
        gr.threshold("three-balls", run={"method": "verlet", "dt": 1e-6}, points=2)


def test_it_is_said_where_nothing_touches_or_the_end_time_cuts_a_contact_off():
    """One ball at 1 m/s, 0.1 m away: contacts of √(m_eff/k) π from t = 0.1 s on; nothing disturbs them."""
    case = gr.Case(gr.Scene([1.0, 1.0, 1.0], [0.0] * 3, [0.1, 1.0], [1.0, 0.0, 0.0]), gr.LinearDashpot(1e4))
    found = gr.threshold(case, "law.k", (1e3, 1e5), points=5, t_end=0.05)
    assert found.sentence == "No contact begins: law.k from 1000 to 100000 N/m was scanned."
    cut = gr.threshold(case, "law.k", (1e3, 1e5), points=5, t_end=0.11)
    lasting = sum(0.1 + math.pi * math.sqrt(0.5 / one.value) > 0.11 for one in cut.values)
    assert 0 < lasting < 5
    assert cut.sentence == ("Every contact is isolated everywhere: law.k from 1000 to 100000 N/m was scanned. "
                            f"At {lasting} of 5 values a contact is cut off by the end time.")
    far = gr.threshold(case, "gap[0]", (0.01, 1.0), points=5, t_end=0.5)
    assert far.sentence.endswith("was scanned. At 1 of 5 values nothing touches.")


def test_everywhere_and_a_change_at_zero():
    ball = gr.threshold("bouncing-ball", "stiffness", (1e5, 1e7), points=3)
    assert ball.sentence.startswith("Every contact is isolated everywhere: stiffness from 100000 to 1e+07 N/m was scan")
    assert ball.holds == ((1e5, 1e7),)
    assert ball.crossings == ()
    line = gr.Scene([1.0, 1.0, 1.0], [0.0] * 3, [0.0, 1.0], [0.0, 0.0, 0.0])  # moved towards touching ones, or away
    away = gr.threshold(gr.Case(line, gr.LinearDashpot(1e4)), "velocity[2]", (-1.0, 1.0), spacing="linear", points=4)
    assert len(away.values) < 60
    assert away.holds[0][1] == 1.0
    assert abs(away.crossings[0].value) < 1e-9


def doubled(n: int):
    """Contacts are over before the next one, 0.01 s later, if π/√k is less."""
    return two_hits(0.99, k=10.0 * 4.0**n)


def test_of_whole_numbers_only_whole_ones_are_tried():
    found = gr.threshold(doubled, "n", (1, 20), points=4, within=1e-6)
    tried = [one.value for one in found.values]
    assert all(value.is_integer() for value in tried)
    assert found.undecided == ()
    (crossing,) = found.crossings
    assert (crossing.low.value, crossing.high.value) == (6.0, 7.0)
    assert gr.threshold("column", "n", (1, 4), points=3).undecided == ()
    with pytest.raises(ValueError, match=r"`between` must be integers, because n is an integer, got \(1e-06, 3\.0\)\."):
        gr.threshold("column", "n", (1e-6, 3))


@pytest.mark.parametrize(("change", "sentence"), [
    ({"over": "gaps"}, "gap"), ({"over": 3},
        r"`over` must be the name of one parameter, such as 'gap', got 3\."), ({"between": (1e-2, 1e-6)},
        r"`between` must be in ascending order, got \(0\.01, 1e-06\)\."),
    ({"between": (0.0, 1.0)},
        r"`between` must be positive for spacing='log', got \(0\.0, 1\.0\)\. Use "
        r"spacing='linear'\."),
    ({"between": (1e-6,)}, r"`between` must be two numbers, such as \(1e-6, 1e-2\), got "),
    ({"between": "ab"}, r"`between` must be two numbers, such as \(1e-6, 1e-2\), "
                        "got "), ({"between": (1e-6, math.inf)}, r"between\[1\]"),
    ({"criterion": "binary"}, "criterion"), ({"spacing": "geo"}, "spacing"), ({"points": 1}, "points"),
    ({"within": 0.0}, "within"), ({"error": 0.0}, "error"), ({"gap": 1e-4}, "both varied and fixed"),
    ({"on_progress": 3}, "on_progress"),
])
def test_misuse_is_a_sentence(change, sentence):
    with pytest.raises((ValueError, TypeError), match=sentence) as refused:
        gr.threshold("three-balls", **change)
    assert "\n" not in str(refused.value)


def test_report_json_and_figure(tmp_path):
    told = []
    found = gr.threshold("three-balls", points=6, restitution=0.9,
                         on_progress=lambda share, count: told.append((share, count)))
    text = str(found)
    assert "disturbed  isolated  first disturbed: pairs floor–1 and 1–2 at t = 0.32" in text
    first = math.ceil(found.holds[0][0] * 1e6) / 1e6
    assert text.splitlines()[-1] == found.sentence
    assert found.sentence == f"Every contact is isolated from gap = {first:.4g} m upwards (scanned up to 0.01 m)."
    assert max(map(len, text.splitlines())) <= 120
    assert told[-1] == (1.0, len(found.values))
    found.to_json(tmp_path / "found.json")
    said = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert said["holds"] == [list(found.holds[0])]
    assert said["crossings"][0]["low"]["verdict"] == "fails"
    assert said["fixed"] == {"restitution": "0.9"}
    assert [one["value"] for one in said["values"]] == [one.value for one in found.values]
    found.plot(tmp_path / "found.png")
    assert (tmp_path / "found.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.rotating
@pytest.mark.parametrize("more", ["", " --criterion error --error 0.05"])
def test_command_is_the_library(granular, tmp_path, more):
    options = {"criterion": "error", "error": 0.05} if more else {}
    found = gr.threshold("three-balls", "gap", (1e-5, 1e-2), points=6, within=0.05, restitution=0.8, **options)
    line = f"threshold three-balls --between 1e-5 1e-2 --points 6 --within 0.05 --restitution 0.8{more}"
    code, out, _ = granular(f"{line} --json out.json --plot out.png")
    assert code == 0
    assert out.strip() == str(found)
    written = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    said = found.to_dict()
    names = ("values", "crossings", "holds", "sentence")
    assert all(written[name] == json.loads(json.dumps(said[name])) for name in names)
    assert (tmp_path / "out.png").exists()


def test_file_and_case_give_the_same(tmp_path):
    case = gr.cases.make("three-balls", restitution=0.8)
    gr.cases.save(case, tmp_path / "case.toml")
    named = gr.threshold("three-balls", restitution=0.8, points=6)
    for other in (gr.threshold(tmp_path / "case.toml", "gap[1]", points=6), gr.threshold(case, "gap[1]", points=6)):
        assert [one.verdict for one in other.values] == [one.verdict for one in named.values]
        assert [one.value for one in other.values] == [one.value for one in named.values]
