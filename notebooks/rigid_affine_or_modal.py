# %% [markdown]
# # Rigid, affine or modal?
#
# Everything bends a little. How much of that has to be in the model of the body, before the force and the
# moment that acted on it are right, and what does it cost to take too little or too much?

# %%
# %matplotlib inline
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

import forceid

BLUE, VERMILION, GREEN, GRAY = "#0072B2", "#D55E00", "#009E73", "#8A8F98"
here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
names = {"top": "top", "spinning_block": "block", "flexible_boomerang": "boomerang"}
flights = {
    short: forceid.open_motion(here.parent / "data" / "synthetic" / f"{name}.h5")
    for name, short in names.items()
}
# what holds the boomerang together is left out: the record has to say in which shapes it deforms
flights["boomerang"]["body"] = flights["boomerang"]["body"].to_dataset().drop_vars("stiffness")

# %% [markdown]
# ## What the ladder takes, and why
#
# The levels, by what they let the body do beside flying: **rigid** nothing; **modal** a few shapes, found
# in the motion itself; **affine** any uniform stretch and shear, six amplitudes. Three flights are tried: a
# stiff top, a soft block that stretches as it spins, and a boomerang whose arms beat.
#
# What a level leaves of the markers should be their noise, a chi-square of one per degree of freedom. From
# the level that explains the motion best `auto` goes down to the smallest that leaves force and moment
# where they are. It says so in `model_choice`; the numbers behind it stand in the attributes `ladder_...`.

# %%
auto = {name: forceid.estimate(flight)["estimate"] for name, flight in flights.items()}
for name, estimate in auto.items():
    print(f"{name}: {estimate.attrs['model_choice']}.\n")


def rungs(estimate, value):
    """A number of each level that was looked at, by its name, from the smallest to the largest."""
    found = {k[7:]: v for k, v in estimate.attrs.items() if k.startswith("ladder_") and k.endswith(value)}
    return {k.removesuffix(f"_{value}"): float(v) for k, v in found.items()}


def freedoms(rung):
    """Amplitudes of a level, by the number in the name of a modal one."""
    return int({"rigid": "0", "affine": "6"}.get(rung, rung.removeprefix("modal_")))


taken = {name: [k for k, v in rungs(e, "taken").items() if v] for name, e in auto.items()}
assert taken == {"top": [], "block": ["affine"], "boomerang": ["modal_1"]}
assert auto["top"].attrs["model"] == "rigid"
assert abs(rungs(auto["block"], "chi_square")["affine"] - 1) < 0.03
assert rungs(auto["block"], "chi_square")["modal_5"] > 5  # six amplitudes, and not one less

ladder_figure = Figure(figsize=(9, 3.4), layout="constrained")
for axes, name in zip(ladder_figure.subplots(1, 2), ("block", "boomerang"), strict=True):
    left = rungs(auto[name], "chi_square")
    modal = [k for k in left if k != "affine"]
    axes.axhline(1, color=GRAY, lw=0.8)
    axes.plot([freedoms(k) for k in modal], [left[k] for k in modal], "o-", color=BLUE, label="rigid, modal")
    axes.plot(6, left["affine"], "s", color=GREEN, ms=7, label="affine")
    (level,) = taken[name]
    axes.plot(freedoms(level), left[level], "o", color=VERMILION, ms=15, mfc="none", mew=1.5, label="taken")
    axes.set(yscale="log", xlabel="amplitudes a frame", xticks=range(7), title=f"The {name}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.legend(fontsize=8)
ladder_figure.axes[0].set_yticks([1, 10, 100, 1000], [1, 10, 100, 1000])
ladder_figure.axes[1].set_yticks([1, 1.5, 2])
ladder_figure.axes[0].set_ylabel("$\\chi^2$ left, per degree of freedom")
ladder_figure

# %% [markdown]
# ## Too small
#
# Here every mass carries a marker, so the mean of the markers is the mass center whatever the body does,
# and the **force is right at any level**. Not so the moment: it is the rate of the angular momentum, which
# a body that stretches as it spins changes by its shape alone. Taken for rigid, the block shows moments
# that were never there, twelve times the error, and far outside the band that a rigid body would deserve.
# The verdict says so: degraded, with the chi-square as the reason.


# %%
def errors(name, estimate):
    """Errors of force (N) and moment (N m), rms of their length over the central three quarters."""
    inner = slice(len(estimate.time) // 8, -(len(estimate.time) // 8))
    truth = flights[name]["truth"]
    off = [(estimate[kind].values - truth[kind].values)[inner] for kind in ("force", "moment")]
    return np.sqrt([np.mean(np.sum(values**2, axis=1)) for values in off])


rigid = {name: forceid.estimate(flights[name], model="rigid")["estimate"] for name in ("block", "boomerang")}
for name in rigid:
    for found in (auto[name], rigid[name]):
        print(f"{name}, {found.attrs['model']}: {found.attrs['verdict']}", errors(name, found).round(4))
worse = {name: errors(name, rigid[name]) / errors(name, auto[name]) for name in rigid}
assert abs(worse["block"][0] - 1) < 0.01
assert abs(worse["boomerang"][0] - 1) < 0.01
assert worse["block"][1] > 10
assert worse["boomerang"][1] > 4
assert {rigid[name].attrs["verdict"] for name in rigid} == {"degraded"}

small_figure = Figure(figsize=(9, 4.6), layout="constrained")
for column, name, n in zip(small_figure.subplots(2, 2, sharex="col").T, rigid, "xy", strict=True):
    truth = flights[name]["truth"]
    for axes, kind, unit in zip(column, ("force", "moment"), ("N", "N m"), strict=True):
        for found, color in ((rigid[name], VERMILION), (auto[name], BLUE)):
            value, std = found[kind].sel(axis=n), found[f"{kind}_std"].sel(axis=n)
            axes.fill_between(found.time, value - 2 * std, value + 2 * std, color=color, alpha=0.25, lw=0)
            axes.plot(found.time, value, color=color, lw=1.2, label=found.attrs["model"])
        axes.plot(truth.time, truth[kind].sel(axis=n), "k--", lw=0.9, label="truth")
        axes.set_ylabel(f"${kind[0].upper()}_{n}$ ({unit})")
    axes.set_xlabel("time (s)")
    axes.legend(fontsize=8, ncols=3)
    column[0].set_title(f"The {name}")
small_figure

# %% [markdown]
# ## Too large
#
# Twelve shapes for the block, where six are enough: force and moment stay, since an amplitude that nothing
# drives is held near zero by what the smoother learns of it. What is lost is time, and the six numbers that
# mean something: which six of the twelve shapes are the stretch nobody says.

# %%
large = forceid.estimate(flights["block"], model="modal", modes=12)["estimate"]
print("block, modal, 12 modes:", errors("block", large).round(4), large.sizes["mode"], "modes")
assert np.allclose(errors("block", large), errors("block", auto["block"]), rtol=0.02)
assert "first_moment" not in large

# %% [markdown]
# ## What the affine level knows beside
#
# Of an affine body also the **first moments of force** are known, $N = \int f\,x^T$, nine numbers: the
# three in which it is not symmetric are the moment, the six others what stretches and shears it. They are
# those of all forces, of the stress inside too. The spin stretches the block by a tenth, and it swings
# about that.

# %%
block, truth = auto["block"], flights["block"]["truth"]
N = block.first_moment.values
std = np.sqrt(np.einsum("tii->ti", block.first_moment_cov.values)).reshape(N.shape)
twist = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], axis=1)
off = (N - truth.first_moment.values)[75:-75]
inside = np.mean(np.abs(off) < 2 * std[75:-75])
stretches = np.linalg.eigvalsh(block.stretch.values)
print(f"first moments: error {np.sqrt(np.mean(off**2)):.3f} N m rms, {inside:.0%} inside two sigma")
print(f"stretches from {stretches.min():.2f} to {stretches.max():.2f}")
assert np.allclose(twist, block.moment.values, atol=1e-9)
assert np.sqrt(np.mean(off**2)) < 0.05
assert inside > 0.85

first_figure = Figure(figsize=(9, 5.6), layout="constrained")
grid = first_figure.subplots(3, 3, sharex=True)
for (i, j), axes in np.ndenumerate(grid):
    low, high = N[:, i, j] - 2 * std[:, i, j], N[:, i, j] + 2 * std[:, i, j]
    axes.fill_between(block.time, low, high, color=BLUE, alpha=0.3, lw=0)
    axes.plot(block.time, N[:, i, j], color=BLUE, label="estimate")
    axes.plot(truth.time, truth.first_moment[:, i, j], "k--", lw=0.9, label="truth")
    axes.set_ylabel(f"$N_{{{'xyz'[i]}{'xyz'[j]}}}$ (N m)")
for axes in grid[2]:
    axes.set_xlabel("time (s)")
grid[0, 2].legend(fontsize=8)
first_figure

# %%
stretch_figure = Figure(figsize=(9, 2.8), layout="constrained")
axes = stretch_figure.subplots()
for k, (name, color) in enumerate((("least", VERMILION), ("middle", GREEN), ("largest", BLUE))):
    axes.plot(block.time, stretches[:, k], color=color, label=name)
axes.axhline(1, color=GRAY, lw=0.8)
axes.set(xlabel="time (s)", ylabel="principal stretch (1)")
axes.legend(fontsize=8, ncols=3)
stretch_figure
