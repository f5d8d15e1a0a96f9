import numpy as np
import pytest
from beam import beam
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_models import random_cov
from scipy.stats import chi2
from white_input import with_white_input

from forceid import kalman
from forceid.errors import ConfigError, EstimationError
from forceid.kalman.bounds import steady
from forceid.kalman.inputs.input_smoothing import input_smoother
from forceid.kalman.inputs.unknown_input import input_filter


def random_system(seed, direct, n=4, m=3, inputs=2):
    """Stable A, and noises of step and sample that go together."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    B, C = rng.standard_normal((n, inputs)), rng.standard_normal((m, n))
    D = rng.standard_normal((m, inputs)) if direct else np.zeros((m, inputs))
    noise = random_cov(rng, n + m, 0.01)
    return A, B, C, D, noise[:n, :n], noise[n:, n:], noise[:n, n:]


def response(system, rng, u, noise=1.0, x0=None):
    """States and measurements for an input u (time, input), the first state as given."""
    A, B, C, D, Q, R, S = system
    L = noise * np.linalg.cholesky(np.block([[Q, S], [S.T, R]]))
    x, states, z = np.zeros(len(A)) if x0 is None else x0, [], []
    for u_k in u:
        e = L @ rng.standard_normal(len(L))
        states.append(x)
        z.append(C @ x + D @ u_k + e[len(A) :])
        x = A @ x + B @ u_k + e[: len(A)]
    return np.array(states), np.array(z)


def batch(system, z, x0, P0):
    """The last state and all inputs from all samples at once, no prior on an input: mean, covariance, NaN."""
    A, B, C, D, Q, R, S = system
    (n, inputs), time = B.shape, len(z)
    rows, values = [], []

    def state(k):
        return np.eye(n, time * (n + inputs), k * n)

    def force(k):
        return np.eye(inputs, time * (n + inputs), time * n + k * inputs)

    if P0 is not None:
        white = np.linalg.inv(np.linalg.cholesky(P0))
        rows.append(white @ state(0))
        values.append(white @ x0)
    for k in range(time):
        seen = np.isfinite(z[k])
        step = n if k < time - 1 else 0
        noise = np.block([[Q, S[:, seen]], [S[:, seen].T, R[np.ix_(seen, seen)]]])[n - step :, n - step :]
        G = (C @ state(k) + D @ force(k))[seen]
        if step:
            G = np.vstack([A @ state(k) + B @ force(k) - state(k + 1), G])
        white = np.linalg.inv(np.linalg.cholesky(noise))
        rows.append(white @ G)
        values.append(white @ np.concatenate([np.zeros(step), z[k, seen]]))
    G, b = np.vstack(rows), np.concatenate(values)
    U, s, Vt = np.linalg.svd(G)
    rank = np.count_nonzero(s > 1e-9 * s[0])
    inverse = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T
    mean, cov = inverse @ b, inverse @ inverse.T
    lost = (np.abs(Vt[rank:]) > 1e-7).any(0)
    mean[lost], cov[lost], cov[:, lost] = np.nan, np.nan, np.nan
    last, u = slice((time - 1) * n, time * n), slice(time * n, None)
    return mean[last], cov[last, last], mean[u].reshape(time, inputs), cov[u, u]


@pytest.mark.parametrize("start", ["known", "unknown"])
@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_unknown_input_filter_is_batch_least_squares_without_a_prior_on_the_input(seed, direct, gaps, start):
    system, rng = random_system(seed, direct), np.random.default_rng(seed)
    _, z = response(system, rng, 10 * rng.standard_normal((12, 2)))
    if gaps:
        z[5] = z[4, 1] = z[8, :2] = z[9, 0] = np.nan
    x0, P0 = (rng.standard_normal(4), random_cov(rng, 4)) if start == "known" else (None, None)
    found = input_filter(*system, z, x0, P0)
    assert found.delay == (0 if direct else 1)
    for k in range(len(z)):
        x, P, u, u_cov = batch(system, z[: k + 1], x0, P0)
        np.testing.assert_allclose(found.x[k], x, rtol=0, atol=1e-8 * (1 + np.nanmax(np.abs(found.x))))
        np.testing.assert_allclose(found.P[k], P, rtol=0, atol=1e-8 * (1 + np.nanmax(found.P)))
        at = k - found.delay
        if at >= 0:
            scale = 1 + np.nanmax(np.abs(found.u)) + np.nanmax(found.u_cov)
            np.testing.assert_allclose(found.u[at], u[at], rtol=0, atol=1e-8 * scale)
            of_it = slice(2 * at, 2 * at + 2)
            np.testing.assert_allclose(found.u_cov[at], u_cov[of_it, of_it], rtol=0, atol=1e-8 * scale)
    if not direct:
        assert np.isnan(found.u[-1]).all()


@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_unknown_input_filter_is_the_limit_of_a_kalman_filter_with_a_wide_white_input(seed, direct):
    system, rng = random_system(seed, direct), np.random.default_rng(seed)
    _, z = response(system, rng, rng.standard_normal((30, 2)))
    ours, apart = input_filter(*system, z, P0=np.eye(4)), []
    for var in (1e3, 1e5):  # beyond 1e6 the plain filter loses digits of its own
        wide = kalman.filter(with_white_input(system, z, var, np.eye(4)), z)
        x, P, u, u_cov = wide.x[:, :4], wide.P[:, :4, :4], wide.x[:, 4:], wide.P[:, 4:, 4:]
        pairs = [(x, ours.x), (P, ours.P)]
        if direct:
            pairs += [(u, ours.u), (u_cov, ours.u_cov)]
        apart.append([np.abs(a - b).max() / np.abs(b).max() for a, b in pairs])
    assert np.max(apart[1]) < 1e-3
    np.testing.assert_allclose(np.divide(*apart), 100, rtol=0.1)  # goes to zero with 1 / var


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10**6), direct=st.booleans(), size=st.sampled_from([1e-3, 1.0, 1e6]))
def test_whatever_the_input_and_the_start_the_filter_is_unbiased(seed, direct, size):
    """A linear estimate is unbiased if it returns state and input exactly from measurements without noise."""
    system, rng = random_system(seed, direct, m=4, inputs=1), np.random.default_rng(seed)
    u = size * np.cumsum(rng.standard_normal((30, 1)) * (rng.random((30, 1)) < 0.3), axis=0)
    x, z = response(system, rng, u, noise=0.0, x0=size * rng.standard_normal(4))
    found = input_filter(*system, z)
    scale = np.abs(x).max() + np.abs(u).max()
    end = len(u) - found.delay
    # some of these systems magnify rounding as they do noise
    worth = 1 + np.sqrt(np.nanmax(np.trace(found.P, axis1=1, axis2=2)))
    np.testing.assert_allclose(found.x[5:], x[5:], rtol=0, atol=1e-9 * worth * scale)
    np.testing.assert_allclose(found.u[5:end], u[5:end], rtol=0, atol=1e-8 * worth * scale)


@pytest.mark.parametrize("direct", [True, False])
def test_claimed_covariance_is_the_spread_of_the_errors_and_innovations_are_white(direct):
    system, rng = random_system(1, direct, m=4), np.random.default_rng(8)
    u = 50 * np.sin(np.arange(1500)[:, None] * [0.1, 0.37])
    x, z = response(system, rng, u)
    found = input_filter(*system, z)
    inside = slice(20, 1498)
    for error, cov in ((found.x - x, found.P), (found.u - u, found.u_cov)):
        e, P = error[inside], cov[inside]
        nees = np.einsum("ti,ti->t", e, np.linalg.solve(P, e[..., None])[..., 0])
        # neighbors share noise: every tenth counts as independent
        some = nees[::10]
        low, high = chi2.ppf([0.0005, 0.9995], e.shape[1] * len(some)) / len(some)
        assert low < some.mean() < high
    white = found.innovation[inside]
    assert np.isnan(white[:, 2:]).all()
    white = white[:, :2]
    low, high = chi2.ppf([0.0005, 0.9995], white.size) / white.size
    assert low < np.mean(white**2) < high
    assert np.abs(np.mean(white[1:] * white[:-1], axis=0)).max() < 3.5 / np.sqrt(len(white))


@pytest.mark.parametrize("start", ["known", "unknown"])
@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_smoother_is_batch_least_squares_without_a_prior_on_the_input(seed, direct, gaps, start):
    system, rng = random_system(seed, direct), np.random.default_rng(seed)
    _, z = response(system, rng, 10 * rng.standard_normal((12, 2)))
    if gaps:
        z[5] = z[4, 1] = z[8, :2] = z[9, 0] = np.nan
    P0 = random_cov(rng, 4) if start == "known" else None
    smoothed = input_smoother(*system, z, P0=P0)
    x, P, u, u_cov = batch(system, z, np.zeros(4), P0)
    np.testing.assert_allclose(smoothed.x[-1], x, rtol=0, atol=1e-8 * (1 + np.nanmax(np.abs(smoothed.x))))
    np.testing.assert_allclose(smoothed.P[-1], P, rtol=0, atol=1e-8 * (1 + np.nanmax(smoothed.P)))
    scale = 1 + np.nanmax(np.abs(u)) + np.nanmax(u_cov)
    np.testing.assert_allclose(smoothed.u, u, rtol=0, atol=1e-8 * scale)
    blocks = [u_cov[i : i + 2, i : i + 2] for i in range(0, 24, 2)]
    np.testing.assert_allclose(smoothed.u_cov, blocks, rtol=0, atol=1e-8 * scale)


@pytest.mark.parametrize("direct", [True, False])
def test_smoother_with_a_white_input_is_the_plain_smoother_of_the_longer_state(direct):
    system, rng = random_system(6, direct), np.random.default_rng(6)
    _, z = response(system, rng, rng.standard_normal((12, 2)))
    z[4, 1] = z[7] = np.nan
    P0 = random_cov(rng, 4)
    ours = input_smoother(*system, z, P0=P0, var=[2.0, 0.5])
    plain = kalman.smooth(with_white_input(system, z, [2.0, 0.5], P0), z)
    np.testing.assert_allclose(np.hstack([ours.x, ours.u]), plain.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.P, plain.P[:, :4, :4], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.u_cov, plain.P[:, 4:, 4:], rtol=0, atol=1e-9)


def test_a_wide_prior_costs_the_smoother_no_digits():
    system, rng = random_system(6, direct=False), np.random.default_rng(6)
    _, z = response(system, rng, rng.standard_normal((12, 2)))
    none, wide = (input_smoother(*system, z, P0=np.eye(4), var=var) for var in (None, 1e12))
    assert np.isnan(none.u[-1]).all()  # the last input has left no trace
    np.testing.assert_allclose(wide.u_cov[-1], 1e12 * np.eye(2), atol=1e-3)
    np.testing.assert_allclose(wide.u[:-1], none.u[:-1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(wide.u_cov[:-1], none.u_cov[:-1], rtol=0, atol=1e-8)


def printed(number, like):
    digits = len(like.replace(".", "").lstrip("0"))
    return f"{number:.{digits}g}"


@pytest.mark.long
@pytest.mark.parametrize(
    ("ambient", "causal", "smooth"), [(0, "0.580838", "0.068295"), (1, "16.5372", "2.10433")]
)
def test_force_on_the_supported_beam_has_the_published_deviation(ambient, causal, smooth):
    """In N; filter without prior, smoother with a white force of variance 1e8."""
    system = beam(ambient)
    z = np.zeros((2000, 4))
    found = input_filter(*system, z, P0=1e-6 * np.eye(16))
    std = np.sqrt(found.u_cov[:, 0, 0])
    assert std[-1] == pytest.approx(std[-500], rel=1e-7)
    assert printed(std[-1], causal) == causal
    bound = steady(with_white_input(system, z, var=1e8, P0=np.eye(16))).smoothed[16, 16]
    smoothed = input_smoother(*system, z, P0=1e-6 * np.eye(16), var=1e8).u_cov[1000, 0, 0]
    assert printed(np.sqrt(bound), smooth) == smooth
    assert printed(np.sqrt(smoothed), smooth) == smooth


def test_beam_filter_needs_no_guess_of_the_start():
    system = beam(1)
    z = np.zeros((1500, 4))
    found = input_filter(*system, z)
    assert np.isnan(found.x[0]).any()
    assert printed(np.sqrt(found.u_cov[-1, 0, 0]), "16.5372") == "16.5372"


@pytest.mark.parametrize("direct", [True, False])
def test_units_of_the_state_do_not_matter(direct):
    A, B, C, D, Q, R, S = system = random_system(5, direct)
    _, z = response(system, np.random.default_rng(5), np.ones((15, 2)))
    unit = np.array([1e-9, 1e6, 1.0, 1e-3])
    other = (
        unit[:, None] * A / unit, unit[:, None] * B, C / unit, D,
        np.outer(unit, unit) * Q, R, unit[:, None] * S,
    )  # fmt: skip
    for P0, other_P0 in ((None, None), (np.eye(4), np.diag(unit**2))):
        for estimate in (input_filter, input_smoother):
            a, b = estimate(*system, z, P0=P0), estimate(*other, z, P0=other_P0)
            np.testing.assert_allclose(b.u, a.u, rtol=1e-7)
            np.testing.assert_allclose(b.u_cov, a.u_cov, rtol=0, atol=1e-7 * np.nanmax(a.u_cov))
            np.testing.assert_allclose(b.x / unit, a.x, rtol=1e-7)


def test_input_in_a_gap_is_nan_and_known_again_after_it():
    system, rng = random_system(2, direct=True), np.random.default_rng(0)
    u = 5 * rng.standard_normal((20, 2))
    _, z = response(system, rng, u)
    z[10] = np.nan
    found = input_filter(*system, z)
    assert np.isnan(found.u[10]).all()
    assert np.isnan(found.u_cov[10]).all()
    assert np.isfinite(found.u[13:]).all()


def test_dependent_inputs_are_refused_by_name():
    A, B, C, D, *noise = random_system(3, direct=True)
    D[:, 1] = -2 * D[:, 0]
    with pytest.raises(
        EstimationError, match=r"feedthrough D has rank 1, expected 2.* input 0 \+ 0.5 input 1"
    ) as e:
        input_filter(A, B, C, D, *noise, np.zeros((5, 3)))
    assert "input_smoother" in e.value.next_step


def test_an_input_without_feedthrough_beside_one_with_it_is_refused_by_name():
    A, B, C, D, *noise = random_system(3, direct=True)
    D[:, 1] = 0.0
    with pytest.raises(EstimationError, match=r"rank 1, expected 2.*no trace of input 1;"):
        input_filter(A, B, C, D, *noise, np.zeros((5, 3)))


def test_inputs_that_reach_no_channel_within_a_sample_are_refused():
    A, B, C, D, *noise = random_system(3, direct=False)
    C -= C @ B @ np.linalg.pinv(B)
    with pytest.raises(EstimationError, match=r"C B, .* has rank 0, expected 2.* input 0; input 1"):
        input_filter(A, B, C, D, *noise, np.zeros((5, 3)))


def test_more_inputs_than_channels_are_refused():
    system = random_system(3, direct=True, m=1)
    with pytest.raises(EstimationError, match="rank 1, expected 2"):
        input_filter(*system, np.zeros((5, 1)))


def test_shapes_that_do_not_fit_and_noise_that_is_none_are_said():
    A, B, C, D, Q, R, S = random_system(3, direct=True)
    with pytest.raises(ConfigError, match=r"S of the model has shape \(3, 4\), expected \(4, 3\)"):
        input_filter(A, B, C, D, Q, R, S.T, np.zeros((5, 3)))
    with pytest.raises(EstimationError, match="R of the model is not positive definite"):
        input_filter(A, B, C, D, Q, 0 * R, S, np.zeros((5, 3)))
