"""The priors that a load may have, by the name that settings give: how each is tuned on a record."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Protocol

from forceid.flight.priors.periodic import tune_periodic
from forceid.flight.priors.protocol import Tuned
from forceid.flight.tuning import tune_loads


class Tuning(Protocol):
    """A search for the kernel that a record calls for, with the arguments of `tune_loads`."""

    def __call__(self, *channels: Any, **more: Any) -> Tuned:
        """The kernel and the noise."""


PRIORS: Mapping[str, Tuning] = MappingProxyType({"matern": tune_loads, "periodic": tune_periodic})
