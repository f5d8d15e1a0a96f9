"""Claims of how modes move, of vibrations drawn from known priors and mixed along axes that nobody chose."""

import numpy as np

from forceid.estimation.loads.hidden.deforming_body import motion_growth
from forceid.flight.vibration import Vibration, tune_vibrations, vibrating
from forceid.kalman.building.process import discretize
from forceid.kalman.engines import engine

STEP, SIGMA, SAMPLES = 2e-3, 3e-4, 600
INNER = slice(SAMPLES // 8, -(SAMPLES // 8))
TIME, VAR = STEP * np.arange(SAMPLES), np.full((SAMPLES, 2), SIGMA**2)
APART = Vibration(
    2 * np.pi * np.array([23.0, 4.0]), np.array([0.2, 0.4]), np.array([1e-3, 8e-3]), np.full(2, 15.0), 2
)


def drawn(seed, prior=APART):
    """Amplitudes and accelerations (time, mode) of two modes that swing by themselves."""
    rng, process, n = np.random.default_rng(seed), prior.process, prior.states
    F, Q = discretize(process, STEP)
    x = np.zeros((SAMPLES, 2, n))
    for k in range(2):
        size = np.sqrt(np.diagonal(process.P0[k]))
        root = size[:, None] * np.linalg.cholesky(Q[k] / np.outer(size, size) + 1e-13 * np.eye(n))
        x[0, k] = np.linalg.cholesky(process.P0[k]) @ rng.standard_normal(n)
        for i in range(1, SAMPLES):
            x[i, k] = F[k] @ x[i - 1, k] + root @ rng.standard_normal(n)
    return x[:, :, 0], np.einsum("kb,tkb->tk", prior.motion[:, 2], x[:, :, :3])


def claimed(q, prior):
    """Accelerations (time, mode) as smoothed, their claimed variance (time, mode), and its growth (mode,)."""
    models, cov = vibrating(prior, VAR, np.diff(TIME)), np.zeros((SAMPLES, 2, 3, 2, 3))
    acceleration = np.zeros_like(q)
    for k in range(2):
        path = engine().smooth(models.one(k), q[:, k])
        cov[:, k, :, k] = prior.motion[k] @ path.P[:, :3, :3] @ prior.motion[k].T
        acceleration[:, k] = path.x[:, :3] @ prior.motion[k, 2]
    cov = cov.reshape(SAMPLES, 6, 6)
    growth = motion_growth(TIME, q, VAR, prior, cov, engine())
    return acceleration, np.diagonal(cov, axis1=1, axis2=2)[:, 2::3], growth


def scores(share, seed):
    """Error over claim of both accelerations without and with growth, where each mode has a share of the
    other.
    """
    mixed = np.array([[1.0, -share], [share, 1.0]]) / np.hypot(1.0, share)
    q, acceleration = (a @ mixed.T for a in drawn(seed))
    q = q + SIGMA * np.random.default_rng([seed, 1]).standard_normal(q.shape)
    found, var, growth = claimed(q, tune_vibrations(TIME, q, VAR, orders=(1, 2, 3)))
    plain = np.sqrt(((found - acceleration)[INNER] ** 2).mean(0) / var[INNER].mean(0))
    return plain, plain / growth[:, 2]


def test_what_a_mode_has_of_its_neighbor_beneath_the_noise_is_within_its_claim():
    each = np.array([scores(0.06, seed) for seed in range(4)])
    plain, grown = each[:, 0, 1], each[:, 1, 1]  # of the slow mode, which has a fast line in it
    assert np.sqrt((plain**2).mean()) > 1.6
    assert np.sqrt((grown**2).mean()) < 1.2
    assert grown.max() < 1.5


def test_a_strong_line_that_a_record_denies_its_neighbor_adds_little_to_a_claim():
    alone = np.array([scores(0.0, seed) for seed in range(4)])
    assert 0.6 < np.sqrt((alone[:, 1] ** 2).mean()) < 1.2
    prior = APART
    q, _ = drawn(7)
    q = q + SIGMA * np.random.default_rng(8).standard_normal(q.shape)
    loud = np.array([100.0, 1.0])  # where so little as a thousandth would show
    _, _, quiet_growth = claimed(q, prior)
    _, _, loud_growth = claimed(
        q * loud, Vibration(prior.frequency, prior.damping, prior.std * loud, prior.rate, 2)
    )
    assert loud_growth[1, 2] < 1.5 * quiet_growth[1, 2]


def test_growth_leaves_claims_at_least_as_they_are_and_gaps_tell_nothing():
    q, _ = drawn(3)
    q = q + SIGMA * np.random.default_rng(4).standard_normal(q.shape)
    q[200:220] = np.nan
    _, _, growth = claimed(q, APART)
    assert np.isfinite(growth).all()
    assert (growth >= 1.0).all()
