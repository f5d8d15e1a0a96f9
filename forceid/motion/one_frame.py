"""The pose of one frame, as fast as it comes in: what does not depend on the frame is prepared once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.compiled import engine as compiled
from forceid.motion.pose import fitted_in_numpy, pose_gain
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Indices

ONLY = np.zeros(1, np.intp)  # the frame in a stack of one


@dataclass(frozen=True)
class FrameFit:
    """What the pose of a frame takes that sees the markers of `pattern` (node,).

    shape (node, 3) m about the mass center; start (node,): weights of the rotation fit that begins; gain:
    gain (6, channel), covariance (6, 6) of the pose in body axes, and weight of the channels; nodes: of the
    pattern; diagonal: the weight as the compiled fit takes it.
    """

    pattern: Flags
    shape: Array
    start: Array
    gain: tuple[Array, Array, Array]
    nodes: Indices
    diagonal: Array

    @property
    def cov(self) -> Array:
        """Covariance (6, 6) of the pose, body axes, rotation as a right error."""
        return self.gain[1]


def frame_fit(shape: Array, weight: Array, pattern: Flags, cov: Array) -> FrameFit | None:
    """The fit of frames that see the markers of a pattern; None where they do not fix a rotation.

    weight (node,) of the rotation fit that begins; cov (3 node, 3 node), body axes, as for `fit_pose`.

    >>> fit = frame_fit(np.eye(3), np.ones(3), np.ones(3, bool), np.eye(9))
    >>> fit_one(fit, np.eye(3) + 2.0)[0].round(9).tolist()
    [2.0, 2.0, 2.0]
    """
    gain = pose_gain(summation_operator(shape), pattern, cov)
    if gain is None:
        return None
    V = np.diagonal(gain[2])
    V = gain[2] if (gain[2] != np.diag(V)).any() else np.ascontiguousarray(V)
    return FrameFit(pattern, shape, weight + weight.max(), gain, np.flatnonzero(pattern), V)


def fit_one(fit: FrameFit, position: Array) -> tuple[Array, Array, Array]:
    """Center (3,), rotation (3, 3) and residual (node, 3), body axes, of one frame (node, 3)."""
    one = position[None]
    if compiled is not None:
        A, C, _ = fit.gain
        center, R, _, _, residual, arrived = compiled.fitted(
            one, ONLY, fit.nodes, fit.shape, fit.start[fit.nodes], A, C, fit.diagonal
        )
        if arrived[0] == 1:
            return center[0], R[0], residual[0]
    center, R, _, residual, _ = fitted_in_numpy(one, fit.pattern, fit.shape, fit.start, fit.gain)
    return center[0], R[0], residual[0]
