"""A rigid body out of a file of another program: the settings that name it, filled in."""

from __future__ import annotations

import difflib
from pathlib import Path

from forceid.errors import ConfigError
from forceid.files.formats.bodies.cad_text import cad_body
from forceid.files.formats.bodies.mass_properties import MassProperties, text_of
from forceid.files.formats.bodies.xml_bodies import xml_bodies
from forceid.import_settings import BodySetting, ImportSettings
from forceid.records import Array


def with_body_file(settings: ImportSettings, where: str) -> ImportSettings:
    """The settings with mass, center and inertia of the body that [import.body] file and link name, if any.

    The file is beside the source. Places of markers on an OpenSim body are taken too. ConfigError: a link
    that the file has not, or mass that is given twice.
    """
    body = settings.body
    if not body.file:
        return settings
    if body.total_mass is not None or body.inertia is not None or body.mass or body.table or settings.segment:
        raise ConfigError(
            "has file beside a mass of its own, expected one of them", "[import.body]:", "drop one"
        )
    found = body_of(Path(where).parent / body.file, body)
    filled = {
        "total_mass": found.mass, "mass_center": vector(found.center),
        "inertia": tuple(vector(row) for row in found.inertia),
    }  # fmt: skip
    if found.marker and not body.position:
        filled["position"] = {name: vector(place) for name, place in found.marker.items()}
    return settings.model_copy(update={"body": body.model_copy(update=filled)})


def body_of(path: Path, body: BodySetting) -> MassProperties:
    """The body that the settings name in a file: of an XML file a link, of another what it prints."""
    if not text_of(path).lstrip().startswith("<"):
        if body.link:
            raise ConfigError(f"names link {body.link!r} of a text of one body", "[import.body]:", "drop it")
        return cad_body(path, body.products)
    known = xml_bodies(path)
    name = body.link or (next(iter(known)) if len(known) == 1 else "")
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.0) if name else [*known][:1]
        what = f"has {len(known)} bodies ({', '.join([*known][:4])}), " + (
            f"none named {name!r}" if name else "expected link, which names one"
        )
        raise ConfigError(what, str(path), f'link = "{near[0]}"?' if near else "give another file")
    return known[name]()


def vector(values: Array) -> tuple[float, float, float]:
    """Three numbers."""
    x, y, z = values.tolist()
    return x, y, z
