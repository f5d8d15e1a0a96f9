"""Mass properties as CAD programs print them: mass, center of mass and moments of inertia, with their units.

SolidWorks, Fusion and Onshape, and what is written like them: a line of the mass, a heading with the center
and three numbers, a heading with the inertia and nine or six numbers named by their axes. Products of inertia
are printed as the integral of x y, or as the entry of the tensor, its opposite: the inertia about the origin
beside that about the center tells which, or the principal axes do.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.bodies.mass_properties import MassProperties, checked, symmetric, text_of
from forceid.files.units import si_factor
from forceid.records import Array

NUMBER = r"[-+]?(?:\d[\d,]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
MASS = re.compile(rf"^\W*mass\s*[:=\t ][ \t]*({NUMBER})[ \t]*(.*)$", re.I | re.M)
CENTER = re.compile(r"cent(?:er|re) of (?:mass|gravity)\b(?![^\n]*output)([^\n]*)", re.I)
HEADING = re.compile(
    r"^.*(?:moments? of inertia|inertia tensor|^\W*inertia\b).*$|^.*taken at the.*$|^.*principal.*$",
    re.I | re.M,
)
ENTRY = re.compile(
    rf"\b([LI])([xyz])([xyz])\s*[:=]?\s*({NUMBER})[ ]*((?![LI][xyz][xyz])[a-z^*²]+[ *]*[a-z^*²0-9]*)?", re.I
)
PRINCIPAL = re.compile(
    rf"\bI([xyz])\s*=\s*\(\s*({NUMBER}),\s*({NUMBER}),\s*({NUMBER})\)\s*P\1\s*=\s*({NUMBER})"
)
WORDS = {
    "kilogram": "kg", "gram": "g", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in",
    "inche": "in", "pound": "lb", "foot": "ft", "feet": "ft",
}  # fmt: skip
SIDES = ((0, 1), (0, 2), (1, 2))
CLEAR = 5.0  # times as near must one sign be as the other


def cad_body(path: Path, products: str = "") -> MassProperties:
    """The body of a printed text; products: "integral" or "tensor" where the text itself does not tell.

    DataError: a number or its unit is missing, or the sign of products is told by nothing.
    """
    text, where = text_of(path), str(path)
    if (mass := MASS.search(text)) is None:
        what = "has no line of the mass, expected one as in 'Mass = 1.2 kilograms'"
        raise DataError(what, where, "copy all of the mass properties; or give a URDF, SDF or OpenSim file")
    if not mass[2].strip():
        raise DataError("has a mass without a unit", where, "add it: Mass = 1.2 kilograms")
    kilograms = number(mass[1]) * si_factor(unit(mass[2]), "kg", f"{where}: mass")
    center = center_of(text, where)
    blocks = inertias(text, where)
    if not blocks:
        what = "has no moments of inertia, expected Ixx to Izz or Lxx to Lzz"
        raise DataError(what, where, "copy all of the mass properties")
    shift = kilograms * (center @ center * np.eye(3) - np.outer(center, center))
    about = {place: np.diag(np.diag(J)) for place, J in blocks.items()}
    sign = sign_of_products(text, blocks, shift, products, where)
    own = {place: about[place] + sign * (J - about[place]) for place, J in blocks.items()}
    inertia = own["center"] if "center" in own else own["origin"] - shift
    return checked(MassProperties(path.stem, kilograms, center, inertia), where)


def number(text: str) -> float:
    """A number, thousands parted by commas or not."""
    return float(text.replace(",", ""))


def unit(text: str) -> str:
    """A unit in words as powers.

    >>> unit("( kilograms * square meters )"), unit("g mm²"), unit("pounds")
    ('kg*m^2', 'g mm²', 'lb')
    """
    inner = re.sub(r"[()]", " ", text).strip().removesuffix(".").strip()
    powers = {"square": "^2", "cubic": "^3"}
    found, power = [], ""
    for word in re.split(r"\s*\*\s*|\s+", inner):
        if word.lower() in powers:
            power = powers[word.lower()]
            continue
        known = WORDS.get(word.lower()) or WORDS.get(word.lower().removesuffix("s"))
        if known is None:
            return inner  # in powers already
        found.append(known + power)
        power = ""
    return "*".join(found)


def center_of(text: str, where: str) -> Array:
    """The center of mass (3,) m: behind its heading, unit in the heading or behind every number."""
    for heading in CENTER.finditer(text):
        rest = heading[1] + "\n" + "\n".join(text[heading.end() :].lstrip("\n").split("\n")[:4])
        found = re.findall(rf"(?<![\w.])({NUMBER})[ \t]*([a-z]+)?", rest, re.I)[:3]
        between = (
            re.sub(r"[\d\s.,:=()XYZ+-]|e[-+]?\d", "", rest.split(found[0][0])[0], flags=re.I) if found else ""
        )
        if len(found) < 3 or "inertia" in between.lower():
            continue
        units = [between or "?" if own.upper() in ("", "X", "Y", "Z") else own for _, own in found]
        if "?" in units:
            raise DataError("has a center of mass without a unit", where, "add it: ( millimeters )")
        return np.array(
            [
                number(v) * si_factor(unit(u), "m", f"{where}: center of mass")
                for (v, _), u in zip(found, units, strict=True)
            ]
        )
    raise DataError("has no center of mass, expected one with three numbers", where, "copy all of the text")


def inertias(text: str, where: str) -> dict[str, Array]:
    """Inertias (3, 3) kg m2 as printed, about the "center" and the "origin", as far as they are there."""
    found: dict[str, Array] = {}
    marks = [*HEADING.finditer(text)]
    stops = [*(m.start() for m in marks), len(text)][1:]
    stated = ""
    for mark, stop in zip(marks, stops, strict=True):
        if in_brackets := re.search(r"\(([^()]*)\)", mark[0]):
            stated = in_brackets[1] if "notation" not in in_brackets[1].lower() else stated
        entries = [m.groups() for m in ENTRY.finditer(text, mark.end(), stop)]
        values = {"".join(sorted((i + j).lower())): (number(v), own) for _, i, j, v, own in entries}
        if "principal" in mark[0].lower() or not {"xx", "yy", "zz"} <= values.keys():
            continue
        of_center = entries[0][0] == "L" or bool(
            re.search(r"cent(?:er|re) of (?:mass|gravity)", mark[0], re.I)
        )
        six = []
        for key in ("xx", "yy", "zz", "xy", "xz", "yz"):
            value, own = values.get(key, (0.0, None))
            six.append(value * si_factor(unit(own or stated), "kg m2", f"{where}: {mark[0].strip()[:40]}"))
        found.setdefault("center" if of_center else "origin", symmetric(*six))
    return found


def sign_of_products(
    text: str, blocks: Mapping[str, Array], shift: Array, products: str, where: str
) -> float:
    """By what products as printed become entries of the tensor: 1 or -1."""
    if products:
        return -1.0 if products == "integral" else 1.0
    if all(abs(J[i, j]) < 1e-6 * np.trace(J) for J in blocks.values() for i, j in SIDES):
        return 1.0  # there are none
    off: dict[float, float] = {}
    if len(blocks) == 2:
        apart = blocks["origin"] - blocks["center"]
        off = {s: sum(abs(s * apart[i, j] - shift[i, j]) for i, j in SIDES) for s in (1.0, -1.0)}
    axes = PRINCIPAL.findall(text)
    if not told(off) and len(axes) == 3 and "center" in blocks:
        A, P = np.array([[number(v) for v in row[1:4]] for row in axes]), [number(row[4]) for row in axes]
        J = blocks["center"] * (sum(P) / np.trace(blocks["center"]))  # in the units of the text
        whole = A.T @ np.diag(P) @ A
        off = {s: sum(abs(s * J[i, j] - whole[i, j]) for i, j in SIDES) for s in (1.0, -1.0)}
    if not told(off):
        what = "does not tell the sign of its products of inertia"
        raise DataError(what, where, 'add [import.body] products = "integral" (of x y) or "tensor"')
    return min(off, key=lambda s: off[s])


def told(off: Mapping[float, float]) -> bool:
    """Whether one sign is much nearer than the other."""
    return any(CLEAR * a < b for a, b in [*pairwise(off.values()), *pairwise([*off.values()][::-1])])
