"""The laboratory in a browser: its controls and the numbers they change."""

from pathlib import Path

import pytest

import granular as gr
from granular.app.page import assemble, renaming, script
from tests.app.page.driving import click, fresh, go, named, settle, slide, text, time_bar

HERE = Path(__file__).parent


def test_the_paper_is_what_the_laboratory_opens_with(page, live) -> None:
    fresh(page, live)
    told = ("No: hard spheres promise the top ball 3.56 drop heights, soft ones 0.53; balls 1 and 2 have 4 contacts,"
            " not 1; the error is 68 % of the fastest impact.")
    assert text(page, ".verdict") == told
    assert page.run("document.querySelectorAll('.stage svg .ball').length") == 4


def test_golden_data_in_the_browser(tab, tmp_path) -> None:
    """With the short names that the page has."""
    check = assemble.EXPORT_PATTERN.sub(
        "", assemble.IMPORT_PATTERN.sub("", (HERE / "golden.mjs").read_text(encoding="utf-8"))
    )
    cases = (HERE / "golden.json").read_text(encoding="utf-8")
    needed = "physics/outcome.mjs", "physics/setups.mjs", "physics/film.mjs", "live/camera.mjs", "physics/reason.mjs"
    source = f"{assemble.source(*needed)}\n{{{check}\nwindow.check = check; }}"
    short = script.joined(renaming.renamed(script.tokens(source)))
    tried = f"{short}{{const cases = {cases};\n"
    tried += "const some = cases.filter((_, i) => i % 5 === 0); window.tried = some.length;"  # all of them: by node
    tried += "window.faults = some.flatMap((c) => window.check(c, 100)); }"
    (tmp_path / "golden.html").write_text(f'<script type="module">{tried}</script>', encoding="utf-8")
    tab.open((tmp_path / "golden.html").as_uri())
    tab.wait("window.faults !== undefined")
    assert tab.run("[window.tried, window.faults]") == [100, []]


def test_sliders_change_everything_at_once(lab) -> None:
    curve = lab.run("document.querySelector('.curve .soft-line').getAttribute('d')")
    slide(lab, "eps", 1000)
    assert lab.run("document.querySelector('output[for=slider-eps]').textContent") == "1"
    slide(lab, "gap", 1000)
    assert text(lab, ".verdict").startswith("Yes")
    assert lab.run("document.querySelector('[data-name=gap]').getAttribute('aria-valuetext')") == "0.1 m"
    lab.wait(f"document.querySelector('.curve .soft-line')?.getAttribute('d') !== {curve!r}")


def test_presets(lab) -> None:
    named(lab, "touching")
    assert text(lab, "output[for=slider-gap]") == "0, touching"
    assert text(lab, ".presets [aria-pressed=true]") == "touching"
    named(lab, "the paper")
    assert text(lab, "output[for=slider-gap]") == "100 µm"


def test_scrubbing_moves_the_balls(lab) -> None:
    at = "document.querySelector('.stage .soft .ball:last-child').getAttribute('transform')"
    before = lab.run(at)
    lab.run("{ const b = document.querySelector('.time-bar'); b.value = 900; b.dispatchEvent(new Event('input')); }")
    assert lab.run(at) != before
    assert lab.run("document.querySelector('.forces .playhead').getAttribute('visibility')") == "visible"
    assert "slowed" in lab.run("document.querySelector('.time-bar').getAttribute('aria-valuetext')")


def test_keyboard(lab) -> None:
    lab.key("Home")
    lab.key("ArrowRight")
    lab.key("ArrowRight")
    assert time_bar(lab) == 40
    lab.key("ArrowLeft")
    assert time_bar(lab) == 20
    lab.key("ArrowRight", shift=True)  # the floor is touched
    lab.key("ArrowRight", shift=True)
    first = lab.run("document.querySelector('.time-now').textContent").replace("\u00a0", " ")
    assert first == "18.78 µs"  # hard spheres meet: 0.1 mm at (1 + 0.7) times 3.13 m/s
    lab.key(" ")
    assert lab.run("document.querySelector('.play').getAttribute('aria-label')") == "pause"
    lab.wait(f"document.querySelector('.time-now').textContent !== {first!r}")
    lab.key(" ")
    assert lab.run("document.querySelector('.play').getAttribute('aria-label')") == "play"
    lab.key("r")
    assert time_bar(lab) == 0
    lab.run("document.querySelector('[data-name=eps]').focus()")
    lab.key("ArrowRight")
    assert time_bar(lab) == 0  # arrows belong to the slider that has the focus


SAVED = """
window.saved = undefined;
URL.createObjectURL = (blob) => { blob.text().then((t) => { window.saved = t; }); return 'data:,'; };
"""


def test_bounces_are_numbered_in_the_table(blank, story) -> None:
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    blank.run("document.querySelectorAll('.table-box details').forEach((one) => { one.open = true; })")
    settle(blank)
    first = "[...document.querySelectorAll('.contacts tbody th')].map((cell) => cell.textContent)"
    blank.wait(f"{first}.length > 0")
    assert blank.run(first) == ["hard 1", "hard 2", "hard 3", "soft 1", "soft 2", "soft 3"]
    blank.is_worn = True


def test_contacts_as_csv(lab) -> None:
    lab.run(SAVED)
    click(lab, ".csv")
    lab.wait("window.saved !== undefined")
    head, *rows = [line.split(",") for line in lab.run("window.saved").replace('"', "").strip().split("\r\n")]
    assert head[0] == "engine"
    assert [row[0] for row in rows].count("soft") == 5
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    log = gr.md.simulate(scene, law, until=gr.until.contact(0, 2)).contacts
    assert [float(row[2]) for row in rows if row[0] == "soft"] == pytest.approx(log["t_begin"], rel=1e-12)


def test_a_collapse_shows_nothing_unfinished(blank, story) -> None:
    go(blank, f"{story}#scene=newtons-cradle&eps=0.105&gap=0.0000881&n=8&moving=5&k=2290000&speed=0.549")
    told = "No: hard spheres collide forever (inelastic collapse), soft spheres separate after 3 contacts."
    assert text(blank, ".verdict") == told
    final = "[...document.querySelectorAll('.finals tbody tr')].map((r) => r.cells[3].textContent)"
    assert blank.run(final) == ["–"] * 8
    assert blank.run("document.querySelectorAll('.rises .hard-bar').length") == 0
    assert "no final velocities" in text(blank, ".finals-note")
    blank.run(SAVED)
    click(blank, ".csv")
    blank.wait("window.saved !== undefined")
    assert blank.run("window.saved.trim().split('\\r\\n').pop()").startswith('note,"Hard spheres collide without end')


def test_overlaps_too_deep_for_a_force_law_are_told_as_by_the_library(blank, story) -> None:
    case = gr.cases.make("real-balls", lower="basketball", upper="tennis ball", gap=1e-3, height=1.0, pair_rule="lens")
    report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    go(blank, f"{story}#scene=real-balls&lang=en")
    blank.run("document.querySelector('.table-box details').open = true")
    log, radius = report.soft.contacts, case.scene.radius  # of the two pairs, the balls overlap more
    share = f"{100.0 * log['xi_max'][log['pair'] == 1].max() / radius[2]:.2g}"
    assert float(share) > 100.0 * log["xi_max"][log["pair"] == 0].max() / radius[1] > 10.0
    told = (f"The overlap of basketball and tennis ball is {share} % of the smaller radius; force laws are valid up to"
            " about 10 %.")
    blank.wait(f"document.querySelector('.finals-note').textContent.replace(/\u00a0/g, ' ') === {told!r}")
    blank.is_worn = True


def test_elastic_balls_do_not_wait_for_rounding(blank, story) -> None:
    go(blank, f"{story}#scene=newtons-cradle&eps=1&gap=0.000136&n=7&moving=5&k=25100000&speed=0.451")
    assert text(blank, ".verdict") == "Yes: every contact is binary, and the outcomes agree to rounding."
    assert text(blank, ".slowdown").startswith("slowed")


def test_a_ball_at_rest_on_the_floor_takes_no_steps(blank, story) -> None:
    go(blank, f"{story}#scene=ball-stack&eps=0.233&gap=0.0015&n=3&massRatio=0.203&k=394000000&height=1.62")
    told = "No: balls 2 and 3 have 2 contacts, not 1."
    assert text(blank, ".verdict") == told
    rises = blank.run("[...document.querySelectorAll('.finals tbody tr')].map((r) => r.cells[6].textContent)")
    assert len(rises) == 3
    assert not any("−" in rise for rise in rises)


def test_a_heavy_ball_on_a_light_one_rises_in_both_pictures(blank, story) -> None:
    go(blank, f"{story}#scene=three-balls&eps=1&gap=0.00000484&ratio=0.782&k=244000000&height=1.27")
    assert text(blank, ".figure:nth-child(2) .hard") == "1.46"
    assert text(blank, ".figure:nth-child(2) .soft") == "1.21"


def test_predict_first(lab) -> None:
    click(lab, ".predict-button")
    assert lab.run("getComputedStyle(document.querySelector('.verdict')).display") == "none"
    lab.key("ArrowRight")
    lab.key(" ")
    assert time_bar(lab) == 0  # nothing is given away
    assert lab.run("document.querySelector('.run').disabled")  # there is no answer before there is a guess
    lab.media(prefers_reduced_motion="reduce")  # the film is its last picture
    lab.run("document.querySelector('.soft .grip').focus()")
    for _ in range(3):
        lab.key("ArrowUp")
    click(lab, ".run")
    assert text(lab, ".told").startswith("You guessed 1.3 drop heights. Hard spheres give 3.56, soft spheres 0.53.")
    assert lab.run("getComputedStyle(document.querySelector('.verdict')).display") != "none"
    lab.media()


def test_all_tie_rules_beside_the_soft_spheres(blank, story) -> None:
    go(blank, f"{story}#scene=newtons-cradle&n=3&gap=0&eps=1")
    cells = "[...document.querySelectorAll('.ties tbody tr')].map((r) => [...r.children].map((c) => c.textContent))"
    blank.wait("document.querySelectorAll('.ties tbody tr').length === 7")
    rows = blank.run(cells)
    assert rows[0][1:] == ["0", "0", "1"]
    assert rows[4][1:] == ["−0.333", "0.667", "0.667"]
    assert rows[6][0] == "soft spheres"


def test_everything_has_a_name_for_those_who_listen(lab) -> None:
    nameless = lab.run(
        "[...document.querySelectorAll('button, input, select, svg[role=img], section')].filter((e) =>"
        " !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)).map((e) => e.outerHTML)"
    )
    assert nameless == []
    assert lab.run("document.querySelector('.announced').getAttribute('role')") == "status"


def test_print_style(lab) -> None:
    lab.media("print")
    shown = lab.run("getComputedStyle(document.querySelector('.transport')).display")
    lab.media()
    assert shown == "none"


@pytest.mark.rotating
@pytest.mark.parametrize("scene", ["three-balls", "ball-stack&n=8", "newtons-cradle&n=9"])
def test_nothing_sticks_out_on_a_small_phone(blank, story, scene) -> None:
    blank.size(360, 740, mobile=True)
    fresh(blank, f"{story}#scene={scene}")
    assert blank.run("document.documentElement.scrollWidth") <= 360
