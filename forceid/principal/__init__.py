"""The d'Alembert-Lagrange principal equations: summation operator, mass, resultants, loads.

What may be used from outside; each name loads on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOMES = {
    "summation_operator": "forceid.principal.operator",
    "cross_matrix": "forceid.principal.operator",
    "cross": "forceid.principal.operator",
    "axial": "forceid.principal.operator",
    "mass_properties": "forceid.principal.mass",
    "resultant": "forceid.principal.wrench",
    "transport": "forceid.principal.wrench",
    "transport_cov": "forceid.principal.wrench",
    "transport_matrix": "forceid.principal.wrench",
    "distribute": "forceid.principal.loads",
    "solve_loads": "forceid.principal.loads",
    "undetermined": "forceid.principal.loads",
    "objectivity": "forceid.principal.change_of_frame",
}
__all__ = [*_HOMES]

if TYPE_CHECKING:
    from forceid.principal.change_of_frame import objectivity as objectivity
    from forceid.principal.loads import distribute as distribute
    from forceid.principal.loads import solve_loads as solve_loads
    from forceid.principal.loads import undetermined as undetermined
    from forceid.principal.mass import mass_properties as mass_properties
    from forceid.principal.operator import axial as axial
    from forceid.principal.operator import cross as cross
    from forceid.principal.operator import cross_matrix as cross_matrix
    from forceid.principal.operator import summation_operator as summation_operator
    from forceid.principal.wrench import resultant as resultant
    from forceid.principal.wrench import transport as transport
    from forceid.principal.wrench import transport_cov as transport_cov
    from forceid.principal.wrench import transport_matrix as transport_matrix


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'forceid.principal' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
