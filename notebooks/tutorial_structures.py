# %% [markdown]
# # Tutorial: what passes through the hinge, and what only bends?
#
# A structure is made of parts, and its parts bend. In 20 minutes you find the force in a hinge from markers
# on both sides, see what bending does to an estimate, and split a force into loads at known places. No
# stiffness is needed for any of it.

# %%
# %matplotlib inline
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import forceid

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
data, config = here.parent / "data" / "synthetic", here.parent / "config"
BLUE, ORANGE = "#0072B2", "#D55E00"

# %% [markdown]
# ## 1. Two parts and a joint
#
# Two blocks on a hinge tumble through the air. Each has eight markers. A short file says which nodes make a
# part, where the joint is, and what it lets go:

# %%
print((config / "two_blocks.toml").read_text())

# %% [markdown]
# `driven = true` says that a spring or a motor may turn the hinge. Without it the moment about the axis is
# zero, and that is one thing less to find. `rigid = true` says that a part does not bend: leave it out unless
# you know.
#
# ## 2. The force in the hinge
#
# Each part is a body in flight. What moves it is weight and the hinge, so its motion tells the hinge force.

# %%
flight = forceid.open_motion(data / "two_blocks.h5")
result = forceid.estimate(flight, config=config / "two_blocks.toml")
hinge = result["interface"].sel(joint="hinge")
print(result["interface"].attrs["verdict"], "- force on", result["interface"].attrs["acts_on"])

truth = flight["truth"].joint_force.isel(joint=0)
figure = Figure(figsize=(8, 5), layout="constrained")
for axes, n in zip(figure.subplots(3, 1, sharex=True), range(3), strict=True):
    force, std = hinge.force[:, n], hinge.force_std[:, n]
    axes.fill_between(hinge.time, force - 2 * std, force + 2 * std, color=BLUE, alpha=0.3, lw=0)
    axes.plot(hinge.time, force, color=BLUE, label="estimate")
    axes.plot(hinge.time, truth[:, n], "k--", lw=0.8, label="truth")
    axes.set_ylabel(f"$F_{'xyz'[n]}$ (N)")
axes.set_xlabel("time (s)")
axes.legend()
figure

# %% [markdown]
# Check it: the error is a few thousandths of three newtons, and the band holds the truth.

# %%
off = (hinge.force - truth).values[16:-16]
rms = float(np.sqrt((off**2).mean()))
print(f"error {rms:.4f} N rms per axis, of {float(np.sqrt((truth.values**2).mean())):.2f} N")
assert result["interface"].attrs["verdict"] == "ok"
assert rms < 0.01

# %% [markdown]
# The force on the whole is another matter. In free flight nothing acts but weight, and weight is excluded. So
# `/estimate` shows zero while three newtons pass through the hinge.

# %%
whole = result["estimate"]
outside = float(np.abs(whole.force.values[16:-16]).max())
print(f"largest force on the whole: {outside:.3f} N")
assert outside < 0.2

# %% [markdown]
# ## 3. A body that bends
#
# A boomerang of springs flexes as it flies. Take it for rigid, and the moment is wrong, because the markers
# move where the rigid body does not. `model = "auto"` (the default) adds the smallest deformation that is
# enough.

# %%
flexible = forceid.open_motion(data / "flexible_boomerang.h5")
found = {model: forceid.estimate(flexible, model=model) for model in ("rigid", "auto")}
error = {}
for model, one in found.items():
    estimate = one["estimate"]
    off = (estimate.moment - flexible["truth"].moment).values[75:-75]
    error[model] = float(np.sqrt((off**2).mean()))
    print(f"{model:6} {error[model]:.4f} N m, verdict {estimate.attrs['verdict']}")
    print("       ", (estimate.attrs["reasons"] or "-")[:150])
assert error["auto"] < error["rigid"] / 3

bars = Figure(figsize=(5, 2.4), layout="constrained")
axes = bars.subplots()
axes.barh(list(error), list(error.values()), color=[ORANGE, BLUE])
axes.set(xlabel="error of the moment, rms per axis (N m)")
bars

# %% [markdown]
# The force is the same in both: the mass center does not care how the body bends. And the verdict of the
# rigid model is `degraded`, with the reason that the markers do not fit a rigid body. That is how you notice.
#
# ## 4. Loads at known places
#
# Six numbers say what acts as a whole. If you know where loads act, and along which line, forceid solves
# for them. Here a thrown disc is asked for three forces at its mass center: a lift along its own axis, and
# two forces along x and y.

# %%
disc = forceid.open_motion(data / "frisbee.h5")
lift = {"name": "lift", "direction": [0.0, 0.0, 1.0], "axes": "body"}
along = [{"name": f"along {n}", "direction": d} for n, d in (("x", [1.0, 0, 0]), ("y", [0, 1.0, 0]))]
forces = [{**load, "point": "mass_center"} for load in (lift, *along)]
three = forceid.estimate(disc, model="rigid", load=forces)["load"]
for load, value in zip(forces, three["load"].mean("time").values, strict=True):
    print(f"{load['name']:8} {value:6.3f} N on the mean")
print("chi-square", round(float(three["chi_square"].median())), "of", three.attrs["dof"], "degrees")

# %% [markdown]
# The chi-square should be near its degrees of freedom. It is thousands of times larger. So forces at the mass
# center cannot be all: they make no moment, and the disc shows one. Add a moment about each axis of the disc.

# %%
moments = [
    {"name": f"moment {n}", "kind": "moment", "axes": "body", "direction": d, "point": "mass_center"}
    for n, d in zip("xyz", np.eye(3).tolist(), strict=True)
]
six = forceid.estimate(disc, model="rigid", load=[*forces, *moments])["load"]
for load, value in zip([*forces, *moments], six["load"].mean("time").values, strict=True):
    print(f"{load['name']:8} {value:7.4f} {'N m' if 'kind' in load else 'N'} on the mean")
assert 1.5 < float(six["load"].mean("time")[0]) < 2.5
assert float(three["chi_square"].median()) > 100 * three.attrs["dof"]

# %% [markdown]
# ## 5. Where it ends
#
# - A closed loop of parts hides one wrench: it runs around the loop and moves nothing.
# - Two loads along the same line cannot be told apart. `null_space` in the result says so.
# - Parts that ring below the noise pass a force that rings. Claims allow for it: `joint-may-bend`.
#
# For your own structure, copy `config/two_blocks.toml`, name your nodes, and ask first:
#
# ```text
# forceid inspect mine.h5 -c mine.toml
# ```
