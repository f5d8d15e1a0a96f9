from forceid.aero.quantities import aero_of as aero_of
