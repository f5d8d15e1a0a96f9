"""forceid: what pushed a body, from how it moved.

The public names load on first use, so that `import forceid` costs no scipy.

>>> import forceid
>>> "estimate" in dir(forceid)
True
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forceid.face import on_first_use

__version__ = "0.1.0"

_PUBLIC = {
    "open_motion": "forceid.files.tree",
    "estimate": "forceid.estimation.run",
    "live": "forceid.estimation.live.run",
    "summation_operator": "forceid.principal.operator",
    "mass_properties": "forceid.principal.mass",
    "resultant": "forceid.principal.wrench",
    "distribute": "forceid.principal.loads",
    "plot_wrench": "forceid.report.notebook",
    "show_report": "forceid.report.notebook",
    "summarize": "forceid.report.notebook",
}
__all__ = ["__version__", *_PUBLIC]

if TYPE_CHECKING:
    from forceid.estimation.live.run import live as live
    from forceid.estimation.run import estimate as estimate
    from forceid.files.tree import open_motion as open_motion
    from forceid.principal.loads import distribute as distribute
    from forceid.principal.mass import mass_properties as mass_properties
    from forceid.principal.operator import summation_operator as summation_operator
    from forceid.principal.wrench import resultant as resultant
    from forceid.report.notebook import plot_wrench as plot_wrench
    from forceid.report.notebook import show_report as show_report
    from forceid.report.notebook import summarize as summarize


__getattr__ = on_first_use(__name__, _PUBLIC)


def __dir__() -> list[str]:
    return sorted(__all__)
