"""What the claims of a body of segments allow for: mass that is not where a table has it.

A segment whose mass center is off by d, in its own axes, adds m R d to the sum that the force drives, and
what that sweeps to the one that the moment drives; the smoother of each load makes of it what it makes of the
rest. The moment is about a mass center that is off as well: a lever of the force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.body.segments.joint_gaps import SegmentPoses
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.records import Array, Indices


def widened_by_misplaced_mass(
    state: FlightState,
    channels: dict[str, Channel],
    priors: dict[str, LoadPrior],
    poses: SegmentPoses,
    share: Array,
    mass: Array,
    arm: Array,
    std: float,
    engine: Engine,
) -> FlightState:
    """The state with a wrench that claims what misplaced mass of segments makes of it.

    share (segment, node), mass (node,) kg, arm (time, node, 3) m from the mass center; std (m): of each
    coordinate of the mass center of the body, to which all segments contribute as if each were off alike.
    """
    own = segment_of_nodes(poses, share)
    m = np.bincount(own, mass, len(poses.segment))
    part = m / m.sum()
    each = std / np.sqrt(part @ part)
    moved = m[:, None, None] * steady(channels["force"].time, poses.rotation).swapaxes(2, 3)  # (.., d, world)
    u = np.stack(
        [np.einsum("n,tna->ta", mass[own == k], arm[:, own == k]) / max(m[k], 1e-300) for k in range(len(m))],
        1,
    )
    swept = np.cross(moved[:-1], u[1:, :, None]) + np.cross(u[:-1, :, None], moved[1:])
    swept = np.concatenate([np.zeros_like(swept[:1]), np.cumsum(swept, axis=0)])
    T = len(arm)
    force = passed(channels["force"], priors["force"], moved.reshape(T, -1, 3), engine)
    moment = passed(channels["moment"], priors["moment"], swept.reshape(T, -1, 3), engine)
    lever = np.cross(moved.reshape(T, -1, 3) / m.sum(), state.force[:, None])
    wrench = each * np.concatenate([force, moment + lever], 2)
    cov = np.einsum("tca,tcb->tab", wrench, wrench)
    return replace(state, wrench_cov=state.wrench_cov + np.nan_to_num(cov))


def passed(channel: Channel, prior: LoadPrior, signals: Array, engine: Engine) -> Array:
    """The load (time, signal, 3) that the smoother of a channel finds in signals (time, signal, 3) of it."""
    z = channel.gain * (signals - signals[:1])
    z = np.where(np.isfinite(channel.z)[:, None], z, np.nan)
    _, states = engine.filter_and_smooth_states(channel_model(channel, prior), z)
    return np.asarray(states[..., : prior.states] @ prior.rows.T)


def segment_of_nodes(poses: SegmentPoses, share: Array) -> Indices:
    """The segment (node,), as an index of these, of each node: its own, or the one that places most."""
    own = share.argmax(0)
    own[poses.segment] = np.arange(len(poses.segment))
    return np.asarray(own)


def steady(time: Array, rotation: Array) -> Array:
    """Rotations (time, segment, 3, 3) with straight lines in their gaps, the identity where never seen."""
    out = np.array(rotation)
    for k in range(rotation.shape[1]):
        seen = np.isfinite(rotation[:, k]).all((1, 2))
        for a, b in np.ndindex(3, 3):
            out[:, k, a, b] = (
                np.interp(time, time[seen], rotation[seen, k, a, b]) if seen.any() else float(a == b)
            )
    return out
