"""Bodies in parts: localized multipliers, solvability, and the forces that pass between parts."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from forceid.partition.assembled import from_assembled as from_assembled
from forceid.partition.assembled import from_meshes as from_meshes
from forceid.partition.assembled import from_names as from_names
from forceid.partition.coupling.commands import mean_control as mean_control
from forceid.partition.coupling.commands import solve_commands as solve_commands
from forceid.partition.coupling.interpolation import interpolation as interpolation
from forceid.partition.coupling.resultants import LinkResultants as LinkResultants
from forceid.partition.coupling.resultants import link_resultants as link_resultants
from forceid.partition.coupling.transfer import reproduction as reproduction
from forceid.partition.coupling.transfer import transfer_load as transfer_load
from forceid.partition.coupling.transfer import transfer_motion as transfer_motion
from forceid.partition.dynamics import integrate as integrate
from forceid.partition.dynamics import mean_motion as mean_motion
from forceid.partition.operators.topology import boolean_from_names as boolean_from_names
from forceid.partition.operators.topology import boolean_from_positions as boolean_from_positions
from forceid.partition.operators.topology import topology as topology
from forceid.partition.solution.interface_forces import InterfaceForces as InterfaceForces
from forceid.partition.statics import Statics as Statics
from forceid.partition.system import PartitionedSystem as PartitionedSystem

if TYPE_CHECKING:
    from forceid.partition.matrix_file import read_matrix as read_matrix
    from forceid.partition.motion_file import from_motion_file as from_motion_file


def __getattr__(name: str) -> Any:
    """What reads files, with h5py and xarray, when it is first asked for."""
    homes = {"from_motion_file": "motion_file", "read_matrix": "matrix_file"}
    if name not in homes:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{homes[name]}"), name)
