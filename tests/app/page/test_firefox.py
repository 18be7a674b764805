"""The teaching page in another browser: it says the same, to the digit, and shows balls at the same places."""

import pytest

from tests.app.page.driving import VISITS
from tests.app.page.fox import Fox, found

STATES = ["screen=1&lang=de", "screen=5&lang=zh", "scene=real-balls&gap=0.01", "scene=newtons-cradle&eps=0.8&lang=fr"]
SETTLED = """new Promise((done) => {
  const see = () => performance.getEntriesByName('settled').length ? done(true) : setTimeout(see, 10);
  see();
})"""
SEEN = """new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done({
  said: ['.story-text', '.verdict-words', '.because', '.figures', '.sliders', '.told']
    .map((part) => document.querySelector(part)?.textContent),
  tops: [...document.querySelectorAll('.stage .top-value, .rises .bar-value')].map((top) => top.textContent),
  faces: [...document.querySelectorAll('.stage .face')].filter((face) => face.checkVisibility()).flatMap((face) => {
    const { e, f, a } = face.getCTM();
    return [e, f, a];
  }),
  spills: document.documentElement.scrollWidth > innerWidth,
}))))"""
ENDED = """new Promise((done) => {
  const bar = document.querySelector('.time-bar');
  bar.value = 2000;
  bar.dispatchEvent(new Event('input'));
  setTimeout(done, 50);
})"""
MOVED = """new Promise((done) => {
  const slider = document.querySelector('.sliders input[type=range]');
  if (slider) {
    slider.value = slider.max * 0.7;
    slider.dispatchEvent(new Event('input', { bubbles: true }));
  }
  setTimeout(done, 50);
})"""


def alike(one, other):
    """Whether two browsers say the same, and show balls at the same places."""
    same = [one[part] == other[part] for part in ("said", "tops", "spills")]
    return all(same) and one["faces"] == pytest.approx(other["faces"], abs=2.0)


@pytest.fixture(scope="module")
def fox():
    if found() is None:
        pytest.skip("no Firefox is installed: the page is driven in Chromium only")
    with Fox() as fox:
        fox.call("WebDriver:SetWindowRect", width=1280, height=900 + 900 - fox.run("innerHeight"))
        assert fox.run("innerHeight") == 900
        yield fox


@pytest.mark.rotating
@pytest.mark.parametrize("state", STATES)
def test_firefox_says_and_shows_the_same(blank, fox, story, state) -> None:
    """As a state opens, at the end of its film, and after a slider has been moved; who is slow is waited for."""
    blank.media(prefers_reduced_motion="reduce")
    for browser in (blank, fox):
        browser.open(f"{story}?visit={next(VISITS)}#{state}" + ("" if "lang" in state else "&lang=en"))
    for act in (SETTLED, ENDED, MOVED):
        blank.run(act)
        fox.run(act)
        for _ in range(50):
            one, other = blank.run(SEEN), fox.run(SEEN)
            if alike(one, other):
                break
        assert alike(one, other), (state, one, other)
        assert not one["spills"]
    assert not fox.run("document.querySelectorAll('.blocked').length")
    blank.media()
    blank.is_worn = True
