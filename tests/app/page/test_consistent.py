"""Odd links, a film dragged to its end, and sentences that stand beside each other."""

import re
from urllib.parse import parse_qsl

import pytest

import granular as gr
from granular.app.page import assemble, live_page
from tests.app.page.driving import click, fresh, go, last_picture, settle, slide, text

LOWEST = "Math.max(...[...document.querySelectorAll('.stage, .play')].map((e) => e.getBoundingClientRect().bottom))"


@pytest.mark.parametrize(("width", "height"), [(1366, 768), (1280, 800), (390, 844)])
def test_a_named_opening_plays_once_above_the_fold(tab, tmp_path, width, height) -> None:
    live_page(tmp_path / "named.html", "three-balls", {"language": "en"})
    tab.size(width, height, mobile=width < 500)
    fresh(tab, (tmp_path / "named.html").as_uri())
    assert tab.run(LOWEST) <= height
    assert tab.run("document.querySelector('.play').getAttribute('aria-label')") == "pause"  # it plays
    click(tab, ".predict-button")
    assert tab.run("document.querySelector('.play').getAttribute('aria-label')") == "play"
    tab.is_worn = True


def test_links_carry_the_names_of_balls(blank, story) -> None:
    """They were seven numbers per ball, and a name was ignored without a word."""
    fresh(blank, f"{story}#scene=real-balls&lower=football&upper=tennis ball&lang=en")
    names = "[...document.querySelectorAll('.stage .soft .ball-name')].map((one) => one.textContent)"
    assert blank.run(names) == ["football", "tennis ball"]
    assert text(blank, ".notice") == ""
    go(blank, f"{story}#scene=real-balls&lower=steel ball&upper=golf ball&m2=0.05&lang=en")
    slide(blank, "gap", 500)
    blank.wait("location.hash.includes('gap=0.0001')")
    link = dict(parse_qsl(blank.run("location.hash")[1:]))
    assert link.keys() == {"scene", "gap", "m2", "r2", "t2", "e2", "air2", "lower", "lang"}
    assert (link["lower"], link["m2"]) == ("steel ball", "0.05")
    go(blank, f"{story}#scene=bouncing-ball&ball=golf ball&lang=en")
    assert blank.run(names) == ["golf ball"]


@pytest.mark.parametrize("width", [1366, 390])
def test_numbers_stay_beside_their_units(page, story, width) -> None:
    """Lines ended with "1" and began with "m"."""
    page.size(width, 844, mobile=width < 500)
    for language in ("en", "fr"):
        for screen in range(7):
            go(page, f"{story}#screen={screen}&lang={language}")
            words = page.run("['.story', '.verdict'].map((part) => document.querySelector(part).innerText).join()")
            assert not re.search(r"\d (m|mm|ms|µm|s|%)\b", words)


SHOWN = "document.querySelector(%r).checkVisibility()"


@pytest.mark.parametrize(("link", "notice"), [
    ("screen=6&rule=9", "cannot be 9 here (lens rule, springs in series): springs in series is shown."),
    ("scene=real-balls&bounces=3", "watch the flight after cannot be 3 here (the first bounce, the second bounce)"),
    ("scene=real-balls&air1=2", "filled with air cannot be 2 here (no, yes): yes is shown."),
    ("scene=three-balls&gap=", "cannot be – here"), ("scene=three-balls&eps=Infinity", "cannot be Infinity here"),
    ("scene=newtons-cradle&n=2&moving=8", "cannot be 8 here (1 – 1): 1 is shown."),
    ("scene=three-balls&foo=3", "There is no setting “foo” here."),
    ("scene=three-balls&lower=football", "There is no setting “lower” here."),
    ("scene=real-balls&lower=medicine ball", "lower cannot be medicine ball here (basketball, football, volleyball"),
])
def test_an_odd_link_opens_the_page_and_is_told(blank, story, link, notice) -> None:
    fresh(blank, f"{story}#{link}&lang=en")
    assert notice in text(blank, ".notice")
    assert text(blank, ".verdict-words")
    blank.is_worn = True


def test_what_is_covered_says_nothing_and_is_whole_afterwards(own, story) -> None:
    go(own, f"{story}#scene=three-balls&lang=en")
    click(own, ".predict-button")
    for part in (".verdict-box", ".because", ".distance-box", ".figures-box"):
        assert not own.run(SHOWN % part), part
    own.run("{ const g = document.querySelector('.guess'); g.value = 100; g.dispatchEvent(new Event('input')); }")
    own.run("document.querySelector('.run').disabled = false")
    click(own, ".run")
    last_picture(own)  # by hand
    settle(own)
    assert text(own, ".told").startswith("You guessed 1 drop heights. Hard spheres give 3.56, soft spheres 0.53")
    assert own.run(SHOWN % ".distance-box")
    width = "document.querySelector('.distance svg').%s"
    assert abs(own.run(width % "viewBox.baseVal.width") - own.run(width % "clientWidth")) <= 2


def test_a_no_is_not_called_agreement(own, story) -> None:
    go(own, f"{story}#scene=newtons-cradle&predict=1&lang=en")
    own.run("{ const g = document.querySelector('.guess'); g.value = 100; g.dispatchEvent(new Event('input')); }")
    click(own, ".run")
    last_picture(own)
    settle(own)
    assert "both agree" not in text(own, ".told")
    assert text(own, ".verdict-words").startswith("No")


BALLS = "document.querySelector('[data-preset=\"%s\"]').click()"


def test_at_the_second_bounce_words_and_heights_go_together(page, story) -> None:
    go(page, f"{story}#screen=6&lang=en")
    page.run(BALLS % "basketball+tennis ball")
    page.run("document.querySelector('[data-name=bounces] input[value=\"1\"]').click()")
    settle(page)
    assert text(page, ".because-line").startswith("Nothing overlaps at this bounce.")
    football, tennis = "m1=0.43&r1=0.11&t1=0.009&e1=0.84&air1=1", "m2=0.0577&r2=0.033&t2=0.005&e2=0.78&air2=1"
    go(page, f"{story}#screen=6&{football}&{tennis}&gap=0.02&bounces=2&lang=en")
    assert text(page, ".verdict-words").startswith("Yes, up to the ball’s next bounce: the error is 0.54 %")


def test_far_from_right_is_not_nearly(page, story) -> None:
    go(page, f"{story}#screen=6&lang=en")
    superball, small = "m1=0.045&r1=0.0225&t1=0.004&e1=0.88&air1=0", "m2=0.0098&r2=0.0135&t2=0.0024&e2=0.88&air2=0"
    go(page, f"{story}#screen=6&{superball}&{small}&gap=0.005&bounces=1&lang=en")
    assert text(page, ".verdict-words") == (
        "No, though the heights agree, 3.62 and 3.58 m; the superball leaves at 1.56 instead of 1.09 m/s; the error is"
        " 5.6 %.")


def test_touching_balls_are_told_with_the_heights_of_two_rules(page, story) -> None:
    """The lens calls a rounding residue touching, and the laboratory opens as the story does."""
    go(page, f"{story}#scene=real-balls&lang=en")
    assert text(page, "output[for=slider-gap]") == "1 mm"
    go(page, f"{story}#scene=real-balls&gap=0&lang=en")
    assert text(page, ".verdict-words") == (
        "Not uniquely: the balls touch, and hard spheres have more than one answer: 3.95 or 0.672 drop heights for the"
        " top ball (tie rules “one by one, the lower first” and “at once, Poisson”); soft spheres give 2.19.")
    go(page, f"{story}#scene=newtons-cradle&gap=0&at=0&lang=en")
    lens = "[...document.querySelectorAll('.lens-value')].map((one) => one.textContent)"
    assert page.run(lens) == ["0, touching"] * 2
    page.size(390, 844, mobile=True)
    go(page, f"{story}#scene=real-balls&gap=0&lang=de")
    ends = "['.lens-value', 'svg'].map((one) => document.querySelector(`.stage ${one}`).getBoundingClientRect().right)"
    word, view = page.run(ends)
    assert word <= view


def test_held_as_far_apart_as_is_offered_the_answer_is_yes(page, story) -> None:
    for lower, upper, gap in gr.balls.PRESETS:
        go(page, f"{story}#screen=6&lang=en")
        page.run(BALLS % f"{lower}+{upper}")
        settle(page)
        click(page, ".apart")
        nearly = (lower, upper) == ("basketball", "table-tennis ball")  # gravity acts during the long contact, too
        assert text(page, ".verdict-words").startswith("No, but nearly" if nearly else "Yes"), gap


@pytest.mark.rotating
@pytest.mark.parametrize("language", ["en", "de", "fr", "es", "tr", "zh"])
def test_on_a_phone_words_of_the_last_picture_do_not_meet(blank, story, language) -> None:
    blank.size(390, 844, mobile=True)
    for state in ("screen=4", "screen=6"):
        go(blank, f"{story}#{state}&lang={language}")
        last_picture(blank)
        settle(blank)
        boxes = blank.run(
            "[...document.querySelectorAll('.stage svg')].map((s) => [s.getBoundingClientRect().toJSON(), ..."
            "[...s.querySelectorAll("
            "'.stage-name, .ruler text, .top-line, .top-value, :scope > .ruler-tick, .ball-name')]"
            ".filter((t) => t.textContent && t.checkVisibility({ visibilityProperty: true }))"
            ".map((t) => t.getBoundingClientRect().toJSON())])")
        for stage, *words in boxes:
            for i, one in enumerate(words):
                assert one["right"] <= stage["right"] + 1, (state, one)
                for other in words[:i]:
                    apart = (one["right"] <= other["left"] or other["right"] <= one["left"]
                             or one["bottom"] <= other["top"] + 2 or other["bottom"] <= one["top"] + 2)
                    assert apart, (state, one, other)


@pytest.mark.rotating
@pytest.mark.parametrize("link", [
    "scene=ball-stack&gap=0.01", "scene=ball-stack&gap=0.1&n=8", "scene=three-balls&gap=0.1",
])
def test_balls_held_far_apart_are_in_the_picture(blank, story, link) -> None:
    go(blank, f"{story}#{link}&lang=en")
    settle(blank)
    tops = blank.run("[...document.querySelectorAll('.stage .ball .face')].map((b) => b.getBoundingClientRect().top"
                     " - b.closest('.stage svg, svg').getBoundingClientRect().top)")
    assert min(tops) > -2


ALL_CONTACTS = ["all contacts together", "alle Kontakte zusammen", "tous contacts réunis", "todos los contactos juntos",
                "bütün temaslar birlikte", "所有接触合计"]


@pytest.mark.parametrize(("language", "counted"), list(zip(assemble.LANGUAGES, ALL_CONTACTS, strict=True)))
def test_the_share_of_one_push_is_not_taken_for_that_of_all_contacts(page, story, language, counted) -> None:
    """Text and curve give 88 % of the floor's push. The tile gives 89 % of the impulse of all contacts."""
    case = gr.cases.make("real-balls", lower="basketball", upper="tennis ball", gap=1e-3, height=1.0, pair_rule="lens")
    soft = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end).soft
    go(page, f"{story}#scene=real-balls&lang={language}")
    tile = text(page, ".figure:nth-child(3)")
    assert counted in tile
    assert f"{100.0 * gr.measures.shared_impulse(soft):.0f}" in re.findall(r"\d+", tile)
    places = ".because-line", ".push-key > :nth-child(2)"
    pushes = [re.findall(r"\d+(?= ?%)|(?<=%)\d+", text(page, place)) for place in places]
    assert pushes[0] == pushes[1]
    assert pushes[0][0] not in re.findall(r"\d+", tile)
