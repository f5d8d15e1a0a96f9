"""First moments of force on affine bodies: closed forms, the scene's truth, and what markers cannot show."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.affine.motion import MOMENT, affine_motion, first_moments
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.run import estimate_recording, estimate_whole
from forceid.files.stored.hdf5 import read_motion
from forceid.principal import axial
from forceid.records import Body, Motion, Recording
from forceid.scenes.flights.spinning_block import CORNERS

STORED = Path(__file__).parents[3] / "data/synthetic/spinning_block.h5"
SIGMA, TIME, EYE = 3e-4, np.arange(300) / 500, np.eye(3)
INNER = slice(38, -38)
X = CORNERS * [0.24, 0.18, 0.14]
BLOCK = Body(tuple("abcdefgh"), X, np.full(8, 0.06))
PLATE = np.array([[x, y, 0.0] for x in (-0.12, 0.0, 0.12) for y in (-0.09, 0.0, 0.09)])
FLAT = Body(tuple("abcdefghi"), PLATE, np.full(9, 0.05))
THICK = np.diag([3e-3, 2e-3, 1e-3])  # second moment of a body whose markers lie in a plane
TILT = Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix()


def second_moment(body):
    return (body.mass * body.position.T) @ body.position


def told_whole(E, position):
    """A body known by its mass and inertia, with markers at position."""
    names = tuple("abcdefghi")[: len(position)]
    inertia = np.trace(E) * EYE - E
    return Body(names, position, total_mass=0.45, mass_center=np.zeros(3), inertia=inertia)


def swinging():
    """F and F'' of a map that swings while it turns: smooth, and known in closed form."""
    w, spin = 2 * np.pi * 3.0, 5.0
    rate = np.diag([0.1, -0.08, 0.05])
    swing = EYE + np.sin(w * TIME)[:, None, None] * rate + 0.05 * np.cos(w * TIME)[:, None, None]
    dswing = w * (np.cos(w * TIME)[:, None, None] * rate - 0.05 * np.sin(w * TIME)[:, None, None])
    R = Rotation.from_rotvec(np.outer(spin * TIME, [0.6, 0.0, 0.8])).as_matrix()
    W = spin * np.array([[0.0, -0.8, 0.0], [0.8, 0.0, -0.6], [0.0, 0.6, 0.0]])
    return R @ swing, R @ (w**2 * (EYE - swing) + 2 * W @ dswing + W @ W @ swing)


def filmed(body, F, seed=0):
    x = np.einsum("tab,nb->tna", F, body.position) + np.array([0.3, 0.1, 1.0])
    x = x + SIGMA * np.random.default_rng(seed).standard_normal(x.shape)
    return Recording(body, Motion(TIME, x, noise_std={"position": SIGMA}))


def estimated(recording):
    return estimate_recording(recording, load_settings(model="affine"))


def std_of(cov):
    return np.sqrt(np.diagonal(cov, axis1=1, axis2=2))


def close(found, truth, inner=INNER):
    error = (found.first_moment - truth).reshape(len(truth), 9)[inner]
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(truth[inner] ** 2))
    assert (np.abs(error) < 1.96 * std_of(found.first_moment_cov)[inner]).mean() > 0.8


@pytest.fixture(scope="module")
def stored():
    return read_motion(STORED)


@pytest.fixture(scope="module")
def result(stored):
    return estimated(stored)


def test_momentum_and_moment_of_nodes_give_the_first_moments_that_their_forces_make():
    rng = np.random.default_rng(4)
    x, mass = rng.standard_normal((9, 3)), rng.uniform(0.1, 1.0, 9)
    x -= mass @ x / mass.sum()
    E = (mass * x.T) @ x
    R = Rotation.random(rng=rng).as_matrix()
    G, dG, ddG = EYE + 0.2 * rng.standard_normal((3, 3)), *rng.standard_normal((2, 3, 3))
    W, dW = (np.cross(EYE, rng.standard_normal(3)).T for _ in range(2))
    place, speed = x @ (R @ G).T, x @ (R @ (dG + W @ G)).T
    force = mass[:, None] * (x @ (R @ (ddG + 2 * W @ dG + (dW + W @ W) @ G)).T)
    H, T = np.cross(place, mass[:, None] * speed).sum(0), np.cross(place, force).sum(0)
    found = R @ first_moments(G, dG, ddG, E, R.T @ H, R.T @ T) @ R.T
    np.testing.assert_allclose(found, force.T @ place, atol=1e-12)


@pytest.mark.long
def test_covariance_is_that_of_small_errors_of_all_that_the_first_moments_are_made_of(stored):
    _, solution = estimate_whole(stored, load_settings(model="affine"))
    kin, state, bend = solution.kinematics, solution.state, solution.deformation
    rng, T, modes = np.random.default_rng(0), len(kin.time), len(kin.shapes)
    small = 1e-3  # of the claims: so that the map is linear
    own = (bend.motion_cov, state.wrench_cov[:, 3:, 3:], state.pose_cov[:, 3:, 3:])
    roots = [np.linalg.cholesky(c) for c in own]
    here, N = affine_motion(kin, state, bend), []
    for _ in range(400):
        q, moment, turn = (small * (L @ rng.standard_normal((T, L.shape[1], 1)))[..., 0] for L in roots)
        q = q.reshape(T, modes, 3)
        path = bend.path.copy()
        chains = path.reshape(T, modes, -1)
        chains[..., 0] += q[..., 0]
        chains[..., 1] += q[..., 1]
        chains[..., 2] += q[..., 2] - np.einsum("ka,tka->tk", bend.prior.motion[:, 2, :2], q[..., :2])
        moved = replace(bend, amplitude=bend.amplitude + q[..., 0], rate=bend.rate + q[..., 1], path=path)
        turned = Rotation.from_rotvec(turn).as_matrix() @ state.rotation
        flight = replace(state, moment=state.moment + moment, rotation=turned)
        N.append((affine_motion(kin, flight, moved).first_moment - here.first_moment).reshape(T, 9) / small)
    scatter = np.sqrt(np.mean(np.square(N), axis=0))
    np.testing.assert_allclose(scatter / std_of(here.first_moment_cov), 1, atol=6 / np.sqrt(800))


def test_free_flight_shows_no_first_moment():
    F0 = Rotation.from_rotvec([0.2, -0.3, 0.1]).as_matrix() @ np.diag([1.1, 0.9, 1.0])
    rate = np.array([[0.3, -0.8, 0.1], [0.7, 0.2, 0.0], [0.1, -0.3, -0.2]])
    F = F0 + TIME[:, None, None] * rate
    found, E = estimated(filmed(BLOCK, F)), second_moment(BLOCK)
    size = np.abs(rate @ E @ rate.T).max()  # of the first moments that its rotation alone would call for
    assert np.abs(found.first_moment[INNER]).max() < 0.5 * size
    assert (np.abs(found.first_moment.reshape(-1, 9)) < 4 * std_of(found.first_moment_cov))[INNER].all()
    assert np.abs(found.F_rate - rate)[INNER].max() < 0.02
    assert np.abs(found.F - F)[INNER].max() < 1e-3


@pytest.mark.long
def test_rigid_rotation_shows_its_centripetal_tensor():
    w, amplitude = 2 * np.pi * 3.0, 0.4
    angle = 6.0 * TIME + amplitude * np.sin(w * TIME)
    rate, turning = 6.0 + amplitude * w * np.cos(w * TIME), -amplitude * w**2 * np.sin(w * TIME)
    tilt = Rotation.from_rotvec([0.4, 0.2, 0.0]).as_matrix()
    R = tilt @ Rotation.from_rotvec(np.outer(angle, [0.0, 0.0, 1.0])).as_matrix()
    Z, plane = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]]), np.diag([1.0, 1.0, 0.0])
    rates = turning[:, None, None] * Z - rate[:, None, None] ** 2 * plane
    found = estimated(filmed(BLOCK, R))
    close(found, R @ rates @ second_moment(BLOCK) @ R.mT)
    np.testing.assert_allclose(found.stretch[INNER], np.tile(EYE, (224, 1, 1)), atol=3e-3)


def test_what_is_antisymmetric_in_the_first_moments_is_the_moment_of_the_result(result):
    assert np.abs(axial(result.first_moment.mT) - result.moment).max() < 1e-12
    cov = MOMENT @ result.first_moment_cov @ MOMENT.T
    assert np.abs(cov - result.wrench_cov[:, 3:, 3:]).max() < 1e-15


def test_the_truth_of_the_scene_lies_within_the_claims(stored, result):
    off = (result.first_moment - stored.truth["first_moment"]).reshape(-1, 9)
    inside = np.abs(off) <= 1.959964 * std_of(result.first_moment_cov)
    assert 0.92 <= inside[75:-75].mean() <= 0.98


def test_stretch_is_that_of_the_map_from_the_reference(stored, result):
    x, X = stored.motion.position, stored.body.position
    F = np.einsum("tna,bn->tab", x - x.mean(1, keepdims=True), np.linalg.pinv(X - X.mean(0)))
    off = (result.stretch @ result.stretch - F.mT @ F)[75:-75]
    assert np.sqrt(np.mean(off**2)) < 0.01  # of one frame: noise of 2 sigma / size


@pytest.mark.long
def test_flat_body_has_all_nine_first_moments_and_its_stretch_across_is_open():
    F, ddF = swinging()
    found = estimated(filmed(FLAT, F))
    close(found, ddF @ second_moment(FLAT) @ F.mT)
    U, square = found.stretch[:, :2, :2], (F.mT @ F)[:, :2, :2]
    np.testing.assert_allclose((U @ U)[20:-20], square[20:-20], atol=5e-3)
    assert np.isnan(found.stretch[:, 2]).all()
    assert np.isnan(found.stretch[:, :, 2]).all()
    assert found.F is None
    assert found.verdict.codes == ("stretch-open",)


def test_a_stretch_that_moves_no_mass_degrades_only_what_asks_for_it():
    """Three masses, all marked: they lie in a plane, and nothing of force and moment is open."""
    flown = read_motion(STORED.with_name("planar_boomerang.h5"))
    levels = {model: estimate_recording(flown, load_settings(model=model)) for model in ("auto", "affine")}
    assert all("stretch-open" in found.verdict.codes for found in levels.values())
    assert {name: found.verdict.level for name, found in levels.items()} == {
        "auto": "ok",
        "affine": "degraded",
    }


@pytest.mark.parametrize("turn", [EYE, TILT], ids=["along", "askew"])
def test_markers_in_a_plane_of_a_body_with_breadth_leave_its_first_moments_open(turn):
    F, _ = swinging()
    found = estimated(filmed(told_whole(turn @ THICK @ turn.T, PLATE), F))
    assert np.isnan(found.first_moment).all()
    assert np.isnan(found.first_moment_cov).all()
    assert np.isfinite(found.force).all()
    assert "first-moments-open" in found.verdict.codes


@pytest.mark.long
def test_mass_center_off_the_plane_of_the_markers_leaves_the_force_open():
    F, _ = swinging()
    found = estimated(filmed(told_whole(THICK, PLATE + np.array([0.0, 0.0, 0.05])), F))
    assert "affine-force-open" in found.verdict.codes
    assert found.verdict.level == "degraded"


def test_markers_in_space_on_a_flat_body_show_all_nine():
    F, ddF = swinging()
    E = np.diag([3e-3, 2e-3, 0.0])
    found = estimated(filmed(told_whole(E, CORNERS * 0.2), F))
    close(found, ddF @ E @ F.mT)
    assert "stretch-without-breadth" in found.verdict.codes


@pytest.mark.long
def test_lost_markers_leave_a_plate_its_first_moments():
    F, ddF = swinging()
    recording = filmed(FLAT, F)
    x = recording.motion.position.copy()
    x[100:130, [0, 2, 5, 7]] = np.nan
    found = estimated(replace(recording, motion=replace(recording.motion, position=x)))
    close(found, ddF @ second_moment(FLAT) @ F.mT)


def test_stress_in_a_plate_is_not_told_and_said_so():
    F, _ = swinging()
    body = replace(FLAT, material={"name": "st_venant_kirchhoff", "lam": 3.0, "mu": 2.0})
    found = estimated(filmed(body, F))
    assert found.applied_first_moment is None
    assert "stress-open" in found.verdict.codes


def test_a_swing_far_above_the_load_is_followed_with_its_first_moments():
    w, depth, slow = 2 * np.pi * 24.0, 6e-4, 4 * np.pi
    size = 1 + 0.06 * np.sin(slow * TIME) + depth * np.sin(w * TIME)
    rate = 0.06 * slow * np.cos(slow * TIME) + depth * w * np.cos(w * TIME)
    bend = -0.06 * slow**2 * np.sin(slow * TIME) - depth * w**2 * np.sin(w * TIME)
    R = Rotation.from_rotvec(np.outer(4.0 * TIME, [0.0, 0.6, 0.8])).as_matrix()
    W = 4.0 * np.array([[0.0, -0.8, 0.6], [0.8, 0.0, 0.0], [-0.6, 0.0, 0.0]])
    size, rate, bend = (a[:, None, None] for a in (size, rate, bend))
    ddF = R @ (bend * EYE + 2 * rate * W + size * W @ W)
    truth = ddF @ second_moment(BLOCK) @ (R * size).mT
    found = estimated(filmed(BLOCK, R * size))
    error = (found.first_moment - truth).reshape(-1, 9)[INNER]
    swing = (depth * w**2 * second_moment(BLOCK)).ravel() / np.sqrt(2)
    assert np.sqrt(np.mean(error**2)) < 0.7 * np.sqrt(np.mean(swing**2))
    assert (np.abs(error) < 1.96 * std_of(found.first_moment_cov)[INNER]).mean() > 0.85


@pytest.mark.long
def test_rigid_and_filtered_flights_have_none(stored):
    rigid = estimate_recording(stored, load_settings(model="rigid", method="savgol"))
    assert rigid.first_moment is rigid.first_moment_cov is rigid.stretch is None
    filtered = estimate_recording(stored, load_settings(model="affine", method="filter"))
    assert filtered.first_moment is None
    assert filtered.stretch is not None


@pytest.mark.long
def test_ladder_takes_affine_and_neither_rigid_nor_modal(stored):
    estimate = estimate_recording(stored, load_settings())
    assert estimate.model == "affine"
    assert estimate.ladder["rigid_vetoed"] == 1.0
    best = max(v for k, v in estimate.ladder.items() if k.startswith("modal") and k.endswith("evidence"))
    assert estimate.ladder["affine_evidence"] > best


@pytest.mark.long
def test_a_rejected_spike_does_not_enter_the_first_moments(stored, result):
    x = stored.motion.position.copy()
    x[300, 2] += 0.05
    found = estimated(replace(stored, motion=replace(stored.motion, position=x)))
    assert "spikes" in found.verdict.codes
    assert np.abs(found.first_moment - result.first_moment).max() < 0.1 * np.abs(result.first_moment).max()


@pytest.mark.long
def test_a_body_known_as_a_whole_has_the_loads_of_the_same_body_known_by_its_masses(stored, result):
    known = inertia_of(stored.body)
    body = replace(
        stored.body, mass=None, total_mass=known.mass, mass_center=known.center, inertia=known.tensor
    )
    whole = estimated(replace(stored, body=body))
    assert np.abs(whole.moment - result.moment).max() < 1e-6 * np.abs(result.moment).max()
    assert np.abs(whole.first_moment - result.first_moment).max() < 1e-6 * np.abs(result.first_moment).max()
