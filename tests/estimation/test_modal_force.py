"""Forces on the modes of an elastic body, against loads that are known in closed form."""

import numpy as np
from scipy.linalg import eigh, solve
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

CORNERS = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * [0.15, 0.10, 0.06]  # m
MASS = np.full(8, 0.05)  # kg
TIME = np.arange(200) / 500
NOISE = 1e-4  # m
PINCH = np.zeros((8, 3))
PINCH[:, 0] = np.sign(CORNERS[:, 0])  # N: pulls the ends apart, without force or moment


def lattice():
    """Stiffness (24, 24) N/m of springs between all corners."""
    K = np.zeros((8, 3, 8, 3))
    for a in range(8):
        for b in range(a):
            arm = CORNERS[a] - CORNERS[b]
            k = 150.0 * np.outer(arm, arm) / (arm @ arm)
            for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                K[i, :, j] += sign * k
    return K.reshape(24, 24)


def pinched(gravity, **known):
    """A box that falls, pinched at 7 Hz, its deformation in steady vibration; and the load (time,) N."""
    w2, shape = eigh(lattice(), np.diag(np.repeat(MASS, 3)))
    w2, shape = w2[6:], shape[:, 6:]
    rate, load = 2 * np.pi * 7.0, np.sin(2 * np.pi * 7.0 * TIME)
    q = load[:, None] * (shape.T @ PINCH.ravel()) / (w2 - rate**2)
    center = 0.5 * np.outer(TIME**2, gravity)
    x = center[:, None] + CORNERS + (q @ shape.T).reshape(-1, 8, 3)
    x = x + NOISE * np.random.default_rng(3).standard_normal(x.shape)
    names = tuple("abcdefgh")
    body = Body(names, CORNERS, MASS, **(known or {"stiffness": lattice()}))
    return Recording(body, Motion(TIME, x, gravity=gravity, noise_std={"position": NOISE})), load


def errors(modal, load, pattern):
    """Errors (time, mode) of forces on modes over their claim, in the middle of the record."""
    truth = np.outer(load, modal.shape.reshape(len(modal.shape), -1) @ pattern.ravel())
    return ((modal.force - truth) / np.sqrt(np.diagonal(modal.cov, axis1=1, axis2=2)))[40:-40]


def test_force_on_modes_is_that_of_the_applied_loads_and_gravity_has_no_part_in_it():
    recording, load = pinched(np.array([0.0, 3.0, -9.0]))
    modal = estimate_recording(recording, load_settings(model="modal")).modal
    driven = np.abs(modal.shape.reshape(-1, 24) @ PINCH.ravel()).argmax()
    assert np.sqrt(np.mean(errors(modal, load, PINCH) ** 2)) < 1.3
    assert np.abs(modal.force[:, driven]).max() > 10 * np.sqrt(modal.cov[:, driven, driven].mean())


def test_steady_spin_pulls_the_modes_without_any_force_on_them():
    spin, across = 20.0, np.tile([1.0, 1.0, 0.0], 8)
    pull = spin**2 * np.repeat(MASS, 3) * across
    S = np.linalg.svd(lattice())[0][:, :18]
    u = S @ solve(S.T @ (lattice() - np.diag(pull)) @ S, S.T @ (pull * CORNERS.ravel()))
    assert np.abs(u).max() > 20 * NOISE
    R = Rotation.from_rotvec(np.outer(spin * TIME, [0, 0, 1])).as_matrix()
    x = np.einsum("tab,nb->tna", R, CORNERS + u.reshape(8, 3))
    x = x + NOISE * np.random.default_rng(4).standard_normal(x.shape)
    body = Body(tuple("abcdefgh"), CORNERS, MASS, stiffness=lattice())
    modal = estimate_recording(
        Recording(body, Motion(TIME, x, noise_std={"position": NOISE})),
        load_settings(model="modal", modes=18),
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
    shapes, hertz = 3.0 * shape[:, driven].T.reshape(2, 8, 3), np.sqrt(w2[driven]) / (2 * np.pi)
    recording, load = pinched(np.zeros(3), mode_shape=shapes, mode_frequency=hertz)
    modal = estimate_recording(recording, load_settings(model="modal")).modal
    np.testing.assert_allclose(modal.shape, shapes, atol=1e-4)
    assert np.sqrt(np.mean(errors(modal, load, PINCH) ** 2)) < 1.3
    result = estimate_recording(pinched(np.zeros(3), mode_shape=shapes)[0], load_settings(model="modal"))
    assert result.modal is None
    assert "no-modal-force" in result.verdict.codes
