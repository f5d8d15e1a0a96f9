"""Models to judge the engines by, and two judges that share nothing with them but the model."""

import numpy as np

from forceid.kalman import StateSpace


def random_cov(rng, n, size=1.0):
    a = rng.standard_normal((n, 2 * n))
    return size * a @ a.T / (2 * n)


def hard_case(seed=3, time=14, n=4, m=3):
    """Every matrix changes with time, on an irregular clock, with a known input, a gap and partial gaps."""
    rng = np.random.default_rng(seed)
    step = rng.uniform(0.02, 0.3, time - 1)
    A = rng.standard_normal((time - 1, n, n))
    F = np.eye(n) + step[:, None, None] * A
    Q = np.stack([h * random_cov(rng, n) for h in step])
    H = rng.standard_normal((time, m, n))
    R = np.stack([random_cov(rng, m, 0.1) for _ in range(time)])
    u = rng.standard_normal((time - 1, n))
    model = StateSpace(F, Q, H, R, rng.standard_normal(n), random_cov(rng, n), u)
    z = draw(model, time, rng)[1]
    z[3:6] = np.nan
    z[7, 0] = z[9, 1:] = z[0, 2] = np.nan
    return model, z


def draw(model, time, rng):
    """A path x (time, state) of the model, and its measurements z (time, channel)."""

    def noise(name, count):
        cov = getattr(model, name)
        size, axes = np.linalg.eigh(cov)
        root = axes * np.sqrt(np.maximum(size, 0))[..., None, :]
        return (root @ rng.standard_normal((count, cov.shape[-1], 1)))[..., 0]

    x, w = np.empty((time, len(model.x0))), noise("Q", time - 1)
    x[0] = model.x0 + noise("P0", 1)[0]
    for k in range(time - 1):
        x[k + 1] = model.at("F", k) @ x[k] + w[k] + (0.0 if model.u is None else model.at("u", k))
    return x, (model.H @ x[..., None])[..., 0] + noise("R", time)


def least_squares(model, z):
    """All states at once: prior, steps and measurements as rows of one weighted least squares problem."""
    time, n = len(z), len(model.x0)
    A, b = [], []

    def rows(blocks, value, cov):
        L = np.linalg.cholesky(cov)
        wide = np.zeros((len(value), time, n))
        for k, block in blocks:
            wide[:, k] = block
        A.append(np.linalg.solve(L, wide.reshape(len(value), -1)))
        b.append(np.linalg.solve(L, value))

    rows([(0, np.eye(n))], model.x0, model.P0)
    for k in range(time - 1):
        u = np.zeros(n) if model.u is None else model.at("u", k)
        rows([(k, -model.at("F", k)), (k + 1, np.eye(n))], u, model.at("Q", k))
    for k in range(time):
        seen = np.isfinite(z[k])
        if seen.any():
            rows([(k, model.at("H", k)[seen])], z[k, seen], model.at("R", k)[seen][:, seen])
    q, r = np.linalg.qr(np.vstack(A))
    cov = np.linalg.inv(r) @ np.linalg.inv(r).T
    x = np.linalg.solve(r, q.T @ np.concatenate(b)).reshape(time, n)
    return x, np.stack([cov[i : i + n, i : i + n] for i in range(0, time * n, n)])


def dense_moments(model, time):
    """Mean and covariance of all measurements stacked, for a constant or time-varying model."""
    n = len(model.x0)
    mean, to_state = [model.x0], [np.eye(n, time * n)]
    for k in range(time - 1):
        F, u = model.at("F", k), 0.0 if model.u is None else model.at("u", k)
        mean.append(F @ mean[-1] + u)
        to_state.append(F @ to_state[-1] + np.eye(time * n)[(k + 1) * n : (k + 2) * n])
    sources = np.zeros((time * n, time * n))
    sources[:n, :n] = model.P0
    for k in range(time - 1):
        at = slice((k + 1) * n, (k + 2) * n)
        sources[at, at] = model.at("Q", k)
    to_z = np.vstack([model.at("H", k) @ to_state[k] for k in range(time)])
    cov, m = to_z @ sources @ to_z.T, len(model.at("R", 0))
    for k in range(time):
        cov[k * m : (k + 1) * m, k * m : (k + 1) * m] += model.at("R", k)
    return np.concatenate([model.at("H", k) @ mean[k] for k in range(time)]), cov
