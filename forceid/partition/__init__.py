"""Bodies in parts: localized multipliers, solvability, and the forces that pass between parts."""

from __future__ import annotations

from forceid.partition.system import PartitionedSystem as PartitionedSystem
from forceid.partition.system import Statics as Statics
from forceid.partition.topology import boolean_from_names as boolean_from_names
from forceid.partition.topology import boolean_from_positions as boolean_from_positions
from forceid.partition.topology import topology as topology
