"""Every notebook runs from top to bottom in a fresh kernel, asserts a number and shows a picture."""

import re
from pathlib import Path

import jupytext
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.py"))


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return jupytext.read(request.param, fmt="py:percent")


def test_notebook_opens_with_its_question_and_asserts_a_number(notebook):
    first, code = notebook.cells[0], [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    assert first.cell_type == "markdown"
    assert "?" in first.source
    assert code[0].startswith("%matplotlib inline")
    assert any(re.search(r"^assert ", source, re.M) for source in code)


@pytest.mark.long
def test_notebook_runs_in_a_fresh_kernel_and_shows_a_picture(notebook):
    client = NotebookClient(notebook, resources={"metadata": {"path": str(NOTEBOOKS[0].parent)}})
    client.execute()  # raises at the first cell that does
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
