"""Equations as drawings that are part of the page: nothing to load, in the color of the text.

The outline of a letter is defined once a page, and used wherever the letter stands.
"""

import re
from functools import cache
from html import escape
from typing import Any

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import logging

SIZE = 17.0  # of the letters as drawn; on the page they are as large as the text
EM = 16.0
VIEW = re.compile(r'<svg [^>]*viewBox="(\S+) (\S+) (\S+) (\S+)"[^>]*>')
OUTLINE = re.compile(r'<symbol id="([^"]+)"[^>]*(?:/>|(?<!/)>.*?</symbol>)', re.S)
ziamath.config.precision = 2
ziamath.config.svg2 = True


@cache
def drawn(tex: str, inline: bool) -> str:
    """The drawing of an equation, with the outlines it uses."""
    return str(ziamath.Latex(tex, size=SIZE, inline=inline, color="currentColor").svg())


def as_drawing(tex: str, inline: bool, writer: Any, node: nodes.Node) -> str:
    """An equation for the page of `writer`; one that cannot be drawn is a warning, and stands as typed."""
    try:
        svg = drawn(tex.strip(), inline)
    except Exception as error:  # whatever the converter stumbles over, the page names the equation
        logging.getLogger(__name__).warning("equation %r: %s", tex, error, location=node)
        return f"<code>{escape(tex)}</code>"
    defined = writer.__dict__.setdefault("outlines_defined", set())

    def once(found: re.Match[str]) -> str:
        new = found[1] not in defined
        defined.add(found[1])
        return found[0] if new else ""

    left, top, width, height = (float(v) for v in VIEW.match(svg).groups())  # type: ignore[union-attr]
    below = top + height
    head = (
        f'<svg class="equation" role="img" aria-label="{escape(" ".join(tex.split()))}"'
        f' viewBox="{left:g} {top:g} {width:g} {height:g}" style="width:{width / EM:.3f}em;'
        f'height:{height / EM:.3f}em;vertical-align:{-below / EM:.3f}em">'
    )
    return head + OUTLINE.sub(once, VIEW.sub("", svg, count=1))


def inline(writer: Any, node: nodes.math) -> None:
    """Write an equation within a line."""
    writer.body.append(as_drawing(node.astext(), True, writer, node))
    raise nodes.SkipNode


def displayed(writer: Any, node: nodes.math_block) -> None:
    """Write an equation on a line of its own."""
    writer.body.append(f'<div class="math">{as_drawing(node.astext(), False, writer, node)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Make this the way in which equations are written."""
    app.add_html_math_renderer("drawn", (inline, None), (displayed, None))
    app.config.html_math_renderer = "drawn"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
