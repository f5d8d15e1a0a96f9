from forceid.laws.fitted import FittedLaw as FittedLaw
from forceid.laws.flights import fit_flights as fit_flights
from forceid.laws.law import LawSetting as LawSetting
from forceid.laws.law import law_setting as law_setting
