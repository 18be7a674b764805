"""The laboratory fits two windows, and a lesson is printed from it."""

import math
import re
from base64 import b64decode
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest

from granular.app.page import assemble, live_page
from tests.app.page.browser import Browser, found
from tests.app.page.driving import click, fresh, go, settle, text


@pytest.mark.rotating
def test_the_laboratory_is_two_windows_tall_and_its_charts_fill_it(blank, live) -> None:
    """1600 px at 1280 by 800, every scene as it opens; what is folded is there once it is opened, and drawn as wide."""
    blank.size(1280, 800)
    fresh(blank, f"{live}#screen=7&lang=en")
    for scene in range(blank.run("document.querySelectorAll('.scenes button').length")):
        blank.run(f"document.querySelectorAll('.scenes button')[{scene}].click()")
        blank.run("new Promise((done) => setTimeout(done, 300))")
        assert blank.run("document.documentElement.scrollHeight") <= 1600
        assert blank.run("document.documentElement.scrollWidth") == 1280
        shown = "[...document.querySelectorAll('.graphs > *')].filter((box) => box.offsetHeight)"
        widths = blank.run(f"{shown}.map((box) => [box.clientWidth, box.querySelector('.chart').clientWidth])")
        assert all(chart == box for box, chart in widths), widths
        assert sum(box for box, _ in widths) > 1080
    blank.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    blank.run("new Promise((done) => setTimeout(done, 300))")
    told = "[...document.querySelectorAll('.times .chart, .sliders input, .finals, .csv')]"
    assert min(blank.run(f"{told}.map((one) => one.clientWidth)")) > 80
    blank.is_worn = True


MISFITS = """
[...document.querySelectorAll('.chart, .stage > svg')].flatMap((one) => {
  const isChart = one.matches('.chart'), box = isChart ? one.parentElement : one;
  const [, , wide, tall] = one.getAttribute('viewBox').split(' ').map(Number);
  const fits = wide === box.clientWidth && (isChart || tall === box.clientHeight);
  return box.clientWidth && !fits ? [[box.className, wide, tall, box.clientWidth, box.clientHeight]] : [];
})
"""


def test_pictures_fill_their_boxes_however_a_scene_is_reached(blank, story) -> None:
    """Loaded with it, from a link, by a button, from another screen, in another language, in a lower window."""
    scenes = ["bouncing-ball", "three-balls", "newtons-cradle&lang=de", "ball-stack&n=8", "real-balls"]
    for width in (1366, 390):
        blank.size(width, 768)
        for scene in ("bouncing-ball", "newtons-cradle&gap=0"):
            fresh(blank, f"{story}#scene={scene}")
            assert blank.run(MISFITS) == []
        for link in [state for one in scenes for state in (f"scene={one}", "screen=2")]:
            go(blank, f"{story}#{link}")
            settle(blank)
            assert blank.run(MISFITS) == [], link
        for scene in reversed(scenes):
            click(blank, f".scenes [data-scene={scene.partition('&')[0]}]")
            assert blank.run(MISFITS) == [], scene
        click(blank, ".times summary")
        assert blank.run(MISFITS) == []
        click(blank, ".times summary")
        blank.size(width, 600)
        settle(blank)
        assert blank.run(MISFITS) == []


FIGURES = """
[...document.querySelectorAll('.figure')].map((one) => [...one.children].map((part) => part.textContent))
"""


def test_the_laboratory_speaks_of_the_scene_that_it_shows(blank, story) -> None:
    """One fact is one figure, and a single ball is neither the top one nor in the last of the pairs."""
    told = {}
    for scene in ("bouncing-ball", "three-balls", "newtons-cradle", "ball-stack", "real-balls", "bouncing-ball"):
        if told:
            click(blank, f".scenes [data-scene={scene}]")
        else:
            go(blank, f"{story}#scene={scene}")
        figures = blank.run(FIGURES)
        assert len({tuple(one[1:3]) for one in figures}) == len(figures) == (2 if scene == "bouncing-ball" else 3)
        told[scene] = [text(blank, ".story-text p:nth-child(2)"), figures]
    assert len({suggestion for suggestion, _ in told.values()}) == 5
    assert "paper" in told["three-balls"][0]
    assert [name for name, *_ in told["bouncing-ball"][1]] == ["contacts in all", "height of the ball, in drop heights"]
    assert told["bouncing-ball"][1][0][3] == ""
    assert told["newtons-cradle"][1][0][3] == "of the last pair: 1 and 1"
    names = "[...document.querySelectorAll('.rises .grid text')].map((one) => one.textContent)"
    assert blank.run(names)[-1] == "basketball"


CROSSED = """
[...document.querySelectorAll('.curve, .distance')].filter((box) => box.clientWidth).flatMap((box) => {
  const top = box.querySelector('.playhead').y1.baseVal.value;
  return [...box.querySelectorAll('.count')].filter((one) => one.getBBox().y + one.getBBox().height > top + 3)
    .map((one) => one.textContent);
})
"""


def test_no_number_of_contacts_is_crossed_by_the_marker(blank, story) -> None:
    """Lines end below the numbers, and go behind the words of a chart."""
    for scene in ("three-balls", "ball-stack", "newtons-cradle", "real-balls"):
        go(blank, f"{story}#scene={scene}")
        assert blank.run("document.querySelectorAll('.curve .count').length") > 0
        assert blank.run(CROSSED) == []
    assert blank.run("document.querySelector('.curve .playhead').nextSibling.querySelectorAll('text').length") > 3


def test_a_lens_is_never_empty(blank, story) -> None:
    """Where balls are farther apart than it shows, they are at its rim, and it says no magnification."""
    go(blank, f"{story}#scene=three-balls")
    inside = "[...document.querySelectorAll('.stage .hard .lens-ball')].map((one) => one.cy.baseVal.value)"
    middle, times = "document.querySelector('.stage .hard .lens-rim')", ".stage .hard .lens-times"
    (lower, upper), (cy, r) = blank.run(inside), [blank.run(f"{middle}.{one}.baseVal.value") for one in ("cy", "r")]
    assert lower - 3 * r < cy + r
    assert upper + 3 * r > cy - r
    assert text(blank, times) == ""
    go(blank, f"{story}#scene=real-balls")
    assert re.fullmatch(r"× \d+(\.\d)?", text(blank, times))


@pytest.mark.rotating
@pytest.mark.parametrize("language", assemble.LANGUAGES)
def test_the_laboratory_is_two_windows_tall_in_every_language(blank, live, language) -> None:
    """1600 px at 1280 by 800, real balls and the paper's: these are the tallest."""
    blank.size(1280, 800)
    for scene in ("real-balls", "three-balls"):
        go(blank, f"{live.partition('#')[0]}#scene={scene}&lang={language}")
        blank.run("new Promise((done) => setTimeout(done, 100))")
        named = assemble.words(language)[f"scene-{scene}"].replace("\u00a0", " ")
        assert text(blank, ".scenes [aria-pressed=true]") == named
        assert blank.run("document.documentElement.scrollHeight") <= 1600


CUT = """
[...document.querySelectorAll('.pack > div')].flatMap((page) => {
  const end = (one) => one.getBoundingClientRect().right, parts = page.querySelectorAll('p, h1, h2, td, th, text');
  return [...parts].filter((one) => end(one) > end(one.ownerSVGElement ?? page) + 1).map((one) => one.textContent);
})
"""
TICKED = """
[...document.querySelectorAll('.sheet .causes')].map((one) => [...one.querySelectorAll('b')].map((b) => b.textContent))
"""
GUESSED = """
(() => {
  const ruler = document.querySelector('.sheet + .sheet .ruler-sheet'), box = ruler.getBoundingClientRect();
  const dots = [...ruler.querySelectorAll('circle:not([stroke])')].map((dot) => dot.getBoundingClientRect());
  return [dots.length, dots.every((dot) => dot.top >= box.top && dot.bottom <= box.bottom && dot.right <= box.right)];
})()
"""
NARROWEST = "Math.min(...[...document.querySelectorAll('.blank.open')].map((one) => one.offsetWidth)) * 25.4 / 96"
FILLED = "[...document.querySelectorAll('.sheet:nth-child(%d) .blank')].map((one) => one.textContent.trim())"


@pytest.mark.parametrize("language", [
    one if one in ("en", "de") else pytest.param(one, marks=pytest.mark.soak) for one in assemble.LANGUAGES])
def test_lesson_sheets_fill_three_pages_in_the_words_of_the_page(blank, story, language, tmp_path) -> None:
    """A sheet for pupils, the same sheet filled in, and a page for the teacher, one page of A4 each.

    Afterwards the page is as it was. A page that is a file of one's own has no code, for nobody else could open it.
    """
    pypdf, words = pytest.importorskip("pypdf"), assemble.words(language)
    go(blank, f"{story}#screen=6&guesses=0 4 4 {'4 ' * 16} 10&lang={language}")
    blank.run("window.print = () => {}")
    click(blank, ".pack-button")
    blank.media("print")
    blank.size(695, 1040)  # 184 mm
    assert blank.run(CUT) == []
    assert blank.run(NARROWEST) >= 15.0
    dots, inside = blank.run(GUESSED)
    assert (dots, inside) == (20, True)
    blank.size(1280, 900)
    blank.media()
    paper = blank.call("Page.printToPDF", preferCSSPageSize=True)["data"]
    (tmp_path / "pack.pdf").write_bytes(b64decode(paper))
    pages = pypdf.PdfReader(tmp_path / "pack.pdf").pages
    assert [[round(side * 25.4 / 72) for side in page.mediabox[2:]] for page in pages] == [[210, 297]] * 3
    for i, page in enumerate(pages):  # no dots of a capital letter on the page before
        assert page.extract_text().split("\n")[-1].strip() not in words["pack-teacher"], i
    blanks = blank.run(FILLED % 1)
    assert blanks == ["\u2060"] * len(blanks)
    numbers = [one.replace(words["decimal"], ".") for one in blank.run(FILLED % 2)]
    assert numbers[1:7] == ["3.95", "2.32", words["pack-own"], "0.67", "82", "12"]
    assert sorted(numbers[7:14]) == ["2v", "3v", "4", "7", "9", "v", "v"]
    assert numbers[14:] == ["88", "24", "4.4", "12", "53"]
    assert float(numbers[16]) == pytest.approx(math.sqrt(2 * 9.81), abs=0.05)
    assert blank.run(TICKED) == [["", "", ""], ["", "", "✓"]]
    assert blank.run("document.querySelectorAll('.sheet .shaded').length") == 1
    said = text(blank, ".pack")
    titles = blank.run("[...document.querySelectorAll('.sheet h2')].map((one) => one.textContent)")
    own = [*(f"{n} {words[f's{n}-title']}" for n in range(1, 7)), words["pack-exit"]]
    assert [title.replace("\u00a0", " ") for title in titles] == [one.replace("\u00a0", " ") for one in own] * 2
    assert blank.run("document.querySelectorAll('.pack .board circle').length") == 6
    assert blank.run("document.querySelectorAll('.code').length") == 0
    assert not re.search(r"pack-|undefined|NaN|[{}|\[\]_]", said)
    assert blank.run("document.body.className.includes('packed')") is False
    blank.is_worn = True


def test_on_paper_what_is_folded_is_open(blank, live) -> None:
    """And folded again afterwards, where it was."""
    go(blank, f"{live.partition('#')[0]}#scene=real-balls&lang=en")
    blank.run("document.querySelector('.sliders details').open = true")
    unfolded = "[...document.querySelectorAll('.sliders details')].map((one) => one.open)"
    blank.run("dispatchEvent(new Event('beforeprint'))")
    assert blank.run(unfolded) == [True, True]
    blank.run("dispatchEvent(new Event('afterprint'))")
    assert blank.run(unfolded) == [True, False]
    blank.is_worn = True


class Quiet(SimpleHTTPRequestHandler):
    """Serves files and says nothing."""

    def log_message(self, *what) -> None:
        pass


@pytest.mark.rotating
def test_paper_has_the_code_of_a_page_that_has_an_address(tmp_path) -> None:
    """Of the state that is printed; lesson sheets have that of the opening. Afterwards there is none."""
    if found() is None:
        pytest.skip("no Chromium or Chrome is installed: the pages are not driven here")
    live_page(tmp_path / "page.html")
    coded = "[...document.querySelectorAll('.code')].map((one) => one.getAttribute('aria-label'))"
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path)) as server, Browser() as browser:
        Thread(target=server.serve_forever, daemon=True).start()
        here = f"http://127.0.0.1:{server.server_port}/page.html"
        browser.open(f"{here}#scene=real-balls&lang=de")
        browser.wait("performance.getEntriesByName('settled').length > 0")
        codes, address = browser.run(f"(dispatchEvent(new Event('beforeprint')), [{coded}, location.href])")
        assert codes == [address]
        assert address == f"{here}#scene=real-balls&lang=de"
        browser.run("dispatchEvent(new Event('afterprint'))")
        assert browser.run(coded) == []
        browser.run("window.print = () => {}")
        click(browser, ".pack-button")
        assert browser.run(coded) == [f"{here}#screen=0&lang=de"]
        assert browser.run(CUT) == []
        server.shutdown()


def test_the_scale_of_paths_fits_into_a_picture_on_a_phone(page, story):
    page.size(390, 844)
    for language in ("de", "fr", "es"):
        go(page, f"{story}#scene=three-balls&lang={language}")
        beyond = page.run(
            "[...document.querySelectorAll('.stage svg text')].filter((one) => / × 10$/.test(one.textContent))"
            ".map((one) => one.getBoundingClientRect().right - one.closest('svg').getBoundingClientRect().right)")
        assert len(beyond) == 2, language
        assert max(beyond) <= 0.0, language
    page.size(1280, 900)


def test_the_table_of_tie_rules_comes_with_its_title(own, story) -> None:
    """Before, it stood there with an empty heading until its six runs were made in idle time."""
    script = "globalThis.requestIdleCallback = (work) => (globalThis.later ??= []).push(work)"
    number = own.call("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]
    fresh(own, f"{story}#scene=newtons-cradle&gap=0&lang=en", "drawn")
    own.call("Page.removeScriptToEvaluateOnNewDocument", identifier=number)
    shown = "document.querySelector('.ties-box').checkVisibility()"
    assert own.run(f"[{shown}, later.length > 0]") == [False, True]
    own.run("while (later.length && !document.querySelector('.ties-title').textContent) later.shift()(); 0")
    assert own.run(shown)
    assert text(own, ".ties-title") == "No unique hard-sphere answer"
