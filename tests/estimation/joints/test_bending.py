"""Joints on parts that deform: where they are, and what they hold of parts that may bend unseen."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.estimation.joints.bending import BENT_ORDER, Bending, affine_about, carried
from forceid.estimation.joints.constraints import PartMotion, moving
from forceid.estimation.joints.forces import joint_forces
from forceid.estimation.joints.parts import parts_of
from forceid.estimation.run import estimate_whole
from forceid.records import Body, Motion, Recording
from tests.estimation.joints.test_joint_forces import chain, jointed, seen

TIME = np.arange(80) / 200.0


def test_fields_are_exact_at_a_node_and_affine_fields_everywhere():
    rng = np.random.default_rng(1)
    X, any_field = rng.standard_normal((9, 3)), rng.standard_normal((2, 9, 3))
    np.testing.assert_allclose(affine_about(X[4], X, any_field)[0], any_field[:, 4], atol=1e-9)
    G, at = rng.standard_normal((3, 3)), rng.standard_normal(3)
    value, gradient = affine_about(at, X, (1.0 + X @ G.T)[None])
    np.testing.assert_allclose(value[0], 1.0 + G @ at, atol=1e-9)
    np.testing.assert_allclose(gradient[0], G, atol=1e-9)


def test_nodes_of_a_plane_carry_a_joint_in_it():
    rng = np.random.default_rng(2)
    X = np.pad(rng.standard_normal((6, 2)), ((0, 0), (0, 1)))
    G = rng.standard_normal((3, 3)) * [1, 1, 0]
    value, _ = affine_about(np.array([0.2, -0.1, 0.0]), X, (X @ G.T)[None])
    np.testing.assert_allclose(value[0], G @ [0.2, -0.1, 0.0], atol=1e-9)


def test_bending_keeps_its_size_and_leaves_rows_that_hold():
    bending = Bending(np.array([0.0, 2e-4, 5e-3]), 30.0)
    model = bending.model(np.array([0.01, 0.02]))
    assert bending.rows.shape == (3, 2 * BENT_ORDER)
    assert not bending.rows[0].any()
    for F, Q in zip(model.F, model.Q, strict=True):
        np.testing.assert_allclose(F @ model.P0 @ F.T + Q, model.P0, rtol=1e-9, atol=1e-15)
    shown = bending.rows @ model.P0 @ bending.rows.T
    np.testing.assert_allclose(np.sqrt(np.diagonal(shown)), bending.std, rtol=1e-12)
    assert Bending(np.zeros(3), 1.0).model(np.array([0.01])).F.shape == (1, 0, 0)


@pytest.fixture(scope="module")
def swelling():
    """Two soft bodies that strain along their axes as they turn, joined at a place of no marker, without
    noise.
    """
    rng, time = np.random.default_rng(3), np.arange(120) / 200.0
    X = rng.uniform(-0.1, 0.1, (2, 8, 3))
    X -= X.mean(1, keepdims=True)
    at, x = np.array([0.15, 0.02, -0.03]), np.empty((len(time), 2, 8, 3))
    X[1] += at - [-0.12, 0.01, 0.02]
    for k, spin in enumerate(rng.uniform(-3, 3, (2, 3))):
        G = np.tile(np.eye(3), (len(time), 1, 1))
        G[:, 0, 0] += 0.15 * np.sin(2 * np.pi * 3 * time + k)
        R = Rotation.from_rotvec(time[:, None] * spin).as_matrix()
        x[:, k] = np.einsum("tab,nb->tna", R @ G, X[k] - at)
    body = Body(tuple(f"n{i}" for i in range(16)), X.reshape(16, 3), np.full(16, 0.02))
    return Recording(body, Motion(time, x.reshape(len(time), 16, 3), gravity=np.zeros(3)))


@pytest.mark.long
def test_a_joint_stays_where_the_strain_of_a_part_takes_it(swelling):
    part = [{"name": "ab"[k], "nodes": list(range(8 * k, 8 * k + 8))} for k in range(2)]
    joint = {"name": "ball", "parts": ("a", "b"), "at": (0.15, 0.02, -0.03), "kind": "ball"}
    settings = Settings.model_validate({"part": part, "joint": [joint], "model": "affine"})
    parts, (ball,) = parts_of(swelling, settings)
    alone = settings.model_copy(update={"part": (), "joint": ()})
    for k in (0, 1):
        estimate, solution = estimate_whole(parts[k].recording, alone)
        there = carried(ball, parts[k], solution, len(estimate.time))
        place = estimate.center + np.einsum("tab,tb->ta", solution.state.rotation, there.arm)
        still = estimate.center + solution.state.rotation @ (ball.at - parts[k].center)
        assert np.abs(place[20:-20]).max() < 3e-4  # m: the origin, on both
        assert np.abs(still[20:-20]).max() > 3e-3


@pytest.mark.long
def test_parts_that_may_bend_hold_a_joint_as_far_as_noise_hides_it():
    parameters = chain(0)
    recording = seen(parameters, 0, time=TIME)
    rigid = joint_forces(recording, jointed(parameters), estimate_whole)
    may_bend = joint_forces(recording, jointed(parameters, model="auto"), estimate_whole)
    assert "joint-moves" not in may_bend.verdict.codes
    assert "joint-may-bend" in may_bend.verdict.codes
    assert "joint-may-bend" not in rigid.verdict.codes
    wider = may_bend.force_std[10:-10] / rigid.force_std[10:-10]
    assert np.sqrt(np.mean(wider**2)) > 1.1
    off = (may_bend.force - recording.truth["joint_force"])[10:-10]
    assert np.sqrt(np.mean(np.square(off / may_bend.force_std[10:-10]))) < 1.5


def test_what_turns_inside_a_part_is_no_spin_of_it():
    rng = np.random.default_rng(5)
    R = Rotation.random(4, rng=rng).as_matrix()
    J, h, omega = (
        np.tile(np.diag([1.0, 2.0, 2.5]), (4, 1, 1)),
        rng.standard_normal((4, 3)),
        rng.standard_normal((4, 3)),
    )
    H = np.einsum("tab,tb->ta", R @ J @ R.mT, omega) + np.einsum("tab,tb->ta", R, h)
    none = np.zeros((4, 3))
    part = PartMotion(R, H, none, 1.0, J, h, np.zeros(3))
    np.testing.assert_allclose(moving(part, none, H, none, none)[2], omega, atol=1e-12)
