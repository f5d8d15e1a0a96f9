"""Bodies of URDF, SDF and OpenSim files: mass, center and inertia of a link, in its own axes.

A document type may bring entities that grow without end, or files from elsewhere: a file with one is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.files.formats.bodies.mass_properties import (
    MassProperties,
    checked,
    numbers_of,
    symmetric,
    text_of,
)
from forceid.records import Array

SIX = ("xx", "yy", "zz", "xy", "xz", "yz")


def xml_bodies(path: Path) -> dict[str, Callable[[], MassProperties]]:
    """What reads each body of an XML file, by its name. DataError: not one of these formats."""
    text = text_of(path)
    if "<!doctype" in text.lower():
        raise DataError("has a DOCTYPE, expected none", str(path), "delete it: these formats need none")
    try:
        root = ElementTree.fromstring(text.encode())
    except (ElementTree.ParseError, ValueError) as e:
        raise DataError(f"is no XML ({e})", str(path), "export it again") from e
    kinds = {"robot": urdf_links, "sdf": sdf_links, "OpenSimDocument": osim_bodies}
    if root.tag not in kinds:
        what = f"is XML of <{root.tag}>, expected {', '.join(f'<{k}>' for k in kinds)}"
        raise DataError(what, str(path), "give a URDF, SDF or OpenSim file")
    return kinds[root.tag](root, str(path))


def urdf_links(root: Element, where: str) -> dict[str, Callable[[], MassProperties]]:
    """The links of a URDF file: the inertia is about the center, in the axes of its origin."""

    def read(link: Element, name: str) -> MassProperties:
        at = f"{where}: link {name}"
        inertial = child(link, "inertial", at)
        origin = inertial.find("origin")
        xyz, rpy = (
            np.zeros(3) if origin is None else numbers_of(origin.get(key, "0 0 0"), 3, f"{at}: origin {key}")
            for key in ("xyz", "rpy")
        )
        mass = float(numbers_of(child(inertial, "mass", at).get("value"), 1, f"{at}: mass value")[0])
        inertia = child(inertial, "inertia", at)
        six = [float(numbers_of(inertia.get(f"i{ij}"), 1, f"{at}: inertia i{ij}")[0]) for ij in SIX]
        R = Rotation.from_euler("xyz", rpy).as_matrix()
        return checked(MassProperties(name, mass, xyz, R @ symmetric(*six) @ R.T), at)

    return readers(root.findall("link"), read)


def sdf_links(root: Element, where: str) -> dict[str, Callable[[], MassProperties]]:
    """The links of an SDF file, by model::link too: the inertia is in the axes of the pose of its frame."""

    def read(link: Element, name: str) -> MassProperties:
        at = f"{where}: link {name}"
        inertial = child(link, "inertial", at)
        center, R = sdf_pose(inertial.find("pose"), f"{at}: inertial pose")
        mass = float(numbers_of(child(inertial, "mass", at).text, 1, f"{at}: mass")[0])
        inertia, six = child(inertial, "inertia", at), []
        for ij in SIX:
            found = inertia.find(f"i{ij}")
            none = "0" if found is None and ij[0] != ij[1] else None  # products that are not told are zero
            six.append(float(numbers_of(none if found is None else found.text, 1, f"{at}: i{ij}")[0]))
        return checked(MassProperties(name, mass, center, R @ symmetric(*six) @ R.T), at)

    found = readers(list(root.iter("link")), read)
    for model in root.iter("model"):
        own = readers(model.findall("link"), read)
        found |= {f"{model.get('name', '')}::{name}": reader for name, reader in own.items()}
    return found


def sdf_pose(pose: Element | None, where: str) -> tuple[Array, Array]:
    """Place (3,) m and rotation (3, 3) of a pose: roll, pitch and yaw in rad or degrees, or x y z w."""
    if pose is None or not (pose.text or "").strip():
        return np.zeros(3), np.eye(3)
    if pose.get("relative_to"):
        what = f"is relative to {pose.get('relative_to')!r}, expected the axes of its link"
        raise DataError(what, where, "write it in these")
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers_of(pose.text, 7, where)
        if not np.linalg.norm(values[3:]) > 0:
            raise DataError("has a quaternion of zeros, expected a rotation", where, "correct it")
        return values[:3], Rotation.from_quat(values[3:]).as_matrix()
    values = numbers_of(pose.text, 6, where)
    degrees = pose.get("degrees", "false") in ("true", "1")
    return values[:3], Rotation.from_euler("xyz", values[3:], degrees=degrees).as_matrix()


def osim_bodies(root: Element, where: str) -> dict[str, Callable[[], MassProperties]]:
    """The bodies of an OpenSim model with the markers on them: inertia about the mass center, body axes."""
    markers: dict[str, dict[str, Array]] = {}
    for marker in root.iter("Marker"):
        frame = marker.findtext("socket_parent_frame") or marker.findtext("body") or ""
        place = numbers_of(marker.findtext("location"), 3, f"{where}: Marker {marker.get('name')}: location")
        markers.setdefault(frame.strip().rsplit("/", 1)[-1], {})[marker.get("name", "")] = place

    def read(body: Element, name: str) -> MassProperties:
        at = f"{where}: Body {name}"
        mass = float(numbers_of(child(body, "mass", at).text, 1, f"{at}: mass")[0])
        center = numbers_of(child(body, "mass_center", at).text, 3, f"{at}: mass_center")
        if body.find("inertia") is not None:
            six = numbers_of(body.findtext("inertia"), 6, f"{at}: inertia").tolist()
        else:  # before OpenSim 4
            six = [
                float(numbers_of(body.findtext(f"inertia_{ij}"), 1, f"{at}: inertia_{ij}")[0]) for ij in SIX
            ]
        return checked(MassProperties(name, mass, center, symmetric(*six), markers.get(name, {})), at)

    return readers(list(root.iter("Body")), read)


def readers(
    elements: list[Element], read: Callable[[Element, str], MassProperties]
) -> dict[str, Callable[[], MassProperties]]:
    """What reads each of some elements, by their names."""
    return {name: partial(read, element, name) for element in elements if (name := element.get("name", ""))}


def child(element: Element, tag: str, where: str) -> Element:
    """A part of an element. DataError: it has none."""
    found = element.find(tag)
    if found is None:
        raise DataError(f"has no <{tag}>, expected one in <{element.tag}>", where, "add it, or name another")
    return found
