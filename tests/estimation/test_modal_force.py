"""Forces on the modes of an elastic body, against loads that are known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh, solve
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

NAMES = tuple("abcd")
CORNERS = np.array([[-1, -1, -1], [-1, 1, 1], [1, -1, 1], [1, 1, -1]]) * 0.1  # m
MASS = np.full(4, 0.05)  # kg
TIME = np.arange(200) / 500
NOISE = 1e-4  # m
EDGES = [CORNERS[a] - CORNERS[b] for a, b in ((0, 1), (2, 3))]
PINCH, CLASP = np.zeros((2, 4, 3))  # N: pulls on two opposite edges, without force or moment
PINCH[:2] = np.outer([1.0, -1.0], EDGES[0] / np.linalg.norm(EDGES[0]))
CLASP[2:] = np.outer([1.0, -1.0], EDGES[1] / np.linalg.norm(EDGES[1]))


def lattice():
    """Stiffness (12, 12) N/m of springs between all corners."""
    K = np.zeros((4, 3, 4, 3))
    for a in range(4):
        for b in range(a):
            arm = CORNERS[a] - CORNERS[b]
            k = 400.0 * np.outer(arm, arm) / (arm @ arm)
            for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                K[i, :, j] += sign * k
    return K.reshape(12, 12)


def pinched(gravity, hertz=7.0, **known):
    """Four masses that fall, pinched at some Hz, in steady vibration; and the load (time,) N."""
    w2, shape = eigh(lattice(), np.diag(np.repeat(MASS, 3)))
    w2, shape = w2[6:], shape[:, 6:]
    rate, load = 2 * np.pi * hertz, np.sin(2 * np.pi * hertz * TIME)
    q = load[:, None] * (shape.T @ PINCH.ravel()) / (w2 - rate**2)
    center = 0.5 * np.outer(TIME**2, gravity)
    x = center[:, None] + CORNERS + (q @ shape.T).reshape(-1, 4, 3)
    x = x + NOISE * np.random.default_rng(3).standard_normal(x.shape)
    body = Body(NAMES, CORNERS, MASS, **(known or {"stiffness": lattice()}))
    return Recording(body, Motion(TIME, x, gravity=gravity, noise_std={"position": NOISE})), load


def errors(modal, load, pattern):
    """Errors (time, mode) of forces on modes over their claim, in the middle of the record."""
    truth = np.outer(load, modal.shape.reshape(len(modal.shape), -1) @ pattern.ravel())
    return ((modal.force - truth) / np.sqrt(np.diagonal(modal.cov, axis1=1, axis2=2)))[40:-40]


def test_force_on_modes_is_that_of_the_applied_loads_and_gravity_has_no_part_in_it():
    recording, load = pinched(np.array([0.0, 3.0, -9.0]))
    modal = estimate_recording(recording, load_settings(model="modal")).modal
    driven = np.abs(modal.shape.reshape(-1, 12) @ PINCH.ravel()).argmax()
    assert np.sqrt(np.mean(errors(modal, load, PINCH) ** 2)) < 1.3
    assert np.abs(modal.force[:, driven]).max() > 10 * np.sqrt(modal.cov[:, driven, driven].mean())


def test_steady_spin_pulls_the_modes_without_any_force_on_them():
    spin, across = 20.0, np.tile([1.0, 1.0, 0.0], 4)
    pull = spin**2 * np.repeat(MASS, 3) * across
    S = np.linalg.svd(lattice())[0][:, :6]
    u = S @ solve(S.T @ (lattice() - np.diag(pull)) @ S, S.T @ (pull * CORNERS.ravel()))
    assert np.abs(u).max() > 20 * NOISE
    R = Rotation.from_rotvec(np.outer(spin * TIME, [0, 0, 1])).as_matrix()
    x = np.einsum("tab,nb->tna", R, CORNERS + u.reshape(4, 3))
    x = x + NOISE * np.random.default_rng(4).standard_normal(x.shape)
    body = Body(NAMES, CORNERS, MASS, stiffness=lattice())
    modal = estimate_recording(
        Recording(body, Motion(TIME, x, noise_std={"position": NOISE})),
        load_settings(model="modal", modes=6),
    ).modal
    assert modal is not None
    pulled = modal.shape.reshape(len(modal.shape), -1) @ (pull * CORNERS.ravel())
    off = errors(modal, np.zeros(len(TIME)), PINCH)
    claim = np.sqrt(np.diagonal(modal.cov, axis1=1, axis2=2)).mean(0)
    assert (np.abs(pulled) / claim).max() > 30
    assert np.sqrt(np.mean(off**2)) < 1.5


def test_modes_given_with_frequencies_have_forces_on_the_shapes_as_given_and_without_have_none():
    w2, shape = eigh(lattice(), np.diag(np.repeat(MASS, 3)))
    driven = 6 + np.argsort(-np.abs(shape[:, 6:].T @ PINCH.ravel()) / w2[6:])[:2]
    shapes, hertz = 3.0 * shape[:, driven].T.reshape(2, 4, 3), np.sqrt(w2[driven]) / (2 * np.pi)
    recording, load = pinched(np.zeros(3), mode_shape=shapes, mode_frequency=hertz)
    modal = estimate_recording(recording, load_settings(model="modal")).modal
    np.testing.assert_allclose(modal.shape, shapes, atol=1e-4)
    assert np.sqrt(np.mean(errors(modal, load, PINCH) ** 2)) < 1.3
    result = estimate_recording(pinched(np.zeros(3), mode_shape=shapes)[0], load_settings(model="modal"))
    assert result.modal is None
    assert "no-modal-force" in result.verdict.codes


def test_loads_without_a_resultant_are_told_apart_where_the_stiffness_is_known():
    recording, load = pinched(np.array([0.0, 0.0, -9.81]))
    pattern = [
        {name: tuple(map(float, f)) for name, f in zip(NAMES, each, strict=True) if f.any()}
        for each in (PINCH, CLASP)
    ]
    settings = {"load": [{"name": "pinch", "pattern": pattern[0]}, {"name": "clasp", "pattern": pattern[1]}]}
    loads = estimate_recording(recording, load_settings(model="modal", **settings)).loads
    off = (loads.load - np.stack([load, np.zeros_like(load)], 1))[25:-25]
    claim = np.sqrt(np.diagonal(loads.load_cov, axis1=1, axis2=2))[25:-25]
    assert loads.null_space.shape == (2, 0)
    assert np.sqrt(np.mean((off / claim) ** 2)) < 1.3
    assert claim.max() < 0.1 * np.abs(load).max()
    unknown = Recording(replace(recording.body, stiffness=None), recording.motion)
    apart = estimate_recording(unknown, load_settings(model="rigid", **settings)).loads
    assert np.nanmedian(np.diagonal(apart.load_cov, axis1=1, axis2=2)) > 100 * claim.max() ** 2


@pytest.mark.long
def test_markers_too_few_for_the_modes_of_a_body_tell_the_forces_on_them_as_well_as_they_claim():
    recording, load = pinched(np.zeros(3))
    position = recording.motion.position.copy()
    position[:, 3] = np.nan
    few = replace(recording, motion=replace(recording.motion, position=position))
    modal, whole = (estimate_recording(r, load_settings(model="modal")).modal for r in (few, recording))
    assert np.sqrt(np.mean(errors(modal, load, PINCH) ** 2)) < 1.3
    assert np.trace(modal.cov, axis1=1, axis2=2).mean() > 4 * np.trace(whole.cov, axis1=1, axis2=2).mean()


@pytest.mark.long
def test_air_that_answers_the_bending_is_told_with_the_forces_and_named():
    w2, shape = eigh(lattice(), np.diag(np.repeat(MASS, 3)))
    w2, shape, time = w2[6:], shape[:, 6:], np.arange(600) / 500
    rate, rng = 2 * np.pi * np.array([3.0, 7.0, 12.0, 19.0, 26.0]), np.random.default_rng(5)
    phase, load = rng.uniform(0, 2 * np.pi, (6, 5)), rng.uniform(0.2, 1.0, (6, 5))  # N by mode and sine
    found = {}
    for air in (0.0, 0.3):  # of the stiffness of every mode
        answer = load / ((1 + air) * w2[:, None] - rate**2)
        q = np.einsum("ks,tks->tk", answer, np.sin(rate * time[:, None, None] + phase))
        g = np.einsum("ks,tks->tk", load, np.sin(rate * time[:, None, None] + phase)) - air * w2 * q
        x = CORNERS + (q @ shape.T).reshape(-1, 4, 3) + NOISE * rng.standard_normal((600, 4, 3))
        motion = Motion(time, x, noise_std={"position": NOISE})
        result = estimate_recording(
            Recording(Body(NAMES, CORNERS, MASS, stiffness=lattice()), motion), load_settings(model="modal")
        )
        modal = result.modal
        truth = g @ (MASS[0] * shape.T @ modal.shape.reshape(len(modal.shape), 12).T)
        off = (modal.force - truth)[60:-60] / np.sqrt(np.diagonal(modal.cov, axis1=1, axis2=2))[60:-60]
        found[air] = np.sqrt(np.mean(off**2)), "load-answers-mode" in result.verdict.codes
    assert found[0.0][0] < 1.3
    assert found[0.3][0] < 1.5
    assert found[0.3][1]


def test_a_moment_as_fast_as_loads_that_modes_show_may_hide_and_is_named_by_frequency():
    fast, _ = pinched(np.array([0.0, 3.0, -9.0]), hertz=30.0)
    found = estimate_recording(fast, load_settings(model="modal"))
    hidden = next(finding for finding in found.verdict.findings if finding.code == "faster-on-modes")
    assert hidden.values["load"] == "moment"  # a mass center that all masses show needs no modes
    assert 25.0 <= hidden.values["frequency_hz"] <= 35.0
    claim = np.sqrt(np.diagonal(found.wrench_cov, axis1=1, axis2=2)[:, 3:].max())
    assert claim >= hidden.values["claim"]
    assert claim > 0.99 * hidden.values["hidden"]


def test_loads_on_modes_as_slow_as_the_whole_body_is_followed_leave_its_claims_small_beside_them():
    slow, load = pinched(np.array([0.0, 3.0, -9.0]), hertz=7.0)
    found = estimate_recording(slow, load_settings(model="modal"))
    claim = np.sqrt(np.diagonal(found.wrench_cov, axis1=1, axis2=2).mean(0))
    pushed = np.sqrt(np.mean(load**2)) * np.linalg.norm(PINCH)
    assert (claim[:3] < 0.03 * pushed).all()
    assert (claim[3:] < 0.03 * pushed * np.abs(CORNERS).max()).all()
