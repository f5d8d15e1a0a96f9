"""State and input of a linear system at once, the input unknown: no prior on it, or a wide white one.

x_{k+1} = A x_k + B u_k + w_k, z_k = C x_k + D u_k + v_k, cov w = Q, cov v = R, E[w v^T] = S.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import ConfigError, EstimationError
from forceid.kalman.linear import StateSpace, as_channels
from forceid.records import Array, Flags

System = tuple[Array, Array, Array, Array, Array, Array, Array]  # A, B, C, D, Q, R, S
# of a state: its mean, a factor of its covariance, and the directions that no sample has shown yet
Known = tuple[Array, Array, Array]
RANK = 1e-9  # smallest singular value, of columns brought to one size; what is below counts as zero
MARK = 1e-7  # share in a direction that no sample has shown from which an entry counts as unknown


@dataclass(frozen=True)
class InputFiltered:
    """State and input as known from the samples so far, without any prior on the input.

    x (time, state), P (time, state, state): after each sample; u (time, input), u_cov (time, input, input):
    the input of each sample, known `delay` samples later; the last `delay` rows are NaN. NaN wherever the
    samples so far leave a state or an input undetermined. innovation (time, channel): whitened, in the
    directions that no input can imitate, of which there are channels less inputs; the rest is NaN.
    """

    x: Array
    P: Array
    u: Array
    u_cov: Array
    innovation: Array
    delay: int


@dataclass(frozen=True)
class InputSmoothed:
    """State x, P and input u (time, input), u_cov (time, input, input) given the whole record."""

    x: Array
    P: Array
    u: Array
    u_cov: Array


def input_filter(
    A: Array,
    B: Array,
    C: Array,
    D: Array,
    Q: Array,
    R: Array,
    S: Array,
    z: Array,
    x0: Array | None = None,
    P0: Array | None = None,
) -> InputFiltered:
    """Minimum-variance unbiased state and input, jointly, whatever the input does.

    A, Q (state, state); B (state, input); C (channel, state); D (channel, input); R (channel, channel); S
    (state, channel); z (time, channel), NaN = missing. x0, P0: the state at the first sample, before it is
    used; without P0 the state there is wholly unknown. The input is found in the same sample where D has as
    many independent columns as there are inputs (`delay` 0), one sample later where D is zero and C B has.

    What is unknown is carried exactly, as directions of infinite variance: the inputs, the start, and
    whatever a gap leaves open, until enough samples come. Where those up to a sample (and `delay` more) do
    not determine its input, it is NaN, also if later ones would. Leave P0 out rather than state a huge one:
    where a start is 1e9 times less certain than a sample, double precision cannot tell it from unknown. An
    invariant zero of (A, B, C, D) outside the unit circle lets the covariance grow without end: see
    `observability.invariant_zeros`.

    Raises EstimationError where D, or C B, has too low a rank, or R is not positive definite; ConfigError for
    shapes that do not fit. Source: Gillijns and De Moor (2007), Automatica 43, 111-116 (without feedthrough)
    and 934-937 (with it).

    >>> A, B, C, D = np.eye(1), np.eye(1), np.ones((2, 1)), np.array([[0.0], [1.0]])
    >>> noise = 1e-6 * np.eye(2)
    >>> found = input_filter(A, B, C, D, 1e-6 * A, noise, np.zeros((1, 2)), np.array([[0.0, 3], [3, 5]]))
    >>> found.delay, np.round(found.u[:, 0], 6)
    (0, array([3., 2.]))
    """
    z = as_channels(z)
    system = checked(A, B, C, D, Q, R, S, z)
    return forward(system, z, x0, P0, determined(*system))[0]


def forward(
    system: System, z: Array, x0: Array | None, P0: Array | None, delay: int
) -> tuple[InputFiltered, list[Known]]:
    """The filter, and what it knows of each state before its sample."""
    (B, C, D), R = system[1:4], system[5]
    time, (n, inputs) = len(z), B.shape
    x = np.zeros(n) if x0 is None else np.asarray(x0, float)
    W, E = (np.zeros((n, 0)), np.eye(n)) if P0 is None else (square_root(P0), np.zeros((n, 0)))
    X, U = np.full((time, n), np.nan), np.full((time, inputs), np.nan)
    X_cov, U_cov = np.full((time, n, n), np.nan), np.full((time, inputs, inputs), np.nan)
    innovation, before = np.full(z.shape, np.nan), []
    for k, seen in enumerate(np.isfinite(z)):
        before.append((x, W, E))
        Ck, Dk, noise = C[seen], D[seen], root(R[np.ix_(seen, seen)])
        # unknowns: how far along each direction E, then the input of this sample or of the last
        known, now = E.shape[1], inputs if delay == 0 or k > 0 else 0
        reach = np.hstack([E, B if delay and now else np.zeros((n, now))])
        direct = np.hstack([np.zeros((len(Ck), known)), 0.0 * Dk[:, :now] if delay else Dk])
        found = learn(x, W, reach, Ck, direct, z[k, seen], noise)  # errors: W e + error e of x, -fit e of u
        fit, free, loose = found.fit[known:], found.free, found.loose
        x, W, error, u = found.x, found.W, found.error, found.amount[known:]
        X[k], X_cov[k] = told(x, squared(W, error), open_rows(reach, loose))
        innovation[k, : len(found.surprise)] = found.surprise
        if now:
            U[k - delay], U_cov[k - delay] = told(u, squared(fit), any_row(loose[known:]))
        Ak, Bk, common, step_noise = uncorrelated(system, seen)
        x, error, E = Ak @ x + common @ z[k, seen], Ak @ error, Ak @ reach @ free
        if delay == 0:
            x, error, E = x + Bk @ u, error - Bk @ fit, E + Bk @ free[known:]
        W = triangle(np.hstack([Ak @ W, error, step_noise]))
        E = independent(E)
    return InputFiltered(X, X_cov, U, U_cov, innovation, delay), before


def input_smoother(
    A: Array,
    B: Array,
    C: Array,
    D: Array,
    Q: Array,
    R: Array,
    S: Array,
    z: Array,
    x0: Array | None = None,
    P0: Array | None = None,
    var: ArrayLike | None = None,
) -> InputSmoothed:
    """State and input given the whole record, for any rank of D and C B.

    Arguments as in `input_filter`. var: variance of the input as white noise, one or (input,); None for no
    prior at all. Then what no sample of the record determines is NaN. A large variance does as well as none,
    and costs no digits: all covariances are factors, and meet only in orthogonal least squares.

    Raises ConfigError for shapes that do not fit, EstimationError where R is not positive definite. Source:
    forward and backward information joined at each sample, Fraser and Potter (1969).

    >>> A, B, C, D = np.eye(1), np.eye(1), np.ones((2, 1)), np.array([[0.0], [1.0]])
    >>> noise, z = 1e-6 * np.eye(2), np.array([[0.0, 3], [3, 5]])
    >>> np.round(input_smoother(A, B, C, D, 1e-6 * A, noise, np.zeros((1, 2)), z).u[:, 0], 6)
    array([3., 2.])
    """
    z = as_channels(z)
    system = checked(A, B, C, D, Q, R, S, z)
    if var is not None:
        system, z = with_prior(system, z, var)
    A, B, C, D, Q, R, S = system
    time, (n, inputs) = len(z), B.shape
    before = forward(system, z, x0, P0, delay=0)[1]
    X, U = np.empty((time, n)), np.empty((time, inputs))
    X_cov, U_cov = np.empty((time, n, n)), np.empty((time, inputs, inputs))
    # all samples from k on say N x = y, with white errors
    N, y = np.zeros((0, n)), np.zeros(0)
    for k in range(time - 1, -1, -1):
        x, W, E = before[k]
        seen = np.isfinite(z[k])
        white = np.linalg.inv(root(R[np.ix_(seen, seen)]))
        Ak, Bk, common, noise = uncorrelated(system, seen)
        # the noise of the step blurs what later samples say of the next state
        blur = triangle(np.hstack([np.eye(len(N)), N @ noise]))
        sharp = np.linalg.inv(blur)
        N, y = sharp @ N, sharp @ y
        # rows: the sample, then all later ones
        of_x, of_u = np.vstack([white @ C[seen], N @ Ak]), np.vstack([white @ D[seen], N @ Bk])
        value = np.concatenate([white @ z[k, seen], y - N @ (common @ z[k, seen])])
        d, one = E.shape[1], np.eye(len(value))
        reach, direct = np.hstack([E, np.zeros((n, inputs))]), np.hstack([np.zeros((len(value), d)), of_u])
        found = learn(x, W, reach, of_x, direct, value, one)
        X[k], X_cov[k] = told(found.x, squared(found.W, found.error), open_rows(reach, found.loose))
        U[k], U_cov[k] = told(found.amount[d:], squared(found.fit[d:]), any_row(found.loose[d:]))
        # what is left of the rows for the state once the input has taken its share
        size = np.linalg.norm(np.vstack([of_u, np.abs(N) @ np.abs(Bk)]), axis=0)
        rest = least_squares(of_u, size)[1]
        upper = triangle(np.hstack([rest @ of_x, (rest @ value)[:, None]]).T).T[:n]
        N, y = upper[:, :n], upper[:, n]
    return InputSmoothed(X, X_cov, U, U_cov)


@dataclass(frozen=True)
class Learned:
    """State x and amounts of unknowns after a sample; see `learn`."""

    x: Array
    W: Array
    error: Array
    amount: Array
    fit: Array
    free: Array
    loose: Array
    surprise: Array


def learn(x: Array, W: Array, reach: Array, C: Array, direct: Array, z: Array, noise: Array) -> Learned:
    """One sample z = C (state) + direct d + noise e of a state x + W e + reach d, no prior on d.

    Afterwards the state is off by W e + error e, the amounts of d by -fit e, with the e of `error` and `fit`
    the same; free, loose: directions of d that stay open; surprise: the white part of the sample that no d
    can imitate. Source: Gillijns and De Moor (2007), in square-root form.
    """
    L, K, W = split(W, C, noise)
    white = np.linalg.inv(L)
    size = np.linalg.norm(np.abs(white) @ (np.abs(C) @ np.abs(reach) + np.abs(direct)), axis=0)
    shown = white @ (C @ reach + direct)
    fit, rest, free, loose = least_squares(shown, size)
    e = white @ (z - C @ x)
    x = x + reach @ (fit @ e) + K @ (rest.T @ (rest @ e))
    return Learned(x, W, (K @ shown - reach) @ fit, fit @ e, fit, free, loose, rest @ e)


def with_prior(system: System, z: Array, var: ArrayLike) -> tuple[System, Array]:
    """The system with one more channel for each input, which measures it as zero, with variance `var`."""
    A, B, C, D, Q, R, S = system
    n, inputs = B.shape
    C, D = np.vstack([C, np.zeros((inputs, n))]), np.vstack([D, np.eye(inputs)])
    S, z = np.hstack([S, np.zeros((n, inputs))]), np.hstack([z, np.zeros((len(z), inputs))])
    R = np.pad(R, [(0, inputs)] * 2)
    R[-inputs:, -inputs:] = np.diag(np.broadcast_to(np.asarray(var, float), inputs))
    return (A, B, C, D, Q, R, S), z


def with_white_input(system: System, z: Array, var: ArrayLike, P0: Array) -> StateSpace:
    """A plain model of states x, u for `kalman.filter` and `bounds.steady`: u white of variance `var`.

    system: A, B, C, D, Q, R, S; noises of step and sample are made independent, for the samples z at hand.
    Its matrices are constant unless S is not zero and z (time, channel) misses some channels.
    """
    B, C, D, R, S = system[1:4] + system[5:]
    n, inputs = B.shape
    spread = np.diag(np.broadcast_to(np.asarray(var, float), inputs))
    seen = np.isfinite(z[:-1])
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    if not S.any() or not len(seen):
        patterns, which = np.ones((1, z.shape[1]), bool), np.zeros(len(seen), int)
    F, Q = (np.zeros((len(patterns), n + inputs, n + inputs)) for _ in range(2))
    known = np.zeros((len(seen), n + inputs))
    for i, there in enumerate(patterns):
        Ak, Bk, common, noise = uncorrelated(system, there)
        F[i, :n], Q[i, :n, :n], Q[i, n:, n:] = np.hstack([Ak, Bk]), squared(noise), spread
        at = np.flatnonzero(which.ravel() == i)
        known[at, :n] = np.where(seen[at][:, there], z[at][:, there], 0.0) @ common.T
    F, Q = (a[0] if len(patterns) == 1 else a[which.ravel()] for a in (F, Q))
    start = np.zeros((n + inputs, n + inputs))
    start[:n, :n], start[n:, n:] = P0, spread
    u = known if S.any() and len(seen) else None
    return StateSpace(F, Q, np.hstack([C, D]), R, np.zeros(n + inputs), start, u)


def uncorrelated(system: System, seen: Flags) -> tuple[Array, Array, Array, Array]:
    """A, B, gain of the sample and factor of Q of a step whose noise has nothing in common with its sample.

    x_{k+1} = A x + B u + w + G (z - C x - D u - v), G = S R^-1: w - G v is independent of v.
    """
    A, B, C, D, Q, R, S = system
    G = np.linalg.solve(R[np.ix_(seen, seen)], S[:, seen].T).T
    return A - G @ C[seen], B - G @ D[seen], np.asarray(G, float), square_root(Q - G @ S[:, seen].T)


def checked(A: Array, B: Array, C: Array, D: Array, Q: Array, R: Array, S: Array, z: Array) -> System:
    """The matrices as arrays of numbers, if their shapes fit each other and the channels of z."""
    states, channels, inputs = len(A), z.shape[1], np.shape(B)[-1]
    shapes = {
        "A": (states, states), "B": (states, inputs), "C": (channels, states), "D": (channels, inputs),
        "Q": (states, states), "R": (channels, channels), "S": (states, channels),
    }  # fmt: skip
    for (name, shape), matrix in zip(shapes.items(), (A, B, C, D, Q, R, S), strict=True):
        if np.shape(matrix) != shape:
            raise ConfigError(
                f"has shape {np.shape(matrix)}, expected {shape}",
                f"{name} of the model",
                f"A says {states} states, z {channels} channels, B {inputs} inputs",
            )
    A, B, C, D, Q, R, S = (np.asarray(a, float) for a in (A, B, C, D, Q, R, S))
    return A, B, C, D, Q, R, S


def determined(A: Array, B: Array, C: Array, D: Array, Q: Array, R: Array, S: Array) -> int:
    """Samples until an input is found: 0 by full feedthrough, 1 without any; anything else is refused."""
    white, inputs, direct = np.linalg.inv(root(R)), B.shape[1], bool(D.any())
    shown, name = (D, "feedthrough D") if direct else (C @ B, "C B, the trace of the inputs a sample later,")
    size = np.linalg.norm(np.abs(white) @ (np.abs(D) if direct else np.abs(C) @ np.abs(B)), axis=0)
    _, _, free, loose = least_squares(white @ shown, size)
    if free.shape[1] == 0:
        return 0 if direct else 1
    unseen = "; ".join(combination(v) for v in loose.T)
    raise EstimationError(
        f"has rank {inputs - free.shape[1]}, expected {inputs}, one for each input: no trace of {unseen}",
        name,
        "add a channel that responds to it (an acceleration beside the load), estimate fewer inputs, or take "
        "input_smoother, which needs no rank",
    )


def root(R: Array) -> Array:
    """Triangular L with L L^T = R."""
    try:
        return np.asarray(np.linalg.cholesky(R), float)
    except np.linalg.LinAlgError as e:
        where, step = "R of the model", "state a measurement noise above zero"
        raise EstimationError("is not positive definite", where, step) from e


def combination(v: Array) -> str:
    """A direction of the inputs in words.

    >>> combination(np.array([1.0, 0.0, -2.0]))
    '0.5 input 0 - input 2'
    """
    v = v / v[np.abs(v).argmax()]
    v = v * np.sign(v[np.flatnonzero(v)[0]])
    words = ""
    for i in np.flatnonzero(v):
        size = "" if np.isclose(abs(v[i]), 1.0) else f"{abs(v[i]):.4g} "
        words += (" - " if v[i] < 0 else " + ") + f"{size}input {i}"
    return words[3:]


def least_squares(G: Array, size: Array) -> tuple[Array, Array, Array, Array]:
    """Least squares of columns G of white rows: the fit, the rest, what stays free, and that without noise.

    fit (unknown, row), minimum-norm inverse; rest (row - rank, row), orthonormal, with rest G = 0; free
    (unknown, unknown - rank): null space. size (unknown,): of the terms that a column was summed from; where
    they cancel to rounding, the column is zero.
    """
    length = np.linalg.norm(G, axis=0)
    zero = length <= RANK * size
    scale = np.where(zero, np.where(size > 0, size, 1.0), length)
    U, s, Vt = np.linalg.svd(np.where(zero, 0.0, G / scale))
    rank = int(np.count_nonzero(s > RANK))
    null = Vt[rank:].T
    fit = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T / scale[:, None]
    loose = np.where(np.abs(null) > MARK, null, 0.0)
    return fit, U[:, rank:].T, null / scale[:, None], loose / scale[:, None]


def independent(E: Array) -> Array:
    """Columns that span those of E (state, direction), each row at its own scale."""
    row = np.abs(E).max(1, initial=0.0)
    row = np.where(row > 0, row, 1.0)[:, None]
    U, s, _ = np.linalg.svd(E / row, full_matrices=False)
    return np.asarray(row * U[:, s > RANK])


def told(mean: Array, cov: Array, lost: Flags) -> tuple[Array, Array]:
    """Mean and covariance, NaN for the entries that are lost."""
    return np.where(lost, np.nan, mean), np.where(lost | lost[:, None], np.nan, cov)


def open_rows(reach: Array, loose: Array) -> Flags:
    """States (state,) that change with the unknowns (unknown, free) along the directions reach."""
    return any_row(np.where(np.abs(reach @ loose) > MARK * (np.abs(reach) @ np.abs(loose)), 1.0, 0.0))


def any_row(loose: Array) -> Flags:
    """Rows that are not zero."""
    return np.asarray((loose != 0).any(1), bool)


def squared(*parts: Array) -> Array:
    """The sum of W W^T over factors W of a covariance."""
    return np.asarray(np.add.reduce([W @ W.T for W in parts]))


def triangle(W: Array) -> Array:
    """Triangular L (row, row or fewer) with L L^T = W W^T: covariances add as factors side by side.

    Large columns first: then a small one beside them keeps its own digits.
    """
    order = np.argsort(-np.abs(W).max(0, initial=0.0))
    return np.asarray(np.linalg.qr(W[:, order].T, mode="r"), float).T


def split(W: Array, C: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Of a state with covariance W W^T and a sample of it: the factor L of the sample's covariance, the part
    K e of the state's error that its white e show, and a factor of the rest, with no difference taken.
    """
    m = len(C)
    both = triangle(np.block([[C @ W, noise], [W, np.zeros((len(W), m))]]))
    return both[:m, :m], both[m:, :m], both[m:, m:]


def square_root(P: Array) -> Array:
    """W with W W^T = P, semidefinite; each state in its own unit: small variances keep their digits."""
    unit = np.sqrt(np.maximum(np.diagonal(P), 0.0))
    unit = np.where(unit > 0, unit, 1.0)
    size, axes = np.linalg.eigh(P / np.outer(unit, unit))
    return np.asarray(unit[:, None] * axes * np.sqrt(np.maximum(size, 0.0)), float)
