# ruff: noqa: I001 (in the order in which they are read about)
from forceid.files.tree import open_motion as open_motion
from forceid.files.arrays import motion as motion
from forceid.files.tree import import_ as import_
from forceid.estimation.inspection import inspect as inspect
from forceid.estimation.long.windows import estimate as estimate
from forceid.estimation.live.run import live as live
from forceid.files.tree import save as save
from forceid.principal.operator import summation_operator as summation_operator
from forceid.principal.mass import mass_properties as mass_properties
from forceid.principal.wrench import resultant as resultant
from forceid.principal.loads import distribute as distribute
from forceid.report.notebook import headline as headline
from forceid.report.notebook import plot_load as plot_load
from forceid.report.notebook import plot_motion as plot_motion
from forceid.report.notebook import plot_path as plot_path
from forceid.report.notebook import plot_wrench as plot_wrench
from forceid.report.notebook import show_report as show_report
from forceid.report.notebook import summarize as summarize

__version__: str
