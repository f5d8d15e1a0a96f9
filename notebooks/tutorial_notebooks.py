# %% [markdown]
# # Tutorial: how do you work with forceid in a notebook?
#
# You have arrays, and you want a force with error bars, plots, and a file at the end, without leaving Python.
# In 20 minutes you bring in numpy, pandas and xarray data, change settings, compare methods, and keep what
# you found.

# %%
# %matplotlib inline
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

import forceid

BLUE, ORANGE = "#0072B2", "#D55E00"

# %% [markdown]
# ## 1. Data
#
# Four markers on a small plate of 0.08 kg. It flies up for two seconds while a fan pushes it along x with
# 0.2 N, rising and falling three times. The camera sees 200 frames with 0.2 mm of noise.

# %%
time = np.arange(200) / 100
shape = np.array([[0.1, 0.0, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, 0.0, 0.1]])
names = ["nose", "left", "right", "top"]
mass, rate = 0.08, 2 * np.pi * 1.5
push = 0.2 * np.sin(rate * time)  # N, along x
path = np.outer(time, [2.0, 0.0, 5.0]) - 0.5 * np.outer(time**2, [0.0, 0.0, 9.81])
path[:, 0] -= 0.2 / mass / rate**2 * np.sin(rate * time)
noise = 2e-4 * np.random.default_rng(0).standard_normal((200, 4, 3))
tracks = path[:, None] + shape + noise  # time, node, axis; m
known = {"mass": [mass / 4] * 4, "gravity": [0.0, 0.0, -9.81]}

# %% [markdown]
# ## 2. Three ways in, one result
#
# Numpy arrays need names for the nodes. A pandas table has them in its columns. An xarray array has
# dimensions in any order, and `names` says what they mean.

# %%
from_numpy = forceid.motion(tracks, time, nodes=names, **known)

columns = [f"{name}_{axis}" for name in names for axis in "xyz"]
table = pd.DataFrame(tracks.reshape(200, 12), pd.Index(time, name="time"), columns)
from_pandas = forceid.motion(table, **known)

array = xr.DataArray(tracks.transpose(1, 2, 0), {"t": time, "marker": names}, ("marker", "xyz", "t"))
from_xarray = forceid.motion(array, names={"time": "t", "node": "marker", "axis": "xyz"}, **known)

assert from_numpy["motion"].identical(from_pandas["motion"])
assert from_numpy["motion"].identical(from_xarray["motion"])
from_numpy

# %% [markdown]
# ## 3. Estimate, and look
#
# A motion is an `xarray.DataTree`, and so is a result. Select by name, as everywhere in xarray.

# %%
result = forceid.estimate(from_numpy)
force = result["estimate/force"].sel(axis="x")
print(result["estimate"].attrs["verdict"], float(abs(force).max()), "N")
error = float(np.sqrt(((force.values - push) ** 2).mean()))
print(f"error {error:.4f} N rms")
assert error < 0.02
result.forceid.plot()

# %% [markdown]
# A result goes into a table for other tools, and into numbers for a paper.

# %%
print(result.forceid.to_dataframe()[["force_x", "force_std_x"]].iloc[::40])
numbers = forceid.summarize(result)
print("rms force (N):", numbers.force_rms.round(3))

# %% [markdown]
# ## 4. Settings are keywords
#
# Every key of the settings file is a keyword of `estimate`. A wrong one is refused, with the nearest known
# name.

# %%
try:
    forceid.estimate(from_numpy, metod="savgol")
except Exception as error_told:
    print(error_told)

methods = {}
for method in ("smoother", "savgol", "spline", "difference"):
    found = forceid.estimate(from_numpy, method=method)["estimate"]
    off = found.force.sel(axis="x").values - push
    methods[method] = float(np.sqrt((off[20:-20] ** 2).mean()))
    print(f"{method:10} {methods[method]:.4f} N rms, {found.attrs['verdict']}")
assert min(methods, key=methods.get) == "smoother"

compared = Figure(figsize=(6, 2.6), layout="constrained")
axes = compared.subplots()
axes.barh(list(methods), list(methods.values()), color=[BLUE] + [ORANGE] * 3)
axes.set(xlabel="error of the force along x, rms (N)")
axes.invert_yaxis()
compared

# %% [markdown]
# ## 5. Gaps are NaN
#
# Hide a marker for a quarter of a second. The estimate bridges it beside its neighbors. Never fill gaps
# yourself: the filling looks like a measurement.

# %%
hidden = tracks.copy()
hidden[80:105, 0] = np.nan
gappy = forceid.estimate(forceid.motion(hidden, time, nodes=names, **known))
print(gappy["estimate"].attrs["verdict"], gappy["estimate"].attrs["reasons"][:120])
off = gappy["estimate/force"].sel(axis="x").values - push
assert np.sqrt((off**2).mean()) < 0.03

# %% [markdown]
# ## 6. Keep it
#
# `save` writes motion and result as HDF5. Matlab, h5py and xarray open them, and so does the command line.

# %%
with TemporaryDirectory() as folder:
    forceid.save(from_numpy, Path(folder) / "plate.h5")
    forceid.save(result, Path(folder) / "plate.result.h5")
    again = forceid.estimate(forceid.open_motion(Path(folder) / "plate.h5"))
    assert np.array_equal(again["estimate/force"].values, result["estimate/force"].values)
    print(sorted(path.name for path in Path(folder).iterdir()))

# %% [markdown]
# `forceid.show_report(result)` shows the whole report within a notebook: figures, numbers, settings, verdict.
# The pages of functions have shapes and units of everything used here.
