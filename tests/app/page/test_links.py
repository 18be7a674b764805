"""Links, frames and policies: the state in which the page opens."""

from html import escape
from pathlib import Path
from urllib.parse import quote, urlparse
from urllib.request import url2pathname

import pytest

import granular as gr
from granular.app.page import assemble, live_page
from tests.app.page.driving import click, fresh, go, slide, text, time_bar


def test_the_link_brings_everything_back(lab, story) -> None:
    click(lab, "[data-scene=newtons-cradle]")
    slide(lab, "n", 7)
    slide(lab, "gap", 300)
    lab.key("ArrowRight")
    lab.wait("location.hash.includes('n=7') && location.hash.includes('at=0.01')")
    link, told = lab.run("location.hash"), text(lab, ".verdict")
    fresh(lab, story + link)
    assert text(lab, ".verdict") == told
    assert (text(lab, "output[for=slider-n]"), time_bar(lab)) == ("7", 20)
    lab.run("location.hash = '#scene=ball-stack&n=99&eps=nonsense'")
    lab.wait("document.querySelector('output[for=slider-massRatio]') !== null")
    assert text(lab, "output[for=slider-n]") == "8"
    assert text(lab, "output[for=slider-eps]") == "0.9"
    assert text(lab, ".notice").startswith("ε cannot be nonsense here (0.1 – 1): 0.9 is shown. N cannot be 99")


@pytest.mark.rotating
@pytest.mark.parametrize("name", ["constructor", "toString", "__proto__"])
def test_a_scene_that_is_none_is_told(blank, story, name) -> None:
    go(blank, f"{story}#scene={name}")
    assert text(blank, ".notice") == f"There is no scene “{name}” here."
    assert text(blank, ".verdict").startswith("No: hard spheres promise the top ball 3.56")


def test_a_value_that_cannot_be_is_told_until_something_changes(blank, story) -> None:
    go(blank, f"{story}#gap=-1")
    assert text(blank, ".notice") == "Δh cannot be -1 here (0, 100 nm – 0.1 m): 0 m is shown."
    slide(blank, "gap", 500)
    assert text(blank, ".notice") == ""


@pytest.mark.parametrize(("key", "values", "top", "shown"), [
    ("guess", ["abc", "-1", "1e9", "11", "1.5.2", "", "NaN"], 10, "–"), ("at", ["abc", "-0.1", "5", ""], 1, "–"),
    ("screen", ["9", "-1", "abc", "", "1#screen=2"], 7, "The laboratory")])
def test_numbers_of_the_page_that_cannot_be_are_told_and_not_changed(blank, story, key, values, top, shown) -> None:
    """guess=-1 was the guess 1, guess=1e9 too, and screen=9 was the laboratory without a word."""
    place = "screen=1&lang=en" if key == "guess" else "lang=en"
    for value in values:
        go(blank, f"{story}#{place}&{key}={value.replace('#', '%23')}")
        told = f"{key} cannot be {value or '–'} here (0 – {top}): {shown} is shown."
        assert text(blank, ".notice") == told
        assert blank.run("document.querySelector('.notice').checkVisibility()")
        blank.wait(f"!location.hash.includes('{key}={value}')" if value else f"!location.hash.includes('{key}=')")
    for value, kept in (("3,5", "3.5"), ("0", "0"), ("+10", "10")) if key == "guess" else ():
        go(blank, f"{story}#{place}&{key}={quote(value)}")
        assert text(blank, ".notice") == ""
        blank.wait(f"location.hash.includes('guess={kept}&')")
        grip = "document.querySelector('.soft .grip').getAttribute('aria-valuetext')"
        assert blank.run(grip) == f"your guess: {kept}"


HOST = """<!doctype html><title>host</title><p>The host's page</p><iframe ATTRIBUTES width=900 height=700></iframe>"""


@pytest.mark.rotating
@pytest.mark.parametrize("sandbox", ["", "sandbox='allow-scripts'"])
@pytest.mark.parametrize("way", ["src", "srcdoc"])
def test_inside_an_iframe_it_stays_what_it_is(blank, live, tmp_path, way, sandbox) -> None:
    """It once replaced itself by the host's page, as about:srcdoc has the host's address for its base."""
    content = live if way == "src" else escape(Path(url2pathname(urlparse(live).path)).read_text(encoding="utf-8"))
    host = HOST.replace("ATTRIBUTES", f'{way}="{content}" {sandbox}')
    (tmp_path / "host.html").write_text(host, encoding="utf-8")
    blank.open((tmp_path / "host.html").as_uri())
    frame = blank.frame()
    blank.wait_in(frame, "performance.getEntriesByName('drawn').length > 0")
    blank.run_in(frame, "document.querySelector('.steps [data-screen=\"5\"]').click()")
    blank.run_in(frame, MOVED)
    blank.run("new Promise((done) => setTimeout(done, 450))")
    after = blank.frame()
    assert blank.run_in(after, "document.querySelector('.story-title').textContent") == "Drag until both agree"
    assert blank.run_in(after, "document.querySelector('h1').textContent") == "Hard or soft?"
    assert blank.run_in(after, "document.querySelector('.soft .grip').getAttribute('aria-valuenow')") == "0"
    assert blank.run("document.querySelector('p').textContent") == "The host's page"


MOVED = """
document.querySelector('.soft .grip').dispatchEvent(new KeyboardEvent('keydown', { key: 'Home', bubbles: true }))
"""


STRICT = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'self'\">"


@pytest.mark.rotating
@pytest.mark.parametrize("policy", [STRICT, STRICT.replace("default", "script")])
def test_where_scripts_are_forbidden_the_page_says_so(tab, live, tmp_path, policy) -> None:
    html = Path(url2pathname(urlparse(live).path)).read_text(encoding="utf-8")
    (tmp_path / "strict.html").write_text(html.replace("<head>", f"<head>{policy}"), encoding="utf-8")
    tab.open((tmp_path / "strict.html").as_uri())
    tab.wait("getComputedStyle(document.querySelector('.blocked')).visibility === 'visible'")
    said = tab.run("document.body.innerText")
    assert all(assemble.words(language)["blocked"] in said for language in assemble.LANGUAGES)


def test_a_page_that_runs_says_nothing_of_it(lab) -> None:
    assert lab.run("document.querySelector('.blocked')") is None
    assert "may not run here" not in lab.run("document.documentElement.outerHTML")


def test_the_page_opens_in_the_state_it_is_asked_for(blank, tmp_path) -> None:
    asked = {"upper": "golf ball", "gap": 2e-3, "pair_rule": "series", "upper_mass": 0.04, "language": "de", "at": 0.5}
    live_page(tmp_path / "golf.html", "real-balls", asked)
    fresh(blank, (tmp_path / "golf.html").as_uri())
    case = gr.cases.make("real-balls", upper="golf ball", gap=2e-3, pair_rule="series")
    assert text(blank, "output[for=slider-gap]") == "2 mm"
    assert text(blank, "output[for=slider-m2]") == "40 g"
    assert text(blank, "output[for=slider-r2]") == f"{1e3 * case.scene.radius[2]:.3g}".replace(".", ",") + " mm"
    assert (text(blank, ".story-title"), time_bar(blank)) == ("Das Labor", 1000)
    assert text(blank, ".notice") == ""


def test_a_link_to_a_file_on_this_disk_is_copied_without_its_path(lab) -> None:
    keep = "{writeText: async (text) => { window.kept = text; }}"
    lab.run(f"Object.defineProperty(navigator, 'clipboard', {{value: {keep}}})")
    click(lab, ".link-button")
    lab.wait("window.kept")
    assert lab.run("window.kept").startswith("#scene=three-balls")
    lab.wait("document.querySelector('.link-button').textContent.includes('#')")
