"""What a tree can do: `tree.forceid.estimate()`, `result.forceid.plot()`, by the public names of forceid."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import forceid
from forceid.errors import DataError
from forceid.files.values import likeliest_name

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class Accessor:
    """The accessor `forceid` of a DataTree, a motion or a result; there once forceid made or read a tree.

    >>> import forceid
    >>> result = forceid.open_motion("data/synthetic/top.h5").forceid.estimate(method="difference")
    >>> list(result.forceid.to_dataframe().columns[:3])
    ['force_x', 'force_y', 'force_z']
    """

    def __init__(self, tree: xr.DataTree) -> None:
        self._tree = tree

    def estimate(self, config: Any = None, **settings: Any) -> xr.DataTree:
        """See `forceid.estimate`."""
        return forceid.estimate(self._tree, config, **settings)

    def inspect(self, config: Any = None, **settings: Any) -> Any:
        """See `forceid.inspect`."""
        return forceid.inspect(self._tree, config, **settings)

    def plot(self, ax: Any = None) -> Any:
        """See `forceid.plot_wrench`; of a result."""
        return forceid.plot_wrench(self._result(), ax=ax)

    def report(self) -> Any:
        """See `forceid.show_report`; of a result."""
        return forceid.show_report(self._result())

    def summarize(self) -> Any:
        """See `forceid.summarize`; of a result."""
        return forceid.summarize(self._result())

    def save(self, path: str | Path) -> Path:
        """See `forceid.save`."""
        return forceid.save(self._tree, path)

    def to_dataframe(self, group: str = "", variables: Sequence[str] = ()) -> pd.DataFrame:
        """What varies in time as a table: a row a time (s), columns as force_x, position_tip_x in SI.

        group: of the tree, /estimate of a result or /motion if not given; variables: only these. Covariances
        (`wrench_cov`) and other matrices come where they are named.
        """
        import pandas as pd

        name = group or ("estimate" if "estimate" in self._tree.children else "motion")
        if name not in self._tree.children:
            hint = likeliest_name(name, list(self._tree.children), "name one that it has")
            raise DataError(f"has no group {name!r}", "tree", hint)
        data, columns = self._tree.children[name].to_dataset(), {}
        over_time = {str(k): v for k, v in data.data_vars.items() if v.dims[:1] == ("time",)}
        for wanted in variables:
            if wanted not in over_time:
                hint = likeliest_name(wanted, list(over_time), "name one that varies in time")
                raise DataError(f"has no variable {wanted!r} over time", f"tree:/{name}", hint)
        plain = [k for k, v in over_time.items() if not any(str(dim).endswith("_2") for dim in v.dims)]
        for called in variables or plain:
            values = over_time[called]
            for at in np.ndindex(values.shape[1:]):
                labels = [
                    str(data[dim].values[k]) if dim in data.coords else str(k)
                    for dim, k in zip(values.dims[1:], at, strict=True)
                ]
                columns["_".join([called, *labels])] = values.values[(slice(None), *at)]
        return pd.DataFrame(columns, index=pd.Index(data["time"].values, name="time"))

    def _result(self) -> xr.DataTree:
        if "estimate" not in self._tree.children:
            what = "is a motion, expected a result"
            raise DataError(what, "tree", "estimate it first: tree.forceid.estimate()")
        return self._tree
