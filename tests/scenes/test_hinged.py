"""Chains of blocks in free flight: each block obeys its own balance, the joints hold, no energy is lost."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from stored_energy import chain_energy

from forceid.scenes.flights.hinged import BLOCK_CORNERS, Parameters, chain_constants, chain_states, drawn, fly

RATE = 1000.0
TIME = np.arange(301) / RATE
CHAIN = Parameters(
    mass=(0.4, 0.3, 0.2),
    size=((0.2, 0.1, 0.06), (0.16, 0.1, 0.08), (0.14, 0.08, 0.05)),
    joint=("ball", "hinge"),
    axis=((0.2, 0.1, 1.0), (0.0, 1.0, 0.5)),
    stiffness=(0.4, 0.3),
    damping=(0.003, 0.002),
    swing=(5.0, -4.0),
    push=1.0,
    push_block=1,
    drive=0.02,
)


@pytest.fixture(scope="module")
def flown():
    return chain_states(CHAIN, TIME), fly(CHAIN, TIME)


def stacked(states, name):
    return np.array([getattr(state, name) for state in states])


@pytest.mark.long
def test_momenta_of_every_block_change_as_its_joints_push_and_say(flown, differentiate):
    states, flight = flown
    chain, truth, inner = chain_constants(CHAIN), flight.truth, slice(4, -4)
    c, v, R, w = (stacked(states, name) for name in ("center", "velocity", "R", "omega"))
    H = np.einsum("tiab,ibc,tidc,tid->tia", R, chain.inertia, R, w)
    force, moment = np.zeros_like(v), np.zeros_like(v)
    for j in range(2):
        load, arm = truth["joint_force"][:, j], truth["joint_point"][:, j]
        for block, sign in ((j, -1.0), (j + 1, 1.0)):
            force[:, block] += sign * load
            moment[:, block] += sign * (truth["joint_moment"][:, j] + np.cross(arm - c[:, block], load))
    force[:, 1] += truth["force"]
    gained = chain.mass[:, None] * (differentiate(v, 1 / RATE) - flight.gravity)
    assert np.abs(gained - force[inner]).max() < 1e-8 * np.abs(force).max()
    assert np.abs(differentiate(H, 1 / RATE) - moment[inner]).max() < 1e-8 * np.abs(moment).max()


@pytest.mark.long
def test_blocks_stay_together_at_their_joints_and_turn_only_as_a_hinge_does(flown):
    states, flight = flown
    chain = chain_constants(CHAIN)
    c, R = stacked(states, "center"), stacked(states, "R")
    ends = [
        c[:, j + k] + np.einsum("tab,b->ta", R[:, j + k], chain.arms[j, k]) for j in (0, 1) for k in (0, 1)
    ]
    assert np.abs(ends[1] - ends[0]).max() < 1e-10
    assert np.abs(ends[3] - ends[2]).max() < 1e-10
    np.testing.assert_allclose(flight.truth["joint_point"][:, 1], ends[2], atol=1e-10)
    assert np.abs((R[:, 2] - R[:, 1]) @ chain.axis[1]).max() < 1e-10
    assert np.abs((R[:, 1] - R[:, 0]) @ chain.axis[0]).max() > 1e-3  # a ball lets it go


@pytest.mark.long
def test_a_hinge_passes_no_moment_about_its_axis_but_that_of_spring_damper_and_motor(flown):
    states, flight = flown
    chain = chain_constants(CHAIN)
    R, w = stacked(states, "R"), stacked(states, "omega")
    axis = R[:, 1] @ chain.axis[1]
    angle = Rotation.from_matrix(R[:, 2] @ R[:, 1].swapaxes(1, 2)).as_rotvec()
    about = np.sum(flight.truth["joint_moment"][:, 1] * axis, 1)
    motor = np.array([drawn(CHAIN)(t)[1][1] for t in TIME])
    expected = motor - 0.3 * np.sum(angle * axis, 1) - 0.002 * np.sum((w[:, 2] - w[:, 1]) * axis, 1)
    np.testing.assert_allclose(about, expected, atol=1e-9)
    assert np.abs(about).max() > 0.01


@pytest.mark.long
def test_no_energy_is_lost_without_dampers():
    free = CHAIN.model_copy(update={"damping": (0.0, 0.0), "push": 0.0, "drive": 0.0})
    total = [chain_energy(chain_constants(free), state) for state in chain_states(free, TIME)]
    assert np.ptp(total) < 1e-10 * abs(total[0])
    damped = [
        chain_energy(chain_constants(CHAIN), state)
        for state in chain_states(CHAIN.model_copy(update={"push": 0.0, "drive": 0.0}), TIME)
    ]
    assert damped[-1] < damped[0] - 1e-3


def test_nothing_but_weight_acts_on_two_blocks_that_are_thrown(differentiate):
    flight = fly(Parameters(), TIME)
    assert not flight.truth["force"].any()
    assert not flight.truth["moment"].any()
    assert np.ptp(flight.truth["angular_momentum"], axis=0).max() < 1e-12
    fall = differentiate(flight.truth["velocity"], 1 / RATE)
    assert np.abs(fall - flight.gravity).max() < 1e-9


def test_push_and_motor_are_of_the_stated_size():
    found = []
    for seed in range(40):
        loads = drawn(Parameters(push=2.0, drive=0.3, drawn_seed=seed))
        found += [np.concatenate(loads(t)) for t in np.arange(0.0, 4.0, 0.2)]
    np.testing.assert_allclose(np.std(found, axis=0), [2.0, 2.0, 2.0, 0.3], rtol=0.1)


@pytest.mark.long
def test_nodes_lie_on_the_corners_with_the_mass_of_their_block(flown):
    _, flight = flown
    assert flight.body.node[:2] + flight.body.node[-1:] == ("a1", "a2", "c8")
    np.testing.assert_allclose(flight.body.mass.reshape(3, 8).sum(1), CHAIN.mass)
    last = flight.body.position[16:] - flight.body.position[16:].mean(0)
    np.testing.assert_allclose(last, BLOCK_CORNERS * CHAIN.size[2], atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint": ("ball",)}, "3 blocks have 2 joints, found 1 joint"),
        ({"push_block": 3}, "a push on block 3"),
        ({"axis": ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))}, "an axis has no direction"),
        ({"mass": (0.4, 0.3)}, "2 masses, 3 sizes"),
    ],
)
def test_a_chain_whose_numbers_do_not_fit_is_refused(change, message):
    with pytest.raises(ValidationError, match=message):
        Parameters.model_validate({**CHAIN.model_dump(), **change})
