"""Coefficients of a law of the air as HDF5, by the names of their TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from forceid import __version__
from forceid.files.schema import Field, Group, root_attrs
from forceid.files.stored.netcdf import write_groups


def write_model(path: Path, record: Mapping[str, Any]) -> None:
    """A fitted law: /coefficients with value, std, low, high and covariance by `coefficient`; the rest as
    JSON in attributes. ConfigError: not writable.
    """
    rows = record["coefficient"]
    name = np.array([row["name"] for row in rows], dtype=str)
    fields = {"coefficient": Field(("coefficient",), name, {"long_name": "component and term"})}
    for key in ("value", "std", "low", "high"):
        fields[key] = Field(("coefficient",), np.array([row[key] for row in rows], float))
    fields["covariance"] = Field(
        ("coefficient", "coefficient_2"), np.array(list(record["covariance"].values()), float)
    )
    rest = {key: json.dumps(record[key]) for key in record if key not in ("coefficient", "covariance")}
    root = root_attrs("coefficients of a law", "forceid coefficients", forceid_version=__version__)
    write_groups(path, {"/": Group({}, root), "coefficients": Group(fields, rest)})
