"""What several smoothed flights say together, and what one says whose path is not at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.flight.model import Flight
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState, smoothed_once_more
from forceid.kalman.engines import Engine
from forceid.motion import log
from forceid.records import Array
from forceid.significance import TENTH


def mixed(states: list[FlightState], share: Array) -> FlightState:
    """The likeliest state with the mean wrench of all, and a covariance that holds what they differ by."""
    wrench = np.stack([np.hstack([state.force, state.moment]) for state in states])
    mean = np.einsum("s,sta->ta", share, wrench)
    off = wrench - mean
    cov = np.einsum("s,stab->tab", share, np.stack([state.wrench_cov for state in states]))
    cov += np.einsum("s,sta,stb->tab", share, off, off)
    return replace(
        states[int(share.argmax())], force=mean[:, :3], moment=mean[:, 3:], wrench_cov=cov
    )  # fmt: skip


def with_left_over(
    flight: Flight, force: LoadPrior, moment: LoadPrior, engine: Engine, state: FlightState
) -> tuple[FlightState, float]:
    """A state that claims what its path still moves by as well, and that over its claim before, at most.

    The loads turn with the path; of one that is not at rest, they move on with it, and that is claimed too.
    """
    assert state.reference is not None
    step = log(state.rotation @ state.reference.rotation.swapaxes(1, 2))
    before = np.sqrt(np.diagonal(state.pose_cov, axis1=1, axis2=2)[:, 3:])
    left = float((np.abs(step) / before).max())
    pose = np.concatenate([np.zeros_like(step), step], 1)
    offs = [np.concatenate([np.cross(step, state.force), np.cross(step, state.moment)], 1)]
    if left > TENTH:
        on = smoothed_once_more(flight, force, moment, engine, state.reference)
        offs.append(np.concatenate([on.force - state.force, on.moment - state.moment], 1))
    wrench_cov = state.wrench_cov + sum(off[:, :, None] * off[:, None] for off in offs)
    pose_cov = state.pose_cov + pose[:, :, None] * pose[:, None]
    return replace(state, pose_cov=pose_cov, wrench_cov=wrench_cov), left
