"""The page as a file: what is in it, what it refuses; recorded runs made small; films."""

import base64
import json
import math
import os
import re
import shutil
import subprocess
from dataclasses import asdict
from pathlib import Path
from urllib.parse import parse_qsl

import numpy as np
import pytest

import granular as gr
from granular.cli import main
from granular.page import assemble, live_page, opening, player_page, recording
from granular.page.recording import filled

HERE = Path(__file__).parent / "page"


@pytest.fixture(scope="module")
def cradle():
    scene, law = gr.scenes.newtons_cradle(4), gr.LinearDashpot(1e7)
    return gr.compare(scene, law)


def test_the_page_is_one_small_file_that_loads_nothing(tmp_path) -> None:
    live_page(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    words = sum(len(assemble.shipped(f"words/{language}.json").encode()) for language in assemble.LANGUAGES)
    assert len(html.encode()) < 167_000 + words
    assert "{{" not in html
    assert not re.search(r'(src|href)="(?!data:,)|@import|url\((?!#)|\bfetch\(|^import |^export ', html, re.MULTILINE)
    assert set(re.findall(r"https?://[^\s\"']+", html)) == {"http://www.w3.org/2000/svg"}  # a name, not an address


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
    assert set(sliders) == set(opening.SCENES) - {"story"}
    for scene, limits in sliders.items():
        ours = {s.slider: [s.least, s.most, s.zero] for s in opening.SETTINGS[scene].values()
                if not isinstance(s, opening.Kind)}
        assert ours == limits


def test_every_setting_of_every_scene_reaches_the_link() -> None:
    random = np.random.default_rng(16)
    for scene in opening.SCENES:
        for name, setting in opening.settings(scene).items():
            if name == "moving":
                continue
            words, whole = setting.words or (True, False), setting.whole
            value = (str(random.choice(words)) if setting.words else bool(random.choice([True, False]))
                     if isinstance(setting, opening.Truth) else int(random.integers(setting.least, setting.most + 1))
                     if whole else float(random.uniform(setting.least, setting.most)))
            state = dict(parse_qsl(opening.link(scene, {name: value})))
            if isinstance(setting, opening.Kind):
                assert float(state[f"t{setting.slider}"]) == gr.balls.BALLS[value].duration
            elif isinstance(setting, opening.Choice):
                assert words[int(state[setting.slider])] == value
            elif isinstance(setting, opening.Language):
                assert state[setting.slider] == value
            else:
                assert float(state[setting.slider]) == value
            with pytest.raises((TypeError, ValueError), match=rf"^{name} is .*needed"):
                opening.link(scene, {name: -1.0 if not words or setting.words else "no number"})


def test_modules_are_bundled_each_once_after_what_they_need() -> None:
    script = assemble.bundle("live/main.mjs")
    assert script.count("function simulateSoft(") == 1
    assert script.index("function firstUpCrossing(") < script.index("function simulateSoft(")


def test_no_template_of_a_script_is_inside_another() -> None:
    """What is inside one is taken for code, and loses its spaces."""
    for module in Path(assemble.__file__).parent.rglob("*.mjs"):
        templates = re.findall(assemble.KEPT[2], module.read_text(encoding="utf-8"))
        assert all(one.count("${") <= one.count("}") for one in templates), module.name


def test_every_name_a_module_imports_reaches_the_bundle() -> None:
    folder = Path(assemble.__file__).parent
    imports = re.compile(r'^import \{([^}]*)\} from "([^"]+)"', re.MULTILINE)
    for module in folder.rglob("*.mjs"):
        for names, path in imports.findall(module.read_text(encoding="utf-8")):
            given = assemble.EXPORT.findall((module.parent / path).read_text(encoding="utf-8"))
            assert {name.strip() for name in names.split(",")} <= set(given), f"{module.name} imports from {path}"


def test_text_cannot_break_out_of_the_page(tmp_path) -> None:
    assert "</script" not in assemble.embedded({"name": "</script><b>"})
    assert "<title>&quot;&gt;&lt;b&gt;" in assemble.page(assemble.PLAYER, '"><b>', data={})


@pytest.mark.thirds
@pytest.mark.parametrize("third", range(3))
def test_numerics_by_node(third) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the page's numerics are not checked against the golden data here")
    balls = {name: asdict(ball) for name, ball in gr.balls.BALLS.items()}
    run = subprocess.run([node, "--test", *HERE.glob("*.test.mjs")], capture_output=True, text=True, check=False,
                         env=os.environ | {"THIRD": str(third), "BALLS": json.dumps(balls)})
    assert run.returncode == 0, run.stdout


def test_golden_data_are_what_python_says(monkeypatch) -> None:
    monkeypatch.syspath_prepend(HERE)
    from make_golden import case

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


def test_a_short_run_is_recorded_whole(cradle) -> None:
    run = gr.md.simulate(cradle.scene, gr.LinearDashpot(1e7), t_end=3e-3, samples=50)
    data = recording.recorded(run, "soft")
    assert data["whole"] == {"rows": 50, "contacts": len(run.contacts), "bodies": 4}
    path = unpacked(data["path"], "<f4").reshape(50, 4)
    np.testing.assert_allclose(path + unpacked(data["offset"], "<f4"), run.position, atol=1e-6)
    np.testing.assert_allclose(unpacked(data["energy"], "<f8"), run.energy())
    np.testing.assert_array_equal(unpacked(data["contacts"]["pair"], "<i4"), run.contacts["pair"])


def test_a_long_run_is_thinned_out_evenly_and_every_contact_is_counted(monkeypatch) -> None:
    monkeypatch.setattr(recording, "CONTACTS", 50)
    monkeypatch.setattr(recording, "ROWS", 20)
    scene = gr.scenes.gas(n=30)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=20 * float(scene.gap.mean()), samples=300)
    data = recording.recorded(run, "gas")
    rows = recording.evenly(300, 20)
    assert (rows[0], rows[-1], len(rows)) == (0, 299, 20)
    assert np.ptp(np.diff(rows)) <= 1
    np.testing.assert_array_equal(unpacked(data["time"], "<f8"), run.time[rows])
    assert len(unpacked(data["contacts"]["pair"], "<i4")) == 50 < data["whole"]["contacts"]
    assert unpacked(data["map"]["counts"], "<u2").sum() == len(run.contacts)


def test_soft_contacts_fill_the_map_as_long_as_they_last(cradle) -> None:
    counts = unpacked(recording.contact_map(cradle.soft)["counts"], "<u2").reshape(600, 3)
    log, span = cradle.soft.contacts, np.ptp(cradle.soft.time)
    lasting = [(counts[:, c] > 0).mean() * span for c in range(3)]
    np.testing.assert_allclose(lasting, [log["duration"][log["pair"] == c].sum() for c in range(3)], atol=span / 200)


def test_velocities_are_kept_as_shares_of_the_largest(cradle) -> None:
    run = gr.md.simulate(cradle.scene, gr.LinearDashpot(1e7), t_end=3e-3, samples=50)
    field = recording.recorded(run, "soft")["field"]
    values = unpacked(field["values"], "i1").reshape(50, field["rows"]) * field["peak"] / 127.0
    assert (field["first"], field["last"]) == (0, run.scene.n - 1)
    np.testing.assert_allclose(values, run.velocity, atol=0.51 * field["peak"] / 127.0)


def test_a_wave_narrower_than_a_lane_is_not_lost(monkeypatch) -> None:
    monkeypatch.setattr(recording, "MAP", (600, 8))
    run = gr.edmd.simulate(gr.scenes.chain(n=40), gr.ConstantRestitution(1.0), t_end=1.0, samples=30)
    field = recording.recorded(run, "chain")["field"]
    values = unpacked(field["values"], "i1").reshape(30, 8)
    np.testing.assert_array_equal(np.abs(values).max(axis=1), 127)  # one ball moves with all the momentum at any time


@pytest.mark.parametrize(
    ("scene", "end"),
    [
        (gr.scenes.bouncing_ball(), 20.0),
        (gr.scenes.column(n=4).replace(external_force=[0.0, -1.0, 0.5, 0.0, -2.0]), 1.0),
        (gr.scenes.ring_gas(n=12), 3.0),
        (gr.scenes.heated_gas(n=12), 3.0),
        (gr.scenes.pendulum_cradle(n=3, rest_gap=1e-3), 3.0),
    ],
    ids=["collapse", "forces", "ring", "thermal", "pendula"],
)
def test_a_hard_run_with_few_rows_gets_those_that_the_engine_would_have_recorded(scene, end) -> None:
    """Before, a collapse was drawn with straight lines between a handful of rows."""
    rule = gr.ConstantRestitution(0.8)
    run = gr.edmd.simulate(scene, rule, t_end=end, samples=3)
    more = filled(run, 3000)
    assert len(more.time) > len(run.time) + 2 * len(np.unique(run.contacts["t_begin"])) - 2
    last = np.append(np.diff(more.time) > 0.0, True)  # of two rows at a contact that after it
    asked = gr.edmd.simulate(scene, rule, t_end=end, samples=more.time[last])
    size = np.ptp(asked.position, axis=0).max()
    np.testing.assert_allclose(more.position[last], asked.position, atol=1e-8 * size)  # bounces beyond the log: 2e-9
    np.testing.assert_allclose(more.gap[last], asked.gap, atol=1e-8 * size)
    log = run.contacts["t_begin"]
    away = last & ~np.isin(more.time, log) & (more.time < (log[-1] if run.status.name == "collapse" else np.inf))
    fastest = np.abs(asked.velocity).max()
    np.testing.assert_allclose(more.velocity[away], asked.velocity[away[last]], atol=1e-8 * fastest)


def test_rows_are_added_only_where_they_follow_from_the_log() -> None:
    scene, rule = gr.scenes.bouncing_ball(), gr.ConstantRestitution(0.8)
    unlogged = gr.edmd.simulate(scene, rule, t_end=2.0, samples=9, log=False)
    soft = gr.md.simulate(scene, gr.LinearDashpot(1e5), t_end=1.0, samples=9)
    shaken = gr.edmd.simulate(gr.scenes.vibrated_column(n=2), rule, t_end=0.2, samples=9)
    assert all(filled(run, 3000) is run for run in (unlogged, soft, shaken))
    assert filled(gr.edmd.simulate(scene, rule, t_end=2.0, samples=9), 12).time.shape == (9,)
    mass, radius, gap = [np.inf, 0.03, 0.03], [0.0, 0.01, 0.01], [0.0, 7e-4]
    resting = gr.Scene(mass=mass, radius=radius, gap=gap, velocity=[0.0] * 3, gravity=9.81)
    ends_in_a_contact = gr.edmd.simulate(resting, gr.ConstantRestitution(0.9), max_events=6)
    assert filled(ends_in_a_contact, 3000) is ends_in_a_contact  # before, the ball at rest fell through the floor


def test_energy_falls_in_steps_and_only_what_is_needed_is_written() -> None:
    run = gr.edmd.simulate(gr.scenes.bouncing_ball(), gr.ConstantRestitution(0.8), t_end=20.0, samples=3)
    data = recording.recorded(run, "ball")
    time, energy = unpacked(data["time"], "<f8"), unpacked(data["energy"], "<f8")
    assert (np.abs(np.diff(energy))[np.diff(time) > 0.0] < 1e-9 * energy[0]).all()
    assert data["map"] is None
    assert data["contacts"]["end"] is None
    assert data["whole"]["rows"] == len(run.time)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (gr.scenes.gas(n=5), "5 balls, walls at both ends"),
        (gr.scenes.three_balls(), "2 balls, floor, g = 9.81 m/s²"),
        (gr.scenes.ring_gas(n=5), "5 balls, ring"),
        (gr.scenes.heated_gas(n=5), "5 balls, walls at both ends, left wall Thermal(temperature=2, seed=1), right wall "
         "Thermal(temperature=1, seed=1)"),
    ],
)
def test_the_ends_of_a_scene_are_floor_and_ceiling_only_where_things_fall(scene, words) -> None:
    assert recording.scene_in_words(scene) == words


def test_a_recorded_run_says_what_it_was_made_of() -> None:
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    soft = dict(recording.recorded(gr.md.simulate(scene, law, t_end=0.33), "soft")["about"])
    assert soft["law or rule"].count("k=5e+07") == soft["law or rule"].count("ε = 0.7") == 2
    assert soft["radii, m"] == "0.1, 0.01"
    hard = recording.recorded(gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.1), "hard")
    assert dict(hard["about"])["law or rule"] == "ConstantRestitution(restitution=0.7)"
    assert hard["upright"]


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


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
        (["page", "gas"], "scene is 'gas': one of story, real-balls, three-balls, ball-stack, newtons-cradle, bounc"),
        (["page", "real-balls", "--upper", "medicine ball"], "upper is 'medicine ball': one of basketball, football, "),
        (["page", "real-balls", "--gap", "1e-9"], "gap is 1e-09: a finite number of at least 1e-07 and at most 0.1 is"),
        (["page", "newtons-cradle", "--n", "3", "--moving", "3"], "moving is 3: a whole number of at least 1 and at"),
        (["page", "three-balls", "--lower", "football"], "'lower' is no setting of the page's three-balls: at, gap, "),
        (["page", "story", "--screen", "7"], "screen is 7: a whole number of at least 0 and at most 6 is needed."),
        (["page", "-o", "/nowhere/p.html"], "a writable place is needed"),
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
    with pytest.raises(ValueError, match="runs are 3: one or two trajectories are needed"):
        player_page(tmp_path / "x.html", [cradle.hard] * 3)


def test_two_runs_of_different_balls_are_refused(tmp_path, cradle) -> None:
    """Newcomer M23."""
    other = gr.edmd.simulate(gr.scenes.gas(n=10), gr.ConstantRestitution(0.9), t_end=0.1)
    with pytest.raises(ValueError, match=r"different scenes \(4 and \d+ bodies\): one trajectory is needed"):
        player_page(tmp_path / "x.html", [cradle.hard, other])
    light = gr.edmd.simulate(cradle.scene.replace(mass=0.5 * cradle.scene.mass), gr.ConstantRestitution(0.9))
    with pytest.raises(ValueError, match=r"different scenes \(masses\)"):
        player_page(tmp_path / "x.html", [cradle.hard, light])


def test_a_film(tmp_path, cradle) -> None:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    cradle.animate(tmp_path / "film.gif", seconds=0.5, fps=10)
    with image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 5
        first = np.asarray(film.convert("RGB"), int)
        film.seek(3)
        assert np.abs(np.asarray(film.convert("RGB"), int) - first).max() > 100


def test_a_film_for_slides(tmp_path, cradle) -> None:
    pytest.importorskip("matplotlib")
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed: no .mp4 is made here")
    cradle.animate(tmp_path / "film.mp4", seconds=0.5, fps=10)
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"


def test_every_picture_reaches_ffmpeg_and_nothing_is_left_where_it_fails(tmp_path, cradle, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    stand_in = tmp_path / "ffmpeg"
    stand_in.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')
    stand_in.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    cradle.animate(tmp_path / "film.mp4", seconds=0.5, fps=10)
    pictures = np.frombuffer((tmp_path / "film.mp4").read_bytes(), np.uint8).reshape(5, 540, 960, 4)
    assert all(np.ptp(np.abs(one.astype(int) - pictures[0])) > 100 for one in pictures[1:])
    stand_in.write_text("#!/bin/sh\ncat > /dev/null\necho no such codec >&2\nexit 1\n")
    with pytest.raises(OSError, match="ffmpeg could not write the film: no such codec"):
        cradle.animate(tmp_path / "other.mp4", seconds=0.5, fps=10)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ffmpeg", "film.mp4"]


def test_films_refuse_what_they_cannot_do(tmp_path, cradle, monkeypatch) -> None:
    with pytest.raises(ValueError, match=r"ending of film.avi is '.avi': one of .gif, .mp4 is needed"):
        cradle.animate(tmp_path / "film.avi")
    with pytest.raises(ValueError, match="seconds is 0"):
        cradle.animate(tmp_path / "film.gif", seconds=0)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ValueError, match="ffmpeg is needed and not installed"):
        cradle.animate(tmp_path / "film.mp4")


def test_a_wall_that_is_shaken_is_drawn_where_it_is():
    run = gr.md.simulate(
        gr.Scene([math.inf, 1.0], [0.0, 0.1], [5.0], [0.0, 0.0], floor=gr.walls.Sine(0.5, 1.0)), gr.LinearDashpot(1e4),
        t_end=1.0, method="verlet", dt=1e-3, samples=201)
    data = recording.recorded(run, "wall")
    path, offset = (np.frombuffer(base64.b64decode(data[name]), np.float32) for name in ("path", "offset"))
    assert path.reshape(201, 2)[:, 0] + offset[0] == pytest.approx(0.5 * np.sin(2.0 * math.pi * run.time), abs=1e-6)
    assert data["account"] == []
