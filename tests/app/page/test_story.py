"""The story of the teaching page, driven as pupils would, in any language."""

import re

import pytest

from granular.app.page import assemble
from tests.app.page.driving import go, last_picture, settle, text, turn

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
