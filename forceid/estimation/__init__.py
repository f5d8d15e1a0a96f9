"""Where the method is put together: a recording in, the applied wrench and a verdict out.

What may be used from outside; each name loads on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forceid.face import on_first_use

_HOMES = {
    "estimate": "forceid.estimation.run",
    "followed_live": "forceid.estimation.live.run",
    "live_pace": "forceid.estimation.live.run",
    "estimate_source": "forceid.estimation.long.out_of_core",
    "read_recording": "forceid.estimation.long.out_of_core",
    "inspect_recording": "forceid.estimation.inspection",
    "identify_recording": "forceid.estimation.identify",
    "identify_modes": "forceid.estimation.identify",
    "Progress": "forceid.estimation.long.windows",
    "unwatched": "forceid.estimation.long.windows",
    "listed": "forceid.estimation.joints.null_space",
    "undetermined_components": "forceid.estimation.joints.null_space",
    "trading_joints": "forceid.estimation.joints.null_space",
}
__all__ = [*_HOMES]

if TYPE_CHECKING:
    from forceid.estimation.identify import identify_modes as identify_modes
    from forceid.estimation.identify import identify_recording as identify_recording
    from forceid.estimation.inspection import inspect_recording as inspect_recording
    from forceid.estimation.joints.null_space import listed as listed
    from forceid.estimation.joints.null_space import trading_joints as trading_joints
    from forceid.estimation.joints.null_space import undetermined_components as undetermined_components
    from forceid.estimation.live.run import followed_live as followed_live
    from forceid.estimation.live.run import live_pace as live_pace
    from forceid.estimation.long.out_of_core import estimate_source as estimate_source
    from forceid.estimation.long.out_of_core import read_recording as read_recording
    from forceid.estimation.long.windows import Progress as Progress
    from forceid.estimation.long.windows import unwatched as unwatched
    from forceid.estimation.run import estimate as estimate

__getattr__ = on_first_use(__name__, _HOMES)
