"""Directive `public-names`: a table of public names, linked to the reference, with the first lines of docstrings."""

import inspect
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.util.nodes import make_refnode

import granular


class PublicNames(Directive):
    """Table of the names given as content, one per line, for example ``gr.compare``."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the table; `link` adds the links once all pages are read."""
        body = nodes.tbody()
        for name in self.content:
            text = inspect.getdoc(found(name)) or ""
            assert text, f"{name} has no docstring"
            line = nodes.paragraph()
            line += [nodes.literal(part, part) if i % 2 else nodes.Text(part)
                     for i, part in enumerate(text.splitlines()[0].replace("``", "`").split("`"))]
            label = nodes.paragraph("", "", nodes.literal(name, name, public_name=name))
            body += nodes.row("", nodes.entry("", label), nodes.entry("", line))
        columns = [nodes.colspec(colwidth=width) for width in (35, 65)]
        return [nodes.table("", nodes.tgroup("", *columns, body, cols=2), classes=["public-names"])]


def found(name: str) -> Any:
    """Return the object of a name such as ``gr.md.simulate``."""
    thing: Any = granular
    for part in name.split(".")[1:]:
        thing = getattr(thing, part)
    return thing


def targets(name: str) -> list[str]:
    """Return the names under which the reference may list an object: its module and the packages above it."""
    thing = found(name)
    if inspect.ismodule(thing):
        return [thing.__name__]
    parts = str(getattr(thing, "__module__", "granular")).split(".")
    last = getattr(thing, "__qualname__", name.rpartition(".")[2])
    return [".".join([*parts[:n], last]) for n in range(len(parts), 0, -1)]


def link(app: Any, tree: Any, docname: str) -> None:
    """Link the names of the tables to the pages that describe them."""
    known = app.env.get_domain("py").objects
    for node in list(tree.findall(nodes.literal)):
        name = node.get("public_name")
        if name:
            place = next((known[target] for target in targets(name) if target in known), None)
            if place is None:
                raise LookupError(f"{name} is on no page of the reference")
            node.replace_self(make_refnode(app.builder, docname, place.docname, place.node_id, node.deepcopy()))


def setup(app: Any) -> None:
    """Register the directive."""
    app.add_directive("public-names", PublicNames)
    app.connect("doctree-resolved", link)
