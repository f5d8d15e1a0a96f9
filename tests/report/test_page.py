"""The page: one file, everything inside."""

from __future__ import annotations

import base64
import re
from dataclasses import replace

import numpy as np
import pytest

from forceid.records import Finding, Verdict
from forceid.report.page import drawings, render_page


def test_page_refers_to_no_host_and_no_other_file(page):
    assert "://" not in page
    assert "default-src 'none'" in page  # a browser loads nothing even where it is asked to
    assert re.findall(r"<script[^>]*>", page) == ['<script type="application/json" id="charts">', "<script>"]
    assert all(s.startswith("data:image/png;base64,") for s in re.findall(r'(?:src|href)="([^"]*)"', page))


def test_pictures_are_png_inside_the_page(page):
    pictures = re.findall(r"data:image/png;base64,([^\"]+)", page)
    assert len(pictures) == 5
    assert all(base64.b64decode(p)[:8] == b"\x89PNG\r\n\x1a\n" for p in pictures)


def test_page_tells_verdict_settings_and_provenance(page):
    assert "Degraded" in page
    assert "add markers off that axis" in page
    assert "method = &#34;smoother&#34;" in page
    assert "ab" * 32 in page
    assert '<th scope="row">Noise std</th><td>0.00051 m</td>' in page
    assert "<li>The moment about x has no defense above 12 Hz; add markers off that axis.</li>" in page
    assert "<li>Add markers off that axis.</li>" in page
    assert "toss &lt;3&gt;" in page


@pytest.mark.long
def test_page_of_a_long_record_stays_small(throw):
    estimate, truth = throw(40_000)
    assert len(render_page(estimate, truth)) < 2e6


def test_page_of_sensors_alone_draws_force_and_moment_and_no_path(throw):
    estimate, truth = throw(50)
    lost = np.full((50, 3), np.nan)
    drawn = drawings(replace(estimate, center=lost, velocity=lost), truth)
    assert "wrench" in drawn
    assert not {"path", "motion"} & set(drawn)


def test_page_of_a_refused_estimate_says_why_and_draws_nothing(throw):
    estimate, _ = throw(50)
    nothing = np.full((50, 3), np.nan)
    refused = replace(
        estimate,
        **dict.fromkeys(("force", "moment", "center", "velocity", "angular_velocity"), nothing),
        angular_momentum=nothing,
        wrench_cov=np.full((50, 6, 6), np.nan),
        deformation=np.empty((50, 0, 3)),
        mode_amplitude=None,
        innovation=np.empty((50, 0)),
        nis=np.full(50, np.nan),
        log_likelihood=np.nan,
        mass=np.nan,
        verdict=Verdict(
            "refused", (Finding("code", "refused", {}, "Three samples cannot show a force; record more."),)
        ),
    )
    html = render_page(refused)
    assert "Refused" in html
    assert "record more" in html
    assert html.count("<b>not known</b>") == 2
    assert "<img" not in html
