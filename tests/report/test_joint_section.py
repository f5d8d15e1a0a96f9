"""Forces between parts on the page: a figure a joint, its band and truth, and what is not told by name."""

import re
from dataclasses import replace

import numpy as np
import pytest

from forceid.records import Finding, Interface, Verdict
from forceid.report.joint_section import joint_section
from forceid.report.page import render_page
from forceid.report.plots.figures import draw_joint, joint_truth

STD = np.array([0.05, 0.04, 0.06, 0.002, 0.003, 0.002])
PLACE = np.array([[0.4, 0.1, 1.2], [0.8, 0.1, 1.2]])
FIELDS = ("force", "moment", "wrench_cov")


def jointed(estimate, **changes):
    """The estimate as that of three parts on two joints, and the truth of these."""
    time, rng = estimate.time, np.random.default_rng(2)
    true = np.sin(time[:, None, None] + np.arange(12).reshape(2, 6)) * [2.0, 2.0, 2.0, 0.1, 0.1, 0.1]
    seen = true + STD * rng.standard_normal(true.shape)
    point = np.broadcast_to(PLACE, (len(time), 2, 3))
    given = {
        "name": ("hip", "knee"),
        "parts": (("trunk", "thigh"), ("thigh", "shank")),
        "force": seen[..., :3],
        "moment": seen[..., 3:],
        "wrench_cov": np.broadcast_to(np.diag(STD**2), (len(time), 2, 6, 6)),
        "point": point,
        "determined": np.ones(2, bool),
        "null_space": np.zeros((2, 6, 0)),
        "gap": np.full((len(time), 2, 3), 1e-4),
        "chi_square": np.full(len(time), 5.0),
        "dof": 6,
        "verdict": Verdict(),
    }
    truth = {"joint_force": true[..., :3], "joint_moment": true[..., 3:], "joint_point": point, "time": time}
    return replace(estimate, interface=Interface(**(given | changes))), truth


@pytest.fixture(scope="module")
def two(throw):
    return jointed(throw()[0])


@pytest.fixture(scope="module")
def section(two):
    return joint_section(*two)


@pytest.fixture(scope="module")
def untold(two):
    """The section where the truth is not known."""
    return joint_section(two[0])


@pytest.fixture
def looped(two):
    """The same where the first joint trades wrenches of four components with another."""
    whole, _ = two
    interface = whole.interface
    hidden = {name: getattr(interface, name).copy() for name in FIELDS}
    for values in hidden.values():
        values[:, 0] = np.nan
    null = np.zeros((2, 6, 4))
    null[0] = np.eye(6)[:, :4]
    verdict = Verdict(
        "degraded",
        (
            Finding(
                "code", "degraded", {}, "the motion does not tell what passes through hip; see null_space"
            ),
        ),
    )
    return jointed(whole, **hidden, determined=np.array([False, True]), null_space=null, verdict=verdict)


def test_the_band_of_a_joint_is_1_96_sigma_on_either_side(two):
    estimate, _ = two
    still = replace(estimate.interface, force=np.zeros_like(estimate.interface.force))
    band = draw_joint(estimate.time, still, 0).axes[0].collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(1.959964 * 0.05)
    assert band[:, 1].min() == pytest.approx(-1.959964 * 0.05)


def test_a_joint_says_who_pushes_whom_in_which_axes_and_units(two, untold):
    estimate, _ = two
    axes = draw_joint(estimate.time, estimate.interface, 1).axes
    assert axes[0].get_title(loc="left") == "Force of thigh on shank, world axes"
    assert axes[1].get_title(loc="left") == "Moment about knee, world axes"
    units = [re.search(r"\((.*)\)$", ax.get_ylabel())[1] for ax in axes]
    assert units == ["N", "N m"] * 3
    picture = untold.pictures[1]
    assert picture.title == "Joint knee"
    assert "moves with the parts and is first seen at (0.8, 0.1, 1.2) m" in picture.caption


def test_truth_is_that_of_the_joint_at_the_same_place_and_carried_to_it(two):
    estimate, truth = two
    swapped = {name: values[:, ::-1] if name != "time" else values for name, values in truth.items()}
    off = np.array([0.0, 0.0, 1e-3])
    swapped["joint_point"] = swapped["joint_point"] + off
    found = joint_truth(estimate.time, estimate.interface, 0, swapped)
    np.testing.assert_allclose(found[:, :3], truth["joint_force"][:, 0])
    expected = truth["joint_moment"][:, 0] + np.cross(off, truth["joint_force"][:, 0])
    np.testing.assert_allclose(found[:, 3:], expected)
    far = truth | {"joint_point": truth["joint_point"] + 0.1}
    assert np.isnan(joint_truth(estimate.time, estimate.interface, 0, far)).all()
    assert len(draw_joint(estimate.time, estimate.interface, 0, truth).axes[0].lines) == 2
    assert len(draw_joint(estimate.time, estimate.interface, 0, far).axes[0].lines) == 1


def test_errors_within_their_claim_score_about_one(section, untold):
    assert section.heads[-1] == "Error over sigma: force, moment"
    for row in section.rows:
        np.testing.assert_allclose([float(x) for x in row[-1].split(", ")], 1.0, atol=0.1)
    assert len(untold.heads) == len(section.heads) - 1


@pytest.mark.long
def test_the_page_tells_verdict_sizes_and_consistency_of_the_joints(two):
    estimate, truth = two
    html = render_page(estimate, truth)
    assert "Forces between parts" in html
    assert "Accurate: forces between the parts" in html
    assert "trunk on thigh" in html
    assert "<td>0.8333 per degree of freedom; one or less where they agree</td>" in html
    assert '<td class="number">0.17 mm</td>' in html
    assert html.count("<img") == 7
    assert "://" not in html


def test_the_null_space_is_named_and_no_figure_drawn_of_it(looped):
    estimate, truth = looped
    section = joint_section(estimate, truth)
    assert [p.title for p in section.pictures] == ["Joint knee"]
    assert section.rows[0][2] == "not identifiable"
    said = dict(section.facts)
    assert said["Not told: hip"].startswith("force x, y, z; moment x; over the record, world axes")
    assert "loads from outside balance" in said["Null space: hip"]
    assert "Not told: knee" not in said


@pytest.mark.long
def test_joints_that_are_refused_say_why_on_the_page(two):
    whole, _ = two
    nothing = {
        name: np.full_like(getattr(whole.interface, name), np.nan) for name in (*FIELDS, "point", "gap")
    }
    reasons = (Finding("code", "refused", {}, "part shank: three samples cannot show a force"),)
    chi = np.full(len(whole.time), np.nan)
    estimate, truth = jointed(
        whole,
        **nothing,
        determined=np.zeros(2, bool),
        chi_square=chi,
        dof=0,
        verdict=Verdict("refused", reasons),
    )
    html = render_page(estimate, truth)
    assert "Refused: no force between the parts" in html
    assert "Part shank: three samples cannot show a force." in html
    assert "all of it" in html
    assert "none</td>" in html
    assert html.count("<img") == 5


def test_a_whole_body_has_no_section_of_joints(throw, page):
    assert joint_section(throw()[0]) is None
    assert "Forces between parts" not in page
