"""Both engines over many draws of a scene: means, standard errors, and whether they agree."""

import json
import math
import pickle
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats

import granular as gr
from granular.app.cli import main
from granular.comparison import outcome
from granular.studies.sweeps import ensembles
from granular.studies.sweeps.ensembles import compared_quantity
from granular.studies.sweeps.plan import make_plan

yes, no, undecided = gr.Answer.yes, gr.Answer.no, gr.Answer.undecided
TOUCHING = {"gap": (1e-4, 1e-5)}


def fastest(run):
    return float(np.abs(run.velocity[-1]).max())


def of_seed(seed):
    """A ball that falls from a height of its own."""
    height = np.random.default_rng(seed).uniform(0.5, 1.0)
    return gr.Case(gr.scenes.bouncing_ball(height=float(height)), gr.LinearDashpot(1e7, 100.0), t_end=0.6)


@pytest.fixture(scope="module")
def three_balls():
    return gr.ensemble("three-balls", 8, TOUCHING, "v_rel", seed=3)


def test_numbers_by_hand(three_balls):
    gaps = [1e-4 + 1e-5 * np.random.default_rng([3, k]).standard_normal() for k in range(8)]
    cases = [gr.cases.make("three-balls", gap=gap) for gap in gaps]
    for pair, q in enumerate(three_balls.quantities):
        hard, soft = np.array([[outcome.separation_speeds(case.simulate(engine))[pair] for case in cases]
                               for engine in ("edmd", "md")])
        assert (q.name, q.units, q.lacking) == (f"v_rel[{pair}]", "m s-1", 0)
        assert q.hard == pytest.approx(hard, rel=1e-14)
        assert q.soft == pytest.approx(soft, rel=1e-12)
        assert q.means == pytest.approx([hard.mean(), soft.mean()], rel=1e-12)
        assert q.spreads == pytest.approx([hard.std(ddof=1), soft.std(ddof=1)], rel=1e-9, abs=1e-14)
        assert q.errors == pytest.approx(q.spreads / math.sqrt(8))
        assert q.difference == pytest.approx((hard - soft).mean(), rel=1e-12)
        assert q.error == pytest.approx(stats.sem(hard - soft), rel=1e-6)
        low, high = stats.t.interval(1.0 - 0.05 / 2, 7, q.difference, q.error)  # 95 % for both pairs at once
        assert (q.difference - q.reach, q.difference + q.reach) == pytest.approx((low, high))
        assert q.margin == pytest.approx(0.1 * soft.std(ddof=1))


def test_an_ensemble_that_agrees_one_that_does_not_and_one_that_cannot_tell(three_balls):
    gas = gr.ensemble("gas", 6, "seed", n=8)
    assert gas.answer is yes
    assert gas.verdict.startswith("Yes: the means agree within ")
    assert three_balls.answer is no
    assert three_balls.verdict.startswith("No: the means of v_rel[1] 3.727 (hard) and 0.1")
    few = gr.ensemble("gas", 6, "seed", n=8, independent=True)
    assert few.answer is undecided
    q, = few.quantities
    needed = 6 * (q.reach / (q.margin - abs(q.difference))) ** 2
    assert few.verdict.endswith(
        f"deciding whether this exceeds {q.margin:.2g} requires about {float(f'{needed:.2g}'):g} draws.")


def test_independent_draws_are_those_that_follow():
    both, apart = (gr.ensemble(of_seed, n, "seed", fastest, independent=own) for n, own in ((10, False), (5, True)))
    (b,), (a,) = both.quantities, apart.quantities
    assert (a.soft == b.soft[:5]).all()
    assert (a.hard == b.hard[5:]).all()
    assert a.error == pytest.approx(np.hypot(*a.errors))
    assert a.reach == pytest.approx(a.error * stats.t.ppf(0.975, 4))
    assert b.error < 0.01 * a.error  # the same draws differ in nothing but the engine


def test_a_run_is_made_once_however_many_ask(monkeypatch):
    count = Counter()
    for name in ("edmd", "md"):
        room = getattr(gr, name)
        known = room.simulate
        monkeypatch.setattr(room, "simulate", lambda *given, known=known, name=name, **options: (
            count.update([name]), known(*given, **options))[1])

    def slowest(run):
        return float(np.abs(run.velocity[-1][1:]).min())

    found = gr.ensemble(of_seed, 4, {"seed": lambda random: int(random.integers(9))}, [fastest, slowest, "energy_left"])
    assert count == {"edmd": 4, "md": 4}
    assert [q.name for q in found.quantities] == ["fastest", "slowest", "energy_left"]
    assert found.quantities[0].soft == pytest.approx(found.quantities[1].soft)  # there is one ball


def test_any_executor_gives_the_same_bits():
    here = gr.ensemble("three-balls", 18, TOUCHING, ["v_rel[1]", "contacts"])
    with ThreadPoolExecutor(2) as pool:
        there = gr.ensemble("three-balls", 18, TOUCHING, ["v_rel[1]", "contacts"], executor=pool)
    assert [q.name for q in here.quantities] == ["v_rel[1]", "contacts[0]", "contacts[1]"]
    for one, other in zip(here.quantities, there.quantities, strict=True):
        assert one.hard.tobytes() + one.soft.tobytes() == other.hard.tobytes() + other.soft.tobytes()
        assert one.answer is other.answer
    draws = ensembles.Draws(make_plan("gas", {"seed": np.zeros(0)}, (), {"n": 5}, {}), (None,), 1)
    again = pickle.loads(pickle.dumps(draws))
    assert again(3).scene == draws(3).scene != draws(4).scene


@pytest.mark.rotating
@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize(("n", "of"), [(4, 1), (30, 3)])
def test_intervals_and_answers_of_random_numbers(paired, n, of):
    """300 ensembles whose true difference is 0, just the margin, and twice the margin."""
    rng, trials, width = np.random.default_rng(n), 300, 0.3
    for shift in (0.0, width, 2.0 * width):
        rows = rng.normal(size=(trials, n))
        hard = shift + (rows if paired else rng.normal(size=(trials, n))) + rng.normal(0.0, 0.3, (trials, n))
        found = [compared_quantity("x", "1", (hard[k], rows[k]), 0.1, width, (paired, of)) for k in range(trials)]
        share = {answer: np.mean([q.answer is answer for q in found]) for answer in (yes, no, undecided)}
        missed = np.mean([abs(q.difference - shift) > q.reach for q in found])
        noise = 4.0 * math.sqrt(0.05 / trials)
        if paired or n > 4:  # of four and four with unlike spreads the smaller count is taken: wider than need be
            assert missed == pytest.approx(0.05 / of, abs=noise)
        assert missed <= 0.05 / of + noise
        assert share[no] <= 0.025 / of + noise or shift > width
        assert share[yes] <= 0.025 / of + noise or shift < width
        if paired and n == 30:
            assert share[yes if shift == 0.0 else no if shift > width else undecided] > 0.9


def test_draws_without_a_value_of_one_engine_allow_no_yes():
    found = gr.ensemble("three-balls", 12, {"gap": (1e-2, 2e-2)}, "contacts", margin={"contacts": 9.0})
    missing = np.isnan(found.quantities[1].hard)
    assert 0 < missing.sum() == found.quantities[1].lacking < 11
    assert found.answer is undecided
    assert found.quantities[1].draws + missing.sum() == 12
    assert f"{missing.sum()} draws lack a value of one engine" in found.verdict
    assert str(found).splitlines()[-1].startswith("refused: `gap[1]` must be non-negative, got -")


def test_runs_that_stop_early_have_no_value():
    case = gr.Case(gr.scenes.newtons_cradle(3, gap=1.0), gr.LinearDashpot(1e6), gr.ConstantRestitution(0.05))
    found = gr.ensemble(case, 3, {"velocity[0]": (1.0, 0.1)})
    assert np.isnan(found.quantities[0].hard).all()  # a collapse
    assert np.isfinite(found.quantities[0].soft).all()
    assert (found.answer, found.quantities[0].lacking) == (undecided, 3)
    assert "3 draws lack a value" in found.verdict


def test_margins_in_units_of_a_result_and_rounding():
    wide = gr.ensemble("three-balls", 4, TOUCHING, ["v_rel", "t_f[1]"], margin={"v_rel": 4.0})
    assert [q.margin for q in wide.quantities[:2]] == [4.0, 4.0]
    assert wide.quantities[2].margin == pytest.approx(0.1 * wide.quantities[2].spreads[1])
    assert [q.answer for q in wide.quantities[:2]] == [yes, yes]
    elastic = gr.ensemble("gas", 4, "seed", n=4, restitution=1.0)
    assert elastic.quantities[0].margin == pytest.approx(1e-9)
    assert elastic.answer is yes


def test_words_json_figure_and_command(three_balls, tmp_path, capsys):
    lines = str(three_balls).splitlines()
    assert lines[0] == three_balls.verdict
    assert lines[2] == "three-balls: 8 draws, the same for both"
    assert max(map(len, lines)) <= 120
    three_balls.to_json(tmp_path / "e.json")
    kept = json.loads((tmp_path / "e.json").read_text())
    assert (kept["answer"], len(kept["quantities"][1]["soft"])) == ("no", 8)
    pytest.importorskip("matplotlib")
    assert [axis.get_xlabel() for axis in three_balls.plot().axes] == ["v_rel[0] (m/s)", "v_rel[1] (m/s)"]
    assert main(["ensemble", "three-balls", "--vary", "gap=1e-4,1e-5", "--draws", "8", "--seed", "3", "--result",
                 "v_rel"]) == 0
    assert capsys.readouterr().out == f"{three_balls}\n"


@pytest.mark.parametrize(("given", "sentence"), [
    (("three-balls", 1, TOUCHING), r"`n` must be an integer of at least 2, got 1"),
    (("three-balls", 4, {}), r"`vary` must have at least one parameter with its distribution, got an empty mapping\."),
    (("three-balls", 4, {"gab": (1.0, 1.0)}), r"three-balls has no parameter `gab`; did you mean `gap`\?"),
    (("three-balls", 4, {"gap": 1e-4}),
        r"`vary\['gap'\]` must be an array of shape \(2,\), got an array of shape \(\)\. Give \(mean, sd\), a "
        r"function of the generator, or None for a seed\."),
    (("three-balls", 4, {"gap": (1e-4, 1e-5, 0.0)}),
        r"`vary\['gap'\]` must be an array of shape \(2,\), got an array of shape \(3,\)\. Give \(mean, sd\), a "
        r"function of the generator, or None for a seed\."),
    (("three-balls", 4, TOUCHING, "v_reel"),
        r"`results` must be one of contacts, v_rel, t_f, v_final, time, energy_left, got 'v_reel'\. Did you mean "
        r"'v_rel'\?"),
    (("three-balls", 4, TOUCHING, "v_rel[2]"), r"unknown result v_rel\[2\]; did you mean v_rel\[1\]\?"),
    (("three-balls", 4, TOUCHING, []), r"`results` must have one or more entries of different names, got none\."),
    (("three-balls", 4, TOUCHING, [fastest, fastest]),
        r"`results` must have one or more entries of different names, got fastest\."),
    (("three-balls", 4, TOUCHING, lambda: 0.0), r"<lambda> must be a function with the argument \(run\), got \(\)\."),
    (("three-balls", 4, {"gap": (-1.0, 0.0)}),
        r"`gap\[1\]` must be at least minus the sum of both radii, got -1\.0\. Deeper overlaps would exchange the "
        r"centres\."),
])
def test_misuse_in_one_sentence(given, sentence):
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.ensemble(*given)


@pytest.mark.parametrize(("options", "sentence"), [
    ({"margin": -0.1}, r"`margin` must be a finite number of at least 0, got -0\.1\."),
    ({"margin": {"t_f": 1.0}}, r"unknown result t_f; available: v_rel, v_rel\[0\], v_rel\[1\]\."),
    ({"seed": 0.5}, r"`seed` must be an integer of at least 0, got 0\.5"),
    ({"gap": 1.0}, r"The parameter gap is both varied and fixed\. Give it once\."),
])
def test_misuse_of_options(options, sentence):
    with pytest.raises(ValueError, match=sentence):
        gr.ensemble("three-balls", 2, TOUCHING, "v_rel", **options)
