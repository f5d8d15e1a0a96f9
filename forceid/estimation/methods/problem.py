"""A recording on its way to a wrench: one record that the stages of a smoother fill, and what it comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.cleaning import NONE_DROPPED, Dropped, Wild, kinematics_without
from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.spin import with_spin_rate
from forceid.estimation.body.tracks.marker_errors import MarkerErrors
from forceid.estimation.body.tracks.rounding import rounding_line
from forceid.estimation.loads.channels import DrivenMotion, driven_motion
from forceid.estimation.loads.hidden.order_uncertainty import Rivals
from forceid.estimation.loads.hidden.ringing_body import Ringing
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.loads.lines import NO_LINES, Lines
from forceid.flight.channels import Channel
from forceid.flight.color import SharedErrors
from forceid.flight.model import Flight
from forceid.flight.path.reference import Reference
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import (
    FlightState,
    smooth_flight,
    smooth_translation,
    with_claims,
    with_translation,
)
from forceid.kalman.engines import Engine
from forceid.records import Array, Body, Finding, HiddenLoad, Impulses, ModalForces, Motion

TO_COME: Any = None  # a stage fills it before another reads it


@dataclass(frozen=True)
class Problem:
    """What is given of a recording, what passes so far have learned, and what this pass has found.

    Given: body, motion (cleaned), settings, engine, and given, the kinematics of all frames under the
    noise stated; shown: what a look at these has shown. Learned: findings; dropped, frames taken out;
    path, center and rotation about which poses are linearized, None for each about itself; lines of the
    loads; errors, of the markers as what no motion makes shows them; late (time, 6), what frames that
    come early or late are off by; shared, errors of all markers at once; slow, the noise of tracks whose
    errors follow each other, None for none; near, priors that those of the same lines are near to. Found:
    driven, the kinematics with the deformation taken out; noise_range, factors that the tuning may put on
    the noise; followed: whether how smooth a pose is tells of the noise of markers; notes, findings of
    this pass; cut: the force as it may come in pieces, where that was looked at; at_limit: by variable,
    whether the likelihood wanted less noise than it was allowed;
    apiece, priors tuned on a channel each; priors, flight and state; wild: what nothing explains;
    crowded: whether too many lines stand out for any to be one.
    Claimed: plain (time, 6, 6), the covariance of the wrench before allowances; gained: numbers of body
    axes; between (time, 6, 6): variance of the wrench between axes of its loads that the record does not
    tell apart; growth: of the errors claimed, moving: of those of affine modes; impulses:
    of loads that come in pieces; ringing: loads that may ring with the body unseen; looks: channels as
    their priors whiten them; wrong_mass: part by which the mass may be told wrong; center_off, inertia_off:
    by what mass center and inertia are.
    """

    body: Body
    motion: Motion
    settings: Settings
    engine: Engine
    given: Kinematics
    shown: DrivenMotion | None = None
    findings: tuple[Finding, ...] = ()
    dropped: Dropped = NONE_DROPPED
    path: tuple[Array, Array] | None = None
    lines: Lines = NO_LINES
    errors: MarkerErrors | None = None
    late: Array | None = None
    shared: SharedErrors | None = None
    slow: dict[str, Array] | None = None
    near: dict[str, LoadPrior] = field(default_factory=dict)
    driven: DrivenMotion = TO_COME
    noise_range: tuple[float, float] = (1.0, 1.0)
    followed: bool = True
    notes: tuple[Finding, ...] = ()
    cut: LoadPrior | None = None
    at_limit: dict[str, bool] = field(default_factory=dict)
    apiece: dict[str, LoadPrior] = field(default_factory=dict)
    priors: dict[str, LoadPrior] = field(default_factory=dict)
    flight: Flight = TO_COME
    state: FlightState = TO_COME
    wild: Wild | None = None
    crowded: bool = False
    plain: Array = TO_COME
    gained: dict[str, float] = field(default_factory=dict)
    between: Array | float = 0.0
    growth: Array | None = None
    moving: Array | None = None
    impulses: Impulses | None = None
    ringing: Ringing | None = None
    looks: Mapping[str, Whitened] = field(default_factory=dict)
    rivals: Rivals | None = None
    wrong_mass: float = 0.0
    center_off: Array | None = None
    inertia_off: Array | None = None

    @property
    def kin(self) -> Kinematics:
        """The kinematics with the deformation taken out."""
        return self.driven.kin

    @property
    def deformation(self) -> Deformation:
        """The deformation, smoothed."""
        return self.driven.deformation

    @property
    def causal(self) -> bool:
        """Whether every sample follows from those up to it."""
        return self.settings.method == "filter"

    @property
    def hides(self) -> bool:
        """Whether modes that no marker tells apart, or mass without markers, may hide what a load does."""
        return not self.followed and (self.kin.elastic is not None or self.kin.hidden is not None)

    @property
    def source(self) -> str:
        """The variable that shows where the body is."""
        return "position" if self.motion.position is not None else "center"

    @property
    def rounding(self) -> float:
        """Amplitude (m) that rounding gives to one frequency of the track of a marker, at most."""
        markers = self.kin.markers
        return 0.0 if markers is None else rounding_line(markers.grid, self.kin.noise["position"])

    @property
    def apart(self) -> bool:
        """Whether force and rotation are smoothed by themselves: nothing links their errors."""
        return self.kin.apart and self.flight.sensors is None and self.flight.modes is None

    @property
    def channels(self) -> dict[str, Channel]:
        """What force and moment drive, of those that the markers show."""
        shown = {"force": self.driven.force}
        return shown | {"moment": self.driven.moment} if self.kin.attitude else shown

    def look(self, noise: dict[str, Array] | None) -> Kinematics:
        """The kinematics without the frames dropped, under the noise of the file or another one."""
        kin = self.given
        if noise is not None or self.dropped.any:
            kin = kinematics_without(self.dropped, self.body, self.motion, self.settings, noise)
        return kin if self.path is None else kin.about(self.path)

    def seeing(self, kin: Kinematics) -> Problem:
        """The problem with these kinematics, the deformation smoothed and taken out of the poses."""
        driven = self.driven or (None if self.causal else self.shown)  # by the pass before, or the look
        if driven is None or kin is not driven.looked:
            driven = driven_motion(kin, self.motion.gravity, self.engine, self.causal)
        color, loud = (None, None) if self.errors is None else (self.errors.color, self.errors.loud)
        was, late, shared = driven.kin, self.late, self.shared
        pairs = (color, was.color), (loud, was.loud), (late, was.late), (shared, was.shared)
        if any(one is not other for one, other in pairs):
            errors = replace(was, color=color, loud=loud, late=late, shared=shared)
            driven = replace(driven, kin=errors)
        return self if driven is self.driven else replace(self, driven=driven)

    def turned_at(self, load: str) -> Array:
        """Rotation (sample, 3, 3) of the body at the samples of the channel of a load."""
        return np.asarray(self.state.rotation[np.isin(self.flight.time, self.channels[load].time)])

    def noting(self, *findings: Finding) -> Problem:
        """The problem with more findings of this pass."""
        return replace(self, notes=(*self.notes, *findings))

    def smoothed(self, flight: Flight, first: Reference | None = None, claimed: bool = False) -> FlightState:
        """The state of a flight under the priors of its loads; first: a reference near to it, if known.

        claimed: whether covariances are asked for, which most stages need not.
        """
        kin, force = self.kin, self.priors["force"]
        if not kin.attitude:
            return smooth_translation(flight, force, self.engine, self.causal)
        both = (None if self.apart else force), self.priors["moment"]
        state = smooth_flight(flight, *both, self.engine, self.causal, first, claimed or self.apart)
        if self.apart:
            carrier = None if first is None or force.body_axes is None else first.rotation
            free = smooth_translation(flight, force, self.engine, self.causal, carrier)
            state = with_translation(state, free)
        return with_spin_rate(state, kin.spin, kin.inertia.line)

    def claimed(self) -> Problem:
        """The problem with the covariances of its state."""
        if self.state.claimed:
            return self
        state = with_claims(self.flight, self.state, self.priors["force"], self.priors["moment"], self.engine)
        return replace(self, state=with_spin_rate(state, self.kin.spin, self.kin.inertia.line))


@dataclass(frozen=True)
class Smoothing:
    """What a smoothed wrench rests on: the flight, the priors of its loads, and allowance (time, 6, 6), what
    its covariance claims beyond what follows from these.
    """

    flight: Flight
    priors: dict[str, LoadPrior]
    allowance: Array


@dataclass(frozen=True)
class Solution:
    """A solved flight: what was seen, how it deformed, its state, and how the numbers were come by.

    tuned: numbers that tuning chose, by name; noise_at_limit: by variable, whether the likelihood wanted
    less noise than it was allowed; findings: for the verdict; priors: of the loads, by name; smoothing: of a
    smoother's wrench; hidden: what that leaves out; growth (6, 6): of the errors that the wrench claims, for
    what the record does not tell of its priors, moving (mode, 3): of those of amplitude, rate and
    acceleration of affine modes, each None for none; between (time, 6, 6): what is to be added then, for axes
    that the record does not tell apart. Levels are compared without them. impulses: of loads that come in
    pieces; shown (6,): variance of the wrench that its innovations show at least, NaN where they do not;
    ringing: loads that may ring with the body unseen; looks: channels as their priors whiten them; modal:
    forces on modes, where the method tells them itself; rivals: what other priors make of the growth;
    wrong_mass: part of itself by which the mass may be told wrong, as far as the record shows; center_off
    (3,) m, inertia_off (3, 3) kg m2: by what, body axes, it shows each to be told wrong, None for nothing.
    """

    kinematics: Kinematics
    deformation: Deformation
    state: FlightState
    engine: str
    tuned: dict[str, float]
    noise_at_limit: dict[str, bool]
    findings: tuple[Finding, ...] = ()
    priors: Mapping[str, LoadPrior] = field(default_factory=dict)
    smoothing: Smoothing | None = None
    hidden: HiddenLoad | None = None
    growth: Array | None = None
    moving: Array | None = None
    impulses: Impulses | None = None
    shown: Array | None = None
    ringing: Ringing | None = None
    looks: Mapping[str, Whitened] = field(default_factory=dict)
    modal: ModalForces | None = None
    rivals: Rivals | None = None
    between: Array | float = 0.0
    wrong_mass: float = 0.0
    center_off: Array | None = None
    inertia_off: Array | None = None

    @property
    def grown(self) -> Array | None:
        """The growth ([time,] 6, 6) of all claimed errors, with that of a body that is seen to ring."""
        if self.ringing is None:
            return self.growth
        return self.ringing.growth if self.growth is None else self.ringing.growth @ self.growth


def named(kin: Kinematics, priors: Mapping[str, LoadPrior]) -> dict[str, float]:
    """What tuning chose of noise and loads, as numbers with names."""
    found = {f"noise_std_{name}": level for name, level in kin.noise.items()}
    for load, prior in priors.items():
        found |= prior.numbers(load)
    return found
