"""The documentation is short and plain: its words, its sentences and its pages are counted."""

from __future__ import annotations

import re
import statistics
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("[!_n]*/*.md")])
WORDS, LONGEST, MEDIAN = 35_000, 35, 16  # of all pages; of a sentence; of half of the sentences, below
LINES = 120  # of the README


def sentences(text: str) -> list[str]:
    """Sentences of the prose of a page: no code, formula on its own, table, heading or directive.

    A piece of code or a formula within a sentence is one word.

    >>> sentences("# Head\\n\\nOne `a b` two. Three\\nfour: $x + y$.\\n\\n| a | b |\\n|---|---|\\n")
    ['One _ two.', 'Three four: _.']
    """
    text = re.sub(r"^ *```.*?^ *```", "\n", text, flags=re.S | re.M)
    text = re.sub(r"^ *\$\$.*?\$\$", "\n", text, flags=re.S | re.M)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", re.sub(r"``?[^`]+``?|\$[^$]+\$", "_", text))
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    lines = [
        "" if re.match(r"\s*([|#@<]|\(.*\)=$)", line) else re.sub(r"^\s*([-*]|\d+\.) ", "\n\n", line)
        for line in text.splitlines()
    ]
    blocks = re.split(r"\n\s*\n", "\n".join(lines))
    parts = (re.split(r"(?<=[.?!])[*_)\"]*\s+(?=[^a-z0-9])", " ".join(block.split())) for block in blocks)
    return [part for block in parts for part in block if len(part.split()) > 1]


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    """Text of every page by its path."""
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in PAGES}


def test_documentation_can_be_read_in_an_afternoon(pages):
    assert sum(len(text.split()) for text in pages.values()) <= WORDS


def test_no_sentence_is_longer_than_a_breath_and_half_are_short(pages):
    found = [(len(one.split()), name, one) for name, text in pages.items() for one in sentences(text)]
    assert [one for one in found if one[0] > LONGEST] == []
    assert statistics.median(count for count, _, _ in found) < MEDIAN
    assert len(found) > 500


def test_every_page_shows_a_picture_or_an_example(pages):
    shown = re.compile(r"!\[|```|^@\w|`(?:[A-Z_]+=1 )?(?:python -m|pytest|make|forceid) [^`]+`", flags=re.M)
    assert [name for name, text in pages.items() if not shown.search(text)] == []


def test_readme_fits_on_two_screens_with_one_picture(pages):
    assert len(pages["README.md"].splitlines()) <= LINES
    assert len(re.findall(r"!\[", pages["README.md"])) == 1
