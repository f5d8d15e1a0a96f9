"""The d'Alembert-Lagrange principal equations: summation operator, mass, resultants, loads."""

from __future__ import annotations

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
