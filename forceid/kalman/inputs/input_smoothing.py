"""State and input of a linear system given the whole record, with a white prior on the input or none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.kalman.covariance import root
from forceid.kalman.inputs.diffuse import diffuse_rows, learn, least_squares, mask_lost
from forceid.kalman.inputs.unknown_input import forward, uncorrelated, validated_system, with_prior
from forceid.kalman.model import as_channels
from forceid.kalman.recursions.square_root import squared, triangle
from forceid.records import Array


@dataclass(frozen=True)
class InputSmoothed:
    """State x, P and input u (time, input), u_cov (time, input, input) given the whole record."""

    x: Array
    P: Array
    u: Array
    u_cov: Array


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
    system = validated_system(A, B, C, D, Q, R, S, z)
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
        X[k], X_cov[k] = mask_lost(found.x, squared(found.W, found.error), diffuse_rows(reach, found.loose))
        U[k], U_cov[k] = mask_lost(found.amount[d:], squared(found.fit[d:]), (found.loose[d:] != 0).any(1))
        # what is left of the rows for the state once the input has taken its share
        size = np.linalg.norm(np.vstack([of_u, np.abs(N) @ np.abs(Bk)]), axis=0)
        rest = least_squares(of_u, size)[1]
        upper = triangle(np.hstack([rest @ of_x, (rest @ value)[:, None]]).T).T[:n]
        N, y = upper[:, :n], upper[:, n]
    return InputSmoothed(X, X_cov, U, U_cov)
