"""The story of the teaching page, driven as pupils would: by mouse, keyboard and finger, in any language, on paper."""

import base64
import re
from pathlib import Path

import pytest
from driving import go, settle, text, turn

from granular.page import assemble

SCREENS = range(1, 8)


def rises(tab):
    """Heights of the top ball, hard and soft, as the figures show them."""
    return [text(tab, f".figure:nth-child(2) .{engine}") for engine in ("hard", "soft")]


def test_the_story_begins_with_one_ball_and_ends_in_the_laboratory(own) -> None:
    assert text(own, ".story-title") == "One ball alone"
    titles = []
    for _ in range(6):
        own.mouse(*own.middle(".story-next"))
        settle(own)
        titles.append(text(own, ".story-title"))
    assert titles[-1] == "The laboratory"
    assert len(set(titles)) == 6
    own.run("history.back()")
    own.wait("document.body.dataset.screen === '6'")
    own.wait("location.hash.startsWith('#screen=6')")


def test_one_ball_bounces_alike_in_both_pictures(page) -> None:
    for ball in ("golf ball", "steel ball", "superball"):
        page.run(f"document.querySelector('[data-preset=\"{ball}\"]').click()")
        settle(page)
        said = page.run("document.querySelector('.rises svg').getAttribute('aria-label')")
        hard, soft = (float(x.replace(" mm", "e-3").replace(" m", "")) for x in re.findall(r"[\d.]+ m?m", said))
        assert soft == pytest.approx(hard, rel=0.02)


def test_the_textbook_says_nine_then_seven_then_four(page) -> None:
    turn(page, 2)
    heights = []
    for preset in ("textbook", "masses", "losses"):
        page.run(f"document.querySelector('[data-preset={preset}]').click()")
        settle(page)
        heights.append(rises(page)[0])
    assert [round(float(height)) for height in heights] == [9, 7, 4]
    assert page.run("document.querySelector('.stage .soft').checkVisibility()") is False


@pytest.mark.parametrize("way", ["mouse", "touch", "keyboard"])
def test_a_guess_is_dragged_and_held_against_both(page, way) -> None:
    turn(page, 3)
    assert page.run("document.querySelector('.run').disabled")
    assert not page.run("document.querySelector('.verdict').checkVisibility()")
    x, y = page.middle(".ruler")
    if way == "keyboard":
        page.run("document.querySelector('.ruler').focus()")
        for _ in range(20):
            page.key("ArrowUp")
        guess = 3.0
    else:
        getattr(page, way)(x, y + 100, to=(x, y))
        guess = page.run("Number(document.querySelector('.ruler').getAttribute('aria-valuenow'))")
        assert 4.0 < guess < 7.0
    page.mouse(*page.middle(".run"))
    settle(page)
    assert text(page, ".told") == (
        f"You guessed {guess:g} drop heights. Hard spheres say 3.95, soft spheres 2.32. "
        f"You were nearer to the {'hard' if guess > 3.135 else 'soft'} spheres."
    )
    page.wait("document.querySelector('.film-caption').textContent === 'falling, as fast as life'")
    assert page.run("document.querySelectorAll('.ruler-ball').length") == 4


FASTER = """
const now = performance.now.bind(performance), begin = now();
performance.now = () => begin + 6 * (now() - begin);
requestAnimationFrame = ((frame) => (f) => frame(() => f(performance.now())))(requestAnimationFrame);
"""  # six times


def test_the_film_has_three_times(own) -> None:
    turn(own, 4)
    own.run(FASTER)
    own.mouse(*own.middle(".film-button"))
    captions = "falling, as fast as life", "stop: the floor is reached", "450\u00a0× slower", "flying, as fast as life"
    for caption in captions:
        own.wait(f"document.querySelector('.film-caption').textContent === {caption!r}")


def test_less_motion_is_a_still(page) -> None:
    page.media(prefers_reduced_motion="reduce")
    turn(page, 4)
    page.mouse(*page.middle(".film-button"))
    settle(page)
    assert text(page, ".film-caption") == "the highest point"
    page.media()


SUNK = """
(() => { const svg = document.querySelector('.stage svg.soft');
         return [Number(svg.querySelector('clipPath rect').getAttribute('height')),
                 Number(/ ([\\d.]+)\\)/.exec(svg.querySelector('.floor').getAttribute('transform'))[1]),
                 svg.querySelector('.ball circle').getBoundingClientRect().bottom
                 - svg.querySelector('.floor').getBoundingClientRect().bottom]; })()
"""


def test_a_ball_that_sinks_in_is_flattened_by_the_floor(blank, story) -> None:
    go(blank, f"{story}#screen=4&at=0.5")
    cut, floor, depth = blank.run(SUNK)
    assert depth > 5.0  # pixels
    assert cut == pytest.approx(floor, abs=0.01)


PLACES = """
[...document.querySelectorAll('.stage svg')].map((view) =>
  [...view.querySelectorAll('.ball')].map((ball) => ball.getBoundingClientRect().left))
"""


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


THUMB = """
(() => { const i = document.querySelector('[data-name=gap]'), b = i.getBoundingClientRect();
         return b.x + 8 + (b.width - 16) * i.value / i.max; })()
"""


@pytest.mark.parametrize("way", ["mouse", "touch", "keyboard"])
def test_the_gap_is_dragged_until_both_agree(page, way) -> None:
    turn(page, 5)
    assert text(page, ".verdict").startswith("They differ: hard spheres promise 3.95 drop heights, soft ones 2.32")
    assert text(page, ".because-line").endswith("lasts 12 ms; balls 1 and 2 meet after 2.38 ms: too early.")
    assert text(page, ".slider-note") == "v tc = 53 mm"
    _, y = page.middle("[data-name=gap]")
    mark = page.run("document.querySelector('.slider-mark').getBoundingClientRect().x")
    start = page.run(THUMB)
    if way == "keyboard":
        page.run("document.querySelector('[data-name=gap]').focus()")
        page.key("End")
    else:
        getattr(page, way)(start, y, to=(mark + 4, y))
    settle(page)
    assert text(page, ".verdict").startswith("They agree to 5 %")
    if way == "mouse":  # the keys are the film's again
        page.wait("document.activeElement === document.body")
        page.key("ArrowRight")
        assert page.run("Number(document.querySelector('.time-bar').value)") == 20


def test_a_table_tennis_ball_flies_at_the_second_bounce(page) -> None:
    turn(page, 6)
    page.run("document.querySelector('[data-preset=\"basketball+table-tennis ball\"]').click()")
    settle(page)
    assert rises(page) == ["5.54", "0.718"]
    page.mouse(*page.middle("[data-name=bounces] label:nth-of-type(2)"))
    settle(page)
    assert rises(page)[1] == "3.63"
    page.wait("document.querySelector('.spread').textContent.includes('3.6 to 3.8 drop heights')")


def test_a_pair_of_balls_offers_the_gap_that_is_enough(page) -> None:
    turn(page, 6)
    for pair in ("golf ball+table-tennis ball", "steel ball+small steel ball"):
        page.run(f"document.querySelector('[data-preset=\"{pair}\"]').click()")
        settle(page)
        assert text(page, ".verdict").startswith("They differ")
        page.mouse(*page.middle(".apart"))
        settle(page)
        assert text(page, ".verdict").startswith("They agree")


EVERY = """
(async () => {
  const step = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))), faults = [];
  const look = (what) => {
    const told = document.querySelector('.verdict').textContent;
    const drawn = [...document.querySelectorAll('main [d]')].map((e) => e.getAttribute('d'));
    const shown = document.querySelector('main').textContent + drawn;
    if (!told || /NaN|undefined|Infinity/.test(shown)) faults.push(what);
  };
  const pressed = async (button) => { button.click(); await step(); look(button.outerHTML); };
  for (const button of [...document.querySelectorAll('.presets button')]) await pressed(button);
  for (const radio of document.querySelectorAll('.choice input')) await pressed(radio);
  const names = [...document.querySelectorAll('.sliders input[type=range]')].map((slider) => slider.dataset.name);
  for (const name of names) {
    for (const share of [0, 1, 0.5]) {
      const slider = document.querySelector(`[data-name=${name}]`), low = Number(slider.min), high = Number(slider.max);
      slider.value = Math.round(low + share * (high - low));
      slider.dispatchEvent(new Event('input', { bubbles: true }));
      await step();
      look(`${name} ${share}`);
    }
  }
  for (const button of document.querySelectorAll('.transport button')) await pressed(button);
  return faults;
})()
"""


@pytest.mark.parametrize("scene", ["real-balls", "three-balls", "ball-stack", "newtons-cradle", "bouncing-ball"])
def test_every_control_of_every_scene_answers(blank, story, scene) -> None:
    go(blank, f"{story}#scene={scene}")
    assert blank.run(EVERY) == []


def test_words_are_explained_on_tap(page) -> None:
    page.mouse(*page.middle("[data-term=eps]"))
    assert text(page, ".meaning").startswith("Restitution ε: speed of parting")
    page.mouse(*page.middle("[data-term=eps]"))
    assert page.run("document.querySelector('.meaning')") is None


LABELS = "[...document.querySelectorAll('[aria-label]')].map((e) => e.ariaLabel).join(' ')"


@pytest.mark.parametrize("language", assemble.LANGUAGES)
def test_every_language_fills_every_screen(blank, story, language) -> None:
    go(blank, f"{story}#lang={language}")
    words = assemble.words(language)
    for screen in SCREENS:
        turn(blank, screen)
        assert text(blank, ".story-title") == words[f"s{screen}-title"].replace("\u00a0", " ")
        shown = blank.run("document.body.innerText") + blank.run(LABELS)
        assert not re.search(r"[{}\[\]]|undefined|NaN|\bs\d-|_c\b", shown)
    assert blank.run("document.documentElement.lang") == words["tag"]
    assert blank.run("document.querySelector('.unread').checkVisibility()") is (language != "en")


def test_tables_have_the_same_sentences_terms_numbers_and_units() -> None:
    english = assemble.words("en")
    for language in assemble.LANGUAGES[1:]:
        table = assemble.words(language)
        assert table.keys() == english.keys()
        for key in english.keys() - {"language", "tag", "decimal"}:
            assert shape(table[key], table["decimal"]) == shape(english[key], "."), f"{language}: {key}"


def shape(sentence, decimal):
    """What a translation may not change: places, explained words, numbers, units."""
    bare = re.sub(r"\{[^}]*\}", "", sentence).replace("\u00a0", " ")
    numbers = [x.replace(decimal, ".") for x in re.findall(r"\d+(?:[.,]\d+)?(?!\w)", bare)]
    units = re.findall(r"(?<=\d )(?:m|mm|ms|µm|s|kg)\b", bare)
    places, terms = set(re.findall(r"\{(\w+)", sentence)), re.findall(r"\[\[([\w-]+)\|", sentence)
    return [sorted(x) for x in (places, terms, numbers, units)]


SMALL = """
[...document.querySelectorAll('button:not(.term), select, input[type=range]')].filter((e) => e.checkVisibility())
  .filter((e) => e.offsetHeight < 44 || (e.matches('button') && e.offsetWidth < 44)).map((e) => e.outerHTML)
"""


@pytest.mark.parametrize("width", [320, 360, 640, 768, 1920])
def test_nothing_sticks_out_and_all_targets_are_large(page, width) -> None:
    """640 is a window of 1280 at 200 %."""
    page.size(width, 800, mobile=width < 500)
    for screen in SCREENS:
        turn(page, screen)
        assert page.run("document.documentElement.scrollWidth") <= width, screen
        assert page.run(SMALL) == []


@pytest.mark.parametrize("state", ["screen=5", "scene=real-balls&gap=0.001", "scene=three-balls&lang=de"])
def test_on_a_phone_slider_and_stage_are_seen_together(page, story, state) -> None:
    page.size(390, 844, mobile=True)
    go(page, f"{story}#{state}")
    page.middle("[data-name=gap]")
    stage, slider = (page.run(PLACE % selector) for selector in (".stage svg", "[data-name=gap]"))
    assert all(0 <= top < bottom <= 844 for top, bottom in (stage, slider))
    for value in (0, 300, 600, 900, 1000):
        page.run(f"{{ const s = document.querySelector('[data-name=gap]'); s.value = {value};"
                 " s.dispatchEvent(new Event('input')); }")
        settle(page)
        assert page.run(PLACE % "[data-name=gap]") == pytest.approx(slider, abs=1.0)


PLACE = "(() => { const b = document.querySelector('%s').getBoundingClientRect(); return [b.top, b.bottom]; })()"


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (768, 1024), (390, 844), (360, 740)])
def test_each_screen_of_the_story_opens_with_its_picture_in_view(page, story, width, height) -> None:
    page.size(width, height, mobile=width < 760)
    for screen in range(1, 7):
        go(page, f"{story}#screen={screen}")
        top, bottom = page.run(PLACE % ".theatre")
        assert 0 < top < bottom - 200 < height - 200, screen


def test_a_swipe_that_scrolls_leaves_the_slider_as_it_was(page) -> None:
    page.size(390, 844, mobile=True)
    turn(page, 5)
    x, y = page.middle("[data-name=gap]")
    before = page.run("scrollY")
    page.touch(x - 100, y, to=(x - 100, y - 150))
    page.wait(f"scrollY > {before}")
    assert text(page, "output[for=slider-gap]") == "1 mm"


CONTRAST = (Path(__file__).with_name("contrast.js")).read_text(encoding="utf-8")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_readable(page, scheme) -> None:
    page.media(prefers_color_scheme=scheme)
    for screen in (3, 4, 7):
        turn(page, screen)
        page.run("new Promise((done) => setTimeout(done, 250))")  # colours fade
        assert page.run(CONTRAST) == []
    page.media()


@pytest.mark.parametrize(
    ("link", "scheme"), [("#screen=6&lang=de", "light"), ("#scene=three-balls", "dark"), ("#scene=real-balls", "light")]
)
def test_it_prints_to_one_sheet(page, story, link, scheme) -> None:
    page.media(prefers_color_scheme=scheme)
    go(page, story + link)
    page.run("new Promise((done) => setTimeout(done, 200))")
    paper = page.call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"]
    assert len(re.findall(rb"/Type\s*/Page\b", base64.b64decode(paper))) == 1
    page.media("print", prefers_color_scheme=scheme)
    assert page.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.media()


