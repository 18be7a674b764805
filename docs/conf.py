"""How the documentation is built: ``sphinx-build -W --keep-going -b html docs docs/_build``.

Nothing is fetched: no fonts, scripts or formulas from elsewhere, so the pages work from ``file://``.
"""

import gc
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "extensions")]

import api_index  # noqa: E402
import gallery  # noqa: E402
import pages  # noqa: E402
import start_page  # noqa: E402

import granular  # noqa: E402

project = "granular"
author = "the authors of granular"
copyright = "the authors of granular, MIT licence"
version = release = granular.__version__

QUICK = tags.has("quick")  # noqa: F821
"""``sphinx-build -t quick``: no sources, index or search, and examples are laid out without being run."""
if QUICK:
    gc.disable()  # it is over in seconds; to look for garbage takes one in five of them
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml"]
extensions += [] if QUICK else ["sphinx.ext.viewcode"]
html_use_index = html_domain_indices = not QUICK
STAGE = HERE / "_examples"
if (HERE.parent / "examples").exists():
    extensions.append("sphinx_gallery.gen_gallery")
    for shelf, (folder, header) in gallery.SHELVES.items():
        gallery.stage(sorted((HERE.parent / "examples" / folder).glob("*.py")), STAGE / shelf, header)
MADE = HERE / "_made"
pages.write(MADE)

exclude_patterns = ["_build", "_examples", "_made", "jupyter_execute", "gallery/**.ipynb", "**/.ipynb_checkpoints"]
exclude_patterns += ["**/sg_execution_times.rst", "sg_execution_times.rst"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_url_schemes = {"http": None, "https": None, "mailto": None, "page": {"url": "page/index.html#{{path}}"}}
"""A link such as (page:scene=three-balls&eps=0.7) opens the teaching page in that state."""
html_math_renderer = "mathml"
myst_heading_anchors = 3
suppress_warnings = ["config.cache"]  # sphinx-gallery keeps functions in its settings

nb_execution_mode = "off"  # notebooks are stored with their outputs; tests/docs/test_notebooks.py runs them
nb_ipywidgets_js: dict[str, dict[str, str]] = {}

default_role = "py:obj"
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types, shapes and units
autodoc_default_options = {"members": True}
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
toc_object_entries_show_parents = "hide"

sphinx_gallery_conf = {
    "examples_dirs": [str(STAGE)],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"_examples[\\/](features[\\/](?!sweep_on_dask))?\w+\.py$",  # needs a cluster; not the paper's
    "ignore_pattern": r"(__init__|conftest)\.py",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "image_scrapers": (gallery.figures,),
    "within_subsection_order": gallery.InOrder,
    "plot_gallery": not QUICK,
    "min_reported_time": 10,
}

html_theme = "pydata_sphinx_theme"
html_title = "granular"
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_extra_path = [MADE.name]
html_css_files = ["granular.css"]
html_js_files = ["named.js"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": []}

EMPHASIS = re.compile(r"(``.*?``|`[^`]+`|(?<![\w*])\*\w[^*|]*\*(?![\w*]))")


def spell_for_sphinx(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are written for reading: formulas stay as they are set, |v| and x** are no markup.
    """
    done: list[str] = []
    before, depth, formula, names = "", 0, False, False
    for line in lines:
        if re.match(r"\s*-{3,}$", line):
            names = before.strip() == "Attributes"
        elif names and re.match(r"\s*\w+, .* : ", line):
            line = re.sub(r", (?=.* : )", ",", line)  # "a, b : float" describes two
        indent = len(line) - len(line.lstrip())
        if line.strip():
            if formula and indent <= depth:
                formula = False
            if not formula and done and not done[-1].strip() and indent >= depth + 4:
                formula = True
                if not before.endswith("::"):
                    done += [" " * depth + "::", ""]
            if not formula:
                before, depth = line.rstrip(), indent
        done.append(line if formula else _escaped(line))
    lines[:] = done


def _escaped(line: str) -> str:
    bullet = re.match(r"\s*\* |", line).group()
    parts = EMPHASIS.split(line[len(bullet) :])
    parts[::2] = [re.sub(r"([|*])", r"\\\1", part) for part in parts[::2]]
    return bullet + "".join(parts)


def without_internal_values(
    app: Any, what: str, name: str, obj: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Write `…` for defaults that are limits of the computer, such as the largest integer."""
    return (signature.replace(str(sys.maxsize), "…") if signature else signature), returns


def setup(app: Any) -> None:
    """Connect the helpers above."""
    app.connect("doctree-resolved", gallery.describe)
    app.connect("autodoc-process-signature", without_internal_values)
    api_index.setup(app)
    app.connect("source-read", start_page.add_description)
    if not QUICK:
        app.connect("build-finished", start_page.record_again)
    if QUICK:
        app.connect("builder-inited", lambda app: setattr(app.builder, "search", False))
    app.connect("autodoc-process-docstring", spell_for_sphinx, priority=400)
