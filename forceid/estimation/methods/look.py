"""What a level shows of a motion before any flight is solved, so that the flight need not look again."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from forceid.estimation.body.deformation import undeformed
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.channels import DrivenMotion
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.engines import Engine
from forceid.records import Array


@dataclass(frozen=True)
class Look:
    """Kinematics of a level, and the motion with the deformation, smoothed, taken out of the poses.

    priors: tuned on channels of these, without lines, the noise as it is, and of any order.
    """

    kin: Kinematics
    driven: DrivenMotion
    priors: tuple[tuple[Channel, LoadPrior], ...] = ()

    def prior_on(self, channel: Channel) -> LoadPrior | None:
        """The prior tuned on a channel that is the same to the bit, None where there is none."""
        return next((prior for own, prior in self.priors if are_same(own, channel)), None)


def look_at(kin: Kinematics, gravity: Array, engine: Engine) -> Look:
    """A look at a level, its deformation smoothed."""
    return Look(kin, DrivenMotion(*undeformed(kin, engine), gravity))


def are_same(one: Channel, other: Channel) -> bool:
    """Whether two channels are the same to the bit, missing samples too."""
    pairs = [(getattr(one, f.name), getattr(other, f.name)) for f in fields(Channel) if f.name != "color"]
    return one.color is other.color and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
