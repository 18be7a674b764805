"""Place and legibility: nothing overlaps, is cut, or sticks out of a window."""

import base64
import re
from pathlib import Path

import pytest

from granular.app.page import assemble
from tests.app.page.driving import click, go, last_picture, settle, slide, text, turn

SCREENS = range(8)


BESIDE = """
[...document.querySelectorAll('.stage > svg')].filter((view) => view.clientWidth).map((view) => {
  const box = (selector) => [...view.querySelectorAll(selector)].map((one) => one.getBoundingClientRect());
  const zero = box('.ruler text')[0], floor = box('.floor')[0], note = view.querySelector(':scope > .ruler-tick');
  return [box('.top-value').every((word) => box('.face').every((ball) =>
    word.right <= ball.left + 1 || ball.right <= word.left + 1 ||
    word.bottom <= ball.top + 4 || ball.bottom <= word.top + 4)),
    zero.bottom <= floor.top + 4, view.querySelector('.ruler').textContent, note.textContent,
    note.getBoundingClientRect().right <= view.getBoundingClientRect().right];
})
"""


@pytest.mark.parametrize("width", [1366, 390])
@pytest.mark.parametrize(("state", "zero"), [
    ("screen=2", "0: basketball at rest"), ("screen=4", "0: tennis ball at rest"),
    ("scene=ball-stack", "0: ball 3 at rest"), ("scene=bouncing-ball", "0: basketball at rest")])
def test_numbers_are_beside_the_balls_and_the_zero_has_a_name(page, story, width, state, zero) -> None:
    page.size(width, 844, mobile=width < 500)
    go(page, f"{story}#{state}")
    last_picture(page)
    settle(page)
    for beside, above, ruler, note, is_in in page.run(BESIDE):
        assert beside
        assert above
        assert ruler.endswith(zero)
        assert is_in
        assert re.fullmatch(r"(balls drawn [\d.]+\s× too large)?", note)


PLACES = """
[...document.querySelectorAll('.stage > svg')].map((view) =>
  [...view.querySelectorAll('.ball')].map((ball) => ball.getBoundingClientRect().left))
"""


@pytest.mark.rotating
@pytest.mark.parametrize("width", [320, 390, 768, 1280])
def test_balls_in_a_row_keep_their_order_beside_the_lens(blank, story, width) -> None:
    """A scale was once below zero where the lens left no room."""
    blank.size(width, 800, mobile=width < 500)
    go(blank, f"{story}#scene=newtons-cradle&n=9&at=0.3")
    for places in blank.run(PLACES):
        assert places == sorted(places)
    assert float(re.search(r"at ([\d.−]+) times", text(blank, ".scale-note"))[1]) > 5.0
    lens = blank.run("document.querySelector('.stage .lens-rim').getBoundingClientRect().left")
    assert max(map(max, blank.run(PLACES))) < lens


SMALL = """
[...document.querySelectorAll('button:not(.term), select, input[type=range]')].filter((e) => e.checkVisibility())
  .filter((e) => e.offsetHeight < 44 || (e.matches('button') && e.offsetWidth < 44)).map((e) => e.outerHTML)
"""


@pytest.mark.rotating
@pytest.mark.parametrize("width", [320, 360, 640, 768, 1920])
def test_nothing_sticks_out_and_all_targets_are_large(page, width) -> None:
    """640 is a window of 1280 at 200 %."""
    page.size(width, 800, mobile=width < 500)
    for screen in SCREENS:
        if screen:
            turn(page, screen)
        assert page.run("document.documentElement.scrollWidth") <= width, screen
        assert page.run(SMALL) == []


@pytest.mark.parametrize("state", ["scene=real-balls&gap=0.001", "scene=three-balls&lang=de"])
def test_on_a_phone_slider_and_stage_are_seen_together(page, story, state) -> None:
    page.size(390, 844, mobile=True)
    go(page, f"{story}#{state}")
    page.middle("[data-name=gap]")
    stage, slider = (page.run(PLACE % selector) for selector in (".stage > svg", "[data-name=gap]"))
    assert all(0 <= top < bottom <= 844 for top, bottom in (stage, slider))
    assert stage[1] <= slider[0]  # not behind the picture, which stays
    for value in (0, 300, 600, 900, 1000):
        page.run(f"{{ const s = document.querySelector('[data-name=gap]'); s.value = {value};"
                 " s.dispatchEvent(new Event('input')); }")
        settle(page)
        assert page.run(PLACE % "[data-name=gap]") == pytest.approx(slider, abs=1.0)


PLACE = "(() => { const b = document.querySelector('%s').getBoundingClientRect(); return [b.top, b.bottom]; })()"


@pytest.mark.rotating
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (768, 1024), (390, 844), (360, 740)])
def test_each_screen_of_the_story_opens_with_its_picture_in_view(page, story, width, height) -> None:
    page.size(width, height, mobile=width < 760)
    for screen in range(7):
        go(page, f"{story}#screen={screen}")
        top, bottom = page.run(PLACE % ".stage")
        assert 0 < top < bottom - 200 < height - 200, screen


def test_a_swipe_that_scrolls_leaves_the_slider_as_it_was(page, story) -> None:
    page.size(390, 844, mobile=True)
    go(page, f"{story}#scene=real-balls&gap=0.001")
    x, y = page.middle("[data-name=gap]")
    before = page.run("scrollY")
    page.touch(x - 100, y, to=(x - 100, y - 150))
    page.wait(f"scrollY > {before}")
    assert text(page, "output[for=slider-gap]") == "1 mm"


CONTRAST = (Path(__file__).with_name("contrast.js")).read_text(encoding="utf-8")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_readable(page, scheme) -> None:
    page.media(prefers_color_scheme=scheme)
    for screen in (1, 4, 5, 7):
        turn(page, screen)
        page.run("new Promise((done) => setTimeout(done, 250))")  # colours fade
        assert page.run(CONTRAST) == []
    page.media()


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("link", "scheme"),
    [("#screen=6&lang=de", "light"), ("#scene=three-balls", "dark"), ("#scene=real-balls&lang=fr", "light")],
)
def test_it_prints_to_one_sheet(page, story, link, scheme) -> None:
    page.media(prefers_color_scheme=scheme)
    go(page, story + link)
    page.run("new Promise((done) => setTimeout(done, 200))")
    for width, height in ((8.27, 11.69), (8.5, 11.0)):  # A4 and Letter, in inches
        paper = page.call("Page.printToPDF", paperWidth=width, paperHeight=height)["data"]
        assert len(re.findall(rb"/Type\s*/Page\b", base64.b64decode(paper))) == 1
    page.media("print", prefers_color_scheme=scheme)
    assert page.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.media()


OVERLAPPING = """
[...document.querySelectorAll('.stage svg')].filter((host) => host.checkVisibility()).flatMap((host) => {
  const unseen = '[display=none], [opacity="0"], [opacity="0.00"], [visibility=hidden]';
  const seen = (one) => one.textContent.trim() && !one.closest(unseen);
  const words = [...host.querySelectorAll('text')].filter(seen);
  const boxes = words.map((one) => one.getBoundingClientRect());
  const edge = host.getBoundingClientRect(), out = (box) => box.left < edge.left - 1 || box.right > edge.right + 1;
  const shared = (a, b, from, to) => Math.min(a[to], b[to]) - Math.max(a[from], b[from]);
  const meet = (a, b) => shared(a, b, 'left', 'right') > 3 && shared(a, b, 'top', 'bottom') > 4;
  const lens = [...host.querySelectorAll('.lens-rim')].filter((rim) => !rim.closest(unseen))
    .map((rim) => rim.getBoundingClientRect());
  const isBad = (box, i) => out(box) || [...boxes.slice(i + 1), ...lens].some((other) => meet(box, other));
  return words.filter((_, i) => isBad(boxes[i], i)).map((one) => one.textContent);
})
"""


@pytest.mark.parametrize(("width", "height", "language"), [(1366, 768, "es"), (390, 844, "es"), (683, 384, "en"), *(
    pytest.param(width, height, language, marks=pytest.mark.soak)
    for width, height in ((1366, 768), (390, 844)) for language in ("en", "de", "fr", "tr", "zh"))])
def test_words_in_the_picture_do_not_overlap_and_are_not_cut(page, width, height, language) -> None:
    """Spanish has the longest names. No word meets a lens, in any scene of the laboratory."""
    page.size(width, height, mobile=width < 500)
    go(page, f"{page.run('location.href.split(/[?#]/)[0]')}#screen=1&lang={language}")
    for screen in range(1, 8):
        turn(page, screen)
        settle(page)
        assert page.run(OVERLAPPING) == [], screen
    for scene in ("three-balls", "ball-stack", "newtons-cradle", "real-balls"):
        click(page, f".scenes [data-scene={scene}]")
        assert page.run(OVERLAPPING) == [], scene


@pytest.mark.parametrize(("width", "height"), [(390, 844), (683, 768), (1366, 768), (1920, 1080)])
def test_names_of_many_balls_a_guess_and_a_far_gap_do_not_overlap(page, story, width, height) -> None:
    """Numbers of eight balls met. Words of a guess met names at 0 and the ruler at 10, those of v t_c a higher ball."""
    page.size(width, height, mobile=width < 500)
    for state in ("&n=8", "&n=8&predict=1", "&n=6&massRatio=0.5"):
        go(page, f"{story}#scene=ball-stack&lang=en{state}")
        assert page.run(OVERLAPPING) == [], state
        names = page.run("[...document.querySelectorAll('.stage .soft .ball-name')].filter((one) =>"
                         " getComputedStyle(one).visibility === 'visible').map((one) => one.textContent)")
        if width > 390 or "predict" in state:  # two narrow pictures have no names beside their balls
            assert (names[0], names[-1]) == ("1", state[3])  # the last one is asked for
    for language in ("en", "fr", "es"):
        for guess in (0, 0.5, 1, 1.5, 9.5, 10):
            go(page, f"{story}#screen=1&guess={guess}&lang={language}")
            assert page.run(OVERLAPPING) == [], (language, guess)
    for state in ("scene=real-balls", "screen=5", "scene=three-balls"):  # held farther apart than v t_c
        go(page, f"{story}#{state}&lang=es")
        for value in (600, 760, 880, 1000):
            slide(page, "gap", value)
            assert page.run(OVERLAPPING) == [], (state, value)


BEHIND_BARS = """
[...document.querySelectorAll('.stage > svg .ball-name')].filter((one) => {
  const name = one.getBoundingClientRect(), view = one.closest('.stage > svg');
  const bar = view.querySelector('.gauge-bar')?.getBoundingClientRect();
  const isSeen = getComputedStyle(one).visibility === 'visible' && name.width;
  return bar && isSeen && name.right > bar.left && name.bottom > bar.top && name.top < bar.bottom;
}).map((one) => one.textContent)
"""


@pytest.mark.parametrize(("width", "height"), [(390, 844), (683, 768), (1366, 768), (1920, 1080)])
def test_no_name_is_behind_the_bar_of_its_height(page, story, width, height) -> None:
    page.size(width, height, mobile=width < 500)
    for language in assemble.LANGUAGES:
        for screen in (4, 5, 6):
            go(page, f"{story}#screen={screen}&lang={language}")
            assert page.run("document.querySelectorAll('.gauge-bar').length") > 0
            assert page.run(BEHIND_BARS) == [], (language, screen)


MEETING = """
[...document.querySelectorAll('.stage > svg')].flatMap((view) => {
  const tops = [...view.querySelectorAll('.top-value')], boxes = tops.map((one) => one.getBoundingClientRect());
  return tops.filter((_, i) => boxes.some((box, j) => j > i && box.left < boxes[i].right - 3
    && boxes[i].left < box.right - 3 && box.top < boxes[i].bottom - 4 && boxes[i].top < box.bottom - 4));
}).map((one) => one.textContent)
"""


@pytest.mark.parametrize("width", [683, 1366, 1920])
def test_numbers_of_many_balls_do_not_overlap_and_the_top_ball_has_one(page, story, width) -> None:
    """From five balls on, numbers were written across each other in every window, at the end of the film, too."""
    page.size(width, 768)
    for state in ("ball-stack&n=5", "ball-stack&n=8", "ball-stack&n=8&eps=0.3", "three-balls&ratio=0.5"):
        go(page, f"{story}#scene={state}&lang=es")
        for value in (1500, 1750, 2000):
            page.run(f"{{ const bar = document.querySelector('.time-bar'); bar.value = {value};"
                     " bar.dispatchEvent(new Event('input')); }")
            assert page.run(MEETING) == [], (state, value)
        for engine in ("hard", "soft"):
            told = text(page, f".figure:nth-child(2) .{engine}")
            tops = f"[...document.querySelectorAll('.stage .{engine} .top-value')].map((top) => top.textContent)"
            assert told in [*page.run(tops), "–"]
