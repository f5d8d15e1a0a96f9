from dataclasses import replace

import numpy as np
import pytest
from flights import INERTIA, SPIN, drawn_flight, flight_of, free_top, prior, steps_of, tumble
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from forceid import kalman
from forceid.errors import EstimationError
from forceid.flight.path import reference as linearized
from forceid.flight.path import settling
from forceid.flight.path.linear import stack
from forceid.flight.path.reference import Reference, rotation_model, translation
from forceid.flight.path.settling import first_reference
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import Tuned
from forceid.flight.smoother import smooth_flight
from forceid.kalman.building.lines import Line

FORCE, MOMENT = prior(std=1.0, rate=20.0), prior(std=0.05, rate=30.0)
TORQUE, TORQUE_RATE = np.array([0.05, -0.03, 0.02]), np.array([1.0, 2.0, -1.0])  # N m, N m/s


def exp(phi):
    return Rotation.from_rotvec(phi).as_matrix()


def log(R):
    return Rotation.from_matrix(R).as_rotvec()


def smooth(flight, force=FORCE, moment=MOMENT, engine="numpy", **more):
    return smooth_flight(flight, force, moment, kalman.engine(engine), **more)


def wrench(state):
    return np.hstack([state.force, state.moment])


def driven_top(step, count=12):
    """A top under a moment that grows quadratically, without noise, and the reference that knows it."""
    time = step * np.arange(count)
    R0 = exp([0.4, -0.2, 0.9])

    def H(t):
        return R0 @ INERTIA @ SPIN + TORQUE * t + 0.5 * TORQUE_RATE * t**2

    R = tumble(time, R0, H)
    chain = np.zeros((count, 15))
    chain[:, 3:6], chain[:, 12:15] = [H(t) for t in time], TORQUE_RATE
    chain[:, 6:9], chain[:, 9:12] = 0.25 * TORQUE, 0.75 * TORQUE + TORQUE_RATE * time[:, None]
    return flight_of(time, np.zeros((count, 3)), R), Reference(R, chain, MOMENT), H


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_one_step_of_the_rotation_is_that_of_dop853(step):
    """A tenth of a radian a step, which is the longest substep."""
    flight, reference, _ = driven_top(step)
    R, _, _ = steps_of(flight, reference)
    assert np.abs(log(R @ reference.rotation[1:].swapaxes(1, 2))).max() < 1e-8


def test_a_step_converges_with_order_four_in_its_substeps(monkeypatch):
    flight, reference, _ = driven_top(0.04)
    error = []
    for count in (10, 20):
        monkeypatch.setattr(linearized, "substeps", lambda *_, count=count: count)
        R, _, _ = steps_of(flight, reference)
        error.append(np.abs(log(R @ reference.rotation[1:].swapaxes(1, 2))).max())
    assert 3.7 < np.log2(error[0] / error[1]) < 4.5


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_linear_rotation_rows_are_finite_differences_of_dop853(step):
    flight, reference, H = driven_top(step)
    model = rotation_model(flight, MOMENT, reference)
    R0, time = reference.rotation[0], np.array([0.0, step])

    def column(start, momentum):
        ahead, behind = (
            tumble(time, exp(s * start) @ R0, lambda t, s=s: H(t) + s * momentum(t))[1] for s in (1, -1)
        )
        return 0.5 * log(ahead @ behind.T)

    for axis in np.eye(3):
        i = int(axis.argmax())
        by_angle = column(1e-5 * axis, lambda t: 0.0) / 1e-5
        by_momentum = column(np.zeros(3), lambda t, axis=axis: 1e-6 * axis) / 1e-6
        by_torque = column(np.zeros(3), lambda t, axis=axis: 1e-3 * axis * t) / 1e-3
        np.testing.assert_allclose(model.F[0, :3, i], by_angle, atol=1e-4)
        np.testing.assert_allclose(model.F[0, :3, 3 + i], by_momentum, atol=5e-4 * step / INERTIA[0, 0])
        # taken in proportion to the response to momentum, so exact in the limit of short steps only
        loose = 0.2 * np.linalg.norm(SPIN) * step * 0.5 * step**2 / INERTIA[0, 0]
        np.testing.assert_allclose(model.F[0, :3, 6 + i], by_torque, atol=loose)
        np.testing.assert_allclose(model.F[0, :3, 9 + i], model.F[0, :3, 6 + i], rtol=0.2, atol=loose)


def test_a_reference_that_is_the_true_flight_needs_no_correction():
    """The linear model, started on the truth, predicts the truth: theta = 0, chain as it is."""
    flight, reference, _ = driven_top(2e-3)
    model = rotation_model(flight, MOMENT, reference)
    predicted = np.einsum("tij,tj->ti", model.F, reference.chain[:-1]) + model.u
    # the momentum under a load that a Matern chain lets relax, over a step short of its memory
    np.testing.assert_allclose(predicted[:, 3:6], reference.chain[1:, 3:6], atol=1e-6)
    # which grows over the step as its square, and turns the body by a third of what it would all along
    relaxed = np.abs(predicted[:, 3:6] - reference.chain[1:, 3:6]).max()
    assert np.abs(predicted[:, :3]).max() < relaxed * 2e-3 / 3 / np.linalg.eigvalsh(INERTIA)[0] + 1e-9


def test_center_falls_as_gravity_says():
    flight = free_top(np.random.default_rng(0), count=20)
    model = translation(flight, FORCE)
    x = np.zeros(len(model.x0))
    start, momentum = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3])
    x[:6] = np.concatenate([start, momentum])
    for k in range(19):
        x = model.F[k] @ x + model.u[k]
    t = flight.time[-1]
    fallen = start + momentum / flight.mass * t + 0.5 * t**2 * flight.gravity
    np.testing.assert_allclose(x[:3], fallen, rtol=1e-12)
    np.testing.assert_allclose(x[3:6], momentum + flight.mass * flight.gravity * t, rtol=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_torque_free_top_shows_no_force_and_no_moment(seed):
    """About its middle axis, where it turns over; within three standard deviations for 99 % of all values."""
    state = smooth(free_top(np.random.default_rng(seed), count=200))
    std = np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))
    assert (np.abs(wrench(state)) < 3 * std).mean() >= 0.99


def test_momentum_closes_over_the_flight():
    """The integral of force and moment is the change of momentum, to the quadrature of the samples."""
    flight, _ = drawn_flight(FORCE, MOMENT, np.random.default_rng(4))
    state = smooth(flight)
    step = flight.time[1] - flight.time[0]
    for rate, momentum in (
        (state.force + flight.mass * flight.gravity, flight.mass * state.velocity),
        (state.moment, state.H),
    ):
        gained = step * (rate[1:-1].sum(0) + 0.5 * (rate[0] + rate[-1]))
        np.testing.assert_allclose(gained, momentum[-1] - momentum[0], atol=2e-3 * np.abs(rate).max() * 0.6)


def test_the_fixed_point_does_not_depend_on_the_first_reference(monkeypatch):
    flight = free_top(np.random.default_rng(5), count=100)
    monkeypatch.setattr(settling, "SINGLE", 1e-8)
    plain = smooth(flight)

    def tilted(flight, moment):
        first = first_reference(flight, moment)
        off = exp(np.random.default_rng(6).normal(0, 0.05, (len(flight.time), 3)))
        chain = first.chain.copy()
        chain[:, 3:6] *= 1.1
        return Reference(off @ first.rotation, chain, moment)

    monkeypatch.setattr(settling, "first_reference", tilted)
    other = smooth(flight)
    assert np.abs(log(other.rotation @ plain.rotation.swapaxes(1, 2))).max() < 1e-9
    np.testing.assert_allclose(other.moment, plain.moment, atol=1e-6 * np.abs(plain.moment).max())
    np.testing.assert_allclose(other.wrench_cov, plain.wrench_cov, atol=1e-6 * plain.wrench_cov.max())


def test_rotating_the_world_rotates_the_estimate(monkeypatch):
    monkeypatch.setattr(settling, "SINGLE", 1e-9)
    flight, _ = drawn_flight(FORCE, MOMENT, np.random.default_rng(7), count=80)
    W = exp([0.7, -1.1, 2.0])
    W6 = np.kron(np.eye(2), W)
    moved = replace(
        flight,
        center=flight.center @ W.T,
        rotation=W @ flight.rotation,
        pose_cov=W6 @ flight.pose_cov @ W6.T,
        gravity=W @ flight.gravity,
    )
    # three different priors, along axes that turn with the world
    uneven = Tuned(Matern(2, np.array([0.02, 0.05, 0.1]), np.array([10.0, 30.0, 50.0])))
    force_line = Line(9.0, 0.3, 1e-3, np.array([0.6, 0.0, 0.8]), driven=False)
    moment_line = Line(4.0, 0.02, 2.0, np.array([0.0, 1.0, 0.0]))
    force = replace(FORCE, lines=(force_line,))
    moment = replace(MOMENT, tuned=uneven, axes=exp([0.3, 0.2, 0.1]), lines=(moment_line,))
    here = smooth(flight, force, moment)
    there = smooth(
        moved,
        replace(force, axes=W, lines=(force_line.along(W.T),)),
        replace(moment, axes=W @ moment.axes, lines=(moment_line.along(W.T),)),
    )
    for name in ("center", "velocity", "force", "moment", "H", "omega"):
        expected = getattr(here, name) @ W.T
        np.testing.assert_allclose(getattr(there, name), expected, atol=1e-9 * max(1, np.abs(expected).max()))
    np.testing.assert_allclose(there.rotation, W @ here.rotation, atol=1e-9)
    for name in ("wrench_cov", "pose_cov"):
        expected = W6 @ getattr(here, name) @ W6.T
        np.testing.assert_allclose(getattr(there, name), expected, atol=1e-9 * np.abs(expected).max())
    assert there.log_likelihood == pytest.approx(here.log_likelihood, abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(("causal", "seed"), [(False, 8), (True, 9)])
def test_stated_covariance_is_the_error_of_loads_drawn_from_the_prior(causal, seed):
    """NEES of the wrench at instants far enough apart to count as independent, in its chi-square band."""
    rng, nees, nis = np.random.default_rng(seed), [], []
    for _ in range(14):
        flight, truth = drawn_flight(FORCE, MOMENT, rng)
        state = smooth(flight, causal=causal)
        error = wrench(state) - truth
        every = np.einsum("ti,tij,tj->t", error, np.linalg.inv(state.wrench_cov), error)
        nees.append(every[15::30])
        nis.append(np.nansum(state.innovation**2))
    count = 6 * np.size(nees)
    low, high = chi2(count).interval(0.998)
    assert low < np.sum(nees) < high
    low, high = chi2(len(nis) * state.innovation.size).interval(0.998)
    assert low < np.sum(nis) < high


@pytest.mark.long
def test_a_gap_widens_the_bound_and_stays_calibrated():
    rng, gap, nees = np.random.default_rng(10), slice(52, 60), []
    for _ in range(12):
        flight, truth = drawn_flight(FORCE, MOMENT, rng)
        flight.center[gap], flight.rotation[gap] = np.nan, np.nan
        state = smooth(flight)
        error = (wrench(state) - truth)[56]
        nees.append(error @ np.linalg.solve(state.wrench_cov[56], error))
        assert (np.diagonal(state.wrench_cov[56]) > 1.5 * np.diagonal(state.wrench_cov[30])).all()
    low, high = chi2(6 * len(nees)).interval(0.998)
    assert low < np.sum(nees) < high


def test_engines_see_the_same_flight():
    flight, _ = drawn_flight(FORCE, MOMENT, np.random.default_rng(11), count=40)
    ours, reference = (smooth(flight, engine=name) for name in ("numpy", "filterpy"))
    np.testing.assert_allclose(wrench(ours), wrench(reference), atol=1e-7 * np.abs(wrench(ours)).max())
    np.testing.assert_allclose(ours.wrench_cov, reference.wrench_cov, atol=1e-6 * ours.wrench_cov.max())


def test_stacked_models_do_not_disturb_each_other():
    flight, reference, _ = driven_top(2e-3)
    free, spun = translation(flight, FORCE), rotation_model(flight, MOMENT, reference)
    both = stack((free, spun), flight.pose_cov)
    z = np.random.default_rng(12).standard_normal((len(flight.time), 6)) * 1e-3
    n = len(free.x0)
    joint = kalman.smooth(both, z)
    for part, model, data in ((slice(0, n), free, z[:, :3]), (slice(n, None), spun, z[:, 3:])):
        alone = kalman.smooth(model, data)
        np.testing.assert_allclose(joint.x[:, part], alone.x, atol=1e-8 * np.abs(alone.x).max())


@pytest.mark.parametrize("engine", ["numpy", "auto"])
def test_where_nothing_links_their_errors_the_rotation_by_itself_has_the_same_moment(engine):
    flight, _ = drawn_flight(FORCE, MOMENT, np.random.default_rng(3))
    full, bare = (smooth(flight, force, engine=engine) for force in (FORCE, None))
    np.testing.assert_allclose(bare.moment, full.moment, atol=1e-9 * np.abs(full.moment).max())
    claim, same = (state.wrench_cov[:, 3:, 3:] for state in (full, bare))
    np.testing.assert_allclose(same, claim, atol=1e-9 * claim.max())


@pytest.mark.long
def test_lines_of_force_and_moment_are_followed_within_their_claims():
    """Loads at a frequency that the smooth prior passes by, one along a direction of its own."""
    rng, ratio, plain, with_lines = np.random.default_rng(14), [], [], []
    along, about = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
    lines = Line(15.0, 1.0, 1e-3, along, False), Line(15.0, 0.05, 1e-3, about, False)
    force, moment = replace(FORCE, lines=lines[:1]), replace(MOMENT, lines=lines[1:])
    for _ in range(8):
        flight, truth = drawn_flight(FORCE, MOMENT, rng)
        w, phase = 2 * np.pi * 15.0, rng.uniform(0, 2 * np.pi)
        wave = np.cos(w * flight.time + phase)[:, None] * along
        swing = (np.cos(phase) - np.cos(w * flight.time + phase)) / w**2 - np.sin(phase) * flight.time / w
        center = flight.center + swing[:, None] * along / flight.mass
        truth[:, :3] += wave
        flight = replace(flight, center=center)
        for kept, priors in ((plain, (FORCE, MOMENT)), (with_lines, (force, moment))):
            state = smooth(flight, *priors)
            error = (wrench(state) - truth)[15:-15, :3] @ along
            kept.append(np.mean(error**2))
        var = np.einsum("a,tab,b->t", along, state.wrench_cov[15:-15, :3, :3], along)
        ratio.append(np.mean(error**2 / var))
    assert np.mean(with_lines) < 0.5 * np.mean(plain)
    assert abs(np.mean(ratio) - 1) < 3 * np.std(ratio) / np.sqrt(len(ratio))


def test_a_reference_that_cannot_settle_is_an_error_with_a_next_step(monkeypatch):
    monkeypatch.setattr(settling, "ITERATIONS", 1)
    with pytest.raises(EstimationError, match=r"does not settle: .* raise the sample rate"):
        smooth(free_top(np.random.default_rng(13), count=40))


def test_a_path_before_the_first_rotation_that_is_seen_is_led_there_in_few_steps(monkeypatch):
    """The start of a path is unknown, and no prior about its reference holds it back."""
    flight, steps = free_top(np.random.default_rng(3), count=200), []
    blind = flight.rotation.copy()
    blind[:40] = np.nan  # 0.2 s, within which the moment may turn the body by two radians
    linear = settling.linear_flight

    def counted(*about, **more):
        steps.append(about)
        return linear(*about, **more)

    monkeypatch.setattr(settling, "linear_flight", counted)
    state = smooth(replace(flight, rotation=blind))
    assert len(steps) < 10  # 18 under a prior of one radian
    assert np.sqrt(np.trace(state.pose_cov[0, 3:, 3:])) > 2.0
