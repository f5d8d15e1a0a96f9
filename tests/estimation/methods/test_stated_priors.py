"""Priors of one's own: what is stated of a load is kept, the rest is tuned."""

import numpy as np
import pytest

import forceid
from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.flight.channels import Channel
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.stated import Stated
from forceid.flight.tuning import tune_loads
from forceid.kalman.building.process import discretize, matern

G = [0.0, 0.0, -9.81]
MASS = {"a": 0.1, "b": 0.1, "c": 0.1, "d": 0.1}
SHAPE = 0.15 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
ORDER, STD, RATE, NOISE, STEP = 2, 3.0, 12.0, 3e-4, 0.01


def drawn(seed, n=200, order=ORDER, std=STD, rate=RATE):
    """A body that does not turn, under a force drawn from a Matern prior: its motion, and the force."""
    rng = np.random.default_rng(seed)
    fine = 10
    process = matern(order, np.full(1, std), np.full(1, rate))
    F, Q = (a[0] for a in discretize(process, np.full(1, STEP / fine)))
    x = np.linalg.cholesky(process.P0[0]) @ rng.standard_normal((order, 3))
    root = np.linalg.cholesky(Q + 1e-12 * np.diag(np.diag(Q)))
    force, speed, place = np.zeros((n, 3)), rng.standard_normal(3), np.zeros(3)
    center = np.zeros((n, 3))
    for k in range(n):
        force[k], center[k] = process.output @ x, place
        for _ in range(fine):
            a = process.output @ x / 0.4 + np.array(G)
            place, speed = place + speed * STEP / fine + 0.5 * a * (STEP / fine) ** 2, speed + a * STEP / fine
            x = F @ x + root @ rng.standard_normal((order, 3))
    noise = NOISE * rng.standard_normal((n, 4, 3))
    tree = forceid.motion(
        center[:, None] + SHAPE + noise, np.arange(n) * STEP, mass=list(MASS.values()), gravity=G,
        nodes=list(MASS), shape=SHAPE, noise_std=NOISE,
    )  # fmt: skip
    return tree, force


@pytest.fixture(scope="module")
def seen():
    """A channel as tuning takes it: times, positions, gain, variances, drift."""
    tree, _ = drawn(0)
    time = tree["motion/time"].values
    z = tree["motion/position"].values.mean(1) - 0.5 * time[:, None] ** 2 * np.array(G)
    return time, z, 1 / 0.4, np.full((len(time), 3), NOISE**2 / 4), np.zeros(3)


def estimated(tree, **prior):
    return forceid.estimate(tree, model="rigid", lines="none", prior={"force": prior} if prior else None)


def tuned_of(result):
    return {k: v for k, v in result["estimate"].attrs.items() if k.startswith("tuned_force")}


def test_what_is_stated_is_kept_and_the_rest_is_likeliest_beside_it(seen):
    free = tune_loads(*seen, orders=(2,))
    for known in (Stated(std=2.0), Stated(rate=20.0), Stated(std=2.0, rate=20.0), Stated(3, 2.0, 20.0)):
        kernel = tune_loads(*seen, stated=known, orders=(2,)).kernel
        assert kernel.order == (known.order or 2)
        assert known.std is None or kernel.std.tolist() == [2.0] * 3
        assert known.rate is None or kernel.rate == pytest.approx([20.0] * 3, rel=1e-12)
    level = tune_loads(*seen, orders=(2,), stated=Stated(std=2.0)).log_likelihood
    tried = [tune_loads(*seen, orders=(2,), stated=Stated(None, 2.0, rate)).log_likelihood
             for rate in (3.0, 6.0, 12.0, 24.0, 48.0)]  # fmt: skip
    assert level >= max(tried) - 0.05
    assert free.log_likelihood >= level - 0.05


def test_a_prior_stated_as_it_was_tuned_is_as_likely(seen):
    free = tune_loads(*seen, orders=(2,))
    std, rate = float(free.kernel.std[0]), float(free.kernel.rate[0])
    one = tuple(a[:, :1] if a.ndim == 2 else a for a in seen[:2])
    alone = (*one, seen[2], seen[3][:, :1], seen[4][:1])
    own = tune_loads(*alone, orders=(2,))
    again = tune_loads(*alone, stated=Stated(2, float(own.kernel.std[0]), float(own.kernel.rate[0])))
    assert again.log_likelihood == pytest.approx(own.log_likelihood, abs=0.02)
    assert (std, rate) == pytest.approx((own.kernel.std[0], own.kernel.rate[0]), rel=0.05)


def test_noise_is_tuned_beside_a_prior_that_is_whole(seen):
    time, z, gain, var, drift = seen
    found = tune_loads(time, z, gain, var / 4, drift, (1.0, 4.0), stated=Stated(ORDER, STD, RATE))
    assert found.noise == pytest.approx([2.0] * 3, rel=0.1)


def test_the_bandwidth_is_where_the_spectrum_is_down_to_a_half():
    for order in (1, 2, 3, 6):
        kernel = Matern(order, np.ones(1), np.array([Stated(bandwidth=3.0).rate_at(order)]))
        low, half = kernel.density(np.array([[0.0], [2 * np.pi * 3.0]]))[:, 0]
        assert half / low == pytest.approx(0.5, rel=1e-12)


def test_settings_state_the_prior_of_a_result():
    tree, _ = drawn(1)
    found = tuned_of(estimated(tree, order=3, std=2.0, bandwidth=1.5))
    assert found["tuned_force_order"] == 3
    assert found["tuned_force_std_2"] == 2.0
    assert found["tuned_force_rate_2"] == pytest.approx(Stated(bandwidth=1.5).rate_at(3))
    half = tuned_of(estimated(tree, order=1))
    assert half["tuned_force_order"] == 1
    assert half["tuned_force_std_1"] not in (1.0, 2.0)


def test_claims_follow_the_prior_and_one_that_the_record_contradicts_degrades_the_verdict():
    tree, _ = drawn(2)
    small, right, large = (estimated(tree, order=2, std=s, rate=RATE)["estimate"] for s in (1e-2, STD, 3e3))
    assert right.attrs["verdict"] == "ok"
    assert right["force_std"].values.mean() < 0.5 * large["force_std"].values.mean()
    assert small.attrs["verdict"] == "degraded"
    assert "innovations-large" in small.attrs["reason_codes"]


@pytest.mark.long
def test_claims_under_the_true_prior_hold_and_err_no_more_than_under_a_tuned_one():
    score, errors = [], []
    for seed in range(12):
        tree, force = drawn(10 + seed)
        inner = slice(20, -20)
        for prior in ({"order": ORDER, "std": STD, "rate": RATE}, {}):
            result = estimated(tree, **prior)["estimate"]
            off = (result["force"].values - force)[inner]
            errors.append(np.mean(off**2))
            if prior:
                score.append(np.mean((off / result["force_std"].values[inner]) ** 2))
    assert np.sqrt(np.mean(score)) == pytest.approx(1.0, abs=0.08)
    assert np.mean(errors[::2]) <= 1.02 * np.mean(errors[1::2])


REFUSED = {
    "both": ({"prior": {"force": {"rate": 1.0, "bandwidth": 2.0}}}, "has rate and bandwidth, expected one"),
    "misspelled": ({"prior": {"force": {"sdt": 1.0}}}, "unknown key 'prior.force.sdt'; did you mean"),
    "order": ({"prior": {"moment": {"order": 9}}}, "prior.moment.order.*less than or equal to 6, found 9"),
    "periodic": ({"prior": {"force": {"std": 1}}, "load_prior": "periodic"}, "load_prior = 'matern' beside"),
    "body": ({"prior": {"force": {"std": 1}}, "load_axes": "body"}, "load_axes = 'world' beside"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_numbers_that_do_not_fit_are_refused_in_one_line(case):
    settings, said = REFUSED[case]
    with pytest.raises(ConfigError, match=said):
        load_settings(**settings)


def test_a_channel_is_what_the_tests_take_it_for(seen):
    assert len(Channel(*seen[:3], np.zeros((len(seen[0]), 3, 3)), np.zeros((3, 3))).z) == 200


@pytest.mark.long
def test_sensors_beside_markers_leave_a_stated_prior_as_it_is():
    prior = {"force": {"order": 2, "std": 4.0, "rate": 30.0}, "moment": {"std": 0.02}}
    result = forceid.estimate(forceid.open_motion("data/synthetic/instrumented.h5"), prior=prior)
    found = result["estimate"].attrs
    force = [found[f"tuned_force_{name}"] for name in ("order", "std_1", "std_3", "rate_2")]
    assert force == [2, 4.0, 4.0, 30.0]
    assert [found[f"tuned_moment_std_{k}"] for k in (1, 2, 3)] == [0.02] * 3


def test_numbers_of_a_prior_are_refused_where_nothing_shows_poses():
    tree = forceid.motion(
        time=np.arange(50) / 100, specific_force=np.ones((50, 1, 3)), angular_velocity=np.ones((50, 1, 3)),
        total_mass=1.0, mass_center=[0, 0, 0], inertia=np.eye(3), sensor_position=[[0, 0, 0]], gravity=G,
        noise_std={"specific_force": 0.1, "angular_velocity": 0.01},
    )  # fmt: skip
    with pytest.raises(ConfigError, match=r"numbers of a prior are for poses, .*; leave it out"):
        forceid.estimate(tree, prior={"force": {"std": 1.0}})
