"""First moments of bodies and markers in a plane: what is shown is right, what is open is NaN and said."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import DataError
from forceid.estimation.affine.channels import affine_channels, aligned_basis, observed_arms
from forceid.estimation.affine.loads import affine_loads
from forceid.estimation.body.material import Solid
from forceid.pseudorigid.material.materials import MooneyRivlin
from forceid.records import Body, Motion, Recording
from forceid.scenes.flights.spinning_block import CORNERS

SIGMA, TIME = 3e-4, np.arange(300) / 500
PLATE = np.array([[x, y, 0.0] for x in (-0.12, 0.0, 0.12) for y in (-0.09, 0.0, 0.09)])
FLAT = Body(node=tuple("abcdefghi"), position=PLATE, mass=np.full(9, 0.05))
THICK = np.diag([3e-3, 2e-3, 1e-3])  # second moment of a body whose markers lie in a plane
TILT = Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix()


def inertia(E):
    return np.trace(E) * np.eye(3) - E


def covered(E=THICK, position=PLATE):
    return Body(
        node=FLAT.node, position=position, total_mass=0.45, mass_center=np.zeros(3), inertia=inertia(E)
    )


def swinging():
    """F and F'' of a map that swings along its axes while it turns: smooth, and known in closed form."""
    w, spin = 2 * np.pi * 3.0, 5.0
    rate = np.diag([0.1, -0.08, 0.05])
    swing = np.eye(3) + np.sin(w * TIME)[:, None, None] * rate + 0.05 * np.cos(w * TIME)[:, None, None]
    dswing = w * (np.cos(w * TIME)[:, None, None] * rate - 0.05 * np.sin(w * TIME)[:, None, None])
    ddswing = w**2 * (np.eye(3) - swing)
    R = Rotation.from_rotvec(np.outer(spin * TIME, [0.6, 0.0, 0.8])).as_matrix()
    W = spin * np.array([[0.0, -0.8, 0.0], [0.8, 0.0, -0.6], [0.0, 0.6, 0.0]])
    return R @ swing, R @ (ddswing + 2 * W @ dswing + W @ W @ swing)


def filmed(body, F, seed=0):
    x = np.einsum("tab,nb->tna", F, body.position) + np.array([0.3, 0.1, 1.0])
    x = x + SIGMA * np.random.default_rng(seed).standard_normal(x.shape)
    return Recording(body, Motion(TIME, position=x, noise_std={"position": SIGMA}))


def close(found, truth, cov):
    error, middle = (found - truth).reshape(300, -1)[38:-38], slice(38, -38)
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))[middle]
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(truth[middle] ** 2))
    assert (np.abs(error) < 1.96 * std).mean() > 0.8


def test_flat_body_has_all_nine_first_moments_and_no_arm_off_its_plane():
    F, ddF = swinging()
    E = 0.05 * PLATE.T @ PLATE
    found = affine_loads(filmed(FLAT, F))
    truth = ddF @ E @ F.mT
    close(found.first_moment, truth, found.first_moment_cov)
    close(found.arm_moment, (ddF @ E)[..., :2], found.arm_moment_cov)
    normal = np.cross(found.spanned[..., 0], found.spanned[..., 1])
    off = np.einsum("tab,tb->ta", found.first_moment, normal / np.linalg.norm(normal, axis=1)[:, None])
    assert np.abs(off).max() < 0.02 * np.abs(truth).max()
    assert "the stretch across it is open" in found.reasons[0]
    assert len(found.reasons) == 1


def test_stretch_of_a_plate_is_known_in_its_plane_and_nan_across():
    F, _ = swinging()
    found = affine_loads(filmed(FLAT, F))
    square = F[..., :2].mT @ F[..., :2]
    U = found.stretch[:, :2, :2]
    np.testing.assert_allclose((U @ U)[20:-20], square[20:-20], atol=5e-3)
    assert np.isnan(found.stretch[:, 2]).all()
    assert np.isnan(found.stretch[:, :, 2]).all()
    np.testing.assert_allclose(found.F[20:-20, :, :2], F[20:-20, :, :2], atol=3e-3)
    for open_map in (found.F, found.dF, found.ddF):
        assert np.isnan(open_map[..., 2]).all()
        assert np.isfinite(open_map[..., :2]).all()
    known = np.isfinite(np.diagonal(found.F_cov, axis1=1, axis2=2)).reshape(-1, 3, 3)
    assert known[..., :2].all()
    assert not known[..., 2].any()


def test_markers_in_a_plane_of_a_body_with_breadth_show_moments_of_arms_in_that_plane_only():
    F, ddF = swinging()
    found = affine_loads(filmed(covered(), F))
    assert np.isnan(found.first_moment).all()
    assert np.isnan(found.first_moment_cov).all()
    assert np.isnan(found.moment).all()
    np.testing.assert_array_equal(found.arms, np.eye(3)[:, :2])
    close(found.arm_moment, (ddF @ THICK)[..., :2], found.arm_moment_cov)
    assert np.isfinite(found.force).all()
    assert any("first moments are told for arms along 2" in said for said in found.reasons)


def test_arms_of_a_body_that_lies_askew_are_those_whose_moment_the_plane_shows():
    F, ddF = swinging()
    E = TILT @ THICK @ TILT.T
    found = affine_loads(filmed(covered(E), F))
    normal = np.array([0.0, 0.0, 1.0])
    assert np.abs(normal @ E @ found.arms).max() < 1e-15
    close(found.arm_moment, ddF @ E @ found.arms, found.arm_moment_cov)


def test_plane_that_lies_askew_shows_the_same_as_one_along_the_axes():
    F, ddF = swinging()
    body = covered(TILT @ THICK @ TILT.T, PLATE @ TILT.T)
    found = affine_loads(filmed(body, F @ TILT.T))
    close(found.arm_moment, ddF @ THICK @ TILT.T @ found.arms, found.arm_moment_cov)
    assert np.isnan(found.stretch).all()  # every reference axis is off the plane
    np.testing.assert_allclose(
        found.spanned.mT @ found.spanned,
        (TILT.T @ found.span).T @ (F.mT @ F) @ TILT.T @ found.span,
        atol=8e-3,
    )


def test_mass_center_off_the_plane_of_the_markers_leaves_the_force_open():
    F, ddF = swinging()
    found = affine_loads(filmed(covered(position=PLATE + np.array([0.0, 0.0, 0.05])), F))
    assert np.isnan(found.force).all()
    assert np.isnan(found.force_cov).all()
    assert np.isnan(found.center).all()
    close(found.arm_moment, (ddF @ THICK)[..., :2], found.arm_moment_cov)
    assert "the force is open" in " ".join(found.reasons)


def test_markers_in_space_on_a_flat_body_show_all_nine():
    F, ddF = swinging()
    E = np.diag([3e-3, 2e-3, 0.0])
    solid = Body(
        node=tuple("abcdefgh"), position=CORNERS * 0.2, total_mass=0.4, mass_center=np.zeros(3),
        inertia=inertia(E),
    )  # fmt: skip
    found = affine_loads(filmed(solid, F))
    close(found.first_moment, ddF @ E @ F.mT, found.first_moment_cov)
    assert "no breadth" in found.reasons[0]


def test_lost_markers_leave_a_plate_its_first_moments():
    F, ddF = swinging()
    recording = filmed(FLAT, F)
    x = recording.motion.position.copy()
    x[100:130, [0, 2, 5, 7]] = np.nan
    holed = replace(recording, motion=replace(recording.motion, position=x))
    assert affine_channels(holed, load_settings()).linked > 0.1
    found = affine_loads(holed)
    close(found.first_moment, ddF @ (0.05 * PLATE.T @ PLATE) @ F.mT, found.first_moment_cov)


def test_stress_in_a_plate_is_not_told_and_said_so():
    F, _ = swinging()
    found = affine_loads(filmed(FLAT, F), solid=Solid(MooneyRivlin.natural(2.5, 0.5, 2.0)))
    assert found.applied_first_moment is None
    assert "so is the stress in it" in found.reasons[-1]


def test_markers_on_a_line_are_refused_with_the_reason():
    line = covered(position=PLATE * [1.0, 0.0, 0.0])
    F, _ = swinging()
    with pytest.raises(
        DataError, match="spread along 1 directions, which show first moments of force about 1"
    ):
        affine_loads(filmed(line, F))


def test_body_of_full_breadth_seen_in_space_has_all_arms_and_nothing_to_say():
    assert observed_arms(THICK, np.eye(3))[0].shape == (3, 3)
    assert observed_arms(THICK, np.eye(3))[1]
    np.testing.assert_array_equal(aligned_basis(TILT), np.eye(3))
