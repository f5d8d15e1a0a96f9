"""The pages in a real browser: no network, no error, readable on phone and paper, by keyboard and by ear."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
from test_batch_page import BATCH

from forceid.records import Finding, Interface, Verdict
from forceid.report.batch_page import render_batch
from forceid.report.comparison import Named, render_comparison
from forceid.report.page import render_page

pytest.importorskip("playwright.sync_api")
pytestmark = pytest.mark.long
PHONE, PAPER = {"width": 360, "height": 720}, {"width": 718, "height": 1000}  # px; A4 within margins
FOCUSABLE = "a[href], button, input, select, textarea, summary, [tabindex]"
UNFOLD = "document.querySelectorAll('details').forEach(e => { e.open = true; })"
DESK = {"width": 1280, "height": 800}


def joints(frames):
    """Two joints, one of them without a name that breaks."""
    rng = np.random.default_rng(0)
    force, cov = rng.standard_normal((frames, 2, 3)), np.tile(0.01 * np.eye(6), (frames, 2, 1, 1))
    return Interface(
        name=("hip", "a_joint_with_a_name_that_has_no_end"),
        parts=(("trunk", "thigh"), ("thigh", "shank")),
        point=force,
        force=force,
        moment=0.1 * force,
        wrench_cov=cov,
        determined=np.ones(2, bool),
        null_space=np.zeros((2, 6, 0)),
        gap=np.zeros((frames, 2, 3)),
        chi_square=np.full(frames, 3.0),
        dof=3,
        verdict=Verdict("ok", ()),
    )


@pytest.fixture(scope="module", params=["result", "refused", "batch", "comparison"])
def page(request, throw, tmp_path_factory):
    """The path of a page."""
    folder = tmp_path_factory.mktemp(request.param)
    path = folder / "index.html"
    if request.param == "batch":
        (folder / "m03.result.html").write_text("a report")
        batch = [{**r, "output": str(folder / r["output"].removeprefix("out/"))} for r in BATCH]
        html = render_batch(batch, folder)
    elif request.param == "comparison":
        both = [Named(f"seed {seed}", throw(100, seed=seed)[0]) for seed in (1, 2)]
        html = render_comparison(both)
    elif request.param == "refused":
        estimate, _ = throw(
            60,
            verdict=Verdict("refused", (Finding("code", "refused", {}, "Nothing is seen."),)),
            force=np.full((60, 3), np.nan),
        )
        html = render_page(estimate, None, "A record of nothing")
    else:
        estimate, truth = throw(200, interface=joints(200))
        html = render_page(estimate, truth, "A throw", "/a/long/path/without/any/space/" + "x" * 80 + ".h5")
    path.write_text(html, encoding="utf-8")
    return path


@pytest.fixture
def opened(browser, page):
    """A function that opens the page in a window of some size, and what the browser says meanwhile."""
    contexts = []

    def at(viewport, **options):
        context = browser.new_context(viewport=viewport, offline=True, **options)
        contexts.append(context)
        tab, said = context.new_page(), []
        tab.on("console", lambda message: said.append(message.text))
        tab.on("pageerror", lambda error: said.append(str(error)))
        tab.on("request", lambda request: said.append(request.url))
        tab.goto(page.as_uri())
        tab.wait_for_load_state("load")
        return tab, said

    yield at
    for context in contexts:
        context.close()


def wide(tab):
    """What is wider than the window and cannot be scrolled to by itself: tag and right edge."""
    return tab.evaluate(
        """() => [...document.querySelectorAll('body *')].filter(e => {
          let inside = e.parentElement.closest('.wide, pre');
          return !inside && e.getBoundingClientRect().right > document.documentElement.clientWidth + 1;
        }).map(e => [e.tagName, e.className, e.getBoundingClientRect().right])"""
    )


def test_it_loads_alone_and_the_browser_has_nothing_to_say(opened, page):
    _, said = opened({"width": 1280, "height": 900})
    assert [text for text in said if not text.startswith("data:image/png")] == [page.as_uri()]


def test_it_fits_a_phone_and_every_line_is_large_enough_to_read(opened):
    tab, _ = opened(PHONE, device_scale_factor=2, is_mobile=True, has_touch=True)
    assert tab.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert wide(tab) == []
    tab.evaluate(UNFOLD)
    sizes = tab.evaluate(
        """() => [...document.querySelectorAll('body *')].filter(e => e.innerText && !e.children.length)
                 .map(e => parseFloat(getComputedStyle(e).fontSize))"""
    )
    assert min(sizes) >= 12.5
    assert wide(tab) == []
    pictures = tab.evaluate("[...document.images].map(i => i.getBoundingClientRect().width)")
    assert min(pictures, default=640) >= 640  # less makes their letters too small; they scroll by themselves


def test_it_fits_paper_and_prints(opened):
    tab, _ = opened(PAPER)
    tab.emulate_media(media="print")
    assert tab.evaluate("document.documentElement.scrollWidth") <= PAPER["width"]
    assert wide(tab) == []
    cut = tab.evaluate(
        "[...document.querySelectorAll('.wide, pre')].filter(e => e.scrollWidth > e.clientWidth + 1).length"
    )
    assert cut == 0
    sheets = tab.pdf(format="A4", print_background=True)
    assert sheets.startswith(b"%PDF")
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", sheets)) <= 8


@pytest.mark.parametrize("viewport", [PHONE, {"width": 1280, "height": 900}], ids=["phone", "desk"])
def test_all_that_can_be_opened_or_scrolled_is_reached_by_keyboard(opened, viewport):
    tab, _ = opened(viewport)
    for summary in tab.query_selector_all("summary"):
        shut = not summary.evaluate("e => e.parentElement.open")
        summary.focus()
        tab.keyboard.press("Enter")
        assert summary.evaluate("e => e.parentElement.open") == shut
    tab, _ = opened(viewport)
    tab.evaluate(UNFOLD)
    seen = f"[...document.querySelectorAll('{FOCUSABLE}')].filter(e => e.checkVisibility())"
    count = tab.evaluate(f"{seen}.map((e, k) => e.dataset.k = k).length")
    reached = []
    for _ in range(count):
        tab.keyboard.press("Tab")
        reached.append(tab.evaluate("Number(document.activeElement.dataset.k ?? -1)"))
        outline = tab.evaluate("getComputedStyle(document.activeElement).outlineStyle")
        assert outline != "none"  # one sees where one is
    assert sorted(reached) == list(range(count))
    unreached = tab.evaluate(
        """() => [...document.querySelectorAll('body *')].filter(e => {
          const scrolls = ['auto', 'scroll'].includes(getComputedStyle(e).overflowX);
          return scrolls && e.scrollWidth > e.clientWidth + 1 && e.tabIndex < 0;
        }).map(e => e.tagName)"""
    )
    assert unreached == []


def test_who_listens_to_it_is_told_what_pictures_show_and_where_things_are(opened):
    tab, _ = opened(PAPER)
    assert tab.evaluate("document.documentElement.lang") == "en-US"
    assert tab.title()
    tab.evaluate(UNFOLD)
    told = tab.evaluate("[...document.images].map(i => [i.alt, i.closest('figure').innerText])")
    for alt, caption in told:
        assert len(alt) > 40
        assert alt not in caption
    assert len({alt for alt, _ in told}) == len(told)
    heads = tab.evaluate("[...document.querySelectorAll('h1, h2, h3')].map(h => Number(h.tagName[1]))")
    assert heads[0] == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(heads))
    assert tab.evaluate("document.querySelectorAll('main').length") == 1
    bare = "[...document.querySelectorAll('thead th')].filter(h => h.scope !== 'col').length"
    assert tab.evaluate(bare) == 0
    nameless = "[...document.querySelectorAll('[role=region]')].filter(r => !r.ariaLabel).length"
    assert tab.evaluate(nameless) == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_letters_stand_out_from_what_is_behind_them(opened, scheme):
    tab, _ = opened(PAPER, color_scheme=scheme)
    tab.evaluate(UNFOLD)
    ratios = tab.evaluate(
        """() => {
          const light = c => { const v = c.match(/[\\d.]+/g).map(Number);
            const [r, g, b] = v.slice(0, 3).map(x => x / 255)
                .map(x => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
            return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
          const ground = e => getComputedStyle(e).backgroundColor;
          const behind = e => { for (; e; e = e.parentElement)
            if (!ground(e).endsWith(', 0)')) return ground(e); return 'rgb(255, 255, 255)'; };
          const all = [...document.querySelectorAll('body *')];
          return all.filter(e => e.innerText && !e.children.length)
            .map(e => [light(getComputedStyle(e).color), light(behind(e))])
            .map(pair => pair.sort((x, y) => y - x))
            .map(([a, b]) => (a + 0.05) / (b + 0.05));
        }"""
    )
    assert min(ratios) >= 4.5  # WCAG 2.1, AA
