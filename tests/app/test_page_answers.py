"""The page gives the library's answer: scenes and settings of its sliders at random, both ends of them too."""

import json
import math
import os
import shutil
import subprocess
from dataclasses import astuple
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import granular as gr
import granular.app.page

HERE = Path(__file__).parent / "page"
ENDS = {"k": (4e3, 1e9), "eps": (0.1, 1.0), "gap": (0.0, 1e-7, 0.1), "t1": (1e-5, 0.03), "t2": (1e-5, 0.03)}
CHECK = """
const { check } = await import("GOLDEN");
const { readFileSync } = await import("node:fs");
const cases = JSON.parse(readFileSync("CASES", "utf8"));
const found = cases.map((one, i) => [i, check(one, 0)]);
console.log(JSON.stringify(found.filter(([, faults]) => faults.length)));
"""


@pytest.mark.parametrize(("seed", "count"), [
    (8, 8), *(pytest.param(seed, 100, marks=pytest.mark.soak) for seed in range(500, 505))])
def test_the_page_answers_as_the_library_does(seed, count, monkeypatch, tmp_path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the answers of the page are not compared here")
    monkeypatch.syspath_prepend(HERE)
    from tests.app.page.make_golden import REAL, SLIDERS, case, settings

    random, cases = np.random.default_rng(seed), []
    for i in range(count):
        name = [*SLIDERS, *REAL][i % 5]
        v = settings(random, name)
        v |= {key: float(random.choice(ends)) for key, ends in ENDS.items() if key in v and random.random() < 0.15}
        cases.append(case(name, v, "left", rises=False))
    cases.append(case("three-balls", FLIGHT, "left", rises=False))
    assert cases[-1]["error"] == pytest.approx(1.300, abs=1e-3)
    (tmp_path / "cases.json").write_text(json.dumps(cases), encoding="utf-8")
    script = CHECK.replace("GOLDEN", (HERE / "golden.mjs").as_uri()).replace("CASES", str(tmp_path / "cases.json"))
    run = subprocess.run([node, "--input-type=module", "-e", script], capture_output=True, text=True, check=True)
    assert [(cases[i], faults) for i, faults in json.loads(run.stdout)] == []
    told = [sum(one[key] is not None for one in cases) for key in ("answer", "error", "counts")]
    assert min(told) > 0.75 * count, told


FLIGHT = {"gap": 0.000504, "eps": 0.736, "k": 41900.0, "ratio": 15.7, "height": 0.585}
"""The upper ball flies for long between two contacts of one episode: this decides the error, 1.30 and not 0.46."""


RISES = """
const folder = "PHYSICS", { compareEngines } = await import(`${folder}/outcome.mjs`);
const { ballValues, contactsIn, sceneOf } = await import(`${folder}/setups.mjs`);
const rises = ([lower, upper], bounces) => {
  const values = { ...ballValues(lower, 1), ...ballValues(upper, 2), gap: 1e-3, height: 1, rule: 0, bounces };
  const { eps, k } = contactsIn("real-balls", values), scene = sceneOf("real-balls", values);
  const { finals } = compareEngines(scene, eps, k);
  return [finals.hard[2].rise, finals.soft[2].rise];
};
console.log(JSON.stringify(JSON.parse(process.env.PAIRS).map((pair) => [1, 2].map((bounces) => rises(pair, bounces)))));
"""


@pytest.mark.parametrize("count", [2, pytest.param(121, marks=pytest.mark.soak)])
def test_real_balls_rise_as_the_library_says_at_either_bounce(count) -> None:
    """The film of the page ends at these heights: tests/app/page/film.test.mjs."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the rises of the page are not compared here")
    pairs = list(product(gr.balls.BALLS.values(), repeat=2))[:: 121 // count][:count]
    told = os.environ | {"PAIRS": json.dumps([[astuple(ball) for ball in pair] for pair in pairs])}
    script = RISES.replace("PHYSICS", (Path(granular.app.page.__file__).parent / "physics").as_uri())
    command = [node, "--input-type=module", "-e", script]
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=told)
    for (lower, upper), page in zip(pairs, json.loads(run.stdout), strict=True):
        between = gr.balls.contact(lower, upper, gr.balls.RULES[0])
        scene, eps = gr.scenes.real_balls(lower, upper, gap=1e-3, height=1.0), [lower.restitution, between.restitution]
        stiff = zip(eps, [lower.stiffness, between.stiffness], scene.pairs, strict=True)
        law = [gr.LinearDashpot.from_restitution(*of) for of in stiff]
        rule = gr.ConstantRestitution(eps)
        report = gr.compare(scene, law, rule, until=gr.until.contact(pair=0, nth=3), t_end=4.5)
        assert page == [pytest.approx(report.rises(bounce), rel=1e-6, abs=1e-6) for bounce in (1, 2)]


RESTS = """
const folder = "PHYSICS", { compareEngines } = await import(`${folder}/outcome.mjs`);
const { contactsIn, sceneOf } = await import(`${folder}/setups.mjs`);
const told = ([name, values]) => {
  const { eps, k } = contactsIn(name, values), { answer, sunk, finals } = compareEngines(sceneOf(name, values), eps, k);
  return [answer, sunk, ["hard", "soft"].map((engine) => finals[engine].at(-1).rise)];
};
console.log(JSON.stringify(JSON.parse(process.env.CASES).map(told)));
"""


STUCK = {"gap": 0.01, "eps": 0.1509, "k": 81411.0, "n": 4, "massRatio": 0.593, "height": 0.15}
"""Hard spheres that stick under either tie rule, after other speeds before: the answer is not unique."""
TOUCHING = {"gap": 0.0, "eps": 0.10966, "k": 18996.0, "n": 2, "massRatio": 0.7, "height": 0.15}
"""Hard spheres that stick: Poisson's rule, which is not defined for them, decides nothing."""


@pytest.mark.parametrize("count", [6, pytest.param(300, marks=pytest.mark.soak)])
def test_balls_that_come_to_rest_sink_and_rise_as_the_library_says(count, monkeypatch) -> None:
    """Soft enough to sink by about 1 % of a radius, and so lossy that hard ones collapse."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the page's balls at rest are not compared here")
    monkeypatch.syspath_prepend(HERE)
    from tests.app.page.make_golden import balls_of, compared, scene_of, settings

    parting = {"height": 0.15, "m1": 0.625, "r1": 0.0644, "t1": 0.0115, "e1": 0.115, "air1": 1}  # deepest at the onset
    settled = [("bouncing-ball", parting), ("ball-stack", STUCK), ("ball-stack", TOUCHING)]
    cases = [(name, v, compared(name, v, "left")) for name, v in settled]
    assert [report.answer.name for _, _, report in cases[1:]] == ["not_unique", "no"]
    random = np.random.default_rng(count)
    for i in range(count):
        name = ("bouncing-ball", "three-balls", "ball-stack")[i % 3]
        v = settings(random, name) | {"height": 0.15, "e1" if i % 3 == 0 else "eps": float(random.uniform(0.1, 0.2))}
        v |= {"n": int(random.integers(2, 5))} if "n" in v else {}
        scene, _ = scene_of(name, v)
        weight = scene.gravity * float(scene.mass[~scene.is_wall].sum())
        stiffness = weight / (float(scene.radius[1]) * 10.0 ** random.uniform(-2.4, -1.8))
        v |= {"k": stiffness} if "k" in v else {"t1": v["t1"] * math.sqrt(balls_of(v)[0].stiffness / stiffness)}
        cases.append((name, v, compared(name, v, "left")))
    told = os.environ | {"CASES": json.dumps([case[:2] for case in cases])}
    script = RESTS.replace("PHYSICS", (Path(granular.app.page.__file__).parent / "physics").as_uri())
    command = [node, "--input-type=module", "-e", script]
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=told)
    rests = 0
    for (name, v, report), (answer, sunk, rises) in zip(cases, json.loads(run.stdout), strict=True):
        assert answer == report.answer.name, (name, v)
        for page, library in zip(rises, report.rises, strict=True):
            assert math.isnan(library) or page == pytest.approx(library, rel=1e-6, abs=1e-6), (name, v)
        log = report.soft.contacts
        still = log[np.isnan(log["t_end"]) & (log["v_in"][:, 0] - log["v_in"][:, 1] <= 0.0)]
        radius = np.fmin(*(np.where(r > 0.0, r, np.inf) for r in report.scene.sides(report.scene.radius)))
        depths = still["xi_max"] / radius[still["pair"]]
        assert not len(still) or sunk > 0.99 * depths.max(), (name, v)
        rests += len(still)
    assert rests > 0
