"""Gyros and accelerometers on a tumbling body, by DOP853 and the laws of Newton and Euler."""

from dataclasses import replace

import numpy as np
import pytest
from flights import GRAVITY, INERTIA, MASS, POSE_STD, SPIN, chains, prior, tumble
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import approx_fprime
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from forceid import kalman
from forceid.flight.instruments import ACCELEROMETER, GYRO
from forceid.flight.instruments.dead_reckoning import gyro_rate, reckoned
from forceid.flight.instruments.moved import Moved
from forceid.flight.instruments.sensors import Sensors, sensed
from forceid.flight.model import Flight
from forceid.flight.smoother import smooth_flight

FORCE, MOMENT = prior(std=1.0, rate=20.0), prior(std=0.05, rate=30.0)
POSITION = np.array([[0.06, 0.01, 0.02], [-0.05, 0.03, -0.01]])
MOUNTED = Rotation.from_rotvec([[0.3, -0.4, 1.1], [2.0, 0.1, 0.0]]).as_matrix()
NOISE = np.array([[0.02, 0.02], [0.1, 0.1]])  # rad/s, m/s2
BIAS = np.array([[0.1, 0.1], [0.5, 0.5]])


def exp(phi):
    return Rotation.from_rotvec(phi).as_matrix()


def euler(R, H, T, F):
    """Angular velocity, and specific force at both positions (time, sensor, 3), body axes."""
    H, T, F = (np.einsum("tba,tb->ta", R, v) for v in (H, T, F))
    omega = H / np.diag(INERTIA)
    alpha = (T - np.cross(omega, H)) / np.diag(INERTIA)
    r = np.broadcast_to(POSITION, (len(R), 2, 3))
    w, a = omega[:, None], alpha[:, None]
    return omega, F[:, None] / MASS + np.cross(a, r) + np.cross(w, np.cross(w, r))


def flown(rng, count=120, step=0.005, spin=SPIN, fine=4, noise=1.0, late=0):
    """A flight under drawn loads with two sensors, its wrench (time, 6), rotation and biases (12,).

    late: fine steps by which the sensors read later than their samples say.
    """
    time = step / fine * np.arange(fine * (count - 1) + 1 + late)
    mass_moment, _, F = chains(FORCE, rng, len(time), step / fine)
    _, H, T = chains(MOMENT, rng, len(time), step / fine)
    R0 = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
    H = H + R0 @ INERTIA @ spin
    path = CubicHermiteSpline(time, H, T)
    then = slice(late, None, fine)
    if late:
        omega, a = euler(tumble(np.append(0, time[then]), R0, path, rtol=1e-9)[1:], H[then], T[then], F[then])
        now = slice(0, -late, fine)
    else:
        now = slice(None, None, fine)
    R = tumble(time[now], R0, path, rtol=1e-9)
    t = time[now, None]
    center = mass_moment[now] / MASS + t * [3.0, 0.5, 2.0] + 0.5 * t**2 * GRAVITY
    H, T, F = H[now], T[now], F[now]
    e = noise * POSE_STD * rng.standard_normal((count, 6))
    if not late:
        omega, a = euler(R, H, T, F)
    read = np.stack([np.stack([omega] * 2, 1), a], 1)  # (time, gyro or accelerometer, sensor, axis)
    bias = BIAS[..., None] * rng.standard_normal((2, 2, 3))
    read = np.einsum("sba,tksb->tksa", MOUNTED, read) + bias
    read += noise * NOISE[..., None] * rng.standard_normal(read.shape)
    sensors = Sensors((GYRO, ACCELEROMETER), read, POSITION, MOUNTED, NOISE, BIAS)
    flight = Flight(
        t[:, 0], center + e[:, :3], exp(e[:, 3:]) @ R, np.tile(np.diag(POSE_STD**2), (count, 1, 1)), MASS,
        np.tile(INERTIA, (count, 1, 1)), np.zeros((count, 3)), GRAVITY, sensors,
    )  # fmt: skip
    return flight, np.hstack([F, T]), R, bias.ravel()


def smooth(flight, engine="auto", **more):
    return smooth_flight(flight, FORCE, MOMENT, kalman.engine(engine), **more)


def wrench(state):
    return np.hstack([state.force, state.moment])


def moved_at(R, H, T, F, J=INERTIA, dJ=None, h=None, dh=None):
    zero = np.zeros((1, 3))
    dJ = np.zeros((3, 3)) if dJ is None else dJ
    h, dh = (zero if v is None else v[None] for v in (h, dh))
    return Moved(R[None], H[None], T[None], F[None], MASS, J[None], dJ[None], h, dh)


def both_sensors():
    return Sensors((GYRO, ACCELEROMETER), np.zeros((1, 2, 2, 3)), POSITION, MOUNTED, NOISE, BIAS)


def seen(moved):
    return sensed(both_sensors(), moved, np.zeros(2))


def test_sensors_read_what_the_equations_of_euler_say():
    rng = np.random.default_rng(0)
    R, (H, T, F) = exp([0.4, 1.0, -0.7]), rng.standard_normal((3, 3)) * [[1e-2], [1e-1], [1.0]]
    omega, a = euler(R[None], H[None], T[None], F[None])
    expected = [omega @ MOUNTED[0], omega @ MOUNTED[1], *(a[:, i] @ MOUNTED[i] for i in range(2))]
    y = seen(moved_at(R, H, T, F)).reading
    np.testing.assert_allclose(y, np.hstack(expected), rtol=1e-12)


def test_rows_are_the_derivatives_of_what_is_read_also_by_a_body_that_deforms():
    rng = np.random.default_rng(1)
    R, (H, T, F) = exp([0.4, 1.0, -0.7]), rng.standard_normal((3, 3)) * [[1e-2], [1e-1], [1.0]]
    bends = rng.standard_normal((3, 3))
    shape = {"J": INERTIA + 2e-5 * (bends + bends.T), "dJ": 1e-3 * (bends @ bends.T)}
    shape |= {"h": 1e-3 * rng.standard_normal(3), "dh": 1e-2 * rng.standard_normal(3)}

    def read(v):
        moved = moved_at(exp(v[:3]) @ R, H + 1e-3 * v[3:6], T + v[6:9], F + v[9:], **shape)
        return seen(moved).reading[0]

    found = seen(moved_at(R, H, T, F, **shape))
    y, rows = found.reading, list(found.by.values())
    rows[1] = 1e-3 * rows[1]
    numeric = approx_fprime(np.zeros(12), read, 1e-6)
    np.testing.assert_allclose(np.concatenate(rows, 2)[0], numeric, atol=2e-4 * np.abs(y).max())


def test_a_reading_of_a_deforming_body_is_the_second_derivative_of_where_the_sensor_is():
    """omega' from J(t) and h(t) against differences of omega, under a moment, as the body changes shape."""
    rng = np.random.default_rng(2)
    A, k = 3e-5 * (lambda a: a + a.T)(rng.standard_normal((3, 3))), 1e-3 * rng.standard_normal(3)
    H0, T = np.array([1e-3, 12e-3, 3e-3]), np.array([0.05, -0.03, 0.02])

    def omega(t, R):
        J, h = INERTIA + A * np.sin(20 * t), k * np.cos(15 * t)
        return R @ np.linalg.solve(J, R.T @ (H0 + T * t) - h)

    t, R, e = 0.03, exp([0.4, 1.0, -0.7]), 1e-5
    w = omega(t, R)
    alpha = (omega(t + e, exp(e * w) @ R) - omega(t - e, exp(-e * w) @ R)) / (2 * e)
    r = POSITION @ R.T
    expected = (np.cross(alpha, r) + np.cross(w, np.cross(w, r))) @ R
    moved = moved_at(
        R, H0 + T * t, T, np.zeros(3), INERTIA + A * np.sin(20 * t), 20 * A * np.cos(20 * t),
        k * np.cos(15 * t), -15 * k * np.sin(15 * t),
    )  # fmt: skip
    y = seen(moved).reading[0, 6:].reshape(2, 3)
    expected = np.einsum("sba,sb->sa", MOUNTED, expected)
    np.testing.assert_allclose(y, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.long
def test_with_sensors_the_claimed_covariance_is_the_error_and_far_below_that_of_markers_alone(causal):
    rng, nees, nis, gain = np.random.default_rng(3 + causal), [], [], []
    for _ in range(6):
        flight, truth, _, bias = flown(rng)
        state = smooth(flight, causal=causal)
        error = wrench(state) - truth
        every = np.einsum("ti,tij,tj->t", error, np.linalg.inv(state.wrench_cov), error)
        nees.append(every[15::30])
        white = np.hstack([state.innovation, state.sensor_innovation])
        nis.append(np.nansum(white**2))
        alone = smooth(replace(flight, sensors=None), causal=causal)
        gain.append(np.mean((wrench(alone) - truth) ** 2, 0) / np.mean(error**2, 0))
        assert (np.abs(state.bias - bias) < 5 * state.bias_std).all()
    for total, count in ((np.sum(nees), 6 * np.size(nees)), (np.sum(nis), len(nis) * white.size)):
        low, high = chi2(count).interval(0.998)
        assert low < total < high
    assert (np.mean(gain, 0) > 4).all(), np.mean(gain, 0)
    assert (state.bias_std < 0.5 * BIAS.repeat(3)).all()


def test_sensors_of_different_rates_share_one_clock():
    """Markers every sixth sample, accelerometers every second, a gyro of a single axis: calibrated."""
    rng, nees, nis, count = np.random.default_rng(6), [], 0.0, 0
    for _ in range(5):
        flight, truth, _, _ = flown(rng, count=180, step=0.003)
        rare, half = np.arange(180) % 6 > 0, np.arange(180) % 2 > 0
        flight.center[rare], flight.rotation[rare] = np.nan, np.nan
        flight.sensors.reading[half, 1] = np.nan
        flight.sensors.reading[:, 0, 1, 1:] = np.nan
        state = smooth(flight)
        error = wrench(state) - truth
        nees.append(np.einsum("ti,tij,tj->t", error, np.linalg.inv(state.wrench_cov), error)[15::33])
        for white in (state.innovation, state.sensor_innovation):
            nis, count = nis + np.nansum(white**2), count + np.isfinite(white).sum()
        assert state.sensor_innovation.shape[1] == len(state.bias) == 10
    for total, dof in ((np.sum(nees), 6 * np.size(nees)), (nis, count)):
        low, high = chi2(dof).interval(0.998)
        assert low < total < high


def nees_of(state, truth):
    error = wrench(state) - truth
    return np.einsum("ti,tij,tj->t", error, np.linalg.inv(state.wrench_cov), error)[15::33]


def with_clock(flight, std):
    return replace(flight, sensors=replace(flight.sensors, clock_std=np.full(2, std)))


@pytest.mark.long
def test_a_clock_that_is_late_is_found_as_well_as_is_claimed_and_ruins_what_ignores_it():
    nees, ignored = [], []
    for seed in range(4):
        flight, truth, _, _ = flown(np.random.default_rng(20 + seed), late=2)
        state = smooth(with_clock(flight, 5e-3))
        nees.append(nees_of(state, truth))
        ignored.append(nees_of(smooth(flight), truth))
        assert (np.abs(state.steady - 2.5e-3) < 4 * state.steady_std).all()
        assert (state.steady_std < 3e-4).all()
    low, high = chi2(6 * np.size(nees)).interval(0.998)
    assert low < np.sum(nees) < high
    assert np.sum(ignored) > 3 * high


def test_clocks_in_doubt_that_agree_cost_next_to_nothing():
    flight, _, _, _ = flown(np.random.default_rng(30))
    agreed, doubted = smooth(flight), smooth(with_clock(flight, 5e-3))
    for load in (slice(3), slice(3, 6)):
        var = [np.diagonal(s.wrench_cov, axis1=1, axis2=2)[:, load].mean() for s in (agreed, doubted)]
        assert 1.0 <= var[1] / var[0] < 1.1
    assert (np.abs(doubted.steady) < 4 * doubted.steady_std).all()
    assert np.all(agreed.steady_std == 0)


def test_biases_that_wander_as_stated_leave_the_claims_right():
    nees, walk = [], np.array([0.1, 1.0])
    for seed in range(4):
        rng = np.random.default_rng(40 + seed)
        flight, truth, _, _ = flown(rng)
        for kind, w in enumerate(walk):
            was = flight.sensors.reading[:, kind]
            was += w * np.sqrt(0.005) * np.cumsum(rng.standard_normal(was.shape), 0)
        flight = replace(flight, sensors=replace(flight.sensors, bias_walk=walk))
        nees.append(nees_of(smooth(flight), truth))
    low, high = chi2(6 * np.size(nees)).interval(0.998)
    assert low < np.sum(nees) < high


FAST = 2 * np.pi / (6 * 0.005)  # rad/s: one turn in six samples of the clock


def frames(flight, every):
    """The flight on the clock of every few samples, without sensors: what markers alone would be."""
    k = slice(None, None, every)
    return Flight(
        flight.time[k], flight.center[k], flight.rotation[k], flight.pose_cov[k], flight.mass,
        flight.inertia[k], flight.h[k], flight.gravity,
    )  # fmt: skip


def spin_of(state, R):
    return np.einsum("tba,tb->ta", R, state.omega)[:, 2]


def test_a_gyro_counts_the_turns_that_markers_past_half_a_turn_a_frame_cannot():
    """Markers see every fourth sample, 240 degrees on: alone they say 120 degrees back."""
    flight, truth, R, _ = flown(np.random.default_rng(7), count=160, spin=np.array([0.3, 0.5, FAST]))
    unmarked = np.arange(160) % 4 > 0
    alone = smooth(frames(flight, 4))
    assert np.median(spin_of(alone, R[::4])) == pytest.approx(-FAST / 2, rel=0.1)
    flight.center[unmarked], flight.rotation[unmarked] = np.nan, np.nan
    state = smooth(flight)
    assert np.median(spin_of(state, R)) == pytest.approx(FAST, rel=0.1)
    error = wrench(state) - truth
    nees = np.einsum("ti,tij,tj->t", error, np.linalg.inv(state.wrench_cov), error)[15::30]
    low, high = chi2(6 * len(nees)).interval(0.998)
    assert low < nees.sum() < high


@pytest.mark.parametrize("share", [0.95, 1.05])
def test_about_half_a_turn_a_frame_a_gyro_at_the_rate_of_the_markers_keeps_the_sense(share):
    fast = share * np.pi / 0.005
    flight, truth, R, _ = flown(np.random.default_rng(8), count=100, spin=np.array([0.3, 0.5, fast]))
    with_gyro, alone = smooth(flight), smooth(frames(flight, 1))
    assert np.median(spin_of(with_gyro, R)) == pytest.approx(fast, rel=0.02)
    aliased = fast if share < 1 else fast - 2 * np.pi / 0.005
    assert np.median(spin_of(alone, R)) == pytest.approx(aliased, rel=0.02)
    error = wrench(with_gyro) - truth
    nees = np.einsum("ti,tij,tj->t", error, np.linalg.inv(with_gyro.wrench_cov), error)[15::30]
    low, high = chi2(6 * len(nees)).interval(0.998)
    assert low < nees.sum() < high


@pytest.mark.long
def test_without_markers_force_and_moment_are_right_as_claimed_and_so_is_the_drift_of_position():
    """The pose of the first sample is given, as where a body is let go; none after it is seen."""
    rng, nees, gone = np.random.default_rng(9), [], []
    for _ in range(6):
        flight, truth, R, _ = flown(rng, count=120)
        last = flight.center[-1].copy()
        flight.center[1:], flight.rotation[1:] = np.nan, np.nan
        state = smooth(flight)
        error = wrench(state) - truth
        nees.append(np.einsum("ti,tij,tj->t", error, np.linalg.inv(state.wrench_cov), error)[15::30])
        off = state.center[-1] - last
        gone.append(off @ np.linalg.solve(state.pose_cov[-1, :3, :3], off))
        turn = Rotation.from_matrix(state.rotation[-1] @ R[-1].T).as_rotvec()
        gone.append(turn @ np.linalg.solve(state.pose_cov[-1, 3:, 3:], turn))
        assert (np.sqrt(np.diagonal(state.pose_cov[-1])[:3]) > 1.0).all()  # m: the speed was never seen
    low, high = chi2(6 * np.size(nees)).interval(0.998)
    assert low < np.sum(nees) < high
    # of the start as good as unknown, the speed of the throw is a small draw
    assert np.sum(gone) < chi2(3 * len(gone)).ppf(0.999)


def test_reckoning_is_led_back_to_the_frames_seen_and_stands_on_the_first_body_where_none_is():
    time = np.linspace(0.0, 1.0, 101)
    R = exp(np.outer(time, [2.0, 40.0, -9.0]))
    step = R[:-1].swapaxes(1, 2) @ R[1:] @ exp([1e-3, 2e-3, -1e-3])  # a gyro with a bias
    seen = np.full_like(R, np.nan)
    np.testing.assert_allclose(reckoned(time, step, seen)[0], np.eye(3), atol=1e-15)
    seen[::25] = R[::25]
    path = reckoned(time, step, seen)
    np.testing.assert_allclose(path[::25], R[::25], atol=1e-12)
    assert np.abs(path - R).max() < 0.03


def test_gyros_are_averaged_and_bridged_and_one_of_fewer_axes_does_not_count():
    sensors = both_sensors()
    time, rate = np.arange(5.0), np.array([[1.0, 2.0, 3.0]]) * (1 + np.arange(5.0))[:, None]
    read = np.einsum("sba,tb->tsa", MOUNTED, rate)
    read[2], read[:, 1, 0] = np.nan, np.nan
    sensors = replace(sensors, reading=np.stack([read, read], 1))
    np.testing.assert_allclose(gyro_rate(time, sensors), rate, atol=1e-12)
    sensors.reading[:, 0, 0, 2] = np.nan
    assert gyro_rate(time, sensors) is None
    assert gyro_rate(time, None) is None


def test_engines_see_the_same_flight_with_sensors():
    flight, _, _, _ = flown(np.random.default_rng(11), count=30)
    ours, plain, reference = (smooth(flight, engine=name) for name in ("auto", "numpy", "filterpy"))
    np.testing.assert_allclose(wrench(ours), wrench(plain), atol=1e-9 * np.abs(wrench(ours)).max())
    np.testing.assert_allclose(ours.wrench_cov, plain.wrench_cov, atol=1e-9 * ours.wrench_cov.max())
    # a start as good as unknown costs the reference digits, which come back as it goes on
    on = slice(10, None)
    size = np.abs(wrench(ours)).max()
    np.testing.assert_allclose(wrench(ours)[on], wrench(reference)[on], atol=1e-6 * size)
    np.testing.assert_allclose(
        ours.wrench_cov[on], reference.wrench_cov[on], atol=1e-5 * ours.wrench_cov.max()
    )
    np.testing.assert_allclose(ours.bias, plain.bias, atol=1e-10)
    # the bias is that of the whole record, and the reference loses digits of it at the start
    assert (np.abs(ours.bias - reference.bias) < 1e-4 * ours.bias_std).all()
