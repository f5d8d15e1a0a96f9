"""What the measurements can show of a linear model, and what they cannot, before any data are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals, matrix_balance, null_space

from forceid.kalman.covariance import root
from forceid.kalman.engines import engine
from forceid.kalman.model import StateSpace
from forceid.kalman.recursions.rest import ROWS
from forceid.records import Array, Flags
from forceid.rounding import SINGLE, SOLVED
from forceid.significance import WHOLE

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Observability:
    """What is lost: rank of the observable part, out of `states`.

    lost (n - rank,): eigenvalues of the part that no measurement shows, with multiplicity; unobservable
    (state, n - rank): an orthonormal basis of it; direction (state, d): the Popov-Belevitch-Hautus vectors v,
    A v = value v and C v = 0, with their eigenvalue (d,). `observable` when nothing is lost.
    """

    rank: int
    states: int
    lost: Complex
    unobservable: Array
    value: Complex
    direction: Complex

    @property
    def observable(self) -> bool:
        """True when every state can be told from the measurements."""
        return self.rank == self.states


def pbh(A: Array, C: Array) -> Observability:
    """Popov-Belevitch-Hautus test of A (state, state), C (channel, state); continuous or discrete time.

    The rank is that of the observable part, found by the staircase: states that C does not see, and A does
    not lead to ones it sees, step by step, so that no power of A is formed. At the eigenvalues of what
    remains the matrix [value - A; C] loses rank. Source: principal equations 4e; Hautus (1969).

    >>> A = np.array([[0.0, 1, 0], [0, 0, 1], [0, 0, 0]])  # position, velocity, force on 1 kg
    >>> found = pbh(A, np.array([[0.0, 0, 1]]))  # an accelerometer
    >>> found.rank, found.lost.real, np.abs(found.direction.T)
    (1, array([0., 0.]), array([[1., 0., 0.]]))
    """
    A, C, size = balanced_system(np.asarray(A, float), np.asarray(C, float))
    reach = max(float(np.linalg.norm(A, 2)), 1e-300)
    hidden = null_space(C, rcond=SOLVED) if np.any(C) else np.eye(len(A))
    while hidden.shape[1]:
        onward = A @ hidden
        leak = onward - hidden @ (hidden.T @ onward)
        _, s, Vt = np.linalg.svd(leak)
        keep = Vt[np.count_nonzero(s > SOLVED * reach) :].T
        if keep.shape[1] == hidden.shape[1]:
            break
        hidden = hidden @ keep
    inner = hidden.T @ A @ hidden
    lost: Complex = np.linalg.eigvals(inner).astype(complex)
    # a repeated eigenvalue with fewer vectors than its count comes out split by a root of rounding
    lost[np.abs(lost) < 1e-7 * reach] = 0.0
    value: list[complex] = []
    direction = np.zeros((len(A), 0), complex)
    for x in lost:
        if all(abs(x - v) > SINGLE * reach for v in value):
            v = size[:, None] * (hidden @ null_space(inner - x * np.eye(len(inner)), rcond=SINGLE))
            value += [complex(x)] * v.shape[1]
            direction = np.hstack([direction, v / v[np.abs(v).argmax(0), np.arange(v.shape[1])]])
    basis = np.asarray(np.linalg.qr(size[:, None] * hidden)[0], float)
    return Observability(len(A) - len(lost), len(A), lost, basis, np.array(value, complex), direction)


def balanced_system(A: Array, C: Array) -> tuple[Array, Array, Array]:
    """A and C in units of the state in which the rows and columns of A balance; rows of C of length one."""
    balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    size = np.asarray(scale, float)
    C = C * size
    C = np.asarray(C / np.maximum(np.linalg.norm(C, axis=1, keepdims=True), 1e-300), float)
    return np.asarray(balanced, float), C, size


@dataclass(frozen=True)
class Gramian:
    """Information of a record in units of the prior.

    eigenvalue (state,), ascending: of P0^1/2 W P0^1/2, prior over posterior variance less one; direction
    (state, state): columns of P0^1/2 times its eigenvectors, the combinations of the state at the first
    sample that are known that well. rank: how many the record shows better than the prior, above 1.
    """

    eigenvalue: Array
    direction: Array
    rank: int


def gramian(F: Array, H: Array, R: Array, P0: Array, samples: int) -> Gramian:
    """Observability Gramian W = sum of F^k' H' R^-1 H F^k over `samples` steps, in units of the prior P0.

    Takes singular values of the stacked rows, not eigenvalues of W: what is unobservable stays zero beside
    what is known 1e12 times better than the prior. Raises EstimationError where R is not positive definite.
    Source: principal equations 4e.

    >>> F = np.array([[1.0, 0.1], [0.0, 1.0]])
    >>> found = gramian(F, H=np.eye(1, 2), R=np.eye(1), P0=np.diag([9.0, 4.0]), samples=1)
    >>> found.eigenvalue, found.rank
    (array([0., 9.]), 1)
    """
    spread, axes = np.linalg.eigh(P0)
    prior = axes * np.sqrt(np.maximum(spread, 0.0)) @ axes.T
    white, at = np.linalg.solve(root(R), H), prior
    triangle = np.zeros((0, len(F)))
    for start in range(0, samples, ROWS):
        rows = [triangle]
        for _ in range(min(ROWS, samples - start)):
            rows.append(white @ at)
            at = F @ at
        triangle = np.asarray(np.linalg.qr(np.vstack(rows), mode="r"), float)
    _, s, Vt = np.linalg.svd(np.vstack([triangle, np.zeros((len(F), len(F)))]))
    eigenvalue = np.where(s > len(F) * np.finfo(float).eps * s.max(), s, 0.0)[::-1] ** 2
    return Gramian(eigenvalue, prior @ Vt[::-1].T, int(np.count_nonzero(eigenvalue > 1.0)))


def variance_ratio(model: StateSpace, samples: int) -> Array:
    """Posterior over prior variance (time, state): of the smoother, over that of the model with no data.

    Source: principal equations 4e. A state that stays at 1 is known by its prior alone; see `prior_only`.

    >>> I, O = np.eye(2), np.zeros((2, 2))
    >>> variance_ratio(StateSpace(I, O, np.array([[1.0, 0.0]]), np.eye(1), np.zeros(2), I), samples=3)[0]
    array([0.25, 1.  ])
    """
    z = np.zeros((samples, model.H.shape[-2]))
    smooth = engine().smooth
    known, blind = (np.diagonal(smooth(model, data).P, axis1=1, axis2=2) for data in (z, np.nan * z))
    return np.asarray(known / np.where(blind > 0, blind, 1.0))


def prior_only(ratio: Array) -> Flags:
    """Which states (state,) of a variance ratio (time, state) no sample brings below WHOLE."""
    return np.asarray(ratio.min(0) >= WHOLE)


@dataclass(frozen=True)
class InvariantZeros:
    """zeros (zero,), complex: frequencies at which an input leaves no trace in the outputs.

    rank: of the transfer from inputs to outputs at almost every frequency; normal_rank: that of Rosenbrock's
    pencil, states more. identifiable: rank equals the number of inputs, so that the outputs fix each of them
    but for motions at the zeros, which a filter without prior must be able to forget (left half plane, or
    inside the unit circle).
    """

    zeros: Complex
    rank: int
    normal_rank: int
    identifiable: bool


def invariant_zeros(A: Array, B: Array, C: Array, D: Array) -> InvariantZeros:
    """Invariant zeros of A (state, state), B (state, input), C (channel, state), D (channel, input).

    Where Rosenbrock's pencil [A - s, B; C, D] loses rank, square or not, continuous or discrete time. The
    pencil is deflated to one with square invertible D by orthogonal steps: no infinite zeros to sort out by
    size, no random compression. Source: principal equations 4e; Emami-Naeini and Van Dooren (1982).

    >>> A, B = np.array([[0.0, 1], [-4, 0]]), np.array([[0.0], [1]])
    >>> invariant_zeros(A, B, np.array([[9.0, 1]]), np.zeros((1, 1))).zeros.real
    array([-9.])
    """
    A, B, C, D = (np.asarray(a, float) for a in (A, B, C, D))
    states, inputs = B.shape
    A, _, size = balanced_system(A, C)
    B, C = B / size[:, None], C * size
    # one factor a channel and one an input move no zero
    for _ in range(2):
        row = np.maximum(np.linalg.norm(np.hstack([C, D]), axis=1, keepdims=True), 1e-300)
        C, D = np.asarray(C / row, float), np.asarray(D / row, float)
        column = np.maximum(np.linalg.norm(np.vstack([B, D]), axis=0), 1e-300)
        B, D = np.asarray(B / column, float), np.asarray(D / column, float)
    small = SOLVED * max(float(np.linalg.norm(A, 2)), 1.0)
    A, B, C, D = full_row_rank(A, B, C, D, small)
    A, C, B, D = (np.asarray(a.T, float) for a in full_row_rank(A.T, C.T, B.T, D.T, small))
    n, rank = len(A), len(D)
    pencil, weight = np.block([[A, B], [C, D]]), np.diag([1.0] * n + [0.0] * rank)
    zeros = np.zeros(0, complex)
    if n:
        # the left null space of [B; D] takes the inputs out of the pencil
        free = null_space(np.vstack([B, D]).T, rcond=1e-14).T if rank else np.eye(n)
        zeros = eigvals(free @ pencil[:, :n], free @ weight[:, :n])
    return InvariantZeros(zeros, rank, states + rank, rank == inputs)


def full_row_rank(A: Array, B: Array, C: Array, D: Array, small: float) -> tuple[Array, Array, Array, Array]:
    """The system with the same finite zeros whose D has full row rank: what outputs at rest allow to move."""
    while True:
        U, s, _ = np.linalg.svd(D)
        direct = int(np.count_nonzero(s > small))
        D, C = (U.T @ D)[:direct], U.T @ C
        C, silent = C[:direct], C[direct:]
        if not len(silent) or not len(A):
            return A, B, C, D
        _, s, Vt = np.linalg.svd(silent)
        seen = int(np.count_nonzero(s > small))
        if not seen:
            return A, B, C, D
        # outputs without feedthrough stay at zero: so do the states they see, whose rates become outputs
        rest, held = Vt[seen:].T, Vt[:seen].T
        C, D = np.vstack([C, held.T @ A]) @ rest, np.vstack([D, held.T @ B])
        A, B = rest.T @ A @ rest, rest.T @ B
