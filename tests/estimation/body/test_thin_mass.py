"""Bodies whose mass lies on a line or on a point: what is determined is given, the rest is known or NaN."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.estimation.body.inertia import Inertia
from forceid.estimation.body.spin import smoothed_signals
from forceid.estimation.inspection import inspect_recording
from forceid.records import Body, Motion, Recording

TILT = Rotation.from_rotvec([0.4, -0.9, 0.3])
SWING, RATE = 0.8, 7.0  # rad, rad/s
PUSH = np.array([0.5, -0.3, 0.9])  # N
JAVELIN = ([-0.5, -0.1, 0.2, 0.4], [0.1, 0.3, 0.2, 0.1])  # m along it, kg
AROUND = np.array([[0.0, 0.3, 0.1], [0.2, -0.2, 0.2], [-0.3, 0.1, -0.3]])


def swung(along=(), mass=(), massless=(), spin=0.0, seed=0, noise=3e-4, shown=None, bent=0.0, off=0.0):
    """A straight body that swings about a fixed axis through its mass center, pushed by a steady force.

    along (node,) m, mass (node,) kg on the first body axis; massless: markers off it; spin rad/s about it;
    shown: nodes that carry a marker; bent m: a sag in the mass gauge, at 9 rad/s; off (node, 3): of the
    masses from the line, round it. The moment is J a'' e, and of a spin the rate of its momentum beside.
    """
    along, mass = np.asarray(along, float), np.asarray(mass, float)
    along = along - mass @ along / mass.sum()
    places = np.vstack([np.outer(along, [1.0, 0, 0]) + off, np.reshape(massless, (-1, 3))])
    every = np.r_[mass, np.zeros(len(places) - len(mass))]
    time = np.arange(150) / 150
    angle = SWING * np.sin(RATE * time)
    turn = (
        TILT
        * Rotation.from_rotvec(np.outer(angle, [0, 0, 1.0]))
        * Rotation.from_rotvec(np.outer(spin * time, [1.0, 0, 0]))
    )
    sag = np.zeros(len(places))
    if bent:
        fit = np.stack([np.ones_like(along), along], 1)
        square = along**2
        sag[: len(along)] = square - fit @ np.linalg.solve(
            fit.T @ (mass[:, None] * fit), fit.T @ (mass * square)
        )
    shape = places + bent * np.sin(9 * time)[:, None, None] * sag[:, None] * [0, 1.0, 0]
    t = time[:, None]
    center = [1.0, 0.5, -2.0] + t * [1.0, -2.0, 3.0] + 0.5 * t**2 * (PUSH / mass.sum() + cf.GRAVITY)
    x = center[:, None] + np.einsum("tab,tnb->tna", turn.as_matrix(), shape)
    x = x + noise * np.random.default_rng(seed).standard_normal(x.shape)
    hidden = [] if shown is None else [k for k in range(len(places)) if k not in shown]
    x[:, hidden] = np.nan
    round_line = mass @ np.sum(places[: len(mass), 1:] ** 2, 1)
    J, e = mass @ along**2 + 0.5 * round_line, TILT.apply([0, 0, 1.0])
    line, turning = turn.apply([1.0, 0, 0]), SWING * RATE * np.cos(RATE * time)[:, None] * e
    moment = -J * SWING * RATE**2 * np.sin(RATE * time)[:, None] * e
    moment = moment + round_line * spin * np.cross(turning, line)
    names = tuple(f"n{k}" for k in range(len(places)))
    body = Body(node=names, position=places + np.array([0.3, 0.1, -0.2]), mass=every)
    motion = Motion(time, x, gravity=cf.GRAVITY, noise_std={"position": noise})
    truth = {"force": np.tile(PUSH, (len(time), 1)), "moment": moment, "line": line}
    return Recording(body, motion, truth)


def score(result, recording, name):
    """Error over claim of a vector whose covariance may be singular."""
    part = slice(0, 3) if name == "force" else slice(3, 6)
    off = (getattr(result, name) - recording.truth[name])[15:-15]
    claimed = np.trace(result.wrench_cov[15:-15, part, part], axis1=1, axis2=2)
    return float(np.sqrt((off**2).sum(1).mean() / claimed.mean()))


@pytest.mark.parametrize(
    "seen",
    [
        {},
        {"shown": (4, 5, 6), "massless": AROUND},
        {"shown": (0, 2, 4), "massless": AROUND, "spin": 12.0},
    ],
    ids=["every mass", "three markers around", "two masses and one beside, spinning"],
)
@pytest.mark.parametrize("method", ["smoother", "savgol"])
def test_mass_on_a_line_has_the_moment_across_it_within_its_claim(estimated, seen, method):
    recording = swung(*JAVELIN, **seen)
    result = estimated(recording, method=method)
    size = cf.rms(recording.truth["moment"])
    least = 0.3 if method == "smoother" else 0.1  # a window claims what is too fast for it, too
    assert least < score(result, recording, "moment") < 1.7
    assert score(result, recording, "force") < 1.7
    assert cf.rms((result.moment - recording.truth["moment"])[15:-15]) < 0.1 * size
    assert result.verdict.level == "ok"
    assert "zero by construction" in result.verdict.reasons[0]


def test_moment_along_the_line_is_zero_and_errs_with_the_line_alone(estimated):
    recording = swung(*JAVELIN)
    result = estimated(recording)
    n = Rotation.from_quat(result.orientation).apply([1.0, 0, 0])
    np.testing.assert_allclose(n, recording.truth["line"], atol=3e-3)
    for vector in (result.moment, result.angular_momentum, result.angular_velocity):
        np.testing.assert_allclose(np.einsum("ta,ta->t", n, vector), 0.0, atol=1e-9)
    along = np.einsum("ta,tab,tb->t", n, result.wrench_cov[:, 3:, 3:], n)
    true = np.einsum("ta,ta->t", n, recording.truth["moment"])  # what lies along the line as it was found
    assert 0.3 < np.sqrt(np.mean(true[15:-15] ** 2) / np.mean(along[15:-15])) < 1.7
    assert along.max() < 1e-4 * np.trace(result.wrench_cov[:, 3:, 3:], axis1=1, axis2=2).max()


def test_beam_of_masses_that_bends_keeps_its_moment(estimated):
    recording = swung(np.linspace(-0.6, 0.6, 11), np.full(11, 0.05), bent=0.1)
    result = estimated(recording)
    assert score(result, recording, "force") < 1.7
    true = recording.truth["moment"]
    assert cf.rms((result.moment - true)[15:-15]) < 0.05 * cf.rms(true)


@pytest.mark.parametrize("method", ["smoother", "filter", "savgol", "spline", "difference"])
def test_no_moment_acts_on_a_point(estimated, method):
    recording = swung([0.0], [0.4], AROUND, shown=(1, 2, 3))
    result = estimated(recording, method=method)
    assert score(result, recording, "force") < 1.7
    assert (result.moment == 0).all()
    assert (result.moment_std == 0).all()
    assert "no moment acts about it" in result.verdict.reasons[0]


@pytest.mark.parametrize(("width", "spin"), [(0.006, 40.0), (0.002, 2.0), (0.0005, 40.0)])
def test_slender_body_that_spins_has_the_moment_of_its_spin_too(estimated, width, spin):
    """Four masses round each place: J about the line is to J across as 2 width^2 to the length squared."""
    along, mass = np.repeat([-0.5, -0.1, 0.2, 0.4], 4), np.repeat([0.1, 0.3, 0.2, 0.1], 4) / 4
    round_it = np.tile(width * np.array([[0, 1.0, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1]]), (4, 1))
    recording = swung(along, mass, AROUND, spin=spin, shown=(16, 17, 18), off=round_it)
    result = estimated(recording)
    assert 0.3 < score(result, recording, "moment") < 1.7
    n = Rotation.from_quat(result.orientation).apply([1.0, 0, 0])
    off = np.einsum("ta,ta->t", n, result.moment - recording.truth["moment"])[15:-15]
    claimed = np.einsum("ta,tab,tb->t", n, result.wrench_cov[:, 3:, 3:], n)[15:-15]
    assert np.sqrt(np.mean(off**2) / np.mean(claimed)) < 1.7
    assert cf.rms(np.einsum("ta,ta->t", n, result.angular_velocity) - spin) < 0.1 * (1 + spin)


def test_line_that_no_marker_shows_gives_the_force_only(estimated):
    recording = swung(*JAVELIN, massless=[[0.0, 0, 0]], shown=(4,))
    result = estimated(recording)
    assert score(result, recording, "force") < 1.7
    assert np.isnan(result.moment).all()
    assert "whose direction no marker shows" in result.verdict.reasons[0]
    assert "mark a second point" in result.verdict.reasons[0]


def test_inspection_of_a_line_ends_and_says_what_is_known():
    found = inspect_recording(swung(*JAVELIN, massless=AROUND), Settings())
    assert found.force
    assert found.moment
    assert found.moment_bandwidth_hz > 1
    assert "zero by construction" in found.warnings[0]


@pytest.mark.parametrize("frames", [3, 5, 8])
def test_few_frames_of_a_thin_body_are_inspected_without_error(frames):
    recording = swung(*JAVELIN)
    motion = recording.motion
    short = replace(motion, time=motion.time[:frames], position=motion.position[:frames])
    assert inspect_recording(Recording(recording.body, short), Settings()).frames == frames


@pytest.mark.parametrize("principal", [(0.0, 0.0, 0.0), (0.0, 1e-3, 1e-3), (1e-7, 1e-3, 1e-3)])
def test_measured_attitude_of_a_body_of_singular_inertia_is_no_error(estimated, principal):
    flown = cf.mean_motion(stated=True)
    result = estimated(replace(flown, body=replace(flown.body, inertia=np.diag(principal))))
    assert np.isfinite(result.force).all()
    assert np.isfinite(result.moment).all()
    assert cf.rms(result.moment) < 0.1


@pytest.mark.long
def test_sensors_alone_tell_the_moment_of_a_rod(estimated):
    """A rod that swings, with its spin: gyros read both, and the tensor of the rod takes the spin out."""
    recording = sensed(swung(*JAVELIN, spin=3.0, noise=0.0))
    result = estimated(recording)
    assert score(result, recording, "force") < 1.7
    assert 0.2 < score(result, recording, "moment") < 1.7


def sensed(recording, spin=3.0):
    """Gyro and accelerometer on a body of `swung`, without markers; truth in the axes of the start."""
    time, rng = recording.motion.time[:60], np.random.default_rng(0)
    angle, rate = SWING * np.sin(RATE * time), SWING * RATE * np.cos(RATE * time)
    turn = (
        TILT
        * Rotation.from_rotvec(np.outer(angle, [0, 0, 1.0]))
        * Rotation.from_rotvec(np.outer(spin * time, [1.0, 0, 0]))
    )
    e, n = TILT.apply([0, 0, 1.0]), turn.apply([1.0, 0, 0])
    omega = rate[:, None] * e + spin * n
    alpha = -(RATE**2) * angle[:, None] * e + spin * np.cross(rate[:, None] * e, n)
    place, pushed = np.array([0.3, 0.05, 0]), PUSH / recording.body.mass.sum()
    arm = turn.apply(place)
    felt = turn.inv().apply(pushed + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm)))
    gyro = turn.inv().apply(omega)[:, None] + 1e-3 * rng.standard_normal((len(time), 1, 3))
    felt = felt[:, None] + 2e-2 * rng.standard_normal((len(time), 1, 3))
    center = recording.body.mass @ recording.body.position / recording.body.mass.sum()
    body = replace(
        recording.body, sensor_position=(place + center)[None], sensor_rotation=np.array([[0.0, 0, 0, 1]])
    )
    known = {"angular_velocity": 1e-3, "specific_force": 2e-2}
    known |= {"angular_velocity_bias": 1e-4, "specific_force_bias": 1e-3}
    motion = Motion(time, angular_velocity=gyro, specific_force=felt, gravity=cf.GRAVITY, noise_std=known)
    start = Rotation.from_matrix(turn.as_matrix()[0]).inv()
    truth = {k: start.apply(v[:60]) for k, v in recording.truth.items()}
    return replace(recording, body=body, motion=motion, truth=truth)


def test_mass_on_a_point_has_no_gyration_whatever_rounding_leaves_of_it():
    assert Inertia(2.0, np.zeros(3), -1e-18 * np.eye(3), None, np.zeros(1)).gyration == 0.0


def test_a_steady_spin_shows_no_more_moment_than_a_parabola_through_it_would():
    """The curvature of a parabola through n readings over T s is off by sqrt(720 / n) / T^2."""
    time, std = np.arange(400) / 75, 2e-3
    angle = 3.0 * time + std * np.random.default_rng(0).standard_normal(400)
    angle[150:170] = np.nan
    found = smoothed_signals(time, angle[:, None], np.full((400, 1), std**2))
    curvature = np.sqrt(720 / 380) * std / time[-1] ** 2
    assert cf.rms(found.second) < 3 * curvature
    np.testing.assert_allclose(found.rate, 3.0, atol=20 * std / time[-1])


def test_a_spin_under_a_moment_errs_by_as_much_as_is_claimed():
    time, std = np.arange(400) / 75, 2e-3
    rng = np.random.default_rng(0)
    true = np.array([1.0, 0.3]) * np.sin(2 * np.pi * np.outer(time, [0.4, 1.1]))
    angle = true.sum(1) + std * rng.standard_normal(400)
    angle[150:170] = np.nan
    found = smoothed_signals(time, angle[:, None], np.full((400, 1), std**2))
    off = found.second[:, 0] + true @ (2 * np.pi * np.array([0.4, 1.1])) ** 2
    inner = slice(20, -20)
    assert 0.5 < np.sqrt(np.mean(off[inner] ** 2) / np.mean(found.second_var[inner])) < 1.7
    assert cf.rms(off[inner]) < 0.1 * cf.rms(found.second)
