"""One browser for all tests that drive the pages, and one teaching page, loaded once where that will do."""

import pytest

from granular.app.page import live_page
from tests.app.page.browser import Browser, found
from tests.app.page.driving import fresh, go


@pytest.fixture(scope="session")
def tab():
    """A tab without a network."""
    if found() is None:
        pytest.skip("no Chromium or Chrome is installed: the pages are not driven here")
    with Browser() as browser:
        browser.is_worn = False
        browser.call(
            "Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0
        )
        yield browser


@pytest.fixture(scope="session")
def story(tmp_path_factory):
    """The address of the teaching page, which opens with its story."""
    path = tmp_path_factory.mktemp("page") / "story.html"
    live_page(path)
    return path.as_uri()


@pytest.fixture(scope="session")
def live(story):
    """The address of its laboratory."""
    return f"{story}#scene=three-balls"


@pytest.fixture
def blank(tab):
    """A tab; afterwards nothing may have been complained about or asked for."""
    tab.size(1280, 900)
    tab.media()
    tab.complaints.clear()
    tab.requests.clear()
    yield tab
    assert tab.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:", "about:")) for url in tab.requests)


@pytest.fixture
def page(blank, story):
    """The story at its beginning."""
    go(blank, story)
    return blank


@pytest.fixture
def lab(blank, live):
    """The paper's two balls in the laboratory."""
    go(blank, live)
    return blank


@pytest.fixture
def own(blank, story):
    """The page loaded for one test, which may do to it what it likes."""
    fresh(blank, story)
    yield blank
    blank.is_worn = True
