"""The charts of a page in a real browser: what is seen first, values under the pointer, zoom, axes, print."""

from __future__ import annotations

import re

import numpy as np
import pytest

from forceid.records import Finding, Verdict
from forceid.report.page import render_page

pytest.importorskip("playwright.sync_api")
pytestmark = pytest.mark.long
DESK, PHONE = {"width": 1280, "height": 800}, {"width": 360, "height": 800}  # px
TITLE = "A boomerang with a marker on every mass"
REASONS = tuple(
    Finding(code, "degraded", {}, "something is wrong; do something about it")
    for code in ("bodies-disagree", "markers-on-line", "innovations-large")
)


@pytest.fixture(scope="module")
def thrown_page(throw, tmp_path_factory):
    """An estimate with cautions, and its page."""
    estimate, truth = throw(300, verdict=Verdict("degraded", REASONS))
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(render_page(estimate, truth, TITLE, "throw.result.h5"), encoding="utf-8")
    return estimate, path


@pytest.fixture
def tab(browser, thrown_page):
    """A function that opens the page."""
    contexts = []

    def at(viewport=DESK, **options):
        contexts.append(browser.new_context(viewport=viewport, offline=True, bypass_csp=True, **options))
        opened = contexts[-1].new_page()
        opened.goto(thrown_page[1].as_uri())
        return opened

    yield at
    for context in contexts:
        context.close()


def bottom(tab, selector):
    return tab.evaluate(f"document.querySelector('{selector}').getBoundingClientRect().bottom")


@pytest.mark.parametrize(("viewport", "limit"), [(DESK, 800), (PHONE, 700)], ids=["desk", "phone"])
def test_verdict_curves_numbers_and_next_step_are_seen_before_one_scrolls(tab, viewport, limit):
    opened = tab(viewport)
    assert bottom(opened, ".first .panel:first-child .plot svg") <= limit  # the force
    for part in (".verdict", ".first .panel:last-child .plot svg", ".cards", ".next li"):
        assert bottom(opened, part) <= viewport["height"]
    assert opened.evaluate("document.querySelectorAll('.cards > div').length") == 3
    assert opened.evaluate("document.querySelectorAll('details[open]').length") == 0


def test_the_value_under_the_pointer_is_that_of_the_estimate_with_its_band(tab, thrown_page):
    estimate, _ = thrown_page
    opened = tab()
    plot = opened.locator(".first .plot").first
    plot.hover(position={"x": 300, "y": 100})
    said = plot.locator(".tip").inner_text().splitlines()
    k = int(np.abs(estimate.time - float(said[0].split()[0])).argmin())
    shown = [line.replace("−", "-").split() for line in said if "±" in line]
    assert [words[0] for words in shown] == ["x", "y", "z"]
    np.testing.assert_allclose([float(words[1]) for words in shown], estimate.force[k], rtol=6e-3)
    np.testing.assert_allclose(
        [float(words[3]) for words in shown], 2 * estimate.force_std[k], rtol=6e-2
    )  # of two digits
    beside = opened.locator(".first .plot").nth(1).locator(".tip").inner_text()
    assert beside.splitlines()[0].split()[0] == said[0].split()[0]


def ticks(tab, panel):
    found = tab.locator(".first .plot").nth(panel).locator("text[text-anchor=middle]").all_text_contents()
    return [float(text) for text in found if re.fullmatch(r"[\d.]+", text)]


def test_a_drag_zooms_all_charts_over_time_and_a_key_shows_all_again(tab):
    opened = tab()
    whole = ticks(opened, 0)
    box = opened.locator(".first .plot").first.bounding_box()
    opened.mouse.move(box["x"] + 200, box["y"] + 80)
    opened.mouse.down()
    opened.mouse.move(box["x"] + 300, box["y"] + 80)
    opened.mouse.up()
    for panel in (0, 1):
        inside = ticks(opened, panel)
        assert min(inside) > min(whole)
        assert max(inside) < max(whole)
    opened.locator(".first .plot").first.focus()
    opened.keyboard.press("0")
    assert ticks(opened, 0) == ticks(opened, 1) == whole
    opened.get_by_role("button", name=re.compile("^Zoom in")).first.click()
    assert ticks(opened, 0) != whole


def test_arrow_keys_read_one_sample_after_the_other(tab):
    opened = tab()
    opened.locator(".first .plot").first.focus()
    tip, seen = opened.locator(".first .tip").first, []
    for _ in range(3):
        opened.keyboard.press("ArrowRight")
        seen.append(float(tip.inner_text().split()[0]))
    np.testing.assert_allclose(np.diff(seen), 3.0 / 299, atol=2e-4)  # of two rounded times


def test_a_button_takes_an_axis_away_and_brings_it_back(tab):
    opened = tab()
    lines = opened.locator(".first .plot").first.locator("path.line")
    assert lines.count() == 6  # estimate and truth along three axes
    button = opened.get_by_role("button", name="x", exact=True).first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert lines.count() == 4
    button.click()
    assert lines.count() == 6


def test_without_scripts_pictures_stand_in_place_of_charts(tab):
    opened = tab(java_script_enabled=False)
    assert opened.locator(".first img").is_visible()
    assert opened.locator("button").count() == 0


def test_paper_has_every_section_unfolded_on_white(tab):
    opened = tab(color_scheme="dark")
    dark = opened.evaluate("getComputedStyle(document.body).backgroundColor")
    opened.emulate_media(media="print", color_scheme="dark")
    opened.wait_for_function("[...document.querySelectorAll('details')].every(e => e.open)")
    assert opened.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)" != dark
    drawn = "[...document.querySelectorAll('.plot')].every(e => e.querySelector('svg'))"
    assert opened.evaluate(drawn)
    opened.emulate_media(media="screen")
    opened.wait_for_function("[...document.querySelectorAll('details')].every(e => !e.open)")


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [DESK, PHONE], ids=["desk", "phone"])
def test_axe_finds_no_violation(tab, viewport, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    opened = tab(viewport, color_scheme=scheme)
    opened.evaluate("document.querySelectorAll('details').forEach(e => { e.open = true; })")
    opened.wait_for_function("[...document.querySelectorAll('.plot')].every(e => e.querySelector('svg'))")
    found = axe.run(opened)
    assert found.violations_count == 0, found.generate_report()
