"""Real balls: what the data say of one ball and of two, against other ways to say it."""

import json
import math
import re
import shutil
import subprocess
from dataclasses import astuple
from html import escape
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.app.cli import main
from granular.app.page import opening
from granular.cases.balls import BALLS, PRESETS, RULES, Ball, contact
from granular.comparison import outcome

PAGE = (Path(__file__).parents[2] / "docs" / "teaching" / "page.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| [a-z][^,|]*, [^|]* \| ([\d.]+) \| ([\d.]+)(?: \(([\d.]+)\))?", re.MULTILINE)


@pytest.mark.parametrize("name", BALLS)
def test_a_ball_lasts_and_returns_what_the_data_say(name) -> None:
    ball = BALLS[name]
    scene = gr.scenes.real_balls(name, None)
    law = gr.LinearDashpot.from_restitution(ball.restitution, ball.stiffness, scene.pairs[0])
    bounce = gr.binary.collision(law, scene.pairs[0], 4.43)
    assert bounce.duration == pytest.approx(ball.duration, rel=1e-9)
    assert bounce.restitution == pytest.approx(ball.restitution, rel=1e-9)


@pytest.mark.parametrize("rule", RULES)
def test_two_equal_balls_return_what_one_does_and_halve_the_stiffness(rule) -> None:
    for ball in BALLS.values():
        both = contact(ball, ball, rule)
        assert both.restitution == pytest.approx(ball.restitution)
        assert both.stiffness == pytest.approx(0.5 * ball.stiffness)


def test_a_ball_on_what_is_all_but_rigid_is_a_ball_on_a_floor() -> None:
    soft, rigid = BALLS["tennis ball"], Ball(1.0, 0.1, 1e-9, 0.5)
    for lower, upper in ((soft, rigid), (rigid, soft)):
        both = contact(lower, upper, "series")
        assert (both.stiffness, both.restitution) == pytest.approx((soft.stiffness, soft.restitution), rel=1e-4)


def test_only_an_air_filled_lower_ball_is_a_lens() -> None:
    for lower, upper, _ in PRESETS:
        series, lens = contact(lower, upper, "series").stiffness, contact(lower, upper, "lens").stiffness
        assert (lens < series) is BALLS[lower].filled
        one, two = BALLS[lower], BALLS[upper]
        if one.filled and two.filled:
            assert lens == pytest.approx(one.stiffness * two.radius / (one.radius + two.radius))


def dropped(lower, upper, rule="lens", gap=0.0):
    """Return the comparison of balls dropped from 1 m."""
    scene, both, floor = gr.scenes.real_balls(lower, upper, gap), contact(lower, upper, rule), BALLS[lower]
    eps, k = [floor.restitution, both.restitution], [floor.stiffness, both.stiffness]
    law = [gr.LinearDashpot.from_restitution(*of) for of in zip(eps, k, scene.pairs, strict=True)]
    return gr.compare(scene, law, gr.ConstantRestitution(eps), until=gr.until.contact(pair=0, nth=2))


def heights(lower, upper, rule="lens", gap=0.0):
    """Heights of the upper ball in drop heights, hard and soft, of balls dropped from 1 m."""
    report = dropped(lower, upper, rule, gap)
    speeds = [outcome.leaving_velocities(run)[2] for run in (report.hard, report.continued[1])]
    return [v * v / (2.0 * report.scene.gravity) for v in speeds]


def test_the_page_of_the_docs_shows_the_engines_heights() -> None:
    rows = ROW.findall(PAGE)
    assert len(rows) == len(PRESETS)
    for (hard, soft, series), (lower, upper, _) in zip(rows, PRESETS, strict=True):
        assert [float(hard), float(soft)] == pytest.approx(heights(lower, upper), abs=0.06)
        if series:
            assert float(series) == pytest.approx(heights(lower, upper, "series")[1], abs=0.06)


def test_the_gap_of_a_preset_is_enough_for_a_yes_by_either_rule() -> None:
    """For a table-tennis ball on a basketball no gap is: what remains at a large one is all that remains."""
    for (lower, upper, gap), rule in product(PRESETS, RULES):
        report, apart = dropped(lower, upper, rule, gap), dropped(lower, upper, rule, 0.1)
        assert (report.answer is gr.Answer.yes) is ((lower, upper) != ("basketball", "table-tennis ball"))
        assert report.error <= 1.02 * apart.error or report.error <= 0.01
        hard, soft = report.rises
        assert soft == pytest.approx(hard, rel=0.025 if lower == "basketball" else 0.01)


def test_misuse_is_one_sentence() -> None:
    with pytest.raises(ValueError, match=r"`lower` must be one of basketball, football, .*, got 'medicine ball'"):
        gr.scenes.real_balls("medicine ball")
    with pytest.raises(ValueError, match=r"`duration` must be a finite number above 0, got 0\.0\."):
        Ball(1.0, 0.1, 0.0, 0.5)
    with pytest.raises(ValueError, match="`rule` must be one of lens, series, got 'parallel'"):
        contact("basketball", "tennis ball", "parallel")


@pytest.mark.exact
def test_a_scene_is_the_balls_on_a_floor() -> None:
    scene = gr.scenes.real_balls("basketball", "golf ball", gap=0.01, height=2.0)
    assert scene.mass.tolist() == [math.inf, 0.624, 0.0459]
    assert scene.gap.tolist() == [2.0, 0.01]
    assert gr.scenes.real_balls("steel ball", None).n == 2


ON_THE_PAGE = """
import { compareEngines } from "PHYSICS/outcome.mjs";
import { cleaned, contactsIn, offer, refused, sceneOf, withoutNames } from "PHYSICS/setups.mjs";
offer(OFFERED);
const rises = ASKED.map((link) => {
  const given = withoutNames("real-balls", Object.fromEntries(new URLSearchParams(link)));
  const values = cleaned("real-balls", given);
  if (refused("real-balls", given).length) throw new Error(link);
  const { eps, k } = contactsIn("real-balls", values);
  const { finals } = compareEngines(sceneOf("real-balls", values), eps, k);
  return [finals.hard[2].rise, finals.soft[2].rise];
});
console.log(JSON.stringify(rises));
"""


def on_the_page(asked):
    """Rises in m, hard and soft, of the upper ball, by the physics of the page in states of these links."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    offered = {"balls": {name: astuple(ball) for name, ball in BALLS.items()}, "pairs": PRESETS}
    script = ON_THE_PAGE.replace("PHYSICS", (Path(gr.__file__).parent / "app" / "page" / "physics").as_uri())
    script = script.replace("OFFERED", json.dumps(offered))
    command = [node, "--input-type=module", "-e", script.replace("ASKED", json.dumps(asked))]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def compared(case):
    return gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end, engine="plain")


@pytest.mark.rotating
def test_library_file_command_and_page_say_the_same_of_real_balls(capsys, tmp_path) -> None:
    random, asked, rises = np.random.default_rng(624), [], []
    for i, (lower, upper, _) in enumerate(PRESETS):
        gap, height, rule = 10 ** random.uniform(-4, -2), random.uniform(0.3, 2.0), RULES[i % 2]
        case = gr.cases.make("real-balls", lower=lower, upper=upper, gap=gap, height=height, pair_rule=rule)
        text = f"[scene]\nname = 'real-balls'\nlower = '{lower}'\nupper = '{upper}'\npair_rule = '{rule}'\n"
        assert gr.cases.loads(text).law == case.law == gr.cases.loads(gr.cases.dumps(case)).law
        rises.append(compared(case).rises)
        given = {"lower": lower, "upper": upper, "pair_rule": rule, "gap": gap, "height": height}
        asked.append(opening.link("real-balls", given | {"bounces": 1}))
        if i < 2:
            words = ["real-balls"] + [word for k, x in given.items() for word in (f"--{k.replace('_', '-')}", str(x))]
            assert main(["page", *words, "--bounces", "1", "-o", str(tmp_path / "page.html")]) == 0
            assert escape(asked[-1]) in (tmp_path / "page.html").read_text(encoding="utf-8")
            for engine, run in (("edmd", compared(case).hard), ("md", compared(case).soft)):
                assert main(["run", *words, "--engine", engine, "--save", str(tmp_path / "run.npz")]) == 0
                saved = gr.Trajectory.load(tmp_path / "run.npz")
                assert saved.contacts["v_out"] == pytest.approx(run.contacts["v_out"], rel=1e-12)
            capsys.readouterr()
            assert main(["compare", *words]) == 0
            said = capsys.readouterr().out
            line = re.search(r"rise of ball 2, drops +([\d.]+) +([\d.]+)  of ([\d.]+) m", said)
            expected = [x / height for x in rises[-1]] + [height]
            assert [float(x) for x in line.groups()] == pytest.approx(expected, rel=1e-3)
    assert np.array(rises) == pytest.approx(np.array(on_the_page(asked)), rel=1e-6)


def rise(case):
    return compared(case).rises[1]


def test_the_case_sweeps_and_has_a_threshold(capsys) -> None:
    swept = gr.sweep("real-balls", {"gap": [0.0, 5e-2]}, [rise], upper="golf ball")
    alone = [heights("basketball", "golf ball", gap=gap)[1] for gap in (0.0, 5e-2)]
    assert swept["rise"].values == pytest.approx(alone, abs=0.06)
    assert main(["threshold", "real-balls", "--over", "gap", "--between", "1e-3", "0.1", "--points", "4"]) == 0
    assert main(["compare", "real-balls", "--upper", "medicine ball"]) == 2
    assert "got 'medicine ball'. Did you mean 'steel ball'?" in capsys.readouterr().err
    assert main(["compare", "real-balls", "--pair-rule", "parallel"]) == 2
    assert "`pair_rule` must be one of lens, series, got 'parallel'" in capsys.readouterr().err
