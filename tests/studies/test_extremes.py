"""One's own scene in the extreme: what is varied, the verdicts, the judge, the table, the figure, and the command."""

import json
import math

import numpy as np
import pytest

import granular as gr
from granular.cases import Case
from granular.laws.contact_law import resolve
from granular.studies import extremes
from granular.studies.extremes import EXTREME_AXES

ONE = Case(gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.1], [0.0, -1.0]), gr.LinearDashpot(1e4, 20.0), t_end=1.0)
LINE = Case(gr.Scene([1.0] * 3, [0.1] * 3, [0.1, 0.2], [1.0, 0.0, 0.0]), gr.Hertz(1e5), until=gr.until.separated())


@pytest.fixture(scope="module")
def report():
    return gr.stability(ONE, axes=("stiffness", "gap", "damping"), methods=("located", "verlet", "gear5"))


@pytest.mark.parametrize(("law", "speed"), [
    (gr.LinearDashpot(1e4, 20.0), 1.0), (gr.ViscoelasticHertz(1e6, 1e3), 0.7), (gr.TsujiHertz(1e6, 0.3), 2.0),
    (gr.WaltonBraun(1e4, 2e4), 1.0),
])
def test_stiffer_keeps_the_restitution(law, speed):
    varied = EXTREME_AXES["stiffness"][0](Case(ONE.scene, law), 1e4).law
    pair = ONE.scene.pairs[0]
    before, after = (gr.binary.collision(one, pair, speed) for one in (law, varied))
    assert after.restitution == pytest.approx(before.restitution, rel=1e-9)
    assert after.duration < 0.1 * before.duration


def test_what_is_pressed_keeps_its_forces_and_unlike_laws_their_restitutions():
    laws = [gr.LinearDashpot(1e6, 5.0), gr.Hertz(1e9), gr.WaltonBraun(1e6, 2e6), gr.ViscoelasticHertz(1e8, 50.0),
            gr.TsujiHertz(1e9, 0.3), gr.MatchedEnd(3.0, 1e6)]
    scene = gr.Scene([1.0] * 7, [0.1] * 7, [1e-2, *[-1e-5] * 5], [0.0] * 7)
    stiff = EXTREME_AXES["stiffness"][0](Case(scene, laws), 1e4)
    for c, (law, other, pair) in enumerate(zip(laws, stiff.law, scene.pairs, strict=True)):
        before, after = (resolve(one, pair).force(xi, 0.0, xi) for one, xi in (
            (law, -scene.gap[c]), (other, -stiff.scene.gap[c])))
        assert c == 0 or after == pytest.approx(before, rel=1e-13)
        if c < 5:
            eps = [gr.binary.restitution(one, pair, 1.0) for one in (law, other)]
            assert eps[1] == pytest.approx(eps[0], rel=1e-9)
    assert stiff.scene.gap[0] == 1e-2
    assert EXTREME_AXES["gap"][0](Case(scene, laws), 1e-3).scene.gap.tolist() == [1e-5, *[-1e-5] * 5]


def test_what_is_varied():
    def varied(axis, factor, case=LINE):
        return EXTREME_AXES[axis][0](case, factor)

    walled = Case(gr.scenes.three_balls(), [gr.LinearDashpot(1e6, 5.0)] * 2)
    assert varied("gap", 0.0, walled).scene.gap.tolist() == [walled.scene.gap[0], 0.0]
    assert [law.gamma for law in varied("damping", 10.0, walled).law] == [50.0, 50.0]
    assert varied("mass", 1e3).scene.mass.tolist() == [1.0, 1e3, 1.0]
    assert varied("mass", 1e3, walled).scene.mass[2] == 1e3 * walled.scene.mass[2]
    assert varied("stiffness", 100.0).law == gr.Hertz(1e7)


@pytest.mark.rotating
def test_located_is_right_everywhere(report):
    assert {row.verdict for row in report.of("located")} == {"right"}
    assert max(row.error for row in report.of("located")) < 1e-14


@pytest.mark.rotating
def test_a_forgotten_step_is_flagged_and_an_own_one_is_right(report):
    for scene in ("stiffness × 1e+06", "stiffness × 1e+08"):
        *forgotten, own = report.of("verlet", scene)
        assert {row.verdict for row in forgotten} == {"flagged"}
        assert all("times the highest rate of the contacts is" in row.said for row in forgotten)
        assert own.verdict == "right"
        assert math.isnan(own.dt)


def test_error_of_a_step_is_that_against_the_closed_form(report):
    eps = gr.binary.restitution(ONE.law, ONE.scene.pairs[0], 1.0)
    for row in report.of("verlet", "as given")[1:3]:
        run = ONE.simulate("md", method="verlet", dt=row.dt)
        assert row.error == pytest.approx(abs(run.contacts["v_out"][0, 1] - eps), abs=1e-14)
    assert report.duration / report.of("verlet", "as given")[0].dt == pytest.approx(8.0)


def test_what_changes_nothing_is_not_tried(report):
    assert all(
        "Neither the scene nor its laws change" in report.left_out[f"gap × {factor:g}"]
        for factor in EXTREME_AXES["gap"][1]
    )
    assert not report.of("located", "gap × 0")


def test_verdicts(monkeypatch):
    def verdicts(**limits):
        for name, value in limits.items():
            monkeypatch.setattr(extremes, name, value)
        return [row.verdict for row in gr.stability(ONE, axes=(), methods="verlet", error=1e-3).rows]

    assert verdicts() == ["flagged", "wrong", "wrong", "right"]
    assert verdicts(rounding_level=lambda task: 2e-3) == ["undecided"] * 4
    assert verdicts(MAX_STEPS=5) == ["flagged"] * 4


def test_refusals_are_flags_and_scenes_that_cannot_be_are_left_out(monkeypatch):
    def refuses(case, factor):
        raise ValueError("mass is too large.")

    monkeypatch.setitem(extremes.EXTREME_AXES, "mass", (refuses, (1e3,)))
    assert gr.stability(LINE, axes="mass", methods="located").left_out == {"mass × 1000": "mass is too large."}
    far = Case(ONE.scene, ONE.law, until=gr.until.separated(), run={"t_start": 1e13})
    short = gr.stability(far, axes=(), methods="verlet").rows[1:]
    assert {row.verdict for row in short} == {"flagged"}
    assert all("`dt` must be large enough to advance the clock" in row.said for row in short)


def test_table_and_words_count_every_run(report):
    head, *lines = report.table()
    assert head == ["", "located", "verlet", "gear5"]
    assert [line[0] for line in lines][:2] == ["as given", "stiffness × 100"]
    signs = " ".join(sign for line in lines for sign in line[1:]).split()
    assert len(signs) == len(report.rows)
    wrong = sum(row.verdict == "wrong" for row in report.rows)
    assert signs.count("✗") == wrong
    assert f"wrong without a warning: {wrong} of {len(report.rows)} runs" in str(report)
    assert "not tried: gap × 0.001, gap × 1e-06, gap × 0: Neither the scene nor its laws change." in str(report)


@pytest.mark.rotating
def test_figure_holds_the_table(report, tmp_path):
    pytest.importorskip("matplotlib")
    figure = report.plot()
    words = [text.get_text() for text in figure.axes[0].texts]
    assert words == [sign for line in report.table()[1:] for sign in " ".join(line[1:]).split()]
    report.plot(tmp_path / "table.png")
    assert (tmp_path / "table.png").stat().st_size > 10_000


def test_json_has_every_run(report, tmp_path):
    report.to_json(tmp_path / "table.json")
    stored = json.loads((tmp_path / "table.json").read_text("utf-8"))
    assert len(stored["rows"]) == len(report.rows)
    first = {"scene": "as given", "method": "located", "dt": None, "verdict": "right", "contacts": 0}
    assert stored["rows"][0].items() >= first.items()


def test_misuse_is_one_sentence():
    with pytest.raises(ValueError, match=r"`axes` must be .*, got 'stiffnes'\. Did you mean 'stiffness'\?"):
        gr.stability(ONE, axes="stiffnes")
    with pytest.raises(ValueError, match=r"`methods` must be .*, got 'verlett'\. Did you mean 'verlet'\?"):
        gr.stability(ONE, methods="verlett")
    with pytest.raises(ValueError, match=r"`error` must be .*, got 0"):
        gr.stability(ONE, error=0)
    with pytest.raises(ValueError, match="`scene` must have a contact that ends"):
        gr.stability(gr.Scene([1, 1], [0.1] * 2, [0.1], np.zeros(2)).replace(), t_end=1.0, law=gr.Hertz(1e5))


@pytest.mark.rotating
def test_the_command(granular):
    code, out, _ = granular("stability three-balls --axes gap --methods located rk4 --gap 1e-3 --json table.json")
    assert code == 0
    assert "gap × 1e-06" in out
    with open("table.json", encoding="utf-8") as file:
        assert json.load(file)["title"] == "three-balls"
    code, _, err = granular("stability three-balls --axes foo")
    assert code == 2
    assert "got 'foo'" in err
