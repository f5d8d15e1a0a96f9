"""What of a capture is the motion: its markers, or the pose of one body in it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.errors import ConfigError, DataError
from forceid.files.formats.captures.capture import Capture, listed
from forceid.files.formats.segments import known_name
from forceid.files.formats.signals import Signals
from forceid.import_settings import CaptureSetting, ImportSettings
from forceid.records import Array

TABLE = "[import.capture]"


def chosen(capture: Capture, settings: ImportSettings, where: str) -> Signals:
    """The markers, or the pose of a body, as variables of /motion.

    Markers where there are any, but the pose where the settings know the body as a rigid whole and name no
    marker. The tracked origin of a pose becomes the mass center, which the settings give in its axes.
    """
    setting, body = settings.capture or CaptureSetting(), settings.body
    stated = body.position or body.mass or body.table or settings.segment
    whole = body.total_mass is not None and not stated
    use = setting.use or ("pose" if capture.pose and (whole or not capture.name) else "markers")
    if use == "pose":
        if not capture.pose:
            raise ConfigError("has no pose of a body, expected markers", where, f"drop use of {TABLE}")
        name = setting.body or (next(iter(capture.pose)) if len(capture.pose) == 1 else "")
        if not name:
            what = f"holds {len(capture.pose)} bodies ({', '.join(capture.pose)}), expected one"
            raise ConfigError(what, where, f'name it: {TABLE} body = "{next(iter(capture.pose))}"')
        known_name(name, tuple(capture.pose), f"{TABLE} body:")
        others = [f"pose of {other}" for other in capture.pose if other != name]
        others += [f"{len(capture.name)} markers"] if capture.name else []
        found = centered(*capture.pose[name], body.mass_center)
        return Signals({"time": capture.time} | found, left_out=(*capture.left_out, *others))
    if not capture.name:
        raise DataError("holds no markers", where, 'take the pose: use = "pose"')
    at = list(range(len(capture.name)))
    if setting.body and not setting.markers:
        at = [k for k in at if capture.name[k].startswith(setting.body)]
        if not at:
            what = f"has no marker that begins with {setting.body!r}"
            raise ConfigError(what, where, f"it has {', '.join(capture.name[:6])}")
    elif setting.markers:
        at = [known_name(name, capture.name, f"{TABLE} markers:") for name in setting.markers]
    names = tuple(capture.name[k] for k in at)
    unused = [name for name in capture.name if name not in names]
    others = [f"markers {listed(unused)}"] if unused else []
    others += [f"pose of {name}" for name in capture.pose]
    found = {"time": capture.time, "position": capture.position[:, at]}
    return Signals(found, names, left_out=(*capture.left_out, *others))


def centered(origin: Array, orientation: Array, mass_center: tuple[float, ...]) -> dict[str, Array]:
    """Mass center (time, 3) m and orientation (time, 4); not seen where the turn is none, as all zero is."""
    norm = np.linalg.norm(orientation, axis=1)
    seen = np.isfinite(origin).all(1) & (norm > 0)
    center, turn = np.full(origin.shape, np.nan), np.full(orientation.shape, np.nan)
    R_world_body = Rotation.from_quat(orientation[seen])
    center[seen] = origin[seen] + R_world_body.apply(np.asarray(mass_center, float))
    turn[seen] = orientation[seen]
    return {"center": center, "orientation": turn}
