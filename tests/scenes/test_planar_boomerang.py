"""Against principal equations 5.1 and the laws of conservation."""

import numpy as np
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation
from stored_energy import spring_energy

from forceid.scenes.flights.planar_boomerang import (
    MASS,
    REST,
    REST_ANGLE,
    Parameters,
    arms,
    fly,
    hinge_angle,
    internal_force,
)
from forceid.scenes.springs import spring_stiffness

FORCE = np.array([0.4, -0.2, 0.1, 0.7, -0.3, 0.5])
DISPLACEMENT = np.array([0.001, -0.0005, 0.0014, 0.0003, -0.0002, 0.0009])
STATIC = np.zeros((3, 2))


def stiffness_by_differences(step=1e-6):
    def pushed(dof, size):
        x = REST.ravel().copy()
        x[dof] += size
        return internal_force(Parameters(), arms(Parameters()), x.reshape(3, 2), STATIC).ravel()

    return np.array([(pushed(i, -step) - pushed(i, step)) / (2.0 * step) for i in range(6)]).T


def test_arms_alone_give_the_published_acceleration_and_four_free_motions():
    K = spring_stiffness(arms(Parameters()), REST)
    acceleration = (FORCE - K @ DISPLACEMENT) / np.repeat(MASS, 2)
    np.testing.assert_allclose(acceleration, (40, -20 / 3, -14, 32, -7.5, -10), rtol=1e-9)
    assert np.linalg.matrix_rank(K) == 2


def test_hinge_leaves_three_rigid_motions_and_the_published_frequencies():
    squared = eigh(stiffness_by_differences(), np.diag(np.repeat(MASS, 2)), eigvals_only=True)
    assert np.abs(squared[:3]).max() < 1e-6 * squared[-1]
    hertz = np.sqrt(squared[3:]) / (2.0 * np.pi)
    np.testing.assert_allclose(hertz, (30.438025, 43.448509, 54.105279), rtol=1e-7)


def test_internal_forces_of_a_turned_and_bent_body_have_no_resultant():
    rng = np.random.default_rng(0)
    for angle in (0.0, 1.0, 2.5, -2.0):
        turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()[:2, :2]
        x = REST @ turn.T + 0.02 * rng.standard_normal((3, 2))
        force = internal_force(Parameters(), arms(Parameters()), x, rng.standard_normal((3, 2)))
        moment = (x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum()
        assert np.abs([*force.sum(0), moment]).max() < 1e-12 * np.abs(force).max()


def test_momenta_change_by_the_applied_wrench_alone(differentiate):
    step = 1.0 / 2000.0
    flight = fly(Parameters(), np.arange(600) * step)
    truth, gravity = flight.truth, flight.gravity
    force = differentiate(MASS.sum() * truth["velocity"], step) - MASS.sum() * gravity
    moment = differentiate(truth["angular_momentum"], step)
    assert np.abs(force - truth["force"][4:-4]).max() < 1e-7
    assert np.abs(moment - truth["moment"][4:-4]).max() < 1e-7
    assert np.abs(truth["moment"][:, 2]).max() > 0.05
    assert not flight.position[..., 2].any()
    assert not truth["moment"][:, :2].any()


def test_free_undamped_boomerang_keeps_its_energy():
    free = Parameters(damping_time=0.0, load=((0, 0), (0, 0), (0, 0)), gravity=(0, 0))
    time = np.arange(2000) / 8000.0
    x = fly(free, time).position[..., :2]
    v = np.gradient(x, time, axis=0, edge_order=2)[1:-1]
    kinetic = 0.5 * np.einsum("n,tna,tna->t", MASS, v, v)
    bend = np.array([hinge_angle(xi)[0] - REST_ANGLE for xi in x])
    stored = np.array([spring_energy(arms(free), xi) for xi in x]) + 0.5 * free.hinge_stiffness * bend**2
    total = kinetic + stored[1:-1]
    assert stored.max() > 0.02
    np.testing.assert_allclose(total, total[0], atol=1e-3 * stored.max())
