# %% [markdown]
# # How good is your camera?
#
# A gust of 1 N pushes a plate of 0.1 kg and changes within a twentieth of a second; a camera follows four
# markers on it. How well can the force be known at all, and what helps: more frames, or sharper ones?

# %%
# %matplotlib inline
import numpy as np
import xarray
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter
from scipy.spatial.transform import Rotation

import forceid
from forceid import kalman

BLUE, VERMILION = "#0072B2", "#D55E00"
MASS, MARKERS = 0.1, 4  # kg
gust = kalman.matern(2, std=1.0, rate=20.0)  # N, 1/s: above the rate its spectrum falls as 1/w^4

# %% [markdown]
# ## The bound
#
# Position is force over mass, integrated twice, so against white noise of the markers the spectrum of what
# is seen of the force falls as $w^{-4}$ more. Where it sinks below the noise nothing is seen, and the power
# above that frequency is the error. Only one number of the camera counts, the noise density $r$, that is
# $\sigma^2 / (\text{markers} \cdot \text{rate})$, and the bound is
#
# $$\text{error} \propto r^{3/16}, \qquad \text{last frequency seen} \propto r^{-1/8}.$$
#
# Both exponents are small. Ten times the frames take a third off the error; markers ten times as sharp,
# more than half, as much as a hundred times the frames. `kalman.driven_load_bound` is the closed form;
# `kalman.steady` is exact at any frame rate, and says when frames are too few for it.


# %%
def bound(rate, noise):
    """Least standard deviation of the force, N, at `rate` Hz with marker noise of `noise` m: closed form."""
    return np.sqrt(kalman.driven_load_bound(2, float(gust.Qc[-1, -1]), MASS, noise**2 / rate / MARKERS))


def sampled_bound(rate, noise):
    """The same at finite rate: the smoother's covariance far from both ends of a record."""
    chain = kalman.integrate(kalman.integrate(gust, var=1.0), var=1.0)  # mass times position, momentum, force
    F, Q = kalman.discretize(chain, 1 / rate)
    R = np.array([[noise**2 / MARKERS]])
    model = kalman.StateSpace(F, Q, chain.output[None] / MASS, R, np.zeros(4), chain.P0)
    return np.sqrt(kalman.steady(model).smoothed[2, 2])


def last_frequency(rate, noise):
    """Where the spectra of force and noise cross, Hz."""
    r = noise**2 / rate / MARKERS
    return (float(gust.Qc[-1, -1]) / (MASS**2 * r)) ** (1 / 8) / (2 * np.pi)


usual = bound(240, 3e-4)
print(f"240 Hz, 0.3 mm: {usual:.4f} N, up to {last_frequency(240, 3e-4):.1f} Hz")
print(f"ten times the rate: {bound(2400, 3e-4) / usual:.2f} of it; a tenth of the noise:", end=" ")
print(f"{bound(240, 3e-5) / usual:.2f} of it")
assert np.isclose(bound(2400, 3e-4) / usual, 10 ** (-3 / 16))
assert np.isclose(bound(240, 3e-5) / usual, 10 ** (-3 / 8))
assert np.isclose(sampled_bound(960, 3e-4), bound(960, 3e-4), rtol=0.01)

# %% [markdown]
# ## Measured
#
# Now a flight is drawn: four seconds of gusts on the plate, which turns once a second. It is filmed again
# and again, and `forceid.estimate` finds the force in each film. It is told neither how strong the gusts
# are nor how fast they change, which the bound takes as known. Where frames are few, the bound at the
# frames dips: what lies between them is known less well, and not counted here.

# %%
FASTEST, SECONDS = 480, 4
rng = np.random.default_rng(8)
chain = kalman.integrate(kalman.integrate(gust, var=0.0), var=0.0)
F, Q = kalman.discretize(chain, 1 / FASTEST)
size = np.sqrt(np.diag(Q))
kicks = size[:, None] * np.linalg.cholesky(Q / np.outer(size, size))
state = np.zeros((SECONDS * FASTEST, 4, 3))
state[0, 2:] = np.linalg.cholesky(gust.P0) @ rng.standard_normal((2, 3))
for k in range(1, len(state)):
    state[k] = F @ state[k - 1] + kicks @ rng.standard_normal((4, 3))
time, center, force = np.arange(len(state)) / FASTEST, state[:, 0] / MASS, state[:, 2]

plate = 0.1 * np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
turn = Rotation.from_rotvec(np.outer(2 * np.pi * time, [0.0, 0.0, 1.0])).as_matrix()
markers = center[:, None] + np.einsum("tij,nj->tni", turn, plate)


def film(rate, noise):
    """The flight as a camera sees it, a motion as `forceid.open_motion` gives it; the force at its frames."""
    step = FASTEST // rate
    seen = markers[::step] + noise * np.random.default_rng(1).standard_normal(markers[::step].shape)
    body = {"position": (("node", "axis"), plate), "mass": ("node", [MASS / MARKERS] * MARKERS)}
    names = {"node": ["a", "b", "c", "d"], "axis": ["x", "y", "z"]}
    groups = {
        "/": xarray.Dataset(attrs={"forceid_schema": "1"}),
        "/body": xarray.Dataset(body, names),
        "/motion": xarray.Dataset(
            {"position": (("time", "node", "axis"), seen, {"noise_std": noise})},
            {"time": time[::step], **names},
            {"gravity": np.zeros(3)},
        ),
    }
    return xarray.DataTree.from_dict(groups), force[::step]


cameras = [(rate, 3e-4) for rate in (30, 60, 120, 240, 480)] + [(240, 1e-3 * s) for s in (0.03, 0.1, 1, 3)]
measured, results = {}, {}
for camera in cameras:
    tree, truth = film(*camera)
    results[camera] = forceid.estimate(tree, model="rigid")["estimate"]
    inner = slice(len(truth) // 10, -len(truth) // 10)  # the ends know less
    measured[camera] = np.sqrt(np.mean((results[camera].force.values - truth)[inner] ** 2))

ratio = np.array([measured[camera] / sampled_bound(*camera) for camera in cameras])
for (f, s), of_bound in zip(cameras, ratio, strict=True):
    print(f"{f:4d} Hz, {1e3 * s:4.2g} mm: {measured[f, s]:.4f} N, {of_bound:.2f} of the bound")
assert np.all(np.abs(ratio - 1) < 0.15)
assert abs(np.sqrt(np.mean(ratio**2)) - 1) < 0.06

# %%
rates, noises = np.geomspace(20, 600, 40), np.geomspace(0.02e-3, 5e-3, 40)
bound_figure = Figure(figsize=(9.5, 3.8), layout="constrained")
by_rate, by_noise = bound_figure.subplots(1, 2, sharey=True)
by_rate.plot(rates, [bound(f, 3e-4) for f in rates], color=BLUE, label="bound, closed form")
by_rate.plot(rates, [sampled_bound(f, 3e-4) for f in rates], "k--", lw=0.9, label="bound, sampled")
by_rate.plot(*zip(*[(f, measured[f, s]) for f, s in cameras if s == 3e-4], strict=True), "o", color=VERMILION,
             label="measured")  # fmt: skip
by_noise.plot(1e3 * noises, [bound(240, s) for s in noises], color=BLUE)
by_noise.plot(1e3 * noises, [sampled_bound(240, s) for s in noises], "k--", lw=0.9)
by_noise.plot(*zip(*[(1e3 * s, measured[f, s]) for f, s in cameras if f == 240], strict=True), "o",
              color=VERMILION)  # fmt: skip
by_rate.set(xlabel="frame rate (Hz), noise 0.3 mm", ylabel="error of the force (N), of 1 N")
by_rate.set_title("more frames: $f^{-3/16}$")
by_noise.set(xlabel="marker noise (mm), 240 Hz", title="sharper frames: $\\sigma^{3/8}$")
for axes in (by_rate, by_noise):
    axes.set(xscale="log", yscale="log", ylim=(0.015, 0.2))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25)
by_rate.set_xticks([30, 60, 120, 240, 480], minor=False)
by_rate.xaxis.set_minor_formatter(NullFormatter())
by_noise.set_xticks([0.03, 0.1, 0.3, 1, 3])
by_rate.legend(loc="upper right", fontsize=8)
bound_figure

# %% [markdown]
# ## What that looks like
#
# One second of it through a blurred, a usual and a sharp camera. The estimate is not wrong where the camera
# is bad, only slow: what is too fast to be seen is left out, and the band, two standard deviations as
# claimed, says how much that may be.

# %%
shown = slice(int(1.5 * 240), int(2.5 * 240))
seen_figure = Figure(figsize=(9.5, 3.2), layout="constrained")
for axes, noise in zip(seen_figure.subplots(1, 3, sharey=True), (3e-3, 3e-4, 3e-5), strict=True):
    found = results[240, noise].isel(time=shown)
    value, std = found.force[:, 0], found.force_std[:, 0]
    axes.fill_between(found.time, value - 2 * std, value + 2 * std, color=BLUE, alpha=0.25, lw=0)
    axes.plot(found.time, value, color=BLUE, label="estimate")
    axes.plot(time[::2][shown], force[::2][shown, 0], "k--", lw=0.9, label="truth")
    axes.set(xlabel="time (s)", title=f"{1e3 * noise:g} mm, to {last_frequency(240, noise):.0f} Hz")
seen_figure.axes[0].set_ylabel("$F_x$ (N)")
seen_figure.axes[0].legend(fontsize=8)
seen_figure

# %% [markdown]
# ## Which camera, then?
#
# Turned around: cameras on one line give the same error. For 0.05 N at 240 Hz the markers have to be known
# to a quarter of a millimeter; a tenth of the error takes noise 460 times smaller, so nobody buys that. A
# lighter body helps: the error goes as the mass to the power 3/8, just as with the noise. The same holds of
# moments, with the inertia for the mass and the noise of the turn, that of a marker over its arm, for
# $\sigma$.
#
# All of this is for white noise. What all markers share, a camera that shakes or a lens not quite
# calibrated, does not get smaller with more of them, and what is slow looks just like a force: see the
# limits.

# %%
needed = 3e-4 * (0.05 / usual) ** (8 / 3)
print(f"0.05 N at 240 Hz: {1e3 * needed:.3f} mm; 0.005 N: {needed / 10 ** (8 / 3) * 1e6:.2f} micrometers")
assert np.isclose(bound(240, needed), 0.05)
assert abs(1e3 * needed - 0.2667) < 0.0005

cost_figure = Figure(figsize=(6.2, 4.2), layout="constrained")
axes = cost_figure.subplots()
f = np.geomspace(20, 5000, 60)
for error in (0.02, 0.03, 0.05, 0.1, 0.15):
    line = np.array([3e-1 * (error / bound(x, 3e-4)) ** (8 / 3) for x in f])  # mm
    axes.plot(f, line, color=VERMILION if error == 0.05 else BLUE, lw=1.2)
    axes.annotate(f"{error:g} N", (f[-1], line[-1]), (4, -3), textcoords="offset points", fontsize=9)
axes.plot(240, 1e3 * needed, "o", color=VERMILION)
axes.annotate("240 Hz, 0.27 mm", (240, 1e3 * needed), (6, -12), textcoords="offset points", fontsize=8)
axes.set(xscale="log", yscale="log", xlim=(20, 5000), ylim=(0.01, 30))
axes.set(xlabel="frame rate (Hz)", ylabel="marker noise (mm)")
axes.set_xticks([30, 60, 120, 240, 500, 1000, 2000, 5000])
axes.set_title("Cameras that know 1 N on 0.1 kg to within ...")
axes.grid(alpha=0.25)
axes.xaxis.set_minor_formatter(NullFormatter())
for axis in (axes.xaxis, axes.yaxis):
    axis.set_major_formatter(ScalarFormatter())
cost_figure
