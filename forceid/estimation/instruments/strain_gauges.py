"""Strain gauges of a recording: what they read of the modes of a body, and nothing of its mean motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.markers import ROUNDOFF
from forceid.estimation.instruments.on_flight import sensor_noise
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.innovations import NIS_BAND
from forceid.flight.model import Flight
from forceid.flight.modes import StrainGauges
from forceid.flight.smoother import FlightState
from forceid.records import Body, Finding, Motion


def with_strain_gauges(
    flight: Flight, kin: Kinematics, body: Body, motion: Motion, settings: Settings
) -> Flight:
    """The flight with the strain gauges of its recording, where it has modes and any gauge reads.

    A gauge reads the displacement from the reference shape as /body/strain_shape (gauge, node, axis) says, to
    within a bias that stays. Noise is as stated, by the file or as noise_std.strain; else as high-order
    differences show it; the bias has a standard deviation of noise_std.strain_bias, else of its largest
    reading. Source: principal equations 4d.
    """
    if flight.modes is None or body.strain_shape is None or motion.strain is None:
        return flight
    used = np.isfinite(motion.strain).any(0)
    if not used.any() or body.position is None:
        return flight
    reads, reading = body.strain_shape[used].reshape(used.sum(), -1), motion.strain[:, used]
    steady = reads @ (kin.shape - (body.position - kin.inertia.center)).ravel()
    known, largest = motion.noise_std | settings.noise_std, np.nanmax(np.abs(reading), axis=0)
    noise = np.array([known.get("strain") or sensor_noise(motion.time, z[:, None]) for z in reading.T])
    noise = np.maximum(noise, np.maximum(ROUNDOFF * largest, 1e-15))
    bias = np.broadcast_to(known.get("strain_bias", np.maximum(largest, noise)), noise.shape)
    cov = np.diag(noise**2)
    if kin.beside is not None:  # modes that the model leaves out strain a gauge too
        cov += (reads @ kin.beside) @ (reads @ kin.beside).T
    rows = reads @ kin.shapes.reshape(len(kin.shapes), -1).T
    rows = np.pad(
        rows, ((0, 0), (0, len(flight.modes.prior.std) - rows.shape[1]))
    )  # hidden mass strains none
    gauges = StrainGauges(reading - steady, rows, cov, np.asarray(bias, float))
    return replace(flight, modes=replace(flight.modes, gauges=gauges))


def judge_strain_gauges(
    flight: Flight, state: FlightState, body: Body, motion: Motion
) -> tuple[Finding, ...]:
    """Gauges that are of no use, or that read what the modes do not explain."""
    if motion.strain is None or not np.isfinite(motion.strain).any():
        return ()
    if body.strain_shape is None:
        return (note("strain-shape-missing"),)
    if flight.modes is None:
        return (note("strain-without-modes"),)
    level = float(np.nanmean(state.gauge_innovation**2))
    return () if level < NIS_BAND[1] else (note("strain-innovations", times=np.sqrt(level)),)
