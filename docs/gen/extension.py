"""Sphinx's extension: pages made from the code, figures in the page, mathematics as MathML.

A page asks for a figure with the directive `drawn` and its name; it comes as SVG in the page
itself, so that it follows light and dark. A page under reference/ that only says that it is made
from the code is replaced by what the code says.
"""

import html
import re
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from latex2mathml.converter import convert
from sphinx.application import Sphinx

from docs.gen.figures import drawn
from docs.gen.reference import PAGES

FUNCTION = re.compile(r"<mi>(sin|cos|arccos)</mi>")
SPACED = r'<mspace width="0.17em"/><mi>\1</mi><mspace width="0.17em"/>'


class Drawn(Directive):
    """`drawn NAME` with a caption below."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the figure with its caption."""
        figure = nodes.container(classes=["drawn"])
        caption = nodes.container(classes=["caption"])
        self.state.nested_parse(self.content, self.content_offset, caption)
        label = html.escape(caption.astext(), quote=True)
        named = f'<svg role="img" aria-label="{label}" '
        picture = drawn(self.arguments[0]).replace("<svg ", named, 1)
        # Who scrolls by keyboard can reach a figure that is wider than the screen.
        pane = f'<div class="pane" tabindex="0">{picture}</div>'
        figure += [nodes.raw("", pane, format="html"), caption]
        return [figure]


def made(app: Sphinx, name: str, source: list[str]) -> None:
    """Replace a page that is made from the code."""
    del app
    if name in PAGES:
        source[0] = PAGES[name]()


def mathml(node: nodes.math | nodes.math_block, display: str) -> str:
    """Return a formula as MathML; names of functions stand apart, which browsers leave to us."""
    return FUNCTION.sub(SPACED, convert(node.astext(), display=display))


def inline(writer: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(mathml(node, "inline"))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    formula = mathml(node, "block")
    writer.body.append(f'<div class="formula" tabindex="0">{formula}</div>')
    raise nodes.SkipNode


def reachable(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object) -> None:
    """Let who uses no mouse scroll what is wider than the screen: code and tables."""
    del app, page, template, tree
    if "body" in context:
        body = context["body"].replace("<pre>", '<pre tabindex="0">')
        context["body"] = body.replace(
            '<div class="table-wrapper', '<div tabindex="0" class="table-wrapper'
        )


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx of all this."""
    app.add_directive("drawn", Drawn)
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("source-read", made)
    app.connect("html-page-context", reachable)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
