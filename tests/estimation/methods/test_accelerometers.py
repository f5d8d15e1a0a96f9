"""Accelerometers alone: wrench of shaken panels and of tumbling bodies, beside a truth that was flown."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.inspection import inspect_recording
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.principal import cross_matrix, summation_operator
from forceid.records import Body, Motion, Recording

DOWN = np.array([0.0, 0.0, -9.81])
SUPPORT = 7  # the node of the panel that the shaker holds
TOLD = {"rtol": 1e-9, "atol": 1e-12}


def waves(rng, low, high, size, count=8):
    """Sums of sines (t) -> (6,), and their rates, with amplitudes size (6,) over the root of their number."""
    w, phase = 2 * np.pi * rng.uniform(low, high, (6, count)), rng.uniform(0, 2 * np.pi, (6, count))
    size = np.asarray(size)[:, None] / np.sqrt(count)
    return (
        lambda t: (size * np.sin(w * t + phase)).sum(1),
        lambda t: (size * w * np.cos(w * t + phase)).sum(1),
    )


def read_by(rng, force, mass, alpha, omega, position, noise, offset, bent=0.0):
    """What sensors at random angles read of a flight, and these angles as quaternions."""
    rotation = Rotation.random(len(position), random_state=rng)
    turn = cross_matrix(omega)
    field = force[:, None] / mass + position @ (cross_matrix(alpha) + turn @ turn).mT + bent
    y = np.einsum("sba,tsb->tsa", rotation.as_matrix(), field)
    off = offset * rng.standard_normal(position.shape)
    return y + off + noise * rng.standard_normal(y.shape), rotation.as_quat()


def shaken_panel(seed, duration=0.5, noise=0.02, offset=0.0):
    """A panel of two modes on a bushing whose far end shakes, nine accelerometers, and the wrench at it."""
    rng = np.random.default_rng(seed)
    X = np.stack([*np.meshgrid(np.linspace(-0.3, 0.3, 5), np.linspace(-0.2, 0.2, 5)), np.zeros((5, 5))], -1)
    X, mass = X.reshape(25, 3), rng.uniform(0.08, 0.12, 25)
    X = X - mass @ X / mass.sum()
    m, S, M = mass.sum(), summation_operator(X), np.repeat(mass, 3)
    J = (S.T @ (M[:, None] * S))[3:, 3:]
    basis = np.linalg.qr(np.sqrt(M)[:, None] * S)[0]
    for bend in (X[:, 0] ** 2, X[:, 0] * X[:, 1]):
        u = np.sqrt(M) * np.outer(bend, [0, 0, 1.0]).ravel()
        u -= basis @ (basis.T @ u)
        basis = np.column_stack([basis, u / np.linalg.norm(u)])
    shape = (basis[:, 6:] / np.sqrt(M)[:, None]).T.reshape(2, 25, 3)
    w, damping = 2 * np.pi * np.array([43.0, 71.0]), np.array([0.02, 0.015])
    stiff = np.repeat([m * (2 * np.pi * 25) ** 2, np.trace(J) / 3 * (2 * np.pi * 35) ** 2], 3)
    brake = 0.2 * stiff / np.repeat([2 * np.pi * 25, 2 * np.pi * 35], 3)
    place, speed = waves(rng, 5, 120, np.repeat([1e-4, 3e-4], 3))
    lever = np.vstack([S[3 * SUPPORT : 3 * SUPPORT + 3], np.hstack([np.zeros((3, 3)), np.eye(3)])])
    moves = np.column_stack([lever, np.vstack([shape[:, SUPPORT].T, np.zeros((3, 2))])])  # by center, turn, q

    def held(t, s):
        return stiff * (place(t) - moves @ s[:8]) + brake * (speed(t) - moves @ s[8:])

    def rates(t, s):
        on = moves.T @ held(t, s)
        turn, spin = Rotation.from_rotvec(s[3:6]), s[11:14]
        alpha = np.linalg.solve(J, on[3:6] - np.cross(spin, J @ spin))
        swing = on[6:] - 2 * damping * w * s[14:] - w**2 * s[6:8]
        return np.concatenate([s[8:], turn.apply(on[:3]) / m + DOWN, alpha, swing])

    time = np.arange(0, duration, 1e-3)
    start = np.zeros(16)
    start[2] = DOWN[2] * m / stiff[2]
    s = solve_ivp(rates, (0, time[-1]), start, "DOP853", t_eval=time, **TOLD).y.T
    on = np.array([moves.T @ held(*at) for at in zip(time, s, strict=True)])
    spin, at = s[:, 11:14], np.array([0, 2, 4, 10, 12, 14, 20, 22, 24])
    alpha = np.linalg.solve(J, (on[:, 3:6] - np.cross(spin, spin @ J)).T).T
    swing = np.array([rates(*pair)[14:] for pair in zip(time, s, strict=True)])
    bent = np.einsum("tk,kna->tna", swing, shape[:, at])
    y, angles = read_by(rng, on[:, :3], m, alpha, spin, X[at], noise, offset, bent)
    body = Body(
        tuple(f"n{k}" for k in range(25)), X, mass, mode_shape=2.0 * shape, mode_frequency=w / (2 * np.pi),
        mode_damping=damping, sensor_position=X[at], sensor_rotation=angles,
    )  # fmt: skip
    pushed = on[:, 6:] / np.linalg.norm(shape, axis=(1, 2))
    truth = {
        "wrench": on[:, :6],
        "modes": pushed,
        "support": np.array([held(*pair) for pair in zip(time, s, strict=True)]),
    }
    return Recording(body, Motion(time, specific_force=y, gravity=DOWN)), truth


def tumbling(seed, count=6, noise=0.02, offset=0.0, spin=None, torque=0.9, flat=False, duration=1.0):
    """A rigid body that tumbles under drawn loads, accelerometers at random places; its wrench and spin."""
    rng = np.random.default_rng(seed)
    J, mass = np.array([[0.02, 0.002, 0], [0.002, 0.03, -0.001], [0, -0.001, 0.04]]), 2.0
    load, _ = waves(rng, 0.3, 8, np.repeat([6.0, torque], 3))
    start = rng.uniform(-6, 6, 3) if spin is None else np.array(spin)

    def rate(t, w):
        return np.linalg.solve(J, load(t)[3:] - np.cross(w, J @ w))

    time = np.arange(0, duration, 2e-3)
    omega = solve_ivp(rate, (0, time[-1]), start, "DOP853", t_eval=time, **TOLD).y.T
    wrench = np.array([load(t) for t in time])
    alpha = np.array([rate(*at) for at in zip(time, omega, strict=True)])
    place = rng.uniform(-0.15, 0.15, (count, 3)) * (1, 1, not flat)
    y, angles = read_by(rng, wrench[:, :3], mass, alpha, omega, place, noise, offset)
    center = np.array([0.1, 0.0, -0.2])
    body = Body(
        total_mass=mass, mass_center=center, inertia=J, sensor_position=place + center, sensor_rotation=angles
    )  # fmt: skip
    return Recording(body, Motion(time, specific_force=y, gravity=DOWN)), {"wrench": wrench, "omega": omega}


def judged(recording, wrench, **settings):
    """The estimate, and by component its error rms over that of the truth, and over the claim."""
    found = estimate_recording(recording, load_settings(**settings))
    error = np.hstack([found.force, found.moment]) - wrench
    claim = np.hstack([found.force_std, found.moment_std])
    told = np.isfinite(error).any(1)
    relative = np.sqrt((error[told] ** 2).mean(0) / (wrench[told] ** 2).mean(0))
    return found, relative, np.sqrt(((error / claim)[told] ** 2).mean(0))


def only(recording, which):
    """The recording with some of its sensors."""
    body, motion = recording.body, recording.motion
    at = {name: getattr(body, name)[which] for name in ("sensor_position", "sensor_rotation")}
    motion = replace(motion, specific_force=motion.specific_force[:, which])
    return replace(recording, body=replace(body, **at), motion=motion)


@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.long)]
)
def test_nine_accelerometers_give_the_wrench_and_the_interface_force_of_a_panel_on_a_shaker(seed):
    recording, truth = shaken_panel(seed)
    found, relative, over = judged(recording, truth["wrench"])
    assert found.verdict.level == "ok"
    assert (relative < 0.01).all(), relative
    assert ((over > 0.8) & (over < 1.3)).all(), over
    _, relative, over = judged(recording, truth["support"], moment_about=f"n{SUPPORT}")
    assert (relative < 0.01).all(), relative
    assert ((over > 0.8) & (over < 1.3)).all(), over


@pytest.mark.long
def test_forces_on_modes_come_out_from_half_their_frequency_on_and_are_within_claims_below():
    recording, truth = shaken_panel(4)
    modal = estimate_recording(recording, load_settings()).modal
    error = modal.force - truth["modes"] + truth["modes"].mean(0)
    over = np.sqrt((error**2 / np.diagonal(modal.cov, axis1=1, axis2=2)).mean(0))
    assert (over < 1.3).all(), over
    found, true = (np.fft.rfft(np.hanning(500)[:, None] * f, axis=0) for f in (modal.force, truth["modes"]))
    at = np.fft.rfftfreq(500, 1e-3)
    for k, mode in enumerate((43.0, 71.0)):
        band = (at > 0.5 * mode) & (at < 130)
        assert np.linalg.norm((found - true)[band, k]) < 0.15 * np.linalg.norm(true[band, k])


@pytest.mark.long
def test_over_drawn_panels_with_offsets_errors_are_those_claimed():
    found = [
        judged(r, t["wrench"])[2] for r, t in (shaken_panel(s, 0.2, 0.02, 0.05) for s in range(100, 140))
    ]
    over = np.sqrt(np.mean(np.square(found), 0))
    assert ((over > 0.8) & (over < 1.3)).all(), over


@pytest.mark.parametrize(("count", "flat"), [(6, False), (4, False), (3, False), (6, True)])
def test_a_body_that_tumbles_is_followed_without_a_gyro(count, flat):
    recording, truth = tumbling(count, count, flat=flat)
    found, relative, over = judged(recording, truth["wrench"], noise_std={"specific_force": 0.02})
    assert found.verdict.level == "ok"
    assert (relative < 0.03).all(), relative
    assert ((over > 0.8) & (over < 1.3)).all(), over
    np.testing.assert_allclose(found.angular_velocity, truth["omega"], atol=0.02)


@pytest.mark.long
def test_over_drawn_tumbles_errors_are_those_claimed_with_noise_and_offsets_unknown():
    found = [judged(r, t["wrench"])[2] for r, t in (tumbling(s, 5, offset=0.05) for s in range(200, 240))]
    over = np.sqrt(np.mean(np.square(found), 0))
    assert ((over > 0.8) & (over < 1.3)).all(), over


def test_of_a_spin_that_stays_the_wrench_is_told_and_its_sense_is_said_to_be_open():
    rng, time = np.random.default_rng(0), np.arange(500) * 2e-3
    place, none = rng.uniform(-0.15, 0.15, (6, 3)), np.zeros((500, 3))
    y, angles = read_by(rng, none, 2.0, none, none + np.array([0, 0, 9.0]), place, 0.02, 0.0)
    body = Body(
        total_mass=2.0, mass_center=np.zeros(3), inertia=np.diag([0.02, 0.03, 0.04]), sensor_position=place,
        sensor_rotation=angles,
    )  # fmt: skip
    found = estimate_recording(Recording(body, Motion(time, specific_force=y, gravity=DOWN)), load_settings())
    assert found.verdict.codes == ("body-axes", "turn-sense-open")
    np.testing.assert_allclose(np.abs(found.angular_velocity[:, 2]), 9.0, atol=0.05)
    over = np.sqrt(
        np.mean((np.hstack([found.force / found.force_std, found.moment / found.moment_std])) ** 2, 0)
    )
    assert ((over > 0.8) & (over < 1.3)).all(), over


def test_readings_that_are_lost_cost_their_samples_and_no_others():
    recording, truth = tumbling(5)
    y = recording.motion.specific_force.copy()
    y[100:120] = np.nan
    y[200:300, 2] = np.nan
    y[400:, 4, 1] = np.nan
    found, relative, over = judged(
        replace(recording, motion=replace(recording.motion, specific_force=y)), truth["wrench"]
    )
    assert np.isnan(found.force[100:120]).all()
    assert np.isfinite(found.moment[121:]).all()
    assert (relative < 0.03).all(), relative
    assert ((over > 0.8) & (over < 1.3)).all(), over


def test_what_too_few_accelerometers_do_not_tell_is_left_out_and_its_neighbors_are_not():
    recording, _ = shaken_panel(1, duration=0.2)
    stiff = replace(
        recording, body=replace(recording.body, mode_shape=None, mode_frequency=None, mode_damping=None)
    )
    found = estimate_recording(only(stiff, [1]), load_settings())
    assert found.verdict.level == "refused"
    assert found.verdict.codes == ("array-too-small",)
    middle = replace(stiff.body, sensor_position=np.zeros((9, 3)))
    found = estimate_recording(only(replace(stiff, body=middle), [0]), load_settings())
    assert found.verdict.codes[:2] == ("body-axes", "array-open")
    assert np.isfinite(found.force).all()
    assert np.isfinite(found.force_std).all()
    assert np.isnan(found.moment).all()


@pytest.mark.long
def test_a_panel_whose_modes_are_not_told_and_a_sensor_out_of_place_are_said():
    recording, _ = shaken_panel(2, duration=0.2)
    body = recording.body
    bare = replace(body, mode_shape=None, mode_frequency=None, mode_damping=None)
    found = estimate_recording(replace(recording, body=bare), load_settings())
    assert found.verdict.level == "degraded"
    assert "array-colored" in found.verdict.codes
    found = estimate_recording(
        replace(recording, body=bare), load_settings(noise_std={"specific_force": 0.02})
    )
    assert "array-misfit" in found.verdict.codes
    place = body.sensor_position + np.eye(9)[:, :3] * 0.02
    found = estimate_recording(replace(recording, body=replace(body, sensor_position=place)), load_settings())
    assert found.verdict.level == "degraded"


def test_accelerometers_that_pass_no_steady_reading_are_said():
    recording, truth = shaken_panel(3)
    motion = recording.motion
    coupled = replace(motion, specific_force=motion.specific_force - motion.specific_force.mean(0))
    found, _, _ = judged(replace(recording, motion=coupled), truth["wrench"] - truth["wrench"].mean(0))
    assert "no-weight-read" in found.verdict.codes
    assert found.verdict.level == "ok"
    assert np.abs(found.force - (truth["wrench"] - truth["wrench"].mean(0))[:, :3]).max() < 0.2


@pytest.mark.parametrize("samples", [1, 2, 100])
@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_records_without_noise_without_motion_or_of_a_sample_are_estimated(samples, factor):
    for recording, _ in (shaken_panel(0, 0.1, noise=0.0), tumbling(1, noise=0.0, duration=0.2)):
        motion = recording.motion
        read = factor * motion.specific_force[:samples]
        short = replace(motion, time=motion.time[:samples], specific_force=read)
        found = estimate_recording(replace(recording, motion=short), load_settings())
        assert found.verdict.level != "refused"
        assert np.isfinite(found.force).all()


def test_a_moment_about_a_point_in_space_is_refused_and_inspection_tells_what_will_come(tmp_path):
    recording, _ = shaken_panel(0, duration=0.2)
    with pytest.raises(
        ConfigError, match="moment_about is a point fixed in space, and sensors alone do not show"
    ):
        estimate_recording(recording, load_settings(moment_about=(0.0, 0.0, 0.0)))
    write_motion(tmp_path / "panel.h5", recording)
    seen = inspect_recording(read_motion(tmp_path / "panel.h5"), load_settings())
    assert (seen.force, seen.moment, seen.rank, seen.shapes) == (True, True, 6, 2)
    assert "accelerometers alone show no pose" in str(seen)


@pytest.mark.long
def test_a_long_and_fast_tumble_is_followed_to_its_end():
    recording, truth = tumbling(5, duration=20.0)
    assert np.abs(truth["omega"]).max() > 20
    found, relative, over = judged(recording, truth["wrench"])
    assert found.verdict.level == "ok"
    assert (relative < 0.01).all(), relative
    assert ((over > 0.8) & (over < 1.3)).all(), over
