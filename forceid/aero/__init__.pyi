from forceid.aero.fitted import FittedLaw as FittedLaw
from forceid.aero.fitted import fit_flights as fit_flights
from forceid.aero.law import LawSetting as LawSetting
from forceid.aero.law import law_setting as law_setting
from forceid.aero.quantities import aero_of as aero_of
