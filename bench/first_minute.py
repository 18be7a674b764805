"""Film, picture and screenshot of the start page.

    python bench/first_minute.py        write docs/_static/two-balls.gif, two-balls.png and page.png (needs Chromium)
    python bench/first_minute.py film   write only two-balls.gif and two-balls.png

`Comparison.animate` draws the film of the paper's base scene, with balls and a ruler only. The picture is the last
frame. tests/docs/test_figures.py compares the stored numbers of the film with recomputed numbers.
"""

from __future__ import annotations

import base64
import sys
import tempfile
from pathlib import Path
from typing import Any

import docs_data

import granular as gr
from granular.app.page import live_page

REPO_ROOT = Path(__file__).parents[1]
STATIC_FOLDER = REPO_ROOT / "docs" / "_static"
FILM_OPTIONS: dict[str, Any] = {"seconds": 5.0, "fps": 12, "charts": False}


def report() -> Any:
    """Comparison of both engines on the base scene of the paper."""
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    return gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))


def film_numbers() -> Any:
    """Numbers shown in the film: the verdict, the contact times and the rises."""
    seen = report()
    log = [run.contacts[["pair", "t_begin", "duration"]].tolist() for run in seen.counted]
    return docs_data.json_values({"verdict": seen.verdict, "contacts": log, "rises": seen.rises})


def screenshot(path: Path, width: int = 1280, height: int = 1130) -> None:
    """Save the fourth screen of the teaching page, which is about real balls."""
    sys.path.insert(0, str(REPO_ROOT))
    from tests.app.page.browser import Browser

    with tempfile.TemporaryDirectory() as folder, Browser(width, height) as tab:
        live_page(Path(folder) / "page.html")
        tab.open((Path(folder) / "page.html").as_uri() + "#screen=4&at=0.42&lang=en")
        tab.wait("performance.getEntriesByName('settled').length > 0")
        tab.run("new Promise((done) => setTimeout(done, 1000))")
        path.write_bytes(base64.b64decode(tab.call("Page.captureScreenshot", format="png")["data"]))


def main() -> None:
    """Write the film and the picture, and the screenshot unless "film" is given."""
    from PIL import Image

    film = STATIC_FOLDER / "two-balls.gif"
    report().animate(film, **FILM_OPTIONS)
    with Image.open(film) as pictures:
        pictures.seek(pictures.n_frames - 1)
        pictures.convert("RGB").quantize(64).save(STATIC_FOLDER / "two-balls.png", optimize=True)
    docs_data.store("first-minute")
    if "film" in sys.argv[1:]:
        return
    screenshot(STATIC_FOLDER / "page.png")
    with Image.open(STATIC_FOLDER / "page.png") as picture:
        picture.convert("RGB").quantize(96).save(STATIC_FOLDER / "page.png", optimize=True)


if __name__ == "__main__":
    main()
