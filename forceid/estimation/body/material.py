"""The material of a body, by the name and the constants that a file or the settings state."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from forceid.config import Settings
from forceid.errors import ConfigError, DataError, ForceIdError
from forceid.pseudorigid import (
    HadamardGreen,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    PerfectGas,
    StVenantKirchhoff,
    piola,
    viscous,
)
from forceid.records import Array, Body

LAWS: dict[str, tuple[Any, str]] = {  # class, and which of its constants are energies (J, or Pa by volume)
    "mooney_rivlin": (MooneyRivlin, "a b c d"),
    "neo_hookean": (NeoHookean, "a c d"),
    "hadamard_green": (HadamardGreen, "alpha beta c d"),
    "ogden": (Ogden, "alpha beta c d"),
    "st_venant_kirchhoff": (StVenantKirchhoff, "lam mu"),
    "perfect_gas": (PerfectGas, "K"),
}


@dataclass(frozen=True)
class Solid:
    """Elastic law W (J, whole body) with Kelvin-Voigt damping (J s): P = dW/dF + damping F d(F^T F)/dt."""

    law: Material
    damping: float = 0.0

    def stress(self, F: Array, dF: Array) -> Array:
        """P (..., 3, 3) J at F and its rate dF (..., 3, 3) 1/s: what drives F'' E = N - P."""
        return piola(self.law, F, dF, self.damping)

    def slopes(self, F: Array, dF: Array) -> tuple[Array, Array]:
        """Changes (..., 9, 9) of P by F and by dF, all row by row."""
        units = np.eye(9).reshape(9, 3, 3)
        F, dF = F[..., None, :, :], dF[..., None, :, :]
        by_F = self.law.hessian(F, units)
        by_F = by_F + self.damping * (viscous(units, dF, F) + viscous(F, dF, units))
        by_dF = self.damping * viscous(F, units)
        return tuple(a.reshape(*a.shape[:-2], 9).swapaxes(-1, -2) for a in (by_F, by_dF))  # type: ignore[return-value]


def with_material(body: Body, settings: Settings) -> Body:
    """The body with the material of the settings, if these state one, else with its own, looked at.

    Raises ConfigError or DataError for a material that there is not.
    """
    if settings.material is None:
        solid_of(body)
        return body
    body = replace(body, material=settings.material)
    try:
        solid_of(body)
    except DataError as e:
        raise ConfigError(e.what, "[material]", e.next_step) from e
    return body


def solid_of(body: Body) -> Solid | None:
    """The material of a body, None where none is stated. Raises DataError for one that there is not.

    >>> body = Body(material={"name": "Neo-Hookean", "a": 1.0, "c": 0.5, "volume": 2.0})
    >>> solid_of(body).law.lame()
    Lame(lam=4.0, mu=4.0)
    """
    if body.material is None:
        return None
    where, stated = "/body/material", dict[str, Any](body.material)
    law, energies = LAWS[law_name(stated, where)]
    del stated["name"]
    several = ("alpha", "beta", "gamma", "delta") if law is Ogden else ()
    for name, value in stated.items():
        numbers = value if name in several and isinstance(value, tuple | list) else [value]
        if not all(isinstance(x, float | int) and np.isfinite(x) for x in numbers):
            raise DataError(f"has {name} {value!r}, expected finite numbers", where, f"correct {name}")
    volume, damping = stated.pop("volume", 1.0), stated.pop("damping", 0.0)
    if not volume > 0:
        raise DataError(f"has volume {volume:g}, expected > 0", where, "correct it, or give constants in J")
    if not damping >= 0:
        raise DataError(f"has damping {damping:g}, expected >= 0", where, "a material gains no energy")
    make = law.natural if hasattr(law, "natural") and "d" not in stated else law
    known = [name for name in inspect.signature(law).parameters if name != "incompressible"]
    needed = [n for n, p in inspect.signature(make).parameters.items() if p.default is p.empty]
    of = f"expected of {law.__name__} {', '.join(known)}"
    if odd := [name for name in stated if name not in known]:
        near = difflib.get_close_matches(odd[0], known, n=1, cutoff=0.0)[0]
        raise DataError(f"has {odd[0]!r}, {of}", where, f"did you mean {near!r}?")
    if lacking := [name for name in needed if name not in stated]:
        raise DataError(f"lacks {lacking[0]!r}, {of}", where, f"add {lacking[0]}")
    for name, value in stated.items():
        value = np.multiply(value, volume if name in energies.split() else 1.0)
        stated[name] = tuple(np.atleast_1d(value).tolist()) if name in several else float(value)
    try:
        return Solid(make(**stated), damping * volume)
    except ForceIdError as e:
        raise DataError(f"is out of range: {e.where} {e.what}", where, e.next_step) from e


def law_name(material: Mapping[str, Any], where: str = "/body/material") -> str:
    """The name of the law of a material, as the table has it."""
    if (name := material.get("name")) is None:
        raise DataError("has no name", where, f"name one of {', '.join(LAWS)}")
    plain = {key.replace("_", ""): key for key in LAWS}
    if (found := plain.get(re.sub("[^a-z]", "", str(name).lower()))) is None:
        near = difflib.get_close_matches(str(name).lower(), LAWS, n=1, cutoff=0.0)[0]
        what = f"is {name!r}, expected one of {', '.join(LAWS)}"
        raise DataError(what, where, f"did you mean {near!r}?")
    return found
