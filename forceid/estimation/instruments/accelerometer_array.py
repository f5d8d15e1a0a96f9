"""Accelerometers on one body as an array: where they stand, and whether their readings say that it turns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import chdtri

from forceid.config import Settings
from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.body.inertia import Inertia, inertia_of
from forceid.estimation.body.markers import ROUNDOFF
from forceid.estimation.body.rotors import momentum_inside
from forceid.estimation.instruments.acceleration_field import (
    FORCE,
    PULL,
    SHOWN,
    TURN,
    Fit,
    Level,
    Sites,
    fit_field,
    level_shown,
)
from forceid.estimation.instruments.gyro_free import symmetric
from forceid.estimation.instruments.on_flight import mounted, sensor_noise
from forceid.flight.instruments import ACCELEROMETER
from forceid.principal import axial
from forceid.records import Array, Body, Flags, Motion
from forceid.significance import DENIED

READ = ACCELEROMETER.name


@dataclass(frozen=True)
class Field:
    """What accelerometers show: readings y (time, channel) at sites, with modes where shapes are told.

    inside (time, 3) kg m2/s, torque (time, 3) N m: momentum of what turns inside, body axes, and its rate.
    still, turned: fits without and with W; level: of noise and offset of a channel, stated (white) or not;
    turns: whether the record says that the body turns.
    """

    y: Array
    sites: Sites
    inertia: Inertia
    inside: Array
    torque: Array
    still: Fit
    turned: Fit
    level: Level
    stated: bool
    turns: bool

    @property
    def fit(self) -> Fit:
        """The fit of what the body does."""
        return self.turned if self.turns else self.still

    @property
    def followed(self) -> bool:
        """Whether the readings tell alpha, w given, so that w can be followed by it."""
        told = self.still.told(np.eye(self.still.number.shape[1])[TURN]).all(1)
        return bool(told.sum() > 2)

    @property
    def told(self) -> Flags:
        """Which components of the wrench (time, 6) the readings tell, where w is found if it can be."""
        if self.followed or not self.turns:
            return self.still.told(self.to_wrench(False))
        return self.told_at_once

    @property
    def told_at_once(self) -> Flags:
        """Which components of the wrench (time, 6) a sample tells by itself of a body that turns."""
        told = self.turned.told(self.to_wrench(True))
        told[:, 3:] &= not self.inside.any()
        return told

    def to_wrench(self, pull: bool) -> Array:
        """The wrench of a unit of f, alpha and the numbers behind them (6, number), W among these if `pull`.

        w x J w is linear in W: its component i sums e_ijk J_kl W_jl.
        """
        rows = np.zeros((6, (self.turned if pull else self.still).number.shape[1]))
        rows[:3, FORCE], rows[3:, TURN] = self.inertia.mass * np.eye(3), self.inertia.tensor
        if pull:
            rows[3:, PULL] = axial(symmetric(np.eye(6)) @ self.inertia.tensor).T
        return rows


def field_of(body: Body, motion: Motion, settings: Settings) -> Field | None:
    """The field of specific force of a recording; None where no accelerometer reads."""
    if motion.specific_force is None or not np.isfinite(motion.specific_force).any():
        return None
    inertia, known = inertia_of(body), motion.noise_std | settings.noise_std
    y = motion.specific_force.reshape(len(motion.time), -1)
    sites = sites_of(body, inertia, motion.specific_force.shape[1], settings)
    while len(sites.shape) and not determined(y, sites):  # the stiffest move least
        sites = replace(sites, shape=sites.shape[:-1])
    still, turned = (fit_field(y, sites.columns(pull), sites.sizes(pull)) for pull in (False, True))
    shown, stated = level_shown(turned), known.get(READ)
    if shown is None:
        differences = np.nanmean([sensor_noise(motion.time, z) ** 2 for z in each(motion)])
        shown = Level(float(np.sqrt(differences)), 0.0)
    turns = shows_turn(still, turned, told_level(shown, y, known))
    shown = told_level(level_shown(turned if turns else still) or shown, y, known)
    inside = np.broadcast_to(momentum_inside(body, motion), (len(motion.time), 3))
    torque = np.gradient(inside, motion.time, axis=0) if len(inside) > 1 else np.zeros_like(inside)
    return Field(
        y, sites, inertia, inside, torque, still, turned, shown, stated is not None, turns
    )  # fmt: skip


def told_level(shown: Level, y: Array, known: Mapping[str, float]) -> Level:
    """A level shown in readings y, or what is stated of it; no less than what they are rounded to."""
    least = ROUNDOFF * float(np.nanmax(np.abs(y))) or ROUNDOFF
    white = max(known.get(READ, shown.white), least)
    return Level(white, known.get(f"{READ}_bias", shown.offset))


def each(motion: Motion) -> list[Array]:
    """Readings (time, 3) sensor by sensor, of those that read."""
    assert motion.specific_force is not None
    every = np.moveaxis(motion.specific_force, 1, 0)
    return [z for z in every if np.isfinite(z).any()]


def sites_of(body: Body, inertia: Inertia, count: int, settings: Settings) -> Sites:
    """Where the sensors of a body stand, and what its modes, in the mass gauge, move them by."""
    assert body.sensor_position is not None
    rotation = np.tile(np.eye(3), (count, 1, 1))
    if body.sensor_rotation is not None:
        rotation = Rotation.from_quat(body.sensor_rotation).as_matrix()
    shape = np.zeros((0, count, 3))
    if body.mode_shape is not None and body.position is not None and settings.model in ("auto", "modal"):
        X = body.position - inertia.center
        gauge = np.ones(len(X)) if inertia.nodal is None else inertia.nodal
        own = split_rigid(body.mode_shape, X, gauge)[1]
        shape = mounted(X, own, body.sensor_position - inertia.center)[0].swapaxes(0, 1)
    places = body.sensor_position - inertia.center
    return Sites(places, rotation, shape[: settings.modes], inertia.gyration or 1.0)


def determined(y: Array, sites: Sites) -> bool:
    """Whether the channels that read tell f, alpha and the modes, and leave something to check them by."""
    columns = sites.columns(False)[np.isfinite(y).any(0)] * sites.sizes(False)
    return bool(len(columns) > columns.shape[1] == np.linalg.matrix_rank(columns, rtol=SHOWN))


def shows_turn(still: Fit, turned: Fit, level: Level) -> bool:
    """Whether W explains more of the readings than chance does: its changes, and its mean beside offsets."""
    more = still.dof - turned.dof
    if not more.any():
        return False
    gained = still.residual - turned.residual
    read = np.isfinite(gained)
    steady = np.nansum(gained, 0) / np.maximum(read.sum(0), 1)
    changes = float(np.nansum((gained - steady) ** 2)) / level.white**2
    of_mean = level.white**2 / len(more) + level.offset**2
    stays = float(steady @ steady) / of_mean
    limits = np.asarray(chdtri(np.array([more.sum(), more.mean()]), DENIED))
    return bool((np.array([changes, stays]) > limits).any())
