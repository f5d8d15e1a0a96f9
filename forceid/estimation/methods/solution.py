"""What a method finds of a recording: kinematics, state of the flight, and what its numbers rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.model import Flight
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding, HiddenLoad, Impulses


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
    acceleration of affine modes, each None for none. Levels are compared without them: they are alike at all
    of them. impulses: of loads that come in pieces.
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


def named(kin: Kinematics, priors: Mapping[str, LoadPrior]) -> dict[str, float]:
    """What tuning chose of noise and loads, as numbers with names."""
    found = {f"noise_std_{name}": level for name, level in kin.noise.items()}
    for load, prior in priors.items():
        found |= prior.numbers(load)
    return found
