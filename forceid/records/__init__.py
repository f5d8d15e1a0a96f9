"""Frozen records that pass between the stages: plain arrays inside, SI units, right-handed frames.

Shapes are written with the dimension names of the motion file. A wrench is ordered force, then moment.
"""

from forceid.records.arrays import AXES, Array, Claims, Flags, Indices, all_finite, deviation
from forceid.records.estimate import Aero, Estimate, Flown, Witness
from forceid.records.live import Frame, LiveWrench
from forceid.records.loads import Feet, HiddenLoad, Impulses, Interface, Loads, ModalForces
from forceid.records.recording import (
    SENSED,
    SENSOR,
    Body,
    KnownLoads,
    KnownPart,
    Motion,
    Reading,
    Recording,
    Variable,
)
from forceid.records.verdict import ABOUT, Finding, Level, Verdict

__all__ = [
    "ABOUT", "AXES", "SENSED", "SENSOR", "Aero", "Array", "Body", "Claims", "Estimate", "Feet", "Finding",
    "Flags", "Flown", "Frame", "HiddenLoad", "Impulses", "Indices", "Interface", "KnownLoads", "KnownPart",
    "Level", "LiveWrench", "Loads", "ModalForces", "Motion", "Reading", "Recording", "Variable", "Verdict",
    "Witness", "all_finite", "deviation",
]  # fmt: skip
