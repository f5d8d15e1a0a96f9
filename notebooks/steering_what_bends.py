# %% [markdown]
# # Can one steer what bends?
#
# A free plate shall go to its place, stop turning, and stop swinging in its first mode: commands for the mean
# motion $\alpha$ and for the amplitude $q$ at the same time, dual control. A controller that has the right
# mass and the right first mode does that, and may still shake the plate to pieces: by a mode that nobody
# modeled, which its thrusters push and its sensors see. When does it, and what helps?

# %%
# %matplotlib inline
import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh, expm

import forceid
from forceid.partition import mean_control, solve_commands
from forceid.partition.grids import solid_parts

BLUE, VERMILION, GREEN, GRAY = "#0072B2", "#D55E00", "#009E73", "#8A8F98"

# %% [markdown]
# ## The plate
#
# 8 m long, 1 m wide, 1.6 kg, free in its plane: $u = R \alpha + \Phi q$, three components of the mean motion
# and here the lowest 24 modes, of unit mass. Its material damps, the first mode at 5.1 Hz by 0.2 %. The
# controller knows that one. The others are the residual modes, of which it knows nothing.

# %%
plate = solid_parts((8, 1), 2, young=2e5)
K, M = (
    sum(L.T @ part @ L for L, part in zip(plate.boolean, parts, strict=True)).toarray()
    for parts in (plate.stiffness, plate.mass)
)
x = plate.place
R = forceid.summation_operator(x, x.mean(axis=0))
square, modes = eigh(K, M)
rate, Phi = np.sqrt(square[3:27]), modes[:, 3:27]
known, residual = Phi[:, :1], Phi[:, 1:]
commanded, whole = np.hstack([R, known]), np.hstack([R, Phi])
print("frequencies, Hz:", (rate[:7] / (2 * np.pi)).round(2).tolist())
assert np.abs(R.T @ M @ Phi).max() < 1e-9  # the modes are in mass gauge: S^T and Phi^T see one each

inertia = whole.T @ M @ whole
stiffness = np.diag([0, 0, 0, *rate**2])
damping = 2 * 0.002 / rate[0] * stiffness  # of Kelvin and Voigt

# %% [markdown]
# ## The controller
#
# It reads $(\alpha, q)$ and asks for $\tau_\alpha$ and $\tau_q$: the mean motion as on a spring of 0.5 Hz and
# well damped, the first mode damped to 30 %. How it reads and how it pushes is all that the two ways below
# differ in.
#
# **At points.** Five thrusters along one edge, five sensors along the other. They read
# $[R_s\ \Phi_s]^+ y$, and push with the least commands that give $\tau$ (`solve_commands`): exact for what is
# modeled. What is left over is the spill.
#
# **Projected.** $\alpha = (R^T M R)^{-1} R^T M u$, $q = \Phi^T M u$, and $f = M R\,c + M \Phi\,\tau_q$
# (`mean_control`), read and pushed all over the plate. No residual mode is seen and none is pushed, without
# knowing a single one.

# %%
unit = commanded.T @ M @ commanded
spring = unit @ np.diag([(2 * np.pi * 0.5) ** 2] * 3 + [0.0])
damper = unit @ np.diag([2 * 0.7 * 2 * np.pi * 0.5] * 3 + [2 * 0.3 * rate[0]])


def pick(places):
    """Unit loads, or readings, (dof, place): of the node at x, y along an axis."""
    found = np.zeros((len(K), len(places)))
    for k, (*place, axis) in enumerate(places):
        found[2 * int(np.argmin(((x - place) ** 2).sum(axis=1))) + axis, k] = 1.0
    return found


thrusters = pick([(0, 0, 1), (2.5, 0, 1), (5, 0, 1), (8, 0, 1), (4, 0, 0)])
sensors = pick([(1, 1, 1), (3.5, 1, 1), (6, 1, 1), (7, 1, 1), (0, 1, 0)])
least = solve_commands(thrusters, R, known, np.eye(4)[:, :3], np.eye(4)[:, 3:], residual, mass=M)
over = np.array([mean_control(M, R, tau) for tau in np.eye(3)])
ways = {  # (reading, push): of modal amplitudes, and of unit commands
    "at points": (np.linalg.pinv(sensors.T @ commanded) @ sensors.T @ whole, whole.T @ thrusters @ least.c.T),
    "projected": (
        np.linalg.solve(unit, commanded.T @ M @ whole),
        whole.T @ np.vstack([over, (M @ known).T]).T,
    ),
}
for name, (reading, push) in ways.items():
    seen, spill = np.abs(reading[:, 4:]).max(), np.abs(push[4:]).max()
    print(f"{name}: sees up to {seen:.1e} of a residual mode, pushes one with up to {spill:.1e} of a command")
    assert np.allclose(reading[:, :4], np.eye(4), atol=1e-9)  # both are exact for what is modeled
    assert np.allclose(push[:4], np.eye(4), atol=1e-9)
assert least.independent
assert np.abs(least.spill).max() > 0.5
assert max(np.abs(ways["projected"][0][:, 4:]).max(), np.abs(ways["projected"][1][4:]).max()) < 1e-10

# %% [markdown]
# ## The loop is closed
#
# Its eigenvalues tell. What was modeled comes out as designed in the projected loop, to all digits, and every
# residual mode keeps the decay that it has by itself. At points the modeled part is near the design too, but
# residual modes are fed faster than they decay.


# %%
def closed(reading, push):
    """The matrix of the closed loop, of (amplitudes, rates)."""
    n = len(inertia)
    pull = np.linalg.solve(inertia, stiffness + push @ spring @ reading)
    drag = np.linalg.solve(inertia, damping + push @ damper @ reading)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-pull, -drag]])


idle = (np.zeros((4, len(inertia))), np.zeros((len(inertia), 4)))
loops = {name: closed(*way) for name, way in ways.items()} | {"without control": closed(*idle)}
poles = {name: np.linalg.eigvals(loop) for name, loop in loops.items()}
decay = {}
for name, found in poles.items():
    found = found[found.imag >= 0]
    nearest = np.abs(np.abs(found)[None] - rate[1:7, None]).argmin(axis=1)
    decay[name] = -found[nearest].real
    print(f"{name}: residual modes 2 to 7 decay at {decay[name].round(3).tolist()} 1/s; "
          f"fastest growth {max(found.real.max(), 0.0):.2f} 1/s")  # fmt: skip
assert np.allclose(decay["projected"], decay["without control"], rtol=1e-6)
assert np.allclose(decay["projected"], 0.002 / rate[0] * rate[1:7] ** 2, rtol=1e-6)
assert poles["projected"].real.max() < 0
assert poles["at points"].real.max() > 2
designed = np.roots([1, 2 * 0.7 * 2 * np.pi * 0.5, (2 * np.pi * 0.5) ** 2])
assert all(np.abs(poles["projected"] - p).min() < 1e-6 for p in designed)

# %% [markdown]
# ## A maneuver
#
# The plate starts 0.1 m off, turned by 2 degrees, and swinging by 10 mm at its ends in the first mode.

# %%
step, time = 2e-3, np.arange(0, 2.0, 2e-3)
start = np.zeros(2 * len(inertia))
start[:4] = 0.1, 0.1, np.radians(2), 0.01 / np.abs(known).max()
paths = {}
for name, loop in loops.items():
    ahead, state, path = expm(loop * step), start, []
    for _ in time:
        path.append(state)
        state = ahead @ state
    paths[name] = np.array(path)[:, : len(inertia)]


def size(amplitudes, shapes):
    """The largest displacement of any point of the plate, mm, over time."""
    return 1e3 * np.abs(amplitudes @ shapes.T).max(axis=1)


parts = {
    "mean motion": (slice(0, 3), R),
    "first mode": (slice(3, 4), known),
    "residual": (slice(4, None), residual),
}
rest = {
    name: {part: size(path[:, at], shape) for part, (at, shape) in parts.items()}
    for name, path in paths.items()
}
for name in ways:
    ends = {part: f"{float(values[-100:].max()):.2g} mm" for part, values in rest[name].items()}
    print(f"{name}, in the last 0.2 s: {ends}; residual modes at most {rest[name]['residual'].max():.1e} mm")
assert rest["projected"]["residual"].max() < 1e-9
assert rest["at points"]["residual"][-100:].max() > 20
assert rest["projected"]["mean motion"][-1] < 0.05 * rest["projected"]["mean motion"][0]
assert rest["projected"]["first mode"][-1] < 1e-5

maneuver = Figure(figsize=(10, 3.4), layout="constrained")
for axes, part in zip(maneuver.subplots(1, 3), parts, strict=True):
    for name, color in (("at points", VERMILION), ("projected", BLUE)):
        axes.semilogy(time, np.maximum(rest[name][part], 1e-12), color=color, label=name)
    axes.set(xlabel="time (s)", title=part, ylim=(1e-12 if part == "residual" else 1e-3, None))
maneuver.axes[0].set_ylabel("largest displacement (mm)")
maneuver.axes[0].legend(fontsize=8)
maneuver

# %% [markdown]
# ## With thrusters and sensors to spare
#
# Who cannot push all over a body takes more thrusters and sensors, and can say which residual modes matter:
# among all commands that give $\tau$, those that push these modes least (`effort`), and readings likewise.
# Twelve of each, without a word about residual modes, are not enough: the mode at 24 Hz still grows. Three
# modes quieted, that one among them, is stable, and all of them keep their own decay. But every mode quieted
# takes from what is left for the commands: at seven, these twelve shout.

# %%
more = [(6.5, 0, 1), (1, 0, 1), (3.5, 0, 1), (7.5, 0, 1), (1.5, 0, 1), (2, 0, 0), (6, 0, 0)]
many_thrusters = np.hstack([thrusters, pick(more)])
many_sensors = np.hstack([sensors, pick([(8 - px, 1, axis) for px, _, axis in more])])


def quiet(places, count):
    """Commands of unit tau (place, 4) that push the first residual modes next to not at all."""
    pushed = residual[:, :count].T @ places
    effort = pushed.T @ pushed + 1e-8 * np.eye(places.shape[1])
    return solve_commands(places, R, known, np.eye(4)[:, :3], np.eye(4)[:, 3:], residual, M, effort).c.T


growth, loudness = [], []
for count in range(8):
    command = quiet(many_thrusters, count)
    reading = quiet(many_sensors, count).T @ many_sensors.T @ whole
    growth.append(float(np.linalg.eigvals(closed(reading, whole.T @ many_thrusters @ command)).real.max()))
    loudness.append(float(np.linalg.norm(command)))
print("fastest growth, 1/s, by the number of modes quieted:", np.round(growth, 2).tolist())
print("size of the commands:", np.round(loudness, 2).tolist())
assert growth[0] > 0.1
assert np.allclose(growth[3:7], -decay["without control"][0], rtol=1e-3)
assert growth[7] > 10
