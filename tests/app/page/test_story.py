"""The story of the teaching page, driven as pupils would: by mouse, keyboard and finger, in any language, on paper."""

import base64
import re
from pathlib import Path

import pytest

from granular.app.page import assemble
from tests.app.page.driving import click, go, last_picture, settle, text, turn

SCREENS = range(8)


WORDS = """
[...document.querySelectorAll('h1, .story-title, .story-text p, button, .verdict, .told')]
  .filter((e) => e.checkVisibility()).flatMap((e) => e.innerText.trim().split(/\\s+/)).filter(Boolean)
"""


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)])
def test_it_opens_with_the_drop_and_few_words(own, width, height) -> None:
    own.size(width, height, mobile=width < 500)
    assert len(own.run(WORDS)) <= 25
    assert text(own, ".story-next") == "Your guess"
    assert own.run("document.querySelector('.story-next').getBoundingClientRect().bottom") <= height
    ball = "document.querySelector('.stage .soft .ball:last-child').getAttribute('transform')"
    before = own.run(ball)
    own.wait(f"{ball} !== {before!r}")  # it plays by itself
    own.key(" ")
    assert own.run("document.querySelector('.play').getAttribute('aria-label')") == "play"
    assert own.run("document.querySelectorAll('.stage .top-value').length") == 0  # nothing is given away


def test_the_story_begins_with_the_drop_and_ends_in_the_laboratory(own) -> None:
    titles = [text(own, ".story-title")]
    for _ in range(7):
        own.mouse(*own.middle(".story-next"))
        settle(own)
        titles.append(text(own, ".story-title"))
    assert (titles[0], titles[-1]) == ("How high will the small ball fly?", "The laboratory")
    assert len(set(titles)) == 8
    own.run("history.back()")
    own.wait("document.body.dataset.screen === '6'")
    own.wait("location.hash.startsWith('#screen=6')")


def test_one_ball_bounces_alike_in_both_pictures(page) -> None:
    turn(page, 2)
    for ball in ("golf ball", "steel ball", "superball"):
        page.run(f"document.querySelector('[data-preset=\"{ball}\"]').click()")
        settle(page)
        hard, soft = last_picture(page)
        assert soft == pytest.approx(hard, rel=0.02)
        assert len(hard) == 1


def test_the_textbook_says_nine_then_seven_then_four(page) -> None:
    turn(page, 3)
    heights = []
    for preset in ("textbook", "masses", "losses"):
        page.run(f"document.querySelector('[data-preset={preset}]').click()")
        settle(page)
        heights.append(last_picture(page)[0][-1])
    assert [round(height) for height in heights] == [9, 7, 4]
    assert page.run("document.querySelector('.stage .soft').checkVisibility()") is False


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


def test_a_guess_comes_before_what_is_next(own) -> None:
    """By keyboard, too. There is one question, and what is for the teacher is folded."""
    own.mouse(*own.middle(".story-next"))
    settle(own)
    order = own.run("[...document.querySelectorAll('.grip, .run, .story-next')].map((one) => one.classList[0])")
    assert order.index("story-next") > order.index("run") > order.index("grip")
    colour = "getComputedStyle(document.querySelector('.story-next')).backgroundColor"
    assert own.run(colour) == "rgba(0, 0, 0, 0)"
    assert not own.run("document.querySelector('.predict .question').checkVisibility()")
    assert not own.run("document.querySelector('.class-guesses').checkVisibility()")
    own.media(prefers_reduced_motion="reduce")  # the film is its last picture
    own.mouse(*own.middle(".stage .soft"))
    own.mouse(*own.middle(".run"))
    own.wait(f"{colour} !== 'rgba(0, 0, 0, 0)'")
    own.media()


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


@pytest.mark.rotating
@pytest.mark.parametrize("scene", ["real-balls", "three-balls", "ball-stack", "newtons-cradle", "bouncing-ball"])
def test_every_control_of_every_scene_answers(blank, story, scene) -> None:
    go(blank, f"{story}#scene={scene}")
    assert blank.run(EVERY) == []


def test_words_are_explained_on_tap(page) -> None:
    turn(page, 2)
    page.mouse(*page.middle("[data-term=eps]"))
    assert text(page, ".meaning").startswith("Restitution ε: speed of separation")
    page.mouse(*page.middle("[data-term=eps]"))
    assert page.run("document.querySelector('.meaning')") is None


LABELS = "[...document.querySelectorAll('[aria-label]')].map((e) => e.ariaLabel).join(' ')"


@pytest.mark.rotating
@pytest.mark.parametrize("language", assemble.LANGUAGES)
def test_every_language_fills_every_screen(blank, story, language) -> None:
    go(blank, f"{story}#screen=0&lang={language}")
    words = assemble.words(language)
    for screen in SCREENS:
        if screen:
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


def test_the_shared_part_of_the_push_is_named_by_what_both_themes_show(blank, story) -> None:
    """It was "the dark part", which is the light one in the dark theme."""
    for dark, language in zip(["dark", "dunkel", "foncé", "oscur", "koyu", "深色"], assemble.LANGUAGES, strict=True):
        assert dark not in assemble.words(language)["s4-b"].lower()
    for scheme in ("light", "dark"):
        blank.media(prefers_color_scheme=scheme)
        go(blank, f"{story}#screen=4&lang=en")
        fill = "getComputedStyle(document.querySelector('.push-%s')).fill"
        fills = [blank.run(fill % part) for part in ("all", "both")]
        assert fills[0] == "none" != fills[1]
    blank.media()


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
