"""First moments of force on affine bodies: closed forms, the scene's truth, and what markers cannot show."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.affine.channels import affine_channels, channel_in_body_axes
from forceid.estimation.affine.loads import affine_loads, smooth_affine
from forceid.estimation.affine.priors import tune_channels
from forceid.estimation.body.affine_fit import fit_affine
from forceid.estimation.body.material import Solid
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion
from forceid.kalman.engines import engine
from forceid.pseudorigid.material.materials import MooneyRivlin
from forceid.records import Body, Motion, Recording
from forceid.scenes.flights.spinning_block import CORNERS, Parameters

STORED = Path(__file__).parents[3] / "data/synthetic/spinning_block.h5"
SIGMA, TIME = 3e-4, np.arange(300) / 500
X = CORNERS * [0.24, 0.18, 0.14]
BODY = Body(node=tuple("abcdefgh"), position=X, mass=np.full(8, 0.06))
E = 0.06 * X.T @ X


def filmed(F, seed=0, body=BODY):
    x = np.einsum("tab,nb->tna", F, body.position) + np.array([0.3, 0.1, 1.0])
    x = x + SIGMA * np.random.default_rng(seed).standard_normal(x.shape)
    return Recording(body, Motion(TIME, position=x, noise_std={"position": SIGMA}))


def since(recording):
    return recording.motion.time - recording.motion.time[0]


def twice_integrated(K, step):
    H = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (K[1:] + K[:-1]), 0) * step])
    return np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (H[1:] + H[:-1]), 0) * step])


def std_of(cov):
    return np.sqrt(np.diagonal(cov, axis1=1, axis2=2))


@pytest.fixture(scope="module")
def stored():
    return read_motion(STORED)


@pytest.fixture(scope="module")
def loads(stored):
    p = Parameters()
    return affine_loads(stored, solid=Solid(MooneyRivlin.natural(p.a, p.b, p.c)))


def test_free_flight_shows_no_first_moment():
    F0 = Rotation.from_rotvec([0.2, -0.3, 0.1]).as_matrix() @ np.diag([1.1, 0.9, 1.0])
    rate = np.array([[0.3, -0.8, 0.1], [0.7, 0.2, 0.0], [0.1, -0.3, -0.2]])
    found = affine_loads(filmed(F0 + TIME[:, None, None] * rate))
    size = np.abs(rate @ E @ rate.T).max()  # of the first moments that its rotation alone would call for
    assert np.abs(found.first_moment).max() < 0.5 * size
    assert (np.abs(found.first_moment.reshape(-1, 9)) < 4 * std_of(found.first_moment_cov)).all()
    assert np.abs(found.dF - rate).max() < 0.02
    assert np.abs(found.F - F0 - TIME[:, None, None] * rate).max() < 1e-3


def test_rigid_rotation_shows_the_moment_of_the_rigid_formula_and_its_centripetal_tensor():
    w, amplitude = 2 * np.pi * 3.0, 0.4
    angle = 6.0 * TIME + amplitude * np.sin(w * TIME)
    rate, turning = 6.0 + amplitude * w * np.cos(w * TIME), -amplitude * w**2 * np.sin(w * TIME)
    tilt = Rotation.from_rotvec([0.4, 0.2, 0.0]).as_matrix()
    R = tilt @ Rotation.from_rotvec(np.outer(angle, [0.0, 0.0, 1.0])).as_matrix()
    moment = np.outer((E[0, 0] + E[1, 1]) * turning, tilt[:, 2])
    Z, plane = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]]), np.diag([1.0, 1.0, 0.0])
    rates = turning[:, None, None] * Z - rate[:, None, None] ** 2 * plane
    tensor = (R @ rates @ E @ R.mT).reshape(-1, 9)
    middle, inside = slice(38, -38), []
    for seed in range(3):
        found = affine_loads(filmed(R, seed))
        for got, truth, std in (
            (found.moment, moment, std_of(found.moment_cov)),
            (found.first_moment.reshape(-1, 9), tensor, std_of(found.first_moment_cov)),
        ):
            assert np.abs(got - truth)[middle].max() < 0.1 * np.abs(truth).max()
            inside.append((np.abs(got - truth) < 1.96 * std)[middle].mean())
        np.testing.assert_allclose(found.stretch[middle], np.tile(np.eye(3), (224, 1, 1)), atol=3e-3)
    assert np.mean(inside[1::2]) > 0.92
    # so smooth a moment has few errors: of three records, six of seven within are chance enough
    assert np.mean(inside[::2]) > 0.86


def test_intervals_hold_the_first_moments_of_the_scene(stored, loads):
    middle = slice(75, -75)
    for name in ("first_moment", "applied_first_moment"):
        error = (getattr(loads, name) - stored.truth[name])[middle].reshape(-1, 9)
        std = std_of(getattr(loads, f"{name}_cov"))[middle]
        assert 0.92 < (np.abs(error) < 1.96 * std).mean() < 0.98
        assert np.sqrt(np.mean(error**2)) < 0.15 * np.sqrt(np.mean(stored.truth[name] ** 2))
    error = (loads.moment - stored.truth["moment"])[middle]
    assert (np.abs(error) < 1.96 * std_of(loads.moment_cov)[middle]).mean() > 0.9
    # the errors of one record's force are few: four fifths within is chance enough
    error = (loads.force - stored.truth["force"])[middle]
    assert (np.abs(error) < 1.96 * std_of(loads.force_cov)[middle]).mean() > 0.8
    assert error.std() < 0.1 * stored.truth["force"].std()


def test_stress_of_the_material_changes_no_moment(loads):
    axial = [
        [N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]]
        for N in (loads.first_moment, loads.applied_first_moment)
    ]
    np.testing.assert_allclose(axial[0], axial[1], atol=1e-10)
    np.testing.assert_allclose(np.array(axial[0]).T, loads.moment, atol=1e-12)
    assert np.abs(loads.first_moment - loads.applied_first_moment).max() > 0.1


def test_smoothed_map_is_better_than_that_of_a_frame_and_its_stretch_is_the_bodys(stored, loads):
    X = CORNERS * np.array(Parameters().size)
    raw = fit_affine(stored.motion.position, X, SIGMA**2)
    assert (
        np.trace(loads.F_cov, axis1=1, axis2=2).max()
        < 3 * np.trace(raw.cov[:, 1:, 1:], axis1=1, axis2=2).max()
    )
    np.testing.assert_allclose(loads.stretch @ loads.stretch, loads.F.mT @ loads.F, atol=1e-10)
    x = loads.center[:, None] + np.einsum("tab,nb->tna", loads.F, X)
    fall = 0.5 * since(stored)[:, None] ** 2 * stored.motion.gravity
    off = x + fall[:, None] - stored.motion.position
    assert off.std() == pytest.approx(SIGMA, rel=0.03)


def test_lost_markers_link_the_errors_and_widen_them(stored, loads):
    x = stored.motion.position[:200].copy()
    x[80:120, [0, 3, 5]] = np.nan
    x[150:153] = np.nan
    short = replace(stored.motion, time=stored.motion.time[:200], position=x)
    holed = replace(stored, motion=short)
    assert affine_channels(holed, load_settings()).linked > 0.1
    found = affine_loads(holed)
    error = (found.first_moment - stored.truth["first_moment"][:200]).reshape(-1, 9)
    std = std_of(found.first_moment_cov)
    assert (np.abs(error) < 1.96 * std)[25:175].mean() > 0.85
    assert std[90:110].mean() > 1.1 * std[30:70].mean()


def test_ladder_takes_affine_and_neither_rigid_nor_modal(stored):
    estimate = estimate_recording(stored, load_settings())
    assert estimate.model == "affine"
    assert estimate.ladder["rigid_vetoed"] == 1.0
    best = max(v for k, v in estimate.ladder.items() if k.startswith("modal") and k.endswith("evidence"))
    assert estimate.ladder["affine_evidence"] > best
    assert estimate.stretch.shape == (len(estimate.time), 3, 3)


def test_covariance_of_the_map_is_the_scatter_of_many_fits():
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.3], [0.0, 0.1, 1.2]])
    rng, seen = np.random.default_rng(5), X[[0, 1, 2, 4, 7]] + 0.02
    x = np.tile(seen @ F.T, (4000, 1, 1)) + SIGMA * rng.standard_normal((4000, 5, 3))
    fit = fit_affine(x, seen, SIGMA**2)
    error = np.concatenate([fit.center[..., None], fit.F - F], 2)
    scatter = np.einsum("tab,tac->bc", error, error) / 12000
    np.testing.assert_allclose(scatter, fit.cov[0], atol=0.05 * np.diagonal(scatter).max())


def test_markers_in_a_plane_show_the_map_in_that_plane_only():
    flat = X * [1.0, 1.0, 0.0]
    F = np.array([[1.1, 0.2, 0.4], [-0.1, 0.9, 0.3], [0.0, 0.1, 1.2]])
    fit = fit_affine((flat @ F.T)[None], flat, SIGMA**2)
    assert fit.plane
    assert np.isnan(fit.F).all()
    np.testing.assert_allclose(fit.columns[0], F @ fit.span, atol=1e-12)
    assert np.isnan(fit_affine((flat @ F.T)[None], flat + np.array([0, 0, 0.1]), SIGMA**2).center).all()


def test_channel_in_the_body_moves_as_the_turned_load_drives_it(stored):
    channels = affine_channels(stored, load_settings())
    t, column = channels.time, channels.columns[0]
    path = Rotation.from_rotvec(np.outer(9.0 * t, [0.0, 0.6, 0.8])).as_matrix()
    bodily = np.stack([np.sin(7 * t), np.cos(11 * t), 0 * t + 1], 1)
    fine = np.linspace(0, t[-1], 16 * (len(t) - 1) + 1)
    turned = Rotation.from_rotvec(np.outer(9.0 * fine, [0.0, 0.6, 0.8])).as_matrix()
    load = np.stack([np.sin(7 * fine), np.cos(11 * fine), 0 * fine + 1], 1)
    z = twice_integrated(np.einsum("tab,tb->ta", turned, load), fine[1])[::16]
    w = channel_in_body_axes(replace(column, z=z), path).z
    seconds = np.diff(w, 2, axis=0) / np.diff(t)[0] ** 2
    assert np.abs(seconds - bodily[1:-1]).max() < 3e-3


def test_a_swing_above_the_smooth_prior_is_found_and_its_first_moments_with_it():
    w, depth = 2 * np.pi * 24.0, 6e-4
    slow = 1 + 0.06 * np.sin(2 * np.pi * 2.0 * TIME) + depth * np.sin(w * TIME)
    bend = -0.06 * (4 * np.pi) ** 2 * np.sin(4 * np.pi * TIME) - depth * w**2 * np.sin(w * TIME)
    R = Rotation.from_rotvec(np.outer(4.0 * TIME, [0.0, 0.6, 0.8])).as_matrix()
    recording, settings, passes = filmed(R * slow[:, None, None]), load_settings(), engine()
    channels = affine_channels(recording, settings)
    priors = tune_channels(channels, passes)
    assert any(abs(line.frequency - 24.0) < 1.0 for line in priors[1].lines)
    found = smooth_affine(channels, priors, passes).first_moment
    without = smooth_affine(channels, [replace(p, lines=()) for p in priors], passes).first_moment
    W = 4.0 * np.array([[0.0, -0.8, 0.6], [0.8, 0.0, 0.0], [-0.6, 0.0, 0.0]])
    d_slow = np.gradient(slow, TIME[1], edge_order=2)
    ddF = R @ (bend[:, None, None] * np.eye(3) + 2 * d_slow[:, None, None] * W + slow[:, None, None] * W @ W)
    truth = ddF @ E @ (R * slow[:, None, None]).mT
    assert np.std((found - truth)[38:-38]) < 0.7 * np.std((without - truth)[38:-38])
