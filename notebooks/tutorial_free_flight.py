# %% [markdown]
# # Tutorial: what did the air do to this disc?
#
# A disc is thrown, and cameras follow nine markers on it, 500 times a second. Nothing touches it but air. In
# 20 minutes you go from the tracks to the force of the air, read the verdict, check the error bars, and see
# what better or worse cameras would change. You need no aerodynamics.

# %%
# %matplotlib inline
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import forceid

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
BLUE, ORANGE = "#0072B2", "#D55E00"

# %% [markdown]
# ## 1. Look before you estimate
#
# A motion file holds the tracks, the body and gravity. Here the body is known as a whole: total mass, mass
# center and inertia. `inspect` says what the record can tell, before anything runs.

# %%
flight = forceid.open_motion(here.parent / "data" / "synthetic" / "frisbee.h5")
print(flight["motion/position"].dims, flight["motion/position"].shape)
print(float(flight["body/total_mass"]), "kg, gravity", flight["motion"].attrs["gravity"])
print(flight.forceid.inspect())

# %% [markdown]
# Three lines matter most. *noise* is how well a marker is seen. *turn* is how far the body turns from frame
# to frame: beyond 180 degrees the sense of the turn is lost. *costs* says what a wrong body would do: one
# percent of mass is so and so many newtons.
#
# ## 2. Estimate
#
# One call. The force is what the surroundings do to the body, weight excluded. So a stone in a vacuum would
# show zero.

# %%
result = forceid.estimate(flight)
estimate = result["estimate"]
print("verdict:", estimate.attrs["verdict"])
print("because:", estimate.attrs["reasons"] or "nothing to say")


def drawn(estimate, truth, title):
    """Force by axis with its band of two standard deviations, beside the truth."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    for axes, name in zip(figure.subplots(3, 1, sharex=True), "xyz", strict=True):
        force, std = estimate.force.sel(axis=name), estimate.force_std.sel(axis=name)
        axes.fill_between(estimate.time, force - 2 * std, force + 2 * std, color=BLUE, alpha=0.3, lw=0)
        axes.plot(estimate.time, force, color=BLUE, label="estimate, two standard deviations")
        axes.plot(truth.time, truth.force.sel(axis=name), "k--", lw=0.8, label="truth")
        axes.set_ylabel(f"$F_{name}$ (N)")
    axes.set_xlabel("time (s)")
    axes.legend(fontsize=8)
    figure.suptitle(title)
    return figure


drawn(estimate, flight["truth"], "Force of the air on the disc")

# %% [markdown]
# Two newtons upward carry the disc, and the drag along x is near 0.7 N. The verdict is `ok`, and it has
# something to add: the disc wobbles, and the wobble shows in the moment. Always read the reasons.
#
# ## 3. Are the error bars honest?
#
# This file is made, so it brings the truth. In your own work it is missing, and the error bars have to be
# trusted. Here you can check them: two standard deviations should hold the truth about 95 times of 100.

# %%
off = estimate.force - flight["truth"].force
within = float((abs(off) < 2 * estimate.force_std).mean())
numbers = forceid.summarize(result)
print(f"{within:.0%} of the samples within two standard deviations")
print("error (N):", numbers.force_error.round(4), " claimed:", numbers.force_std.round(4))
assert within > 0.85
assert np.linalg.norm(numbers.force_error) < 0.02

# %% [markdown]
# ## 4. What do noise and frame rate cost?
#
# Make the tracks worse: add noise of 1 mm, and take every fourth frame only. The error grows a little, and
# the claim grows more: of worse tracks less can be promised.

# %%
rng = np.random.default_rng(1)
tracks, time = flight["motion/position"].values, flight["motion"].time.values
body = {name: flight[f"body/{name}"].values for name in ("total_mass", "mass_center", "inertia")}
body |= {"shape": flight["body/position"].values, "gravity": [0.0, 0.0, -9.81]}
worse = {
    "as it is": (tracks, time),
    "1 mm of noise": (tracks + 1e-3 * rng.standard_normal(tracks.shape), time),
    "every 4th frame": (tracks[::4], time[::4]),
}
rows = []
for name, (seen, when) in worse.items():
    found = forceid.estimate(forceid.motion(seen, when, **body))["estimate"]
    true = flight["truth"].force.sel(time=when)
    error = float(np.sqrt(((found.force.values - true.values) ** 2).mean()))
    claim = float(np.sqrt((found.force_std.values**2).mean()))
    rows.append((name, error, claim))
    print(f"{name:16} error {error:.4f} N, claimed {claim:.4f} N, {found.attrs['verdict']}")
assert rows[1][1] > rows[0][1]

cost = Figure(figsize=(6, 3), layout="constrained")
axes = cost.subplots()
place = np.arange(len(rows))
axes.barh(place - 0.2, [row[1] for row in rows], 0.4, color=ORANGE, label="error")
axes.barh(place + 0.2, [row[2] for row in rows], 0.4, color=BLUE, label="claimed")
axes.set(yticks=place, yticklabels=[row[0] for row in rows], xlabel="force, rms per axis (N)")
axes.legend(fontsize=8)
cost

# %% [markdown]
# ## 5. Your turn
#
# Put your tracks into a table with columns `time`, `nose_x`, `nose_y`, ... in meters. State the mass that
# each marker stands for. Then:
#
# ```python
# table = pandas.read_csv("throw.csv", index_col="time")
# motion = forceid.motion(table, mass=[0.02, 0.02, 0.02], gravity=[0.0, 0.0, -9.81])
# result = forceid.estimate(motion)
# forceid.show_report(result)
# ```
#
# If the verdict is `degraded`, its reason says what to measure. If it is `refused`, the record does not show
# a force, and the reason says why.
