"""Which mass an affine map of the markers may speak for, and what is said where none does."""

import numpy as np
import pytest

from evidence.drawn.plate_face import SIGMA, plate_flight
from forceid.config import load_settings
from forceid.estimation.body.deformation_residual import lever
from forceid.estimation.model_choice.load_seen import expected_error
from forceid.estimation.run import estimate_recording

CORNERS = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3)


def test_lever_is_the_momentum_that_independent_markers_give_an_affine_body():
    rng = np.random.default_rng(3)
    X, mass = rng.standard_normal((9, 3)), rng.uniform(0.5, 2.0, 9)
    X -= mass @ X / mass.sum()
    Z = np.column_stack([np.ones(9), X])
    marked = np.arange(9) < 6
    u = rng.standard_normal((20000, 6, 3))
    moved = np.einsum("kn,tna->tka", Z @ np.linalg.pinv(Z[marked]), u)  # of all nodes, by the map of six
    force = (np.einsum("n,tna->ta", mass, moved) ** 2).mean() / mass.sum() ** 2
    turned = (np.einsum("n,tna->ta", mass, np.cross(X, moved)) ** 2).sum(1).mean()
    moment = turned / (3 * mass.sum() * (mass @ (X**2).sum(1)))
    assert lever(X, marked, Z.T @ (mass[:, None] * Z)) ** 2 == pytest.approx(max(force, moment), rel=0.05)


def test_lever_grows_as_the_mass_center_leaves_markers_that_are_nearly_in_a_plane():
    moments = np.diag([1.0, 1.0, 1.0, 1.0])
    around = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    face = around * [1, 1, 0.05] + [0, 0, 0.5]
    four = np.ones(4, bool)
    assert lever(around, four, moments) == 0.5
    assert lever(face, four, moments) > 0.5 / 0.05 * 0.5
    assert lever(face * [1, 1, 0], four, moments) == np.inf
    assert lever(around, four, np.full((4, 4), np.nan)) == np.inf


def test_expected_error_takes_what_chance_explains_for_none_of_the_bias():
    rng = np.random.default_rng(0)
    truth = np.zeros((4000, 3))
    small, more = (0.6 * rng.standard_normal((4000, 3)) for _ in range(2))
    better, worse = truth + small, truth + small + more
    one, both = np.full((4000, 3), 0.6), np.full((4000, 3), np.sqrt(0.72))
    assert expected_error(better, one, worse, both) == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert expected_error(worse, both, better, one) == pytest.approx(np.sqrt(2), rel=0.05)
    off = expected_error(better + 2.0, one, worse, both)
    assert off == pytest.approx(np.sqrt(0.5 + 4 / 0.72), rel=0.05)
    assert expected_error(better * [1, 1, np.nan], one, worse, both) == np.inf


@pytest.mark.long
@pytest.mark.parametrize(("markers", "told"), [(4, "total mass"), (3, "modes")])
def test_few_markers_on_one_face_leave_no_force_open_that_a_rigid_fit_tells(markers, told):
    ratio = []
    for seed in range(1, 10):
        recording = plate_flight(seed, markers, told)
        taken, rigid = (
            estimate_recording(recording, load_settings(model=m, lines="none")) for m in ("auto", "rigid")
        )
        off = [np.sqrt(((e.force - recording.truth["force"])[60:-60] ** 2).mean()) for e in (taken, rigid)]
        assert taken.model != "affine"
        ratio.append(off[0] / off[1])
    assert np.median(ratio) < 1.2


@pytest.mark.long
def test_poses_that_allow_for_deformation_show_no_noise_below_the_stated():
    """Four markers hardly tell three modes from the pose: rigid, the force is 30 N off."""
    recording = plate_flight(100, 4, "modes")
    found = estimate_recording(recording, load_settings(lines="none"))
    assert found.tuned["noise_std_position"] == SIGMA
    assert np.sqrt(((found.force - recording.truth["force"])[60:-60] ** 2).mean()) < 0.1


@pytest.mark.long
def test_total_mass_and_markers_that_do_not_move_as_one_are_never_ok():
    found = estimate_recording(plate_flight(0, 5, "total mass"), load_settings(lines="none"))
    assert found.verdict.level == "degraded"
    (said,) = (r for r in found.verdict.reasons if "total mass and inertia do not say" in r)
    assert 12 < float(said.split("chi-square ")[1].split()[0]) < 13
