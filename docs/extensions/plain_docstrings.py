"""Docstrings are plain text, names in single backquotes, indented equations and doctests: so on a page."""

import re
from textwrap import dedent
from typing import Any

from sphinx.application import Sphinx

QUOTED = re.compile(r"`([^`\n]+)`")
FORWARD = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")
NAME = re.compile(r"[A-Za-z_][\w.]*")
SPECIAL = re.compile(r"([\\*|_`])")


def as_text(line: str) -> str:
    """One line of prose: names become links where they lead somewhere, the rest stands as typed."""
    out = []
    for index, piece in enumerate(QUOTED.split(line)):
        if index % 2 == 0:
            out.append(SPECIAL.sub(r"\\\1", piece))
        else:
            out.append(f":py:obj:`{piece}`" if NAME.fullmatch(piece) else f"``{piece}``")
    return "".join(out)


def as_page(lines: list[str]) -> list[str]:
    """The paragraphs of a docstring: doctests as they are, indented ones as equations, the rest as prose."""
    page: list[str] = []
    for block in re.split(r"\n\s*\n", "\n".join(lines).strip("\n")):
        rows = dedent(block).splitlines() if page or not block.startswith(" ") else block.splitlines()
        if rows and rows[0].startswith(">>>"):
            page += rows
        elif block.startswith("    "):
            page += ["::", "", *("    " + row for row in rows)]
        elif rows and rows[0].startswith("- "):
            page += [as_text(row) if row.startswith("- ") else "  " + as_text(row.strip()) for row in rows]
        else:
            # a table typed with spaces keeps its lines
            page += [
                ("| " if any("   " in row.strip() for row in rows) else "") + as_text(row) for row in rows
            ]
        page.append("")
    return page


def process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrite a docstring in place, as autodoc asks for it."""
    lines[:] = as_page(lines)


def skip(app: Sphinx, what: str, name: str, obj: Any, skipped: bool, options: Any) -> bool | None:
    """Leave out what says nothing: the fields of a tuple, which its docstring tells of."""
    return True if (getattr(obj, "__doc__", "") or "").startswith("Alias for field number") else None


def named(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, arguments: str, returns: str
) -> tuple[str | None, str | None]:
    """Signatures with the names of array types, in place of what stands for a name not resolved."""
    return tuple(text and FORWARD.sub(r"\1", text) for text in (arguments, returns))  # type: ignore[return-value]


def setup(app: Sphinx) -> dict[str, Any]:
    """Listen to autodoc."""
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-process-signature", named)
    app.connect("autodoc-skip-member", skip)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
