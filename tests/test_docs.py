"""The documentation site: whole, readable without a network, and true where it can be run."""

from __future__ import annotations

import doctest
import inspect
import re
import subprocess
import sys
import time
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from urllib.parse import unquote, urlsplit

import click
import pytest
import typer

from forceid.cli.app import COMMANDS, app

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "object": "data"}
PAGES_OF = {"forceid": "forceid", "kalman": "forceid.kalman", "partition": "forceid.partition"}
PAGES_OF |= {"pseudorigid": "forceid.pseudorigid"}
# (node, 3), (..., dof), (mode,), a vector of numbers, or a unit that stands by itself
SHAPE_OR_UNIT = re.compile(
    r"\((\.\.\.|[a-z_0-9]+)(, [a-z_0-9\. ]+)*,?\)|\b(m|kg|s|N|J|Hz|rad|N m|1/s|kg m2)\b|[uU]nits?\b"
)


class Page(HTMLParser):
    """Identifiers, links and visible text of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[tuple[str, str]] = []
        self.words: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.text = "".join(self.words)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what a tag names, and where it leads."""
        for name, value in attrs:
            if name in ("id", "name") and value:
                self.ids.add(value)
            if name in ("href", "src", "data", "srcset") and value:
                self.links.append((tag, value))

    def handle_data(self, data: str) -> None:
        """Collect text."""
        self.words.append(data)


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """The site, built once for all processes of the tests; notebooks are not run again, they have tests."""
    root = tmp_path_factory.getbasetemp()
    root = root if worker_id == "master" else root.parent
    out, said = root / "site", root / "site.said"
    try:
        (root / "site.lock").mkdir()
    except FileExistsError:
        while not said.exists():
            time.sleep(0.2)
        return out
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    options = ["-D", "nb_execution_mode=off", "-d", str(root / "site.read"), str(DOCS), str(out)]
    built = subprocess.run([*command, *options], capture_output=True, text=True, cwd=root, check=False)
    beside = root / "site.partial"
    beside.write_text(f"{built.returncode}\n{built.stdout}{built.stderr}")
    beside.rename(said)
    return out


@pytest.fixture(scope="session")
def pages(site: Path) -> dict[Path, Page]:
    """Every page of the site by its path."""
    return {path: Page(path) for path in sorted(site.rglob("*.html"))}


@pytest.mark.long
def test_site_is_built_without_a_warning(site):
    said = (site.parent / "site.said").read_text()
    assert said.split() == ["0"], said


@pytest.mark.long
def test_every_link_within_the_site_leads_somewhere(pages, site):
    broken = []
    for path, page in pages.items():
        for _, link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            named = pages.get(target)
            if not target.exists() or (parts.fragment and named and unquote(parts.fragment) not in named.ids):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert not broken
    assert len(pages) > 30


@pytest.mark.long
def test_no_page_loads_anything_from_a_network(pages, site):
    loaded = {
        link for page in pages.values() for tag, link in page.links if tag in LOADED and "//" in link[:8]
    }
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not loaded
    assert not re.findall(r"@import|url\(\s*['\"]?(?:https?:)?//", styles)


@pytest.mark.long
def test_equations_are_drawn_and_can_be_read_aloud(pages, site):
    written = (site / "method.html").read_text(encoding="utf-8")
    assert written.count('<svg class="equation" role="img" aria-label="') > 150
    assert "$" not in pages[site / "method.html"].text


@pytest.mark.long
def test_command_reference_names_every_command_and_every_option(pages, site):
    text = pages[site / "commands.html"].text
    group = typer.main.get_command(app)
    for name in COMMANDS:
        assert f"forceid {name} " in text
        command = group.get_command(click.Context(group), name)
        for taken in command.get_params(click.Context(command)):
            for spelled in taken.opts if taken.param_type_name == "option" else [taken.metavar]:
                assert spelled in text, f"{name}: {spelled}"


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES_OF)
def test_reference_has_every_public_name_with_shapes_or_units(pages, site, page):
    sys.path.insert(0, str(DOCS / "extensions"))
    try:
        exported, meant = (getattr(import_module("generated"), name) for name in ("exported", "meant"))
    finally:
        sys.path.pop(0)
    package = import_module(PAGES_OF[page])
    shown, silent = pages[site / "api" / f"{page}.html"], []
    for name in exported(package):
        thing = meant(package, name)
        if inspect.ismodule(thing):
            assert any(known.startswith(f"{thing.__name__}.") for known in shown.ids), name
            continue
        assert name == "__version__" or f"{PAGES_OF[page]}.{name}" in shown.ids, name
        if inspect.isfunction(thing) and "Array" in str(signature := inspect.signature(thing)):
            returned = getattr(inspect.getmodule(thing), str(signature.return_annotation), None)
            said = f"{inspect.getdoc(thing)} {inspect.getdoc(returned) if returned else ''}"
            silent += [] if SHAPE_OR_UNIT.search(said) else [name]
    assert not silent
    assert "nits" in shown.text or page == "forceid"


@pytest.mark.long
def test_every_notebook_is_in_the_gallery(pages, site):
    listed = {link for _, link in pages[site / "gallery.html"].links}
    for notebook in (ROOT / "notebooks").glob("*.py"):
        assert f"notebooks/{notebook.stem}.html" in listed
        assert (site / "notebooks" / f"{notebook.stem}.html").exists()


def test_every_page_of_results_stands_in_the_table_with_its_command():
    text = (DOCS / "results.md").read_text(encoding="utf-8")
    table, _, tree = text.partition("```{toctree}")
    for entry in re.findall(r"^\w[\w/]*$", tree, re.M):
        row = next((line for line in table.splitlines() if f"({entry}.md)" in line), "")
        assert row.rstrip(" |").endswith("`"), entry


def test_tests_that_the_errata_and_limits_name_exist():
    defined = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.M)
    }
    for page, least in (("errata.md", 40), ("limits.md", 2)):
        named = set(re.findall(r"`(test_\w+)`", (DOCS / page).read_text(encoding="utf-8")))
        assert named <= defined, named - defined
        assert len(named) >= least


@pytest.mark.parametrize(
    ("folder", "least"),
    [pytest.param("", 9, id="pages"), pytest.param("howto", 6, marks=pytest.mark.long, id="how-to pages")],
)
def test_examples_of_the_pages_run(folder, least, tmp_path, monkeypatch, capsys):
    (tmp_path / "data").symlink_to(ROOT / "data")  # what the examples write stays out of the tree
    monkeypatch.chdir(tmp_path)
    ran = 0
    for path in sorted((DOCS / folder).glob("*.md")):
        names: dict[str, object] = {}
        for block in re.findall(r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.S | re.M):
            ran += 1
            if ">>>" not in block:
                exec(compile(block, path.name, "exec"), names)
                continue
            test = doctest.DocTestParser().get_doctest(block, names, path.name, str(path), 0)
            runner = doctest.DocTestRunner()
            failed = runner.run(test, clear_globs=False).failed
            names = test.globs
            assert failed == 0, capsys.readouterr().out
    assert ran >= least
    assert folder or "ok ('time', 'axis')" in capsys.readouterr().out
