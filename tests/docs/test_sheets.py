"""The student sheet and the teacher's key: their links are states the page knows, their numbers the engines' own."""

import json
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from urllib.parse import parse_qsl

import pytest

import granular as gr

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
LINK = re.compile(r"\]\(page:([^)\s]*)\)")
ROW = re.compile(r"^\| \[[^\]]*\]\(page:([^)]*)\) \|(.*)\|$", re.MULTILINE)
STUDENT, KEY = ((DOCS / "teaching" / f"{name}-sheet.md").read_text(encoding="utf-8") for name in ("student", "teacher"))
BLANK = re.findall(r"^\| (?:hard|soft|contacts|touching, soft|1 mm apart).*$", STUDENT, re.MULTILINE)
ASK = """
import { SETUPS, refused } from "%s";
const names = (scene) => SETUPS[scene].sliders.map((slider) => slider.name);
const unknown = ({ scene, at, predict, ...rest }) =>
  Object.hasOwn(SETUPS, scene) ? Object.keys(rest).filter((key) => !names(scene).includes(key)) : [scene];
const given = %s;
console.log(JSON.stringify(given.filter((g) => unknown(g).length || refused(g.scene, g).length)));
"""


def state(link):
    return dict(parse_qsl(link, strict_parsing=True))


@cache
def compared(link):
    """The comparison that the page makes in that state, made by the Python engines."""
    from tests.app.page.make_golden import compared

    given = state(link)
    values = {key: float(x) if key not in ("n", "moving") else int(x) for key, x in given.items() if key != "scene"}
    return compared(given["scene"], values, "left")


def numbers_of(link):
    """What a row of the key shows of a state, by scene."""
    report = compared(link)
    if state(link)["scene"] == "three-balls":
        pair = report.pairs[1]
        return [pair.hard_contacts, pair.soft_contacts, pair.hard_v_rel, pair.soft_v_rel]
    if state(link)["scene"] == "newtons-cradle":
        return report.soft.velocity[-1].tolist()
    return [run.of(run.scene.n_pairs - 1)[-1]["v_out"][1] / report.impact_speed for run in (report.hard, report.soft)]


def test_every_link_into_the_page_is_a_state_it_knows():
    texts = {page.name: page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md")}
    links = [(name, link) for name, text in texts.items() for link in LINK.findall(text) if link]
    assert {"student-sheet.md", "teacher-sheet.md"} <= {name for name, _ in links}
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the page is not asked what it knows")
    setups = (ROOT / "granular" / "app" / "page" / "physics" / "setups.mjs").as_uri()
    asked = [state(link) for _, link in links] + [{"scene": "three-balls", "epsilon": "1"}, {"scene": "none"},
                                                  {"scene": "three-balls", "eps": "7"}]
    run = subprocess.run([node, "--input-type=module", "-e", ASK % (setups, json.dumps(asked))], capture_output=True,
                         text=True, check=True)
    assert json.loads(run.stdout) == asked[-3:]


def test_the_key_shows_the_engines_numbers():
    rows = ROW.findall(KEY)
    assert len(rows) == 17
    for link, shown in rows:
        for cell, number in zip(shown.split("|"), numbers_of(link), strict=True):
            digits = len(cell.strip().partition(".")[2])
            assert abs(float(cell.replace("−", "-")) - number) <= 0.5001 * 10.0**-digits, link


def test_both_sheets_ask_of_the_same_states_and_the_students_has_no_answers():
    links = set(LINK.findall(STUDENT)) - {""}
    assert links == set(LINK.findall(KEY))
    assert len(BLANK) == 6
    for row in BLANK:
        assert set(row.split("|")[2:]) <= {" ", ""}
    for answer in ("802", "198", "0.177", "3.73", "2.37", "0.942", "5.61"):
        assert answer not in STUDENT
        assert answer in KEY


def test_what_the_key_explains_is_so():
    base, stiff = (compared(link) for link, _ in (ROW.findall(KEY)[0], ROW.findall(KEY)[4]))
    floor, first = base.soft.of(0)[0], base.soft.of(1)[0]
    assert f"The floor contact lasts {1e6 * floor['duration']:.0f} µs" in KEY
    alone = gr.binary.collision(base.law[0], base.scene.pairs[0], base.impact_speed).duration
    assert f"({1e6 * alone:.0f} µs for the ball alone" in KEY
    after = 1e6 * (first["t_begin"] - floor["t_begin"])
    assert f"\nlasts {1e6 * first['duration']:.0f} µs and begins {after:.0f} µs" in KEY
    assert f"$t_c$ = {1e6 * stiff.soft.of(0)[0]['duration']:.0f} µs" in KEY
    assert f"= {1e3 * base.impact_speed * floor['duration']:.1f} mm" in KEY
    for words, gap, says in (
        ("*Yes* above 2.03 mm", 2.03e-3, lambda report: report.error <= 0.01),
        ("No contacts overlap above 2.37 mm", 2.37e-3, lambda report: report.measures["shared_impulse"] == 0.0),
    ):
        assert words in KEY
        below, above = (re.sub("gap=[^&]*", f"gap={gap + step:g}", ROW.findall(KEY)[0][0]) for step in (-1e-5, 0.0))
        assert says(compared(above))
        assert not says(compared(below))
    hard, soft = numbers_of(next(link for link, _ in ROW.findall(KEY) if "eps=0.5&" in link))[2:]
    assert f"the factor is {round(hard / soft, -2):.0f}" in KEY


def test_what_the_key_says_beside_the_page_is_so():
    report = compared(ROW.findall(KEY)[0][0])
    scene, tenth = report.scene, report.soft.of(1)["duration"].min() / 10.0
    cradle = gr.scenes.newtons_cradle(n=5)
    rules = {ties: gr.edmd.simulate(cradle, gr.ConstantRestitution(1.0), ties=ties).velocity[-1]
             for ties in ("left", "right", "random", "reflect", "newton", "poisson")}
    one_out = [0.0, 0.0, 0.0, 0.0, 1.0]
    assert [ties for ties, v in rules.items() if v.round(9).tolist() != one_out] == ["newton", "poisson"]
    assert rules["newton"] == pytest.approx([-0.6, 0.4, 0.4, 0.4, 0.4])
    soft = gr.md.simulate(cradle, gr.Hertz(1e10)).velocity[-1]
    assert f"(Hertz: {', '.join(f'{v:.3f}' for v in soft).replace('-', '−')})" in KEY
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    with pytest.warns(RuntimeWarning):
        verlet = gr.md.simulate(scene, law, until=gr.until.contact(pair=0, nth=2), method="verlet", dt=tenth)
    low, high = verlet.of(1)[-1]["v_out"]
    assert f"{verlet.count(1)} contacts and\n   {high - low:.4f} m/s" in KEY
    ball = gr.scenes.bouncing_ball(height=1.0)
    spring = gr.LinearDashpot.from_restitution(0.5, k=1e5, pair=ball.pairs[0])
    assert f"in {gr.edmd.simulate(ball, gr.ConstantRestitution(0.5)).time[-1]:.4f} s" in KEY
    assert len(gr.md.simulate(ball, spring).contacts) == 10


def test_the_numbers_of_the_lesson_are_those_of_the_engines():
    """Rises of real balls in m, the share of the floor's push, the restitution, and v t_c."""
    text = (DOCS / "teaching" / "lesson.md").read_text(encoding="utf-8")

    def rises(upper, gap):
        case = gr.cases.make("real-balls", lower="basketball", upper=upper, gap=gap)
        report = gr.compare(case.scene, case.law, until=case.until, t_end=case.t_end)
        return report, "{:.2f} and {:.2f}".format(*report.rises())

    near, said = rises("tennis ball", 1e-3)
    assert f"1. {said}. " in text
    pushed = re.search(r"load on ball 1\s+= (0\.\d+)", near.details())
    assert f"4. {100.0 * float(pushed[1]):.0f} %" in text
    far, touching = rises("tennis ball", 0.02)[0].rises()[1], rises("tennis ball", 0.0)[0].rises()[1]
    assert f"{far:.3g} m instead of {touching:.3g} m" in text
    hard, soft = rises("table-tennis ball", 0.0)[0].rises()
    assert f"6. {hard:.1f} and {soft:.1f}" in text
    ball, speed = gr.balls.BALLS["basketball"], (2.0 * 9.81) ** 0.5
    assert f"2. {ball.restitution**2:.2f} m, {ball.restitution:g} of" in text
    assert f"{1e3 * speed * ball.duration:.0f} mm = {speed:.1f} m/s · {1e3 * ball.duration:.0f} ms" in text
