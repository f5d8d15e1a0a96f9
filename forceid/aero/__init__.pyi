from forceid.aero.air import density_of as density_of
from forceid.aero.air import wind_at as wind_at
from forceid.aero.axes import Flow as Flow
from forceid.aero.axes import cross as cross
from forceid.aero.axes import dot as dot
from forceid.aero.axes import flow as flow
from forceid.aero.quantities import aero_of as aero_of
