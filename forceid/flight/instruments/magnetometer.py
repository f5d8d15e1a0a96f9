"""A magnetometer: a field that is the same everywhere and stays, in its own axes.

    y = S^T R^T B

B in world axes is found with the flight. A reading is blind to the turn about B: that one is left to frames,
gyros and the equations of the top. Without any frame, B is in the axes of the body at the first sample.
"""

from __future__ import annotations

import numpy as np

from forceid.flight.instruments.moved import InBody, Slopes
from forceid.flight.instruments.protocol import BentMount, Instrument
from forceid.motion import apply
from forceid.principal import cross_matrix as skew
from forceid.records import Array
from forceid.rounding import SOLVED


def read(here: InBody, S: Array, r: Array, steady: Array) -> tuple[Array, Slopes]:
    """S^T R^T B, wherever on the body; theta turns it as R^T [B]x theta."""
    return here.Rt @ steady @ S, {"theta": S.T @ here.Rt @ skew(steady), "steady": S.T @ here.Rt}


def bend(here: InBody, on: BentMount) -> tuple[Array, Array, Array, float]:
    """On a body that bends: in axes tilted by Psi q."""
    field = here.Rt @ on.steady
    by_q = on.back @ skew(field) @ on.tilt
    return apply(on.back, field) - field @ on.S, by_q, np.zeros_like(by_q), 0.0


def start(rotation: Array, reading: Array, mounting: Array) -> Array:
    """B (3,) T of least squares along rotations (time, 3, 3), beside a bias of each sensor that stays."""
    count = len(mounting)
    observed = np.asarray(np.isfinite(rotation).all((1, 2)))
    seen = np.isfinite(reading) & observed[:, None, None]
    rows = np.zeros((*reading.shape, 3 + 3 * count))
    rows[..., :3] = np.einsum("sba,tcb->tsac", mounting, rotation)
    for s in range(count):
        rows[:, s, :, 3 + 3 * s : 6 + 3 * s] = np.eye(3)
    return np.asarray(np.linalg.lstsq(rows[seen], reading[seen], rcond=SOLVED)[0][:3])


MAGNETOMETER = Instrument(
    "magnetic_field", "T", "magnetometers", "magnetometer", offset=1e-4,  # data sheets: 1 gauss of hard iron
    read=read, bend=bend, start=start, steady=tuple(f"magnetic_field_world_{axis}" for axis in "xyz"),
)  # fmt: skip
