"""What a shell completes in place of a scene or a failure; each list is imported when asked for."""

from __future__ import annotations

from forceid.cli.boundary.completion import fitting


def scenes(incomplete: str) -> list[str]:
    """Shipped scenes and bodies in parts by name.

    >>> scenes("solid")
    ['solid_8']
    """
    from evidence.subjects.flights.cases import shipped
    from evidence.subjects.parts.cases import GRIDS

    return fitting([*shipped(), *GRIDS], incomplete)


def failures(incomplete: str) -> list[str]:
    """Failures of the stress map, and groups of them, by name.

    >>> failures("outl")
    ['outliers', 'outlier_size']
    """
    from evidence.stress.failure_table import FAILURES, GROUPS

    return fitting([*GROUPS, *(failure.name for failure in FAILURES)], incomplete)
