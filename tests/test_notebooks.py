"""Every notebook runs from top to bottom; each asserts a number of its own."""

import runpy
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.py"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_its_number_holds(path):
    assert "assert " in path.read_text()
    assert "forceid" in runpy.run_path(str(path))
