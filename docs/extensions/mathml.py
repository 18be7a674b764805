"""Formulas as MathML, set while the site is built: browsers draw them, without script or network.

The conversion from LaTeX is that of docutils, which Sphinx is built on. What it cannot read is a warning.
"""

import html
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.logging import getLogger
from sphinx.util.math import get_node_equation_number


def setup(app: Any) -> dict[str, bool]:
    """Offer the renderer."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def inline(writer: Any, node: Any) -> None:
    """A formula within a line."""
    writer.body.append(mathml(node))
    raise SkipNode


def block(writer: Any, node: Any) -> None:
    """A formula on a line of its own, with its number if it has a label."""
    anchors = "".join(f'<span id="{name}"></span>' for name in node.get("ids", ()))
    number = ""
    if node["number"]:
        number = f'<span class="eqno">({get_node_equation_number(writer, node)})</span>'
    formula = mathml(node).replace("<math ", '<math display="block" ', 1)
    writer.body.append(f'<div class="math-block" role="group">{anchors}{formula}{number}</div>\n')
    raise SkipNode


def mathml(node: Any) -> str:
    """The formula of a node; as it was written, with a warning, if it cannot be read."""
    text = node.astext()
    try:
        formula = str(tex2mathml(text)).replace(">|</mo>", ' lspace="0" rspace="0">|</mo>')  # bars stand close
        return formula.replace("<mtable", '<mtable displaystyle="true"')  # fractions in rows as large as elsewhere
    except Exception as error:
        getLogger(__name__).warning("no formula: %s (%s)", text, error, location=node)
        return f"<code>{html.escape(text)}</code>"
