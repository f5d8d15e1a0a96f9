"""Affine scenes obey the mechanics they state: momenta, energy, first moments, no moment from stress."""

import numpy as np
import pytest
from stored_energy import drop_energy

from forceid.pseudorigid import Body, MooneyRivlin
from forceid.scenes.affine_body import affine_motion
from forceid.scenes.flights import spinning_block, wobbling_drop

RATE = 1000.0
TIME = np.arange(201) / RATE
SCENES = (spinning_block, wobbling_drop)
FREE = {"force": 0.0, "first_moment": 0.0}


def block_energy(p, F):
    C = F.T @ F
    I1, J = np.trace(C), np.linalg.det(F)
    d = 2 * p.a + 4 * p.b + 2 * p.c
    return p.a * I1 + 0.5 * p.b * (I1**2 - np.trace(C @ C)) + p.c * J**2 - d * np.log(J)


ENERGY = {spinning_block: block_energy, wobbling_drop: drop_energy}


@pytest.fixture(scope="module", params=SCENES, ids=lambda s: s.__name__.split(".")[-1])
def scene(request):
    return request.param


@pytest.fixture(scope="module")
def loaded(scene):
    p = scene.Parameters()
    return p, affine_motion(scene.throw(p), TIME), scene.fly(p, TIME)


def test_gradient_is_the_derivative_of_the_energy(scene):
    p, rng = scene.Parameters(), np.random.default_rng(3)
    F, H = np.eye(3) + 0.2 * rng.standard_normal((2, 3, 3))
    step = 1e-5
    slope = (ENERGY[scene](p, F + step * H) - ENERGY[scene](p, F - step * H)) / (2 * step)
    assert np.sum(scene.gradient(p, F) * H) == pytest.approx(slope, rel=1e-8)


def test_undeformed_body_is_free_of_stress_and_no_stress_makes_a_moment(scene):
    p, rng = scene.Parameters(), np.random.default_rng(4)
    assert np.abs(scene.gradient(p, np.eye(3))).max() < 1e-12
    F = np.eye(3) + 0.2 * rng.standard_normal((3, 3))
    stress = scene.gradient(p, F) @ F.T
    np.testing.assert_allclose(stress, stress.T, atol=1e-12)


def test_library_of_affine_bodies_makes_the_same_flight_of_the_block():
    p, time = spinning_block.Parameters(), TIME[:101]
    thrown = spinning_block.throw(p)
    made = affine_motion(thrown, time)
    block = Body(thrown.second_moment, MooneyRivlin.natural(p.a, p.b, p.c), mass=float(thrown.mass.sum()))
    found = block.simulate(
        made.F[0],
        made.dF[0],
        time,
        force=lambda t: thrown.loads(np.array([t]))[0][0],
        first_moment=lambda t: thrown.loads(np.array([t]))[1][0],
        weight=block.mass * np.array(p.gravity),
        center=made.center[0],
        velocity=made.velocity[0],
    )
    for name in ("F", "dF", "center", "velocity"):
        np.testing.assert_allclose(getattr(found, name), getattr(made, name), atol=1e-9)
    force, N = thrown.loads(time)
    np.testing.assert_allclose(found.force, force, atol=1e-12)
    np.testing.assert_allclose(found.first_moment, N, atol=1e-12)


def test_free_body_keeps_its_energy_and_angular_momentum(scene):
    p = scene.Parameters(**FREE)
    thrown = scene.throw(p)
    motion, E = affine_motion(thrown, TIME), thrown.second_moment
    kinetic = 0.5 * np.einsum("tab,bc,tac->t", motion.dF, E, motion.dF)
    total = kinetic + np.array([ENERGY[scene](p, F) for F in motion.F])
    H = motion.dF @ E @ motion.F.mT
    assert np.ptp(total) < 1e-9 * kinetic.max()
    assert np.ptp(H - H.mT, axis=0).max() < 1e-10 * np.abs(H).max()
    truth = scene.fly(p, TIME).truth
    assert not truth["applied_first_moment"].any()
    assert np.abs(truth["moment"]).max() < 1e-15
    assert np.abs(truth["first_moment"]).max() > 0.01


def test_first_moments_are_those_of_the_accelerations(loaded, scene, differentiate):
    p, motion, flight = loaded
    thrown, inner = scene.throw(p), slice(4, -4)
    ddF = differentiate(motion.dF, 1 / RATE)
    first = ddF @ thrown.second_moment @ motion.F[inner].mT
    truth = flight.truth["first_moment"]
    assert np.abs(first - truth[inner]).max() < 1e-7 * np.abs(truth).max()
    a = differentiate(motion.velocity, 1 / RATE) - flight.gravity
    assert np.abs(p.mass * a - flight.truth["force"][inner]).max() < 1e-7


def test_moment_is_the_antisymmetric_part_of_both_first_moments(loaded):
    _, _, flight = loaded
    for name in ("first_moment", "applied_first_moment"):
        N = flight.truth[name]
        axial = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], 1)
        np.testing.assert_allclose(axial, flight.truth["moment"], atol=1e-12)


def test_markers_move_affinely_and_the_body_stretches(loaded):
    _, motion, flight = loaded
    rest = np.hstack([flight.body.position, np.ones((len(flight.body.node), 1))])
    left = flight.position - rest @ np.linalg.pinv(rest) @ flight.position
    assert np.abs(left).max() < 1e-13
    assert np.ptp(np.linalg.svd(motion.F, compute_uv=False), axis=0).max() > 0.05
    assert np.linalg.det(motion.F).min() > 0.5
