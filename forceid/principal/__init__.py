"""The d'Alembert-Lagrange principal equations: summation operator, mass, resultants, loads.

What may be used from outside; each name loads on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forceid.face import on_first_use

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


__getattr__ = on_first_use(__name__, _HOMES)
