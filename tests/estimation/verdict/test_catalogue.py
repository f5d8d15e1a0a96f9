"""The catalogue of findings: what a program can rely on, and what the code writes agrees with it."""

import ast
import re
import string
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

from forceid.estimation.verdict.catalogue import CATALOGUE, GROUPS, note
from forceid.estimation.verdict.finding import judge
from forceid.files.result import read_verdict
from forceid.files.schema import verdict_attrs

ROOT = Path(__file__).parents[3]
ENTRIES = [entry for group in GROUPS.values() for entry in group]


def names_of(entry):
    return {name for _, name, _, _ in string.Formatter().parse(entry.sentence) if name}


@cache
def sources():
    """Every call and every comparison in the sources, with its file."""
    return [
        (path, node)
        for path in sorted((ROOT / "forceid").rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call | ast.Compare)
    ]


def calls():
    """Every call of `note` in the sources with a code written out: file, code, names of its values."""
    for path, node in sources():
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "note":
            codes = [n.value for n in ast.walk(node.args[0]) if isinstance(n, ast.Constant)]
            yield path, [c for c in codes if c in CATALOGUE], {k.arg for k in node.keywords}


def test_every_code_is_one_and_reads_as_words():
    assert len(CATALOGUE) == len(ENTRIES)
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", entry.code) for entry in ENTRIES)


def test_every_entry_says_what_it_means_and_what_to_do_in_sentences():
    for entry in ENTRIES:
        for text in (entry.meaning, entry.action):
            assert text[0].isupper(), entry.code
            assert text.endswith("."), entry.code
        assert not entry.sentence.endswith("."), entry.code


def test_every_call_gives_the_values_that_its_sentence_asks_for():
    for path, codes, given in calls():
        for code in codes:
            assert given == names_of(CATALOGUE[code]), (path.name, code)


def test_every_entry_is_written_somewhere_in_the_sources():
    text = "\n".join(path.read_text("utf-8") for path in (ROOT / "forceid").rglob("*.py"))
    assert [entry.code for entry in ENTRIES if f'"{entry.code}"' not in text] == []


def test_no_module_decides_on_the_words_of_a_sentence():
    """A comparison that looks for text in a reason, a finding's text or a warning."""
    found = []
    for path, node in sources():
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn | ast.Eq):
            for side in (node.left, *node.comparators):
                name = getattr(side, "id", "") or getattr(side, "attr", "")
                text = name == "text" and isinstance(side, ast.Attribute)
                if text or name in ("reason", "reasons", "sentence", "warnings"):
                    found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found == []


def test_findings_come_back_from_a_file_as_they_were():
    found = judge([note("spikes", count=3, readings=90, markers="a 3", time_s=0.1), note("one-marker")])
    assert read_verdict(verdict_attrs(found)) == found
    assert read_verdict(verdict_attrs(judge([]))) == judge([])
    folded = judge([note("no-applied-moments", error="a line\nand another"), note("one-marker")])
    assert read_verdict(verdict_attrs(folded)) == folded


def test_a_file_without_codes_keeps_its_sentences():
    attrs = {"verdict": "degraded", "reasons": "one; do this\nanother; do that"}
    found = read_verdict(attrs)
    assert found.level == "degraded"
    assert found.reasons == ("one; do this", "another; do that")
    assert [finding.code for finding in found.findings] == ["", ""]


def test_what_is_not_finite_is_no_number_of_a_file():
    found = note("errors-shared", agree_mm=float("inf"), noise_mm=1.0)
    assert found.values == {"agree_mm": None, "noise_mm": 1.0}
    assert "to inf mm" in found.text


def test_a_code_that_the_catalogue_lacks_is_an_error():
    with pytest.raises(KeyError, match="no-such-code"):
        note("no-such-code")


def test_the_page_of_the_documentation_has_every_finding(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "extensions"))
    page = import_module("generated").findings()
    sys.modules.pop("generated")
    assert "@findings" in (ROOT / "docs" / "findings.md").read_text("utf-8").splitlines()
    for entry in ENTRIES:
        assert f"### {entry.code}\n" in page
        assert entry.meaning in page
        assert entry.action in page
