"""How well markers tell rigid motion from deformation, against closed forms and published tables."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.optimize import brentq

from forceid.config import load_settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.verdict.leakage import joint_condition, leakage, rigid_condition, rotation_sigma, sine
from forceid.motion.pose import pose_rank
from forceid.principal.operator import summation_operator

TRIANGLE = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.15, 0]])
NEARLY_A_LINE = np.array([[0, 0, 0], [0.2, 0, 0], [0.1, 0.002, 0]])
FIVE_IN_A_PLANE = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.15, 0], [0.1, 0.1, 0], [-0.1, 0.05, 0]])
TETRAHEDRON = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.15, 0], [0, 0, 0.1]])
LINE = np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])


def looked_at(recording, **settings):
    return leakage(recording.body, kinematics(recording.body, recording.motion, load_settings(**settings)))


def free_beam(x):
    """Deflection of the first mode of a uniform free beam of 1 m, closed form, and its rigid motions."""
    b = brentq(lambda b: np.cosh(b) * np.cos(b) - 1, 4.0, 5.5)
    ratio = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
    mode = np.cosh(b * x) + np.cos(b * x) - ratio * (np.sinh(b * x) + np.sin(b * x))
    return np.stack([np.ones_like(x), x - 0.5], 1), mode[:, None]


@pytest.mark.parametrize(
    ("nodes", "published"), [([0, 5, 10, 15, 20], 0.93846), ([9, 10, 11, 12], 0.03802)], ids=["even", "near"]
)
def test_angle_of_a_beam_mode_with_rigid_motion_is_the_published_one(nodes, published):
    rigid, mode = free_beam(np.linspace(0, 1, 21)[nodes])
    assert sine(rigid, mode)[0] == pytest.approx(published, abs=5e-6)


def test_sine_is_one_where_rigid_motion_does_not_feel_the_shape_and_zero_where_it_is_one():
    rng = np.random.default_rng(0)
    rigid = rng.standard_normal((12, 6))
    Q = np.linalg.qr(rigid, mode="complete")[0]
    assert sine(rigid, Q[:, 6:]) == pytest.approx(1.0)
    assert sine(rigid, rigid @ rng.standard_normal((6, 3))) == pytest.approx(0.0, abs=1e-12)
    angle = 0.3
    turned = np.cos(angle) * Q[:, :1] + np.sin(angle) * Q[:, 7:8]
    assert sine(rigid, 5 * turned)[0] == pytest.approx(np.sin(angle))


def test_sine_of_two_columns_is_that_of_their_condition():
    # of two unit columns at angle a the condition is cot(a / 2)
    a = 0.4
    both = np.array([[1.0, np.cos(a)], [0.0, np.sin(a)]])
    assert joint_condition(7 * both[:, :1], both[:, 1:]) == pytest.approx(1 / np.tan(a / 2))
    assert joint_condition(both[:1, :1], both[:1, 1:]) == np.inf


@pytest.mark.parametrize(
    ("markers", "rigid", "affine"),
    [(LINE, 5, 6), (TRIANGLE, 6, 9), (FIVE_IN_A_PLANE, 6, 9), (TETRAHEDRON, 6, 12)],
    ids=["line", "triangle", "plane", "solid"],
)
def test_ranks_are_the_published_ones(markers, rigid, affine):
    assert pose_rank(summation_operator(markers)) == rigid
    assert 3 * np.linalg.matrix_rank(np.hstack([markers, np.ones((len(markers), 1))])) == affine
    assert np.isfinite(rigid_condition(markers)) == (rigid == 6)


def test_rotation_of_a_triangle_is_as_uncertain_as_published():
    assert rotation_sigma(TRIANGLE) == pytest.approx([0.54019, 0.405142, 0.280691], rel=2e-6)
    assert rotation_sigma(NEARLY_A_LINE) == pytest.approx([35.086, 0.40514, 0.40512], rel=2e-5)
    assert rigid_condition(NEARLY_A_LINE) == pytest.approx(86.6083, abs=1e-4)


def test_turn_about_a_line_is_not_known_at_all():
    assert rotation_sigma(LINE)[0] == np.inf
    assert np.isfinite(rotation_sigma(LINE)[1:]).all()


def test_rotation_sigma_is_what_noise_does_to_a_fit():
    from forceid.motion.frames import fit_pose
    from forceid.motion.pose import log

    rng = np.random.default_rng(0)
    x = TRIANGLE + 1e-5 * rng.standard_normal((4000, 3, 3))
    turned = log(fit_pose(x, TRIANGLE - TRIANGLE.mean(0), np.ones(3), 1e-10 * np.eye(9)).rotation)
    assert np.degrees(turned.std(0)) == pytest.approx(1e-2 * rotation_sigma(TRIANGLE), rel=0.05)


def test_rigid_fit_takes_of_a_mode_what_it_takes_of_the_mode_drawn_on_the_markers():
    # a mode of the first node alone, given: the fit's leak is found by moving the markers by it
    from forceid.estimation.body.deforming.modes import split_rigid
    from forceid.motion.frames import fit_pose

    recording = cf.toss()
    raw = np.zeros((1, 6, 3))
    raw[0, 0] = [1.0, 2.0, 0.5]
    body = replace(recording.body, mode_shape=raw, mode_frequency=np.array([12.0]))
    kin = kinematics(body, recording.motion, load_settings(model="rigid"))
    found = leakage(body, kin)
    assert found.name == ("mode 1 (12 Hz)",)
    shape = split_rigid(raw, kin.shape, kin.inertia.weight)[1][0]
    size = 1e-6
    pose = fit_pose((kin.shape + size * shape)[None], kin.shape, np.ones(6), cf.NOISE**2 * np.eye(18))
    moved = (pose.center + np.einsum("tab,nb->tna", pose.rotation, kin.shape) - kin.shape)[0]
    percent = 100 * np.sqrt((moved**2).sum() / (size**2 * (shape**2).sum()))
    assert found.to_rigid[0] == pytest.approx(percent, abs=1e-3)


def test_shape_in_the_model_leaks_less_than_one_that_is_left_out():
    recording = cf.waved(cf.toss())
    x = recording.motion.position.copy()
    x[::4, 3] = np.nan  # uneven markers: their fit is not that of the masses
    found = looked_at(cf.seen_as(recording, x))
    assert found.name[0] == "shape 1"
    assert found.to_rigid[0] < 0.1
    assert found.to_rigid_worst[0] >= found.to_rigid[0]
    assert found.to_shape == 0.0


def test_rigid_body_is_asked_what_its_strains_would_do():
    found = looked_at(cf.toss())
    assert found.name == tuple(f"strain {k}" for k in range(1, 7))
    assert found.to_rigid == pytest.approx(0.0, abs=1e-9)  # six markers in pairs: equal weights, equal masses
    assert found.numbers()["shape_to_rigid_percent"] == pytest.approx(0.0, abs=1e-9)


def test_markers_on_a_line_have_no_leakage_to_speak_of_and_no_markers_none_at_all():
    line = looked_at(cf.toss(body=cf.points([0.1, 0, 0, 0.1], [-0.1, 0, 0, 0.1])))
    assert line.name == ()
    assert line.condition == np.inf
    assert looked_at(cf.mean_motion()) is None
