"""Mass that tables misplace, in the claims of a body of segments.

A segment whose mass center is off by d, in its own axes, adds m R d to the sum that the force drives, and
what that sweeps to the one that the moment drives; the smoother of each load makes of it what it makes of the
rest. The moment is about a mass center that is off as well: a lever of the force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.segment_noise import SegmentNoise, SegmentPoses
from forceid.estimation.body.tracks.bridging import straight
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.records import Array, Indices

CENTER_STD = 0.01  # m, each axis: by which tables misplace the mass center of a person


def misplaced_each(mass: Array, noise: SegmentNoise, settings: Settings) -> float:
    """By how much the mass center of each segment is off along an axis (m), if all are off alike, and the
    mass center of all, of nodes of masses (node,), by what is known of it.
    """
    part = np.bincount(noise.owner, mass) / mass.sum()
    return float((settings.body_std.mass_center or CENTER_STD) / np.sqrt(part @ part))


def widened_by_misplaced_mass(
    state: FlightState,
    channels: dict[str, Channel],
    priors: dict[str, LoadPrior],
    poses: SegmentPoses,
    own: Indices,
    mass: Array,
    arm: Array,
    each: float,
    engine: Engine,
) -> FlightState:
    """The state with a wrench that claims what misplaced mass of segments makes of it.

    own (node,): the segment of each node; mass (node,) kg, arm (time, node, 3) m from the mass center; each
    (m): by which the mass center of a segment is off, along each of its axes.
    """
    total = np.bincount(own, mass, len(poses.segment))
    heavy = np.flatnonzero(total > 0)
    m, turned = total[heavy], filled_turns(channels["force"].time, poses.rotation[:, heavy])
    moved = m[:, None, None] * turned.swapaxes(2, 3)  # (time, segment, d, world)
    weighed = [np.einsum("n,tna->ta", mass[own == k], arm[:, own == k]) / total[k] for k in heavy]
    u = np.stack(weighed, 1)
    swept = np.cross(moved[:-1], u[1:, :, None]) + np.cross(u[:-1, :, None], moved[1:])
    swept = np.concatenate([np.zeros_like(swept[:1]), np.cumsum(swept, axis=0)])
    T = len(arm)
    force = load_found_in(channels["force"], priors["force"], moved.reshape(T, -1, 3), engine)
    moment = np.zeros_like(force)
    if "moment" in channels:
        moment = load_found_in(channels["moment"], priors["moment"], swept.reshape(T, -1, 3), engine)
    lever = np.cross(moved.reshape(T, -1, 3) / m.sum(), state.force[:, None])
    wrench = each * np.concatenate([force, moment + lever], 2)
    cov = np.einsum("tca,tcb->tab", wrench, wrench)
    return replace(state, wrench_cov=state.wrench_cov + np.nan_to_num(cov))


def load_found_in(channel: Channel, prior: LoadPrior, signals: Array, engine: Engine) -> Array:
    """The load (time, signal, 3) that the smoother of a channel finds in signals (time, signal, 3) of it."""
    z = channel.gain * (signals - signals[:1])
    z = np.where(np.isfinite(channel.z)[:, None], z, np.nan)
    _, states = engine.filter_and_smooth_states(channel_model(channel, prior), z)
    return np.asarray(states[..., : prior.states] @ prior.rows.T)


def filled_turns(time: Array, rotation: Array) -> Array:
    """Rotations (time, segment, 3, 3) with straight lines in their gaps, the identity where never seen."""
    out = np.array(rotation)
    for k in range(rotation.shape[1]):
        seen = np.isfinite(rotation[:, k]).all((1, 2))
        out[:, k] = straight(time, time[seen], rotation[seen, k]) if seen.any() else np.eye(3)
    return out
