"""The page as a file: what is in it, its numerics beside golden data, what it refuses; and the commands for it."""

import json
import os
import re
import shutil
import subprocess
from dataclasses import astuple
from pathlib import Path
from urllib.parse import parse_qsl

import numpy as np
import pytest

import granular as gr
from granular.app.cli import main
from granular.app.page import assemble, live_page, opening, player_page, renaming, script

HERE = Path(__file__).parent / "page"


def test_the_page_is_one_small_file_that_loads_nothing(tmp_path) -> None:
    live_page(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "{{" not in html
    assert not re.search(r'(src|href)="(?!data:,)|@import|url\((?!#)|\bfetch\(|^import |^export ', html, re.MULTILINE)
    assert set(re.findall(r"https?://[^\s\"']+", html)) == {"http://www.w3.org/2000/svg"}  # a name, not an address


@pytest.mark.parametrize("scene", opening.PAGE_SCENES)
def test_a_page_of_two_languages_weighs_at_most_200_kb(scene, tmp_path, monkeypatch) -> None:
    live_page(tmp_path / "page.html", scene)
    assert (tmp_path / "page.html").stat().st_size <= 320_000  # of six
    for language in opening.LANGUAGES[1:]:
        monkeypatch.setattr(assemble, "LANGUAGES", ("en", language))
        live_page(tmp_path / "page.html", scene)
        assert (tmp_path / "page.html").stat().st_size <= 200_000, language


def test_the_page_opens_with_a_scene_and_values(tmp_path) -> None:
    live_page(tmp_path / "page.html", "ball-stack", {"n": 4, "restitution": 0.8})
    assert 'data-start="scene=ball-stack&amp;eps=0.8&amp;n=4"' in (tmp_path / "page.html").read_text(encoding="utf-8")


LIMITS = """
const { SETUPS } = await import("SETUPS");
console.log(JSON.stringify(Object.fromEntries(Object.entries(SETUPS).map(([scene, { sliders }]) =>
  [scene, Object.fromEntries(sliders.map(({ name, min, max, zero = false }) => [name, [min, max, zero]]))]))));
"""


def test_what_can_be_set_are_the_sliders_of_the_page() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the limits of the page's sliders are not compared here")
    script = LIMITS.replace("SETUPS\")", f'{(Path(opening.__file__).parent / "physics/setups.mjs").as_uri()}")')
    told = subprocess.run([node, "--input-type=module", "-e", script], capture_output=True, text=True, check=True)
    sliders = json.loads(told.stdout)
    assert set(sliders) == set(opening.PAGE_SCENES) - {"story"}
    for scene, limits in sliders.items():
        ours = {s.slider: [s.least, s.most, s.zero] for s in opening.SCENE_SETTINGS[scene].values()
                if not isinstance(s, opening.BallSetting)}
        assert ours == limits


def test_every_setting_of_every_scene_reaches_the_link() -> None:
    random = np.random.default_rng(16)
    for scene in opening.PAGE_SCENES:
        for name, setting in opening.settings(scene).items():
            if name == "moving":
                continue
            words, whole = setting.words or (True, False), setting.whole
            value = float(random.uniform(setting.least, setting.most))
            if setting.words:
                value = str(random.choice(words))
            elif isinstance(setting, opening.BooleanSetting):
                value = bool(random.choice([True, False]))
            elif whole:
                value = int(random.integers(setting.least, setting.most + 1))
            state = dict(parse_qsl(opening.link(scene, {name: value})))
            if isinstance(setting, opening.BallSetting):
                assert state[name] == value
            elif isinstance(setting, opening.Choice):
                assert words[int(state[setting.slider])] == value
            elif isinstance(setting, opening.Language):
                assert state[setting.slider] == value
            else:
                assert float(state[setting.slider]) == value
            with pytest.raises((TypeError, ValueError), match=rf"^`{name}` must be .*, got "):
                opening.link(scene, {name: -1.0 if not words or setting.words else "no number"})


def test_modules_are_bundled_each_once_after_what_they_need() -> None:
    script = assemble.bundle("live/main.mjs")
    assert script.count("function simulateSoft(") == 1
    assert script.index("function firstUpCrossing(") < script.index("function simulateSoft(")


@pytest.mark.parametrize("main_module", [assemble.LIVE_PARTS[1], assemble.PLAYER_PARTS[1]])
def test_no_two_modules_of_a_page_have_a_name_in_common(main_module) -> None:
    """They share one scope, so what is a module's own would be another's too."""
    top = re.compile(r"^(?:export )?(const|let|(?:async )?function\*?|class) ([\w$]+)(.*)", re.MULTILINE)
    names: list[str] = []
    for module in dict.fromkeys(assemble._needed_modules(main_module)):
        for kind, name, rest in top.findall(assemble.part_text(module)):
            names += [name, *(re.findall(r", (\w+) = ", rest) if kind == "const" and "=>" not in rest else [])]
    assert len(names) > 80
    assert {name for name in names if names.count(name) > 1} == set()


def test_a_script_keeps_its_texts_and_patterns() -> None:
    """What is taken away is air: spaces, brackets round a lone name, the last semicolon."""
    source = 'const a = (x) => { return "b ; }  const " + x - -x; };\nconst c = /[ ;]}"/.test(`d  ${a} ;}`);\n'
    assert minified(source) == 'let a=x=>{return"b ; }  const "+x- -x},c=/[ ;]}"/.test(`d  ${a} ;}`);'
    assert minified("let a = b === Infinity ? true : -Infinity;\n") == "let a=b===1/0?!0:-1/0;"
    assert minified("const a = (1 + b) * 2, // one\nb = 0.5;\nlet c = [a, 3 % b];\n") == "let a=(1+b)*2,b=.5,c=[a,3%b];"
    assert minified("a = x / Infinity + y.true;") == "a=x/Infinity+y.true;"
    assert minified("for (const x of of) x.a = `${`${x} y`} / z` / 2;") == "for(let x of of)x.a=`${`${x} y`} / z`/2;"
    with pytest.raises(ValueError, match="must consist of known tokens, got '# no'"):
        minified("a = 1; # no")


def minified(source):
    return script.joined(script.tokens(source))


SHADOWS = """
const speed = 2, other = { speed, twice: (speed) => 2 * speed }, { length: far = 7, ...rest } = { a: "speed" };
function fall(speed, { height, gravity = speed } = {}, [first, , last] = [1, 2, 3]) {
  const text = `speed ${speed} ${`of ${height ?? "none"}`}`, of = (height) => height / 2 / gravity;
  for (const [name, value] of Object.entries({ speed, height: of(4) })) rest[name] = value;
  try { throw speed; } catch (error) { rest.error = error; }
  return [text, first, last, /speed[/]\\d/.test(text), { speed, gravity }, arguments.length];
}
class Ball {
  constructor(speed) { Object.assign(this, { speed, height: speed ** 2 }); }
  get height() { return other.speed; }
  set height(height) { this.top = height; }
  async speedOf({ speed = other.speed }) { return speed + this.speed; }
}
let height = fall(speed, { height: 1 }).length, long = new Ball(height);
const told = (speed) => [fall(speed), rest, far, long, long.height, other.twice(height)];
long.speedOf({}).then((speed) => console.log(JSON.stringify(told(speed))));
"""


def test_short_names_change_nothing_but_names() -> None:
    """Names are the same in several scopes, in keys, shorthands, texts and patterns."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: scripts are not run here")
    short = script.joined(renaming.renamed(script.tokens(SHADOWS)))
    assert len(short) < 0.85 * len(minified(SHADOWS))
    assert '"speed"' in short
    told = [subprocess.run([node, "--input-type=module", "-e", one], capture_output=True, text=True, check=True).stdout
            for one in (SHADOWS, short)]
    assert told[0] == told[1] != ""


def test_names_of_the_browser_are_kept() -> None:
    """A name that is declared nowhere is not replaced, nor does another get it."""
    source = "const value = (Infinite) => a(b, value.name, Infinite);\nlet a1 = (x = print) => x, b1 = { value };\n"
    short = script.joined(renaming.renamed(script.tokens(source)))
    assert short == "let c=d=>a(b,c.name,d),d=(x=print)=>x,e={value:c};"
    for main_module in (assemble.LIVE_PARTS[1], assemble.PLAYER_PARTS[1]):
        assert len(assemble._bundle_with_short_names(main_module)) < 0.83 * len(assemble.bundle(main_module))


def test_every_name_a_module_imports_reaches_the_bundle() -> None:
    folder = Path(assemble.__file__).parent
    imports = re.compile(r'^import \{([^}]*)\} from "([^"]+)"', re.MULTILINE)
    for module in folder.rglob("*.mjs"):
        for names, path in imports.findall(module.read_text(encoding="utf-8")):
            given = assemble.EXPORT_PATTERN.findall((module.parent / path).read_text(encoding="utf-8"))
            assert {name.strip() for name in names.split(",")} <= set(given), f"{module.name} imports from {path}"


def test_custom_properties_are_short_but_those_of_the_scripts() -> None:
    """Each declared property that a rule reads is declared under the same name."""
    style = ":root{--ink:#000;--inkpot:1;--hard:red;--hard-ball:pink;--to:1}a{b:var(--ink);c:var(--inkpot) var(--to)}"
    short = assemble._with_short_properties(style, 'colour(`--${engine}`), set("--to", 2)')
    assert short == ":root{--a:#000;--b:1;--hard:red;--hard-ball:pink;--to:1}a{b:var(--a);c:var(--b) var(--to)}"
    for parts in (assemble.LIVE_PARTS, assemble.PLAYER_PARTS):
        html = assemble.page(parts, "x", data={})
        style, code = html.partition("<style>")[2].partition("</style>")[0], html.partition("<script type=module>")[2]
        declared = re.findall(r"[{;](--[\w-]+):", style)
        used = {*re.findall(r"var\((--[\w-]+)", style), *re.findall(r"[\"(](--[a-z-]+)", code)}
        assert len(used) > 10
        assert used - {"--from", "--to"} <= set(declared)  # scripts set these two
        assert set(declared) >= assemble.COMPOSED_PROPERTIES


def test_quotation_marks_are_left_out_where_a_value_needs_none() -> None:
    html = assemble.page(assemble.LIVE_PARTS, "a b", "scene=a", {"a": 'b="c" d="e">'})
    assert "<section class=pack data-label=pack></section>" in html
    assert "<input class=guess type=range min=0" in html
    assert 'data-on="4 5 6 7"' in html
    assert "<title>a b</title>" in html
    assert '<body data-start="scene=a">' in html
    assert '{"a":"b=\\"c\\" d=\\"e\\">"}' in html


def test_text_cannot_break_out_of_the_page(tmp_path) -> None:
    assert "</script" not in assemble.embedded({"name": "</script><b>"})
    assert "<title>&quot;&gt;&lt;b&gt;" in assemble.page(assemble.PLAYER_PARTS, '"><b>', data={})


@pytest.mark.rotating
@pytest.mark.parametrize("third", range(3))
def test_numerics_by_node(third) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the page's numerics are not checked against the golden data here")
    balls = {name: astuple(ball) for name, ball in gr.balls.BALLS.items()}
    run = subprocess.run([node, "--test", *HERE.glob("*.test.mjs")], capture_output=True, text=True, check=False,
                         env=os.environ | {"THIRD": str(third), "BALLS": json.dumps(balls)})
    assert run.returncode == 0, run.stdout


def test_golden_data_are_what_python_says(monkeypatch) -> None:
    monkeypatch.syspath_prepend(HERE)
    from tests.app.page.make_golden import case

    cases = json.loads((HERE / "golden.json").read_text(encoding="utf-8"))
    assert len(cases) == 500
    for then in cases[7::50]:
        now = case(then["scene"], then["values"], then["ties"])
        assert all(now[told] == then[told] for told in ("answer", "kind", "said", "counts"))
        assert now["error"] == pytest.approx(then["error"], abs=1e-9)
        for engine in ("soft", "hard"):
            for number in ("velocity", "rise", "span"):
                assert now[engine][number] == pytest.approx(then[engine][number], abs=1e-9)


def test_golden_data_hold_all_that_can_go_wrong() -> None:
    cases = json.loads((HERE / "golden.json").read_text(encoding="utf-8"))
    kinds = [one["kind"] for one in cases]
    assert {"yes", "yes, overlap", "not_unique", "forever", "counts", "off"} <= set(kinds)
    assert sum(one["error"] is not None for one in cases) > 350
    elastic = [one for one in cases if one["scene"] == "newtons-cradle" and one["values"]["eps"] == 1.0]
    assert len({one["values"]["gap"] for one in elastic if one["kind"] == "yes"}) > 5
    heavy_on_light = [one for one in cases if one["values"].get("ratio", 1.0) < 1.0]
    assert sum(None not in (one["soft"]["rise"], one["hard"]["rise"]) for one in heavy_on_light) > 10


def test_the_commands_write_pages(tmp_path, capsys, cradle) -> None:
    assert main(["page", "newtons-cradle", "-o", str(tmp_path / "p.html")]) == 0
    assert "kB" in capsys.readouterr().out
    cradle.hard.save(tmp_path / "run.npz")
    assert main(["view", str(tmp_path / "run.npz"), "--title", "A <cradle>"]) == 0
    assert "<title>A &lt;cradle&gt;</title>" in (tmp_path / "run.html").read_text(encoding="utf-8")
    assert '"name":"run"' in (tmp_path / "run.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (["page", "gas"], "`scene` must be one of story, real-balls, three-balls, ball-stack, newtons-cradle, bounc"),
        (["page", "real-balls", "--upper", "medicine ball"], "`upper` must be one of basketball, football, "),
        (["page", "real-balls", "--gap", "1e-9"], "`gap` must be a number in [1e-07, 0.1], got 1e-09."),
        (["page", "newtons-cradle", "--n", "3", "--moving", "3"],
         "`moving` must be an integer from 1 to 2, got 3. At least one ball has to be at rest."),
        (["page", "three-balls", "--lower", "football"], "the page three-balls has no setting `lower`; available: "
                                                         "at, "),
        (["page", "story", "--screen", "7"], "`screen` must be an integer from 0 to 6, got 7"),
        (["page", "-o", "/nowhere/p.html"], "The output path must be writable, got '/nowhere/p.html' (No such file or "
                                            "directory)."),
        (["view", "nothing.npz"], "nothing.npz: No such file"),
        (["view"], "RUN.npz"),
        (["page", "--opne"], "did you mean --open?"),
    ],
)
def test_misuse_is_one_sentence(command, sentence, capsys) -> None:
    assert main(command) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1


def test_three_runs_are_refused(tmp_path, cradle) -> None:
    with pytest.raises(ValueError, match="`runs` must be one or two trajectories, got 3"):
        player_page(tmp_path / "x.html", [cradle.hard] * 3)


def test_two_runs_of_different_balls_are_refused(tmp_path, cradle) -> None:
    """Newcomer M23."""
    other = gr.edmd.simulate(gr.scenes.gas(n=10), gr.ConstantRestitution(0.9), t_end=0.1)
    with pytest.raises(ValueError, match=r"must be of the same balls, got different scenes \(4 and \d+ bodies\)"):
        player_page(tmp_path / "x.html", [cradle.hard, other])
    light = gr.edmd.simulate(cradle.scene.replace(mass=0.5 * cradle.scene.mass), gr.ConstantRestitution(0.9))
    with pytest.raises(ValueError, match=r"different scenes \(masses\)"):
        player_page(tmp_path / "x.html", [cradle.hard, light])
