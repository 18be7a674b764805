"""Hands and eyes of the tests that drive the pages."""

from itertools import count

VISITS = count()
PAINTED = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
ARRIVED = """
new Promise((done) => {
  addEventListener('hashchange', () => requestAnimationFrame(() => requestAnimationFrame(done)), { once: true });
  document.activeElement.blur();
  scrollTo(0, 0);
  location.hash = 'STATE';
})
"""


def fresh(tab, url, drawn="settled"):
    """Load a page; under another address than before, so that its link alone does not stand for it."""
    path, hash_sign, state = url.partition("#")
    tab.complaints.clear()
    tab.requests.clear()
    tab.open(f"{path}?visit={next(VISITS)}{hash_sign}{state}")
    tab.wait(f"performance.getEntriesByName('{drawn}').length > 0")


def go(tab, url):
    """Bring the page into a state by its link, without loading it again if it is there: a fifth of the work."""
    path, _, state = url.partition("#")
    if tab.run("location.href.split(/[?#]/)[0]") != path or tab.is_worn:
        tab.is_worn = False
        fresh(tab, url)
    else:
        language = "" if "lang=" in state else "&lang=en"
        tab.run(ARRIVED.replace("STATE", f"{state or 'screen=0'}{language}{'&' * (1 + next(VISITS) % 40)}"))


def settle(tab):
    tab.run(PAINTED)


def text(tab, selector):
    return tab.run(f"document.querySelector({selector!r}).textContent").replace("\u00a0", " ")


def click(tab, selector):
    tab.run(f"document.querySelector({selector!r}).click()")
    settle(tab)


def named(tab, label):
    """Click the button of that name."""
    tab.run(f"[...document.querySelectorAll('button')].find((b) => b.textContent === {label!r}).click()")
    settle(tab)


def slide(tab, name, value):
    """Move a slider of the page as a hand would."""
    tab.run(
        f"{{ const s = document.querySelector('[data-name={name}]'); s.value = {value};"
        " s.dispatchEvent(new Event('input', {bubbles: true})); }"
    )
    settle(tab)


def time_bar(tab):
    return tab.run("Number(document.querySelector('.time-bar').value)")


def turn(tab, screen):
    tab.run(f"document.querySelector('.steps [data-screen=\"{screen}\"]').click()")


def last_picture(tab):
    """Bring the film to its end and return the heights at its ticks, bottom to top: hard, soft."""
    tab.run("{ const b = document.querySelector('.time-bar'); b.value = 2000; b.dispatchEvent(new Event('input')); }")
    ticks = "[...document.querySelectorAll('.stage .%s .top-value')].map((tick) => Number(tick.textContent))"
    return [tab.run(ticks % engine) for engine in ("hard", "soft")]
