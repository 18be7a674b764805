"""The gallery's findings: every number on their pages, each with its own tolerance; longer ones in the soak.

Soft numbers are those that a page prints, to half a unit of their last digit, and some are had from scipy, which knows
nothing of events. Hard ones are closed forms. Collapse is in `test_findings_collapse`.
"""

import ast
import math
import runpy
from itertools import pairwise

import numpy as np
import pytest

import granular as gr
from tests.helpers.findings import FOLDER, printed, script

SCRIPTS = sorted(FOLDER.glob("*.py"))


detachment, domino, kerwin, cradle, tapered = map(script, ("detachment", "domino", "kerwin", "cradle", "tapered"))
SOAK = pytest.mark.soak


def by_scipy(scene, law, t_end):
    """Velocities at `t_end` of balls with one law, by an integrator that steps over onsets and ends of contacts."""
    solve_ivp = pytest.importorskip("scipy.integrate").solve_ivp
    m, gap, pairs = scene.mass, scene.gap, scene.pairs
    laws = law if isinstance(law, list) else [law] * len(pairs)

    def slope(_, state):
        x, v = np.split(state, 2)
        xi, rate = -(gap + np.diff(x)), -np.diff(v)
        force = [max(0.0, one.force(a, b, p)) if a > 0.0 else 0.0
                 for one, a, b, p in zip(laws, xi.tolist(), rate.tolist(), pairs, strict=True)]
        push = np.concatenate([[0.0], force]) - np.concatenate([force, [0.0]])
        return np.concatenate([v, np.where(np.isinf(m), 0.0, push / m)])

    start = np.concatenate([np.zeros(len(m)), scene.velocity])
    shortest = min(gr.binary.collision(one, p, np.ptp(scene.velocity)).duration
                   for one, p in zip(laws, pairs, strict=True))
    done = solve_ivp(slope, (0.0, t_end), start, "DOP853", rtol=1e-9, atol=1e-12, max_step=0.3 * shortest)
    return done.y[len(m) :, -1]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_finding_is_short_and_uses_public_names_only(path):
    """What counts is below its docstring, which says what was published, what comes out, and what was read."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    said = ast.get_docstring(tree)
    assert all(f"\n:{word}:" in said for word in ("Published", "Hard spheres", "Soft spheres", "New", "Read"))
    assert 20 <= len(text.splitlines()) - tree.body[0].end_lineno <= 60
    names = [node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    assert not [name for name in names if name.startswith("_")]
    imported = {node.module if isinstance(node, ast.ImportFrom) else node.names[0].name
                for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)}
    assert imported <= {"granular", "numpy", "matplotlib.pyplot", "math", "bisect", "functools"}


@SOAK
@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_finding_runs_and_draws(path, tmp_path, monkeypatch, capsys):
    import matplotlib.pyplot as plt

    if '"compiled"' in path.read_text(encoding="utf-8"):
        pytest.importorskip("numba")
    plt.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    with plt.rc_context():
        runpy.run_path(str(path), run_name="__main__")
        plt.close("all")
    assert capsys.readouterr().out.count("\n") >= 4
    assert (tmp_path / f"{path.stem}.png").stat().st_size > 20_000


@pytest.mark.parametrize(("gap", "soft", "tc"), [
    (1e-6, 0.9301, 0.981), (0.1, 0.8645, 0.981), (0.3, 0.6447, 0.980), (1.0, 0.1850, 0.980), (1.89, 0.1085, 0.980),
    (2.41, 0.1082, 0.108)])
def test_a_column_of_touching_balls_loses_less(gap, soft, tc):
    of_newton, of_tc, of_hard = detachment.energy_left(gap)
    assert of_newton == printed(soft, 4)
    assert of_tc == pytest.approx(tc, abs=1e-3)  # whether it is less than t_c since the last collision can be a tie
    assert of_hard == printed(0.1082, 4)


def test_a_column_of_isolated_contacts_is_one_of_hard_spheres():
    """To rounding, beside 0.108; of the TC model, one collision of all dissipates if the balls nearly touch."""
    of_newton, of_tc, of_hard = detachment.energy_left(10.0)
    assert of_newton == pytest.approx(of_hard, rel=1e-13)
    assert of_tc == of_hard
    assert detachment.energy_left(1e-6)[1] == pytest.approx(1.0 - (1.0 - detachment.EPS**2) / detachment.N, rel=1e-13)
    for gap, isolated in ((2.41, True), (2.39, False)):
        scene = gr.scenes.column(detachment.N, gap=gap * detachment.T_C)
        stats = gr.md.simulate(scene, detachment.laws(scene)).stats
        assert (stats["isolated"] == stats["contacts"]) is isolated


def test_tc_is_the_better_one_up_to_a_gap_of_039():
    """The page's interpolation is good to its two digits."""
    for gap, nearer in ((0.37, 1), (0.41, 2)):
        answers = detachment.energy_left(gap)
        assert min((1, 2), key=lambda way: abs(answers[way] - answers[0])) == nearer


@SOAK
def test_scipy_leaves_the_same_of_a_column():
    """To 1e-5: its steps do not know where a dashpot's force jumps."""
    scene = gr.scenes.column(detachment.N, gap=0.3 * detachment.T_C)
    run = gr.md.simulate(scene, detachment.laws(scene))
    speeds = by_scipy(scene, detachment.laws(scene), run.contacts["t_end"].max() + detachment.T_C)
    assert 0.1 * (speeds**2).sum() == pytest.approx(detachment.energy_left(0.3)[0], rel=1e-5)


@SOAK
def test_with_gaps_at_random_tc_is_further_off_than_hard_spheres():
    """At a mean gap of v t_c, by nine standard errors of the mean of 12 draws."""
    draws = np.random.default_rng(1).exponential(size=(12, detachment.N))
    soft, tc, hard = np.array([detachment.energy_left(draw) for draw in draws]).T
    worse = abs(tc - soft) - abs(hard - soft)
    assert worse.mean() > 9.0 * worse.std(ddof=1) / math.sqrt(len(draws))


def test_magic_ratios_are_the_published_ones():
    """To the digits of the abstract: 1, and the third power of the golden ratio."""
    assert [domino.MAGIC_RATIOS[1], domino.MAGIC_RATIOS[2]] == pytest.approx([1.0, 2.0 + math.sqrt(5.0)], rel=1e-15)
    assert domino.MAGIC_RATIOS[3] == printed(9.097835, 6)


@pytest.mark.parametrize("k", [2, 3])
def test_a_hard_domino_runs_at_the_speed_of_the_kick(k):
    """A cell in 2 d/v, and the speed of the kick in each; rounding grows with the number of cells."""
    run = domino.hard_run(domino.MAGIC_RATIOS[k], 201, until=gr.until.contact(199))
    time, speed = domino.front(run)
    assert np.diff(time) == pytest.approx(2.0, rel=1e-11)
    assert speed == pytest.approx(1.0, rel=1e-12)
    assert np.sum(abs(run.velocity[-1]) > 1e-9) == 2
    assert len(run.contacts) == 2 * k * 99 + 1


@pytest.mark.parametrize(("name", "k", "end"), [
    ("springs", 2, 3.0 / math.sqrt(5.0) - 1.0), ("springs", 3, 0.119399), ("Hertz contacts", 2, 0.365937),
    pytest.param("Hertz contacts", 3, 0.135680, marks=SOAK)])
def test_a_soft_domino_is_isolated_up_to(name, k, end):
    """The grid of the search has steps of 1e-6."""
    assert domino.isolation_limit(domino.SOFT_LAWS[name][0], k) == pytest.approx(end, rel=0.0, abs=1.1e-6)


def test_a_soft_domino_keeps_its_speed_until_then_and_not_beyond():
    law = domino.SOFT_LAWS["springs"][0]
    time, speed = domino.front(domino.soft_run(law, 2, 0.3416, 25))
    assert speed == pytest.approx(1.0, rel=1e-12)
    assert np.diff(time) == pytest.approx(np.diff(time)[0], rel=1e-12)
    slower = domino.front(domino.soft_run(law, 2, 0.45, 25))[1]
    assert slower[-1] == printed(0.937, 3)
    assert slower[-6:] == pytest.approx(slower[-1], rel=1e-4)  # as slow as ever


@SOAK
@pytest.mark.exact  # where every ball moves, what a rounding does grows
def test_a_blast_slows_down():
    """δ = 0.62 of 401 balls, and of twice as many."""
    for n, delta in ((401, 0.62), (801, 0.62)):
        run = domino.hard_run(2.0, n, until=gr.until.contact(n - 2))
        assert np.sum(abs(run.velocity[-1]) > 1e-9) == n - 1
        reached = domino.front(run)[0][20:]
        assert np.polyfit(np.log(reached), np.log(np.arange(41, n - 1, 2)), 1)[0] == printed(delta, 2)


def test_kerwins_rows_of_hard_balls():
    """The product of (2 a/(a + b))² b/a, and the shares that are published: 27 to 1 in 2, 3, 4 and 8 balls."""
    for n, share in ((2, 0.1378), (3, 0.2931), (4, 0.4219), (8, 0.6808)):
        masses = np.geomspace(1.0, kerwin.LAST_MASS, n)
        product = math.prod(4.0 * a * b / (a + b) ** 2 for a, b in pairwise(masses))
        assert kerwin.hard_share(*masses) == pytest.approx(product, rel=1e-13)
        assert kerwin.hard_share(*masses) == printed(share, 4)
    geometric_mean = pytest.approx(math.sqrt(kerwin.LAST_MASS), rel=5e-3)  # the step of the search
    assert kerwin.best_mass(kerwin.hard_share) == geometric_mean


@pytest.mark.parametrize(("name", "mass", "share", "mean"), [
    ("steel, Hertz", 0.1072, 0.2179, 0.1993), ("Hertz, one k", 0.0977, 0.2021, 0.1789),
    ("springs", 0.0648, 0.1762, 0.1238)])
def test_kerwins_best_masses_of_touching_balls(name, mass, share, mean):
    """Shares to their digits; of the mass, that 3 % more or less is worse, to either side by about as much."""
    below, there, above, at_mean = (kerwin.soft_share(kerwin.SOFT_LAWS[name], 1.0, m, kerwin.LAST_MASS)
                                    for m in (mass / 1.03, mass, 1.03 * mass, math.sqrt(kerwin.LAST_MASS)))
    assert [there, at_mean] == [printed(share, 4), printed(mean, 4)]
    assert 0.0 < there - below == pytest.approx(there - above, rel=0.3)
    assert (at_mean < kerwin.hard_share(1.0, kerwin.LAST_MASS)) == (name == "springs")


def test_scipy_hands_on_the_same():
    """To 1e-6: Hertz contacts begin and end smoothly."""
    scene = kerwin.row([1.0, 0.1072, kerwin.LAST_MASS], 0.0)
    law = [kerwin.SOFT_LAWS["steel, Hertz"](pair) for pair in scene.pairs]
    run = gr.md.simulate(scene, law, until=gr.until.separated())
    assert by_scipy(scene, law, run.time[-1]) == pytest.approx(run.velocity[-1], abs=1e-6)


@pytest.mark.parametrize(("gap", "speeds"), [
    (0.0, (-0.0711, -0.0303, -0.0145, 0.1270, 0.9888)), (1e-6, (-0.0326, -0.0065, -0.0014, 0.0419, 0.9986)),
    (3e-6, (-0.0055, -0.0002, 0.0, 0.0058, 1.0)), (1e-5, (0.0, 0.0, 0.0, 0.0, 1.0))])
def test_a_cradle_after_the_impact(gap, speeds):
    found = cradle.speeds_after_impact(gap)
    assert found == printed(np.array(speeds), 4)
    if gap == 1e-5:  # less than the striker moves in the time of a contact, and isolated: to rounding
        pair = gr.scenes.newtons_cradle(5, mass=cradle.BALL_MASS).pairs[0]
        law = gr.Hertz.from_material(*cradle.STEEL, pair)
        duration = gr.binary.collision(law, pair, cradle.IMPACT_SPEED).duration
        assert 1e6 * cradle.IMPACT_SPEED * duration == printed(17, 0)
        assert found == pytest.approx(speeds, abs=1e-13)


def test_a_touching_cradle_does_not_depend_on_speed_or_stiffness():
    """Powers scale: to rounding of some hundred pieces."""
    assert cradle.speeds_after_impact(0.0) == pytest.approx(cradle.long_row(5), abs=1e-11)


def test_a_swinging_cradle():
    """After 20 periods, to the digits of the page and more; soft balls in the soak."""
    assert cradle.swing_energy(0.0, 20, gr.edmd)[-1] == printed(0.2141, 4)


@SOAK
def test_a_cradle_after_20_periods():
    for gap, left in ((0.0, 0.3369), (1e-6, 0.2306), (1e-5, 0.2267)):
        assert cradle.swing_energy(gap, 20)[-1] == printed(left, 4)


@SOAK
def test_a_long_row_is_that_of_hinch_and_saint_jean():
    """-0.071, 0.149 and 0.986 are published; six digits stay from 30 balls to 50."""
    for n in (30, 50):
        speeds = cradle.long_row(n)[[0, -2, -1]]
        assert speeds == printed(np.array([-0.071, 0.149, 0.986]), 3)
        assert speeds == printed(np.array([-0.071085, 0.148600, 0.985679]), 6)


def test_tapered_chains_of_hard_balls():
    for q, share in ((0.0, 1.0), (0.05, 0.8937), (0.1, 0.6234)):
        a = (1.0 - q) ** 3
        assert tapered.hard_share(q) == pytest.approx(a**19 * (2.0 / (1.0 + a)) ** 38, rel=1e-12)
        assert tapered.hard_share(q) == printed(share, 4)


SHARES = [("springs", 0.0, 0.6491), ("springs", 0.05, 0.2063), ("springs", 0.1, 0.0189),
          ("steel, Hertz", 0.0, 0.9716), ("steel, Hertz", 0.05, 0.7520), ("steel, Hertz", 0.1, 0.2741),
          ("Hertz, one k", 0.0, 0.9716), ("Hertz, one k", 0.05, 0.7204), ("Hertz, one k", 0.1, 0.2037)]


@pytest.mark.parametrize(("name", "q", "share"), [
    case if i < 2 else pytest.param(*case, marks=SOAK) for i, case in enumerate(SHARES)])
def test_tapered_chains_of_touching_balls(name, q, share):
    assert tapered.soft_share(q, tapered.SOFT_LAWS[name][0]) == printed(share, 4)
