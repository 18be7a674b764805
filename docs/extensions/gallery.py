"""The gallery: examples as pages with titles, and with their figures as images.

The first line of the docstring of an example is its title, the rest its description. Its variable `figure` is drawn.
"""

import html
import re
from pathlib import Path
from typing import Any

HEADER = """\
Examples
========

Findings: published results, compared with hard spheres and with Newton's equation. Each page also states the new
result.
"""
FEATURES = "Features\n========\n\nShort examples with their output and figures.\n"
PAPER = """\
The paper's figures
===================

Scripts of the figures in :doc:`/theory/paper`. Each script writes its figure and the numbers in it, for example
``python examples/paper/sequence.py -o x.png --json x.json``.
"""
SHELVES = {"": ("findings", HEADER), "features": ("", FEATURES), "paper": ("paper", PAPER)}
"""Where scripts are shown, in that order: their folder in ``examples/``, and the words above them."""
FIGURES = Path(__file__).parents[1] / "figures"


def stage(scripts: list[Path], folder: Path, header: str) -> None:
    """Lay examples out anew: with a header, and their first line as a title. Files that stay the same are left.

    A script whose figure is stored, ``figures/FOLDER-NAME.png``, has that for its picture.
    """
    folder.mkdir(exist_ok=True)
    (folder / "GALLERY_HEADER.rst").write_text(header)
    for old in {path.name for path in folder.glob("*.py")} - {path.name for path in scripts}:
        (folder / old).unlink()
    for script in scripts:
        source = script.read_text(encoding="utf-8")
        if heading := re.match(r'"""(.*?)(?:"""|\n)', source):
            title = heading[1].rstrip(".")
            stored = FIGURES / f"{folder.name}-{script.stem.replace('_', '-')}.png"
            picture = f"\n.. image:: /figures/{stored.name}\n   :alt: {title}\n" if stored.exists() else ""
            source = f'"""\n{title}\n{"=" * len(title)}\n{picture}{source[heading.end(1) :]}'
            source += f'\n# sphinx_gallery_thumbnail_path = "figures/{stored.name}"\n' if picture else ""
        staged = folder / script.name
        if not staged.exists() or staged.read_text(encoding="utf-8") != source:
            staged.write_text(source, encoding="utf-8")


class InOrder:
    """Sort the examples as a reader would try them; what is not named comes last, by its name."""

    NAMES = ("detachment", "domino", "kerwin", "cradle", "engines", "bouncing", "tapered", "collapse",
             "rebound", "pi", "touching", "cooling",
             "clumps", "waves", "three_balls", "kerwin_stack", "newtons_cradle", "cooling_gas", "your_own_law",
             "your_own_rule",
             "bouncing_on_a_plate", "hertz_chain", "where_edmd_breaks", "error_against_run_time",
             "sketch", "forces", "sequence", "counts", "gap", "radii", "viscoelastic", "viscoelastic_material",
             "validity", "breakdown", "predictors", "material", "setting")

    def __init__(self, folder: str) -> None:
        """Take the folder, which does not matter."""

    def __call__(self, name: str) -> tuple[int, str]:
        """The place of a file."""
        stem = Path(name).stem
        return (self.NAMES.index(stem) if stem in self.NAMES else len(self.NAMES)), stem


def figures(block: Any, block_vars: dict[str, Any], settings: dict[str, Any]) -> str:
    """Save what an example calls `figure`, once, and say where it stands on the page (a scraper of sphinx-gallery)."""
    from sphinx_gallery.scrapers import figure_rst

    drawn = block_vars["example_globals"].pop("figure", None)
    if drawn is None:
        return ""
    path = next(block_vars["image_path_iterator"])
    drawn.savefig(path, dpi=200)
    return str(figure_rst([path], settings["src_dir"], title_of(block_vars["src_file"])))


def title_of(path: str) -> str:
    """The title of a staged example."""
    return Path(path).read_text(encoding="utf-8").splitlines()[1]


def describe(app: Any, tree: Any, docname: str) -> None:
    """Name the pictures of the gallery, which sphinx-gallery leaves without words, by the titles below them."""
    from docutils import nodes

    for link in tree.findall(nodes.reference):  # links to the teaching page are written relative to the top
        if link.get("refuri", "").startswith("page/"):
            link["refuri"] = "../" * docname.count("/") + link["refuri"]
    unnamed = []
    for node in list(tree.findall()) if re.match("gallery/(.*/)?index$", docname) else []:
        if isinstance(node, nodes.image) and not node.get("alt"):
            unnamed.append(node)
        elif isinstance(node, nodes.raw) and (title := re.search(r'thumbnail-title">([^<]+)<', node.astext())):
            while unnamed:
                unnamed.pop()["alt"] = html.unescape(title[1])
