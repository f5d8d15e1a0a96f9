"""State and input of a linear system filtered at once, without any prior on the input.

x_{k+1} = A x_k + B u_k + w_k, z_k = C x_k + D u_k + v_k, cov w = Q, cov v = R, E[w v^T] = S. Gillijns and
De Moor (2007); what is unknown is carried as directions of infinite variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import ConfigError, EstimationError
from forceid.kalman.covariance import root, square_root
from forceid.kalman.inputs.diffuse import diffuse_rows, independent, learn, least_squares, mask_lost
from forceid.kalman.model import as_channels
from forceid.kalman.recursions.square_root import squared, triangle
from forceid.records import Array, Flags

# of a state: its mean, a factor of its covariance, and the directions that no sample has shown yet
Known = tuple[Array, Array, Array]
SystemMatrices = tuple[Array, Array, Array, Array, Array, Array, Array]  # A, B, C, D, Q, R, S


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
    system = validated_system(A, B, C, D, Q, R, S, z)
    return forward(system, z, x0, P0, determined(*system))[0]


def forward(
    system: SystemMatrices, z: Array, x0: Array | None, P0: Array | None, delay: int
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
        X[k], X_cov[k] = mask_lost(x, squared(W, error), diffuse_rows(reach, loose))
        innovation[k, : len(found.surprise)] = found.surprise
        if now:
            U[k - delay], U_cov[k - delay] = mask_lost(u, squared(fit), (loose[known:] != 0).any(1))
        Ak, Bk, common, step_noise = uncorrelated(system, seen)
        x, error, E = Ak @ x + common @ z[k, seen], Ak @ error, Ak @ reach @ free
        if delay == 0:
            x, error, E = x + Bk @ u, error - Bk @ fit, E + Bk @ free[known:]
        W = triangle(np.hstack([Ak @ W, error, step_noise]))
        E = independent(E)
    return InputFiltered(X, X_cov, U, U_cov, innovation, delay), before


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


def combination(v: Array) -> str:
    """A direction of the inputs in words."""
    v = v / v[np.abs(v).argmax()]
    v = v * np.sign(v[np.flatnonzero(v)[0]])
    words = ""
    for i in np.flatnonzero(v):
        size = "" if np.isclose(abs(v[i]), 1.0) else f"{abs(v[i]):.4g} "
        words += (" - " if v[i] < 0 else " + ") + f"{size}input {i}"
    return words[3:]


def validated_system(
    A: Array, B: Array, C: Array, D: Array, Q: Array, R: Array, S: Array, z: Array
) -> SystemMatrices:
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


def uncorrelated(system: SystemMatrices, seen: Flags) -> tuple[Array, Array, Array, Array]:
    """A, B, gain of the sample and factor of Q of a step whose noise has nothing in common with its sample.

    x_{k+1} = A x + B u + w + G (z - C x - D u - v), G = S R^-1: w - G v is independent of v.
    """
    A, B, C, D, Q, R, S = system
    G = np.linalg.solve(R[np.ix_(seen, seen)], S[:, seen].T).T
    return A - G @ C[seen], B - G @ D[seen], np.asarray(G, float), square_root(Q - G @ S[:, seen].T)


def with_prior(system: SystemMatrices, z: Array, var: ArrayLike) -> tuple[SystemMatrices, Array]:
    """The system with one more channel for each input, which measures it as zero, with variance `var`."""
    A, B, C, D, Q, R, S = system
    n, inputs = B.shape
    C, D = np.vstack([C, np.zeros((inputs, n))]), np.vstack([D, np.eye(inputs)])
    S, z = np.hstack([S, np.zeros((n, inputs))]), np.hstack([z, np.zeros((len(z), inputs))])
    R = np.pad(R, [(0, inputs)] * 2)
    R[-inputs:, -inputs:] = np.diag(np.broadcast_to(np.asarray(var, float), inputs))
    return (A, B, C, D, Q, R, S), z
