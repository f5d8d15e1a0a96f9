"""Lines of a load in its chain, behind all other states: each the line, its quadrature, and what a frequency
that is off adds to both.

A line drives all three axes as its direction says, where that turns by the mean of a step. Source: principal
equations 4e.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from forceid.flight.priors.body_fixed import swept
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.lines import Line
from forceid.kalman.building.process import integrate
from forceid.records import Array


def add_lines(
    chain: tuple[Array, Array, Array],
    lines: tuple[Line, ...],
    axes: Array,
    unique: Array,
    step: Array,
    rotation: Array | None,
) -> None:
    """Fill in the blocks of lines at the end of F, Q (step, state, state) and P0 of a chain.

    axes (3, 3): of the chain; unique: its steps s, step: those of the clock; rotation (time, 3, 3): of the
    body, for lines that turn with it.
    """
    F, Q, P0 = chain
    alike, which = np.unique(np.round(unique, 12), return_inverse=True)
    for line, own in zip(lines, places(len(P0), lines), strict=True):
        F_line, Q_line = discretize_steps(integrate(integrate(line.process, 0.0), 0.0), alike)
        turns = line.turns and rotation is not None
        moved = np.zeros((len(unique if turns else alike), 6 + line.states, 2 + line.states))
        # its Y and H along its direction, its own states as they are
        early, mean = swept(step, rotation) if turns and rotation is not None else (np.eye(3), np.eye(3))
        moved[:, :3, 0], moved[:, 3:6, 1] = (turn @ line.direction @ axes for turn in (early, mean))
        moved[:, 6:, 2:] = np.eye(line.states)
        if turns:
            F_line, Q_line = F_line[which], Q_line[which]
        F_own, Q_own = moved @ F_line[:, :, 2:], moved @ Q_line @ moved.mT
        if not turns and len(alike) < len(unique):
            F_own, Q_own = F_own[which], Q_own[which]
        rows = np.r_[0:6, own]
        F[:, rows, own] = F_own
        Q[:, rows[:, None], rows] += Q_own
        P0[own, own] = line.process.P0


def line_rows(rows: Array, lines: tuple[Line, ...], rotation: Array | None) -> Array:
    """Rows (3, state) that read a load, with its lines as well; (time, 3, state) along a rotation."""
    if rotation is not None:
        rows = np.tile(rows, (len(rotation), 1, 1))
    for line, own in zip(lines, places(rows.shape[-1], lines), strict=True):
        direction = line.direction
        if line.turns:
            assert rotation is not None
            direction = rotation @ direction
        rows[..., own.start] = direction
    return rows


def line_rate(chain: Array, lines: tuple[Line, ...]) -> Iterator[Array]:
    """Rate (time, 3), world axes, of each line in the states of a chain (time, state)."""
    for line, own in zip(lines, places(chain.shape[1], lines), strict=True):
        yield (chain[:, own] @ line.process.A[0])[:, None] * line.direction


def places(states: int, lines: tuple[Line, ...]) -> list[slice]:
    """Where the states of each line are in a chain of so many."""
    stop = states - sum(line.states for line in lines) + np.cumsum([line.states for line in lines])
    return [slice(int(end) - line.states, int(end)) for line, end in zip(lines, stop, strict=True)]
