"""Film and screenshot of the start page, recorded from the teaching page in a browser.

    python docs/extensions/start_page.py     write the stored copies in docs/_static (needs Chromium)

A full build of the documentation records both again if Chromium is installed. Otherwise the stored copies are shown.
"""

import base64
import io
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

REPO_ROOT = Path(__file__).parents[2]
STATIC_FOLDER = REPO_ROOT / "docs" / "_static"
SCREEN = "#screen=4&lang=en"
"""The screen of the teaching page that shows both models side by side."""
FRAMES, FRAME_TIME, LAST_FRAME_TIME = 50, 100, 1100
"""Number of frames of the film, the time of each frame in ms, and of the last frame: 6 s in all."""
FILM_VIEWPORT, PICTURE_VIEWPORT = (1280, 600), (1280, 760)
"""Width and height of the window in pixels."""
COLOURS = 96
"""Number of colours of stored PNG files."""


@contextmanager
def screen(width: int, height: int) -> Iterator[Any]:
    """Open the screen in a browser window of this size in pixels."""
    from granular.app.page import live_page
    from tests.app.page.browser import Browser

    with tempfile.TemporaryDirectory() as folder, Browser(width, height) as tab:
        live_page(Path(folder) / "page.html")
        tab.open(f"{(Path(folder) / 'page.html').as_uri()}{SCREEN}&at=0.42")
        tab.wait("performance.getEntriesByName('settled').length > 0")
        yield tab


def picture(tab: Any, selector: str | None = None) -> Any:
    """Return what the window or one element shows, as an image."""
    from PIL import Image

    clip = tab.run(f"(({{x, y, width, height}}) => ({{x, y, width, height, scale: 1}}))"
                   f"(document.querySelector({selector!r}).getBoundingClientRect())") if selector else None
    tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    png = base64.b64decode(tab.call("Page.captureScreenshot", **({"clip": clip} if clip else {}))["data"])
    return Image.open(io.BytesIO(png)).convert("RGB")


def record_film(folder: Path) -> None:
    """Write two-balls.webp, a film of both models, and its last frame two-balls.png."""
    frames = []
    with screen(*FILM_VIEWPORT) as tab:
        for n in range(FRAMES):
            tab.run(f"location.hash = '{SCREEN}&at={n / (FRAMES - 1):.5f}'")
            frames.append(picture(tab, ".stage-box"))
    times = [FRAME_TIME] * (FRAMES - 1) + [LAST_FRAME_TIME]
    frames[0].save(folder / "two-balls.webp", save_all=True, append_images=frames[1:], duration=times, loop=0,
                   quality=50, method=5)
    frames[-1].quantize(COLOURS, kmeans=1).save(folder / "two-balls.png", optimize=True)


def record_screenshot(folder: Path) -> None:
    """Write page.png and its description page.txt, which has the title and the answer of the screen."""
    with screen(*PICTURE_VIEWPORT) as tab:
        picture(tab).quantize(COLOURS, kmeans=1).save(folder / "page.png", optimize=True)
        (folder / "page.txt").write_text(description(tab), encoding="utf-8")


def description(tab: Any) -> str:
    """Describe the screen by its own title and answer."""
    title, answer = (tab.run(f"document.querySelector({selector!r}).innerText.replace(/\\s+/g, ' ')")
                     for selector in (".story h2", ".verdict"))
    return (f"The teaching page, screen “{title}”: a tennis ball on a basketball, as hard and as soft spheres side by "
            f"side, and the force of the floor over time. The answer reads: “{answer}”\n")


def add_description(app: Any, name: str, source: list[str]) -> None:
    """Replace `{page-description}` in a source of the documentation."""
    source[0] = source[0].replace("{page-description}", (STATIC_FOLDER / "page.txt").read_text("utf-8").strip())


def record_again(app: Any, error: Exception | None) -> None:
    """Record film and screenshot for a full build, if Chromium is installed."""
    sys.path.insert(0, str(REPO_ROOT))
    from tests.app.page.browser import found

    if error is None and found():
        record_film(Path(app.outdir) / "_static")
        record_screenshot(Path(app.outdir) / "_static")


if __name__ == "__main__":
    sys.path.insert(0, str(REPO_ROOT))
    record_film(STATIC_FOLDER)
    record_screenshot(STATIC_FOLDER)
