"""An inertia told wrong, where a body that tumbles shows another: that is taken, and no moment is left."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.judged import judged_part, rms
from forceid.config import BodyStdSetting, load_settings
from forceid.estimation.body.inertia import Inertia
from forceid.estimation.run import estimate_recording, estimate_whole
from forceid.estimation.stated import with_body_shown
from forceid.estimation.verdict.body_errors import with_uncertain_body
from forceid.records import Body, Motion, Recording

RATE, FRAMES, NOISE, MARKERS = 200.0, 400, 3e-4, 8  # Hz, frames, m
EDGES = np.array([0.6, 0.4, 0.2])  # m, of a box of 1 kg
OFF = 0.02  # of each second moment of mass: as well they are known by swings on wires
RIGID = {"model": "rigid"}


def tumbling(seed, law=lambda t, w: 0.0 * w, off=OFF):
    """A box without weight under a moment law(time, spin), body axes, its second moments told `off` beside.

    Returned: the recording, its moment (time, 3) in world axes, and the true inertia (3, 3).
    """
    rng = np.random.default_rng(seed)
    square = EDGES**2 / 12
    J = square.sum() - square
    t = np.arange(FRAMES) / RATE
    spin = np.exp(rng.uniform(*np.log([3, 12]))) * (d := rng.standard_normal(3)) / np.linalg.norm(d)

    def rate(time, state):
        q, w = state[:4], state[4:]
        turn = 0.5 * np.append(q[3] * w + np.cross(q[:3], w), -q[:3] @ w)
        return np.concatenate([turn, (law(time, w) - np.cross(w, J * w)) / J])

    flown = solve_ivp(rate, t[[0, -1]], [0, 0, 0, 1, *spin], "DOP853", t, rtol=1e-11, atol=1e-12).y.T
    R = Rotation.from_quat(flown[:, :4]).as_matrix()
    X = EDGES * rng.uniform(-0.5, 0.5, (MARKERS, 3))
    x = np.outer(t, rng.standard_normal(3))[:, None] + np.einsum("tab,nb->tna", R, X)
    x = x + NOISE * rng.standard_normal(x.shape)
    told = square * (1 + off * rng.standard_normal(3))
    body = Body(
        tuple(f"m{k}" for k in range(MARKERS)), X, total_mass=1.0, mass_center=np.zeros(3),
        inertia=np.diag(told.sum() - told),
    )  # fmt: skip
    moment = np.array([law(time, w) for time, w in zip(t, flown[:, 4:], strict=True)])
    motion = Motion(t, x, gravity=np.zeros(3), noise_std={"position": NOISE})
    return Recording(body, motion), np.einsum("tab,tb->ta", R, moment), np.diag(J)


def beside(told, true):
    """How far an inertia is beside the true one but for its size, which no motion shows."""
    told, true = (J / np.trace(J) for J in (told, true))
    return np.linalg.norm(told - true) / np.linalg.norm(true)


def is_shown(found):
    """Whether the inertia was taken as the motion shows it."""
    return "inertia-shown" in {finding.code for finding in found.verdict.findings}


@pytest.mark.long
@pytest.mark.parametrize("said", [0.0, OFF])
def test_a_moment_that_a_wrong_inertia_makes_is_gone_where_the_motion_shows_the_inertia(said):
    less, over = [], []
    for seed in range(6):
        one, _, _ = tumbling(seed)
        settings = load_settings(**RIGID, body_std={"inertia": said})
        found = estimate_recording(one, settings)
        if is_shown(found):
            told = estimate_whole(one, settings)[0].moment
            less.append(rms(found.moment) / rms(told))
            over.append(rms(found.moment) / rms(found.moment_std))
    assert len(less) >= 4
    assert np.median(less) < 0.1
    assert max(over) < 2


def test_an_inertia_is_taken_within_a_tenth_of_how_far_it_was_told_wrong():
    one, _, true = tumbling(4)
    _, solution = estimate_whole(one, load_settings(**RIGID))
    taken = one.body.inertia - solution.inertia_off
    assert beside(taken, true) < 0.1 * beside(one.body.inertia, true)


@pytest.mark.long
def test_a_moment_that_acts_on_the_body_stays():
    """It swings along axes of the body, whose inertia is told right, or wrong."""
    for seed in range(4):
        rng = np.random.default_rng([8, seed])
        most, pace, phase = rng.uniform(-0.2, 0.2, 3), rng.uniform(2, 9, 3), rng.uniform(0, 6, 3)

        def swinging(t, w, most=most, pace=pace, phase=phase):
            return most * np.sin(pace * t + phase)

        for off in (0.0, OFF):
            one, moment, _ = tumbling(seed, swinging, off)
            found = estimate_recording(one, load_settings(**RIGID))
            error = judged_part(found.moment - moment)
            assert rms(error) < 2 * rms(judged_part(found.moment_std))
            assert rms(error) < 0.2 * rms(moment)
            assert off or not is_shown(found)


@pytest.mark.long
def test_air_that_brakes_a_turn_is_no_inertia_told_wrong():
    """A moment against the spin, linear or square in it, takes energy, which no inertia does."""
    for seed in range(8):
        rng = np.random.default_rng([9, seed])
        drag, power = np.exp(rng.uniform(*np.log([1e-3, 1e-2]), 3)), seed % 2

        def braking(t, w, drag=drag, power=power):
            return -drag * w * (np.linalg.norm(w) / 5) ** power

        one, moment, _ = tumbling(seed, braking, 0.0)
        found = estimate_recording(one, load_settings(**RIGID))
        assert rms(found.moment - moment) < 2 * rms(found.moment_std)


def test_a_moment_that_keeps_to_a_body_in_steady_spin_is_no_inertia_told_wrong():
    """About the axis that it does not leave, both are the same."""
    one, _, _ = tumbling(3, off=0.0)
    R = Rotation.from_rotvec(np.outer(9.0 * one.motion.time, [0.6, 0.0, 0.8])).as_matrix()
    x = np.einsum("tab,nb->tna", R, one.body.position)
    x = x + NOISE * np.random.default_rng(5).standard_normal(x.shape)
    found = estimate_recording(replace(one, motion=replace(one.motion, position=x)), load_settings(**RIGID))
    assert not is_shown(found)


def test_the_size_of_an_inertia_that_is_shown_is_as_uncertain_as_it_was_stated():
    """It makes part of the moment found, and no more."""
    one, _, _ = tumbling(4, lambda t, w: np.array([0.3, -0.2, 0.25]) * np.sin(9 * t), 0.0)
    _, solution = estimate_whole(one, load_settings(**RIGID))
    said = BodyStdSetting(inertia=0.05)
    state, *seen = solution.state, solution.kinematics, solution.deformation
    added = with_uncertain_body(state, *seen, said, frozenset({"moment"})).wrench_cov - state.wrench_cov
    claimed = np.sqrt(np.trace(added[:, 3:, 3:], axis1=1, axis2=2))
    np.testing.assert_allclose(claimed, said.inertia * np.linalg.norm(state.moment, axis=1), rtol=1e-6)


def test_an_inertia_that_is_shown_is_one_that_a_body_may_have():
    """Of a plate, whose second moment across itself is none, noise leaves less than none."""
    told = Inertia(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]), None, np.zeros(0))
    body = with_body_shown(Body(total_mass=1.0), told, tensor=np.diag([1.0, 2.0, 3.01]))
    size = np.linalg.eigvalsh(body.inertia)
    assert size[2] <= size[0] + size[1] + 1e-12
    assert body.inertia_off == pytest.approx(0.01 / np.sqrt(14))
    assert with_body_shown(body, told, tensor=told.tensor).inertia_off == 0.0
