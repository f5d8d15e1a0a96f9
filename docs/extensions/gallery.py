"""Notebooks of the gallery, kept as Python in percent format: read, and told to show figures as pictures."""

from typing import Any

import jupytext
from nbformat.v4 import new_code_cell


def read(text: str) -> Any:
    """The notebook of a Python file; its figures are not from pyplot, which would switch pictures on."""
    notebook = jupytext.reads(text, fmt="py:percent")
    notebook.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    notebook.cells.insert(1, new_code_cell("%matplotlib inline", metadata={"tags": ["remove-cell"]}))
    return notebook
