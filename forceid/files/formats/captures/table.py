"""The formats of captures, each recognized by how its files begin: a line here for a new one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from forceid.files.formats.captures.capture import Capture, head_of
from forceid.files.formats.captures.motive import is_motive, read_motive
from forceid.files.formats.captures.qualisys import is_qualisys, read_qualisys
from forceid.files.formats.captures.ros_pose import is_ros_pose, read_ros_pose
from forceid.files.formats.captures.vicon import is_vicon, read_vicon
from forceid.files.formats.mocap import is_c3d, is_trc, read_c3d, read_trc


@dataclass(frozen=True)
class Format:
    """A format: its name, whether a file that begins so is one, its reader, and the axis that points up."""

    name: str
    begins: Callable[[str], bool]
    read: Callable[[Path], Capture]
    up: str = "z"


FORMATS = (
    Format("Vicon CSV", is_vicon, read_vicon),
    Format("Motive CSV", is_motive, read_motive, up="y"),
    Format("Qualisys TSV", is_qualisys, read_qualisys),
    Format("ROS pose CSV", is_ros_pose, read_ros_pose),
    Format("TRC", is_trc, read_trc, up="y"),
    Format("C3D", is_c3d, read_c3d),
)
ENDINGS = {".trc": "TRC", ".c3d": "C3D"}  # of files that are this even where they do not begin so


def format_of(path: Path) -> Format | None:
    """The format of a capture, by how the file begins, else by its ending; None for any other file."""
    head = head_of(path)
    found = next((one for one in FORMATS if one.begins(head)), None)
    named = ENDINGS.get(path.suffix.lower())
    return found or next((one for one in FORMATS if one.name == named), None)
