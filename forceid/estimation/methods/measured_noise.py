"""The noise of markers as they show it themselves, against what was stated of it."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.deformation_residual import KNOWN, errors_beyond
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.tracks.marker_errors import MarkerErrors
from forceid.estimation.verdict.catalogue import note
from forceid.flight.color import LowPassed
from forceid.records import Array, Finding, Level, Motion
from forceid.rounding import SINGLE

HEAVY = 5.0  # kurtosis: 3 of normal errors, 4.1 where half of the markers are twice as noisy
SAID = 1.5  # times, or one over it: less is no news to who stated a noise


def judge_filter(kin: Kinematics, band: Array | None = None) -> list[Finding]:
    """Tracks that were low-passed: harmless where loads are not followed up to the cut; band (load,) Hz."""
    color = kin.color
    if not isinstance(color, LowPassed):
        return []
    highest = 0.5 / (color.every * color.step)
    below = band is not None and not (band > (1 - SINGLE) * highest).any()
    return [note("smoothed-at-source", "ok" if below else "degraded", cut_hz=color.cut)]


def may_show(kin: Kinematics, motion: Motion) -> bool:
    """Whether markers are asked for their noise: not where a mass center tells it while the body deforms."""
    return motion.position is not None and not (kin.apart and kin.deforms)


def measured_errors(
    kin: Kinematics, motion: Motion
) -> tuple[MarkerErrors | None, Array | None, tuple[Finding, ...]]:
    """Errors of markers where they show them, with deviations (3,) m along world axes, and what to say of it.

    None where they do not show them, or show what was stated; nor of a body that deforms about a mass center
    known by itself, which tells its own noise, whatever the shapes.
    """
    source = "position"
    seen = errors_beyond(kin, motion) if may_show(kin, motion) else None
    if seen is None:
        return None, None, ()
    errors, std = seen
    # the size of heavy errors is known as well as their fourth moment lets it be
    size = errors.relative * float(np.sqrt(max(errors.kurtosis - 1, 0.0) / 2))
    level: Level = "degraded" if size > KNOWN else "ok"
    heavy = (note("noise-heavy", level, kurtosis=errors.kurtosis),) if errors.kurtosis > HEAVY else ()
    # what is smaller than the noise stated is no motion beside it
    smaller = kin.stated[source] and errors.std * SAID < kin.noise[source]
    color = errors.color if std is not None or smaller else None
    if std is None or (kin.stated[source] and errors.as_stated(kin.noise[source])):
        return None, None, heavy
    ratio = errors.std / kin.noise[source]
    if not kin.stated[source] or 1 / SAID < ratio < SAID or isinstance(color, LowPassed):
        return errors, std, heavy
    told = note("noise-measured", variable=source, stated=kin.noise[source], noise=errors.std)
    return errors, std, (told, *heavy)
