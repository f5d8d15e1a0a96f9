import dataclasses
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_models import dense_moments, draw, hard_case, least_squares, random_cov
from scipy.stats import chi2, multivariate_normal

from forceid import kalman
from forceid.errors import ConfigError, EstimationError
from forceid.flight.channels import Start, load_chain
from forceid.kalman import engines
from forceid.kalman.recursions import linear

BUILT = find_spec("forceid.compiled._engine") is not None
OURS = ("numpy", "compiled") if BUILT else ("numpy",)
ENGINES = (*OURS, "filterpy")


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def particle(step=0.004, noise=3e-4):
    """A 0.1 kg particle under a Matern force, its position measured; starts as the force prior does."""
    prior = kalman.matern(2, std=1.0, rate=10 * np.pi)
    chain = kalman.integrate(kalman.integrate(prior, var=0.01), var=1e-4)
    F, Q = kalman.discretize(chain, step)
    H = 10 * chain.output[None]
    return kalman.StateSpace(F, Q, H, np.array([[noise**2]]), np.zeros(4), chain.P0)


@pytest.mark.parametrize("seed", range(5))
def test_smoother_is_batch_least_squares_whatever_changes_with_time(engine, seed):
    model, z = hard_case(seed)
    x, P = least_squares(model, z)
    smoothed = kalman.smooth(model, z, engine=engine)
    np.testing.assert_allclose(smoothed.x, x, atol=1e-8 * np.abs(x).max(), rtol=0)
    np.testing.assert_allclose(smoothed.P, P, atol=1e-8 * np.abs(P).max(), rtol=0)


def test_filter_is_batch_least_squares_of_the_samples_so_far(engine):
    model, z = hard_case()
    filtered = kalman.filter(model, z, engine=engine)
    for k in range(len(z)):
        so_far, past = z[: k + 1], z[: k + 1].copy()
        past[k] = np.nan
        for data, x_k, P_k in (
            (so_far, filtered.x[k], filtered.P[k]),
            (past, filtered.x_pred[k], filtered.P_pred[k]),
        ):
            x, P = least_squares(model, data)
            np.testing.assert_allclose(x_k, x[k], atol=1e-8 * np.abs(x).max(), rtol=0)
            np.testing.assert_allclose(P_k, P[k], atol=1e-8 * np.abs(P).max(), rtol=0)


def test_likelihood_is_the_dense_multivariate_normal(engine):
    model, z = hard_case()
    mean, cov = dense_moments(model, len(z))
    seen = np.isfinite(z).ravel()
    dense = multivariate_normal(mean[seen], cov[seen][:, seen]).logpdf(z.ravel()[seen])
    assert float(kalman.log_likelihood(model, z, engine=engine)) == pytest.approx(dense, abs=1e-8)
    assert kalman.filter(model, z, engine=engine).log_likelihood == pytest.approx(dense, abs=1e-8)


def test_whitened_innovations_carry_the_whole_quadratic_form_of_the_likelihood(engine):
    model, z = hard_case()
    mean, cov = dense_moments(model, len(z))
    seen = np.isfinite(z).ravel()
    misfit = z.ravel()[seen] - mean[seen]
    quadratic_form = misfit @ np.linalg.solve(cov[seen][:, seen], misfit)
    white = kalman.filter(model, z, engine=engine).innovation
    assert np.array_equal(np.isfinite(white), np.isfinite(z))
    assert np.nansum(white**2) == pytest.approx(quadratic_form, abs=1e-8)


def assert_same(ours, reference, tolerance=1e-8):
    filtered = ("x", "P", "x_pred", "P_pred", "innovation", "nis")
    for a, b, names in ((ours, reference, ("x", "P")), (ours.filtered, reference.filtered, filtered)):
        for name in names:
            left, right = getattr(a, name), getattr(b, name)
            size = np.nanmax(np.abs(right))
            np.testing.assert_allclose(left, right, rtol=tolerance, atol=tolerance * size, err_msg=name)
    np.testing.assert_allclose(
        ours.filtered.log_likelihood, reference.filtered.log_likelihood, rtol=tolerance, atol=tolerance
    )


@pytest.mark.parametrize("ours", OURS)
def test_engines_agree_in_every_number(ours):
    model, z = hard_case(seed=11, time=40)
    assert_same(kalman.smooth(model, z, engine=ours), kalman.smooth(model, z, engine="filterpy"))


@pytest.mark.parametrize("ours", OURS)
@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 1), (5, 2), (6, 6), (12, 6), (19, 4), (30, 30)])
@pytest.mark.parametrize("driven", [True, False])
def test_the_converged_gain_is_the_full_recursion_at_every_size_and_across_gaps(
    ours, n, m, driven, monkeypatch
):
    rng = np.random.default_rng(n + m)
    F = 0.97 * np.linalg.qr(rng.standard_normal((n, n)))[0]
    H, u = rng.standard_normal((m, n)), rng.standard_normal((399, n))
    u = u if driven else None
    model = kalman.StateSpace(F, random_cov(rng, n), H, random_cov(rng, m), np.ones(n), np.eye(n), u)
    z = rng.standard_normal((400, m)).cumsum(0)
    z[200:215] = z[300:310, 0] = np.nan
    monkeypatch.setattr(linear, "LONG_RUN", 50)  # also by the gain of Rauch, Tung and Striebel
    smoothed = kalman.smooth(model, z, engine=ours)
    assert len(smoothed.filtered.gains.start) < 300
    assert len(smoothed.start) < 400
    varying = dataclasses.replace(model, F=np.tile(F, (399, 1, 1)))  # a step of its own each
    full = kalman.smooth(varying, z, engine=ours)
    assert len(full.filtered.gains.start) == 400
    assert_same(smoothed, full, 1e-9)
    assert_same(smoothed, kalman.smooth(model, z, engine="filterpy"))


def test_many_signals_of_one_model_are_each_signal_by_itself(engine):
    rng = np.random.default_rng(4)
    model = dataclasses.replace(particle(), u=1e-3 * rng.standard_normal((199, 4)))
    z = np.stack([draw(model, 200, rng)[1] for _ in range(11)], 1)
    z[80:90] = np.nan
    together = kalman.smooth(model, z, engine=engine)
    each = [kalman.smooth(model, z[:, j], engine=engine) for j in range(11)]
    np.testing.assert_allclose(together.x, np.stack([s.x for s in each], 1), atol=1e-12)
    likelihood = [s.filtered.log_likelihood for s in each]
    np.testing.assert_allclose(together.filtered.log_likelihood, likelihood, rtol=1e-10)
    np.testing.assert_allclose(kalman.log_likelihood(model, z, engine=engine), likelihood, rtol=1e-10)
    nis = np.stack([s.filtered.nis for s in each], 1)
    np.testing.assert_allclose(together.filtered.nis, nis, atol=1e-7)


def test_filter_and_states_at_once_are_those_of_each_pass(engine):
    model, rng = particle(), np.random.default_rng(5)
    z = np.stack([draw(model, 60, rng)[1] for _ in range(3)], 1)
    z[20:25] = np.nan
    ours = engines.engine(engine)
    filtered, states = ours.filter_and_smooth_states(model, z)
    np.testing.assert_allclose(filtered.innovation, ours.filter(model, z).innovation, atol=1e-9)
    np.testing.assert_allclose(states, ours.smooth_states(model, z), rtol=1e-9, atol=1e-12)


def test_signals_with_gaps_of_their_own_have_covariances_of_their_own(engine):
    model, rng = particle(), np.random.default_rng(6)
    z = np.stack([draw(model, 60, rng)[1] for _ in range(3)], 1)
    z[20:25, 0] = z[30:50, 2] = np.nan
    together = kalman.smooth(model, z, engine=engine)
    assert together.P.shape == (60, 3, 4, 4)
    for j in range(3):
        alone = kalman.smooth(model, z[:, j], engine=engine)
        np.testing.assert_allclose(together.x[:, j], alone.x, atol=1e-12)
        np.testing.assert_allclose(together.P[:, j], alone.P, rtol=1e-9)
        np.testing.assert_allclose(together.filtered.x_pred[:, j], alone.filtered.x_pred, atol=1e-12)
        np.testing.assert_allclose(together.filtered.nis[:, j], alone.filtered.nis, atol=1e-8)
        together_likelihood = together.filtered.log_likelihood[j]
        assert together_likelihood == pytest.approx(alone.filtered.log_likelihood, rel=1e-10)


@pytest.mark.parametrize("ours", OURS)
def test_a_channel_without_white_noise_smooths_to_the_dense_answer(ours):
    """Colored noise alone leaves R = 0: nothing of the noise is inverted."""
    model, rng = hard_case(seed=2, time=11)[0], np.random.default_rng(0)
    z = rng.standard_normal((11, 3))
    none = dataclasses.replace(model, R=0 * model.R)
    tiny = dataclasses.replace(model, R=1e-12 * np.eye(3) + 0 * model.R)
    x, P = least_squares(tiny, z)
    smoothed = kalman.smooth(none, z, engine=ours)
    np.testing.assert_allclose(smoothed.x, x, atol=1e-6 * np.abs(x).max())
    np.testing.assert_allclose(smoothed.P, P, atol=1e-6 * np.abs(P).max())
    np.testing.assert_allclose(np.einsum("tij,tj->ti", model.H, smoothed.x), z, atol=1e-9)


@pytest.mark.skipif(not BUILT, reason="no compiler at install")
@pytest.mark.parametrize("limit", [2.0, np.inf])
def test_an_outlier_is_believed_less_by_either_engine_alike(limit):
    model, rng = particle(), np.random.default_rng(8)
    z = draw(model, 600, rng)[1]
    z[[0, 9, 300, 301, 450]] += 5e-3
    z[200:230] = np.nan
    a, b = (kalman.engine(name).log_likelihood(model, z, limit) for name in OURS)
    assert float(a) == pytest.approx(float(b), rel=1e-10)
    assert float(a) < float(kalman.log_likelihood(model, draw(model, 600, rng)[1]))


@settings(deadline=None, derandomize=True, max_examples=20)
@given(
    gaps=st.lists(st.tuples(st.integers(0, 13), st.integers(0, 2)), max_size=42),
    which=st.sets(st.sampled_from(["F", "Q", "H", "R", "u"])),
)
def test_engines_agree_on_any_gaps_with_any_matrices_constant(gaps, which):
    model, z = hard_case()
    model = dataclasses.replace(model, **{name: getattr(model, name)[2] for name in which})
    for k, channel in gaps:
        z[k, channel] = np.nan
    reference = kalman.smooth(model, z, engine="filterpy")
    for name in OURS:
        assert_same(kalman.smooth(model, z, engine=name), reference)


def test_a_signal_without_channel_axis_is_one_channel(engine):
    model = particle()
    z = draw(model, 30, np.random.default_rng(0))[1]
    a, b = (kalman.smooth(model, data, engine=engine) for data in (z, z[:, 0]))
    assert np.array_equal(a.x, b.x)


def test_the_last_filtered_state_is_the_last_smoothed_one(engine):
    model, z = hard_case()
    smoothed = kalman.smooth(model, z, engine=engine)
    assert np.array_equal(smoothed.x[-1], smoothed.filtered.x[-1])


def test_a_record_without_data_returns_the_prior(engine):
    model = particle()
    smoothed = kalman.smooth(model, np.full((5, 1), np.nan), engine=engine)
    P = model.P0
    for k in range(5):
        np.testing.assert_allclose(smoothed.P[k], P, rtol=1e-9, atol=1e-12 * np.abs(P).max())
        P = model.F @ P @ model.F.T + model.Q
    assert smoothed.filtered.log_likelihood == 0
    assert np.isnan(smoothed.filtered.nis).all()


def test_many_models_at_once_are_each_model_by_itself(engine):
    rng = np.random.default_rng(5)
    time, std, rate = 60, np.array([0.5, 1.0, 3.0, 4.0]), np.array([3.0, 30.0, 100.0, 8.0])
    chain = load_chain(kalman.matern(2, std, rate), Start(1e-2, 1e-2, 1.0))
    step = rng.uniform(0.002, 0.006, time - 1)
    F, Q = kalman.discretize(dataclasses.replace(chain, A=chain.A[None], Qc=chain.Qc[None]), step[:, None])
    H = np.broadcast_to(10 * chain.output, (1, 4, 1, 5))
    R = rng.uniform(1e-8, 1e-7, (time, 4, 1, 1))
    u = 1e-4 * rng.standard_normal((time - 1, 4, 5))
    many = kalman.StateSpace(F, Q, H, R, np.zeros((4, 5)), chain.P0, u)
    z = 1e-2 * rng.standard_normal((time, 4, 1))
    z[20:24] = np.nan
    each = [
        kalman.log_likelihood(
            kalman.StateSpace(F[:, i], Q[:, i], H[0, i], R[:, i], np.zeros(5), chain.P0[i], u[:, i]), z[:, i]
        )
        for i in range(4)
    ]
    np.testing.assert_allclose(kalman.log_likelihood(many, z, engine=engine), each, rtol=1e-8)


@pytest.mark.parametrize("engine", OURS)
@pytest.mark.parametrize("limit", [3.0, np.inf])
@pytest.mark.parametrize("models", [1, 4, 11])
def test_any_number_of_models_at_once_meets_outliers_as_each_by_itself(models, limit, engine):
    rng, time = np.random.default_rng(models), 300
    std, rate = rng.uniform(0.5, 4.0, models), rng.uniform(3.0, 100.0, models)
    chain = load_chain(kalman.matern(3, std, rate), Start(1e-2, 1e-2, 1.0))
    F, Q = kalman.discretize(chain, 0.004)
    H = 10 * chain.output[None, None, None]
    R = np.full((1, models, 1, 1), 1e-7)
    many = kalman.StateSpace(F[None], Q[None], H, R, np.zeros((models, 6)), chain.P0)
    z = 1e-2 * rng.standard_normal((time, 1)).cumsum(0)
    z[100:120] = np.nan
    z[[40, 200]] += 1.0
    engine = kalman.engine(engine)
    together = engine.log_likelihood(many, np.repeat(z[:, None], models, 1), limit)
    each = [kalman.engine("numpy").log_likelihood(many.one(j), z, limit) for j in range(models)]
    np.testing.assert_allclose(together, each, rtol=1e-9)


@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("steady", [True, False])
def test_whitened_innovations_of_many_models_are_those_of_each_filter(engine, steady, alike):
    """With gaps that all models share, and with gaps of their own."""
    rng, time, models = np.random.default_rng(3), 1200, 3
    chain = load_chain(kalman.matern(2, rng.uniform(0.5, 4.0, models), 30.0), Start(1e-2, 1e-2, 1.0))
    F, Q = kalman.discretize(chain, 0.004)
    H, R = 10 * chain.output[None, None, None], 1e-7 * rng.uniform(0.5, 2.0, (time, models, 1, 1))
    R = R[:1] if steady else R
    many = kalman.StateSpace(F[None], Q[None], H, R, np.zeros((models, 5)), chain.P0)
    z = 1e-2 * rng.standard_normal((time, models)).cumsum(0)
    z[100:120, slice(None) if alike else 1] = np.nan
    each = [kalman.engine(engine).filter(many.one(j), z[:, j]).innovation[:, 0] for j in range(models)]
    together = kalman.engine(engine).innovations(many, z)
    size = np.nanmax(np.abs(together))
    np.testing.assert_allclose(together, np.stack(each, 1), rtol=1e-9, atol=1e-9 * size)


@pytest.mark.parametrize("engine", OURS)
def test_many_models_of_many_channels_are_each_model_by_itself(engine):
    rng, models = np.random.default_rng(7), 3
    F = 0.9 * np.linalg.qr(rng.standard_normal((models, 4, 4)))[0]
    Q, R = (np.stack([random_cov(rng, n) for _ in range(models)]) for n in (4, 2))
    H, P0 = rng.standard_normal((models, 2, 4)), np.stack([np.eye(4)] * models)
    many = kalman.StateSpace(F[None], Q[None], H[None], R[None], np.zeros((models, 4)), P0)
    z = rng.standard_normal((50, models, 2))
    z[20:24, :, 0] = z[40:42] = np.nan
    each = [kalman.filter(many.one(j), z[:, j], engine="filterpy").log_likelihood for j in range(models)]
    np.testing.assert_allclose(kalman.engine(engine).log_likelihood(many, z), each, rtol=1e-10)


@pytest.mark.parametrize("engine", OURS)
@pytest.mark.parametrize("order", [2, 3, 4])
def test_variances_stay_positive_after_a_start_as_good_as_unknown(order, engine):
    """A micrometer of noise, and a start known to ten meters: thirteen decades of variance."""
    prior = kalman.superpose(kalman.random_walk(0.0, 1e4), kalman.matern(order, std=1.0, rate=10.0))
    chain = kalman.integrate(kalman.integrate(prior, var=1e2), var=1e2)
    F, Q = kalman.discretize(chain, 1e-3)
    model = kalman.StateSpace(F, Q, 10 * chain.output[None], np.array([[1e-12]]), np.zeros(len(F)), chain.P0)
    ours, reference = (kalman.smooth(model, np.zeros(150), engine=name).P for name in (engine, "filterpy"))
    size = np.sqrt(np.diagonal(ours, axis1=1, axis2=2))
    assert np.linalg.eigvalsh(ours / size[:, :, None] / size[:, None]).min() > 0
    late = slice(20, None)  # where the reference has its digits back
    np.testing.assert_allclose(ours[late, 3, 3], reference[late, 3, 3], rtol=1e-3)


def nanometers(order, step):
    """A load of that order seen as position to 1e-9 m."""
    prior = kalman.matern(order, std=1.0, rate=30.0)
    chain = kalman.integrate(kalman.integrate(prior, var=1.0), var=1.0)
    chain = chain if np.ndim(step) == 0 else dataclasses.replace(chain, A=chain.A[None], Qc=chain.Qc[None])
    F, Q = kalman.discretize(chain, step)
    n = len(chain.output)
    return kalman.StateSpace(F, Q, chain.output[None], np.array([[1e-18]]), np.zeros(n), chain.P0)


def assert_positive(*covariances):
    for P in covariances:
        size = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        assert np.isfinite(size).all()
        scaled = P / size[:, :, None] / size[:, None, :]
        np.testing.assert_allclose(scaled, scaled.transpose(0, 2, 1), atol=1e-9)
        assert np.linalg.eigvalsh(scaled).min() > 0


@pytest.mark.parametrize("engine", OURS)
@pytest.mark.parametrize("order", [2, 3])
def test_a_million_samples_at_ten_kilohertz_stay_symmetric_positive_and_in_place(order, engine):
    model, rng = nanometers(order, 1e-4), np.random.default_rng(order)
    z = 1e-9 * rng.standard_normal((1_000_000, 1))  # nothing moves
    z[400_000:400_300] = np.nan
    smoothed = kalman.smooth(model, z, engine=engine)
    gains = smoothed.filtered.gains
    assert_positive(smoothed.runs, gains.P, gains.P_pred)
    assert np.isfinite(smoothed.x).all()
    assert np.abs(smoothed.x[-1000:, 0]).max() < 6e-9  # and nothing drifted away


@pytest.mark.parametrize("engine", OURS)
def test_a_long_irregular_record_stays_symmetric_and_positive(engine):
    rng, count = np.random.default_rng(0), 100_000 if engine == "compiled" else 10_000
    model = nanometers(3, 1e-4 * rng.uniform(0.5, 1.5, count - 1))
    z = 1e-9 * rng.standard_normal((count, 1))
    z[count // 4 : count // 3] = np.nan
    smoothed = kalman.smooth(model, z, engine=engine)
    for P in (smoothed.P, smoothed.filtered.P):
        assert_positive(P)


def known_offset():
    """A random walk plus a constant 2 that is known exactly."""
    F, Q, P0 = np.eye(2), np.diag([0.1, 0.0]), np.diag([1.0, 0.0])
    return kalman.StateSpace(F, Q, np.ones((1, 2)), np.eye(1), np.array([0.0, 2.0]), P0)


def test_a_state_known_exactly_is_as_good_as_left_out():
    walk = kalman.StateSpace(*(np.array([[a]]) for a in (1.0, 0.1, 1.0, 1.0)), np.zeros(1), np.eye(1))
    z = np.random.default_rng(3).standard_normal(30)
    both, alone = kalman.smooth(known_offset(), z + 2), kalman.smooth(walk, z)
    np.testing.assert_allclose(both.x, np.hstack([alone.x, np.full((30, 1), 2.0)]), atol=1e-12)
    np.testing.assert_allclose(both.P[:, 0, 0], alone.P[:, 0, 0], rtol=1e-12)
    assert np.abs(both.P[:, 1]).max() == 0


def test_the_reference_engine_says_that_it_cannot_smooth_a_state_known_exactly():
    with pytest.raises(EstimationError, match=r'knows a state exactly at sample 4.* choose engine = "numpy"'):
        kalman.smooth(known_offset(), np.zeros(5), engine="filterpy")


def test_smoothing_never_widens_what_the_filter_knew(engine):
    model, z = hard_case()
    smoothed = kalman.smooth(model, z, engine=engine)
    shrunk = np.linalg.eigvalsh(smoothed.filtered.P - smoothed.P)
    assert shrunk.min() > -1e-10 * np.abs(smoothed.P).max()


def test_mean_nis_lies_in_its_chi_square_band_on_data_of_the_model():
    model, rng = particle(), np.random.default_rng(1)
    nis = np.concatenate([kalman.filter(model, draw(model, 400, rng)[1]).nis for _ in range(8)])
    low, high = chi2(len(nis)).interval(0.99)
    assert low < nis.sum() < high


def test_monte_carlo_error_is_the_bound_the_smoother_states():
    """Tolerance of principal equations 6: rmse over bound 0.97 to 1.03, over records drawn from the prior."""
    model, rng = particle(), np.random.default_rng(2)
    ratio = []
    for _ in range(40):
        x, z = draw(model, 500, rng)
        smoothed = kalman.smooth(model, z)
        ratio.append((smoothed.x[:, 2] - x[:, 2]) ** 2 / smoothed.P[:, 2, 2])
    assert 0.97 < np.sqrt(np.mean(ratio)) < 1.03


def test_a_singular_innovation_is_an_error_that_names_the_sample(engine):
    one, none = np.eye(2), np.zeros((2, 2))
    model = kalman.StateSpace(one, none, one, none, np.zeros(2), one)
    with pytest.raises(EstimationError, match="not positive definite at sample 1; state a measurement noise"):
        kalman.filter(model, np.zeros((3, 2)), engine=engine)


def test_engine_is_chosen_by_name_and_a_wrong_name_gets_the_nearest():
    assert kalman.engine("auto").name == ("compiled" if BUILT else "numpy")
    model, z = hard_case()
    reference = kalman.engine("filterpy").smooth(model, z)
    assert np.array_equal(reference.x, kalman.smooth(model, z, engine="filterpy").x)
    with pytest.raises(ConfigError, match=r"unknown engine 'nunpy'; did you mean 'numpy'\?"):
        kalman.smooth(model, z, engine="nunpy")


def test_where_no_engine_was_compiled_numpy_takes_its_place(monkeypatch):
    gone = {**engines.MODULES, "compiled": "forceid.kalman._not_built"}
    monkeypatch.setattr(engines, "MODULES", gone)
    assert kalman.engine("auto").name == "numpy"
    with pytest.raises(ConfigError, match="install again with a C\\+\\+ compiler"):
        kalman.engine("compiled")


def test_an_engine_built_for_another_processor_is_passed_over(monkeypatch, tmp_path):
    (tmp_path / "built_elsewhere.py").write_text("raise ImportError('built for a processor with AVX-512')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(engines, "MODULES", {**engines.MODULES, "compiled": "built_elsewhere"})
    assert kalman.engine("auto").name == "numpy"
    with pytest.raises(ConfigError, match="AVX-512"):
        kalman.engine("compiled")
