# %% [markdown]
# # Ellipsoids that turn inside
#
# A drop of liquid in space holds together by its own gravity and turns. What shapes can it have? And can
# its shape stand still while it turns inside?
#
# Newton, Maclaurin, Jacobi, Dedekind and Riemann answered this: ellipsoids, whose every particle moves as
# $x = F(t) X$. They are the exact motions that the affine bodies of forceid are tested on. All is in units
# of $\pi G \rho = 1$.

# %%
# %matplotlib inline
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from forceid import pseudorigid

BLUE, VERMILION, GREEN, PURPLE, GRAY = "#0072B2", "#D55E00", "#009E73", "#AA4499", "#8A8F98"

# %% [markdown]
# ## The families
#
# Slow drops are **Maclaurin** spheroids, the flatter the faster, up to a fastest one: flatter still, they
# have more angular momentum and turn slower. Before that, at $e = 0.8127$, another family branches off,
# **Jacobi's**, with three unequal axes: for the same angular momentum they have less energy, so a drop with
# a little friction ends there. Without friction the spheroid lasts until $e = 0.9529$; beyond that it
# breaks by itself.

# %%
eccentricity = np.concatenate([np.linspace(0.01, 0.99, 200), 1 - np.geomspace(0.01, 1e-4, 60)[1:]])
spheroids = pseudorigid.maclaurin(eccentricity)
triaxial = pseudorigid.jacobi(np.geomspace(0.05, 1, 60))


def stability(e):
    """4 B_11 - Omega^2 of the spheroid: where it is negative, the spheroid breaks without friction."""
    m = pseudorigid.maclaurin(e)
    return 4 * pseudorigid.pair_symbols(*m.axes)[1][0, 0] - m.omega_squared


def slope(e):
    """Zero where Omega^2 is largest."""
    return np.arcsin(e) * (9 - 8 * e**2) - e * np.sqrt(1 - e**2) * (9 - 2 * e**2)


fastest, unstable = (brentq(condition, 0.9, 0.99, xtol=1e-15) for condition in (slope, stability))
special = {
    "Jacobi branches off": (pseudorigid.jacobi(1.0), VERMILION, (-82, 4)),
    "fastest": (pseudorigid.maclaurin(fastest), GRAY, (-22, 9)),
    "unstable from here on": (pseudorigid.maclaurin(unstable), PURPLE, (10, 2)),
}


def flatness(ellipsoid):
    """Eccentricity of the section through the longest and the shortest axis."""
    return np.sqrt(1 - ellipsoid.axes[..., 2] ** 2)


for name, (point, _, _) in special.items():
    print(f"{name}: e = {flatness(point):.6f}, Omega^2 = {point.omega_squared:.6f}")
points = [point for point, _, _ in special.values()]
assert np.allclose([flatness(p) for p in points[:2]], [0.812670010611743, 0.929955685456233], rtol=1e-10)
assert np.isclose(flatness(points[2]), 0.952886702034254, rtol=1e-10)
assert np.allclose([p.omega_squared for p in points[:2]], [0.374229674786196, 0.449331412123914], rtol=1e-10)
sample = pseudorigid.jacobi(0.6)
assert np.isclose(sample.axes[2], 0.433781034891506, rtol=1e-10)
assert np.isclose(sample.omega_squared, 0.337329903375693, rtol=1e-10)
assert np.isclose(sample.angular_momentum, 0.335618389771884, rtol=1e-10)

family_figure = Figure(figsize=(9.5, 3.9), layout="constrained")
by_shape, by_momentum = family_figure.subplots(1, 2, sharey=True)
for axes, of in ((by_shape, flatness), (by_momentum, lambda e: e.angular_momentum)):
    axes.plot(of(spheroids), spheroids.omega_squared, color=BLUE, label="Maclaurin, two axes equal")
    axes.plot(of(triaxial), triaxial.omega_squared, color=VERMILION, label="Jacobi, three axes")
    for name, (point, color, offset) in special.items():
        axes.plot(of(point), point.omega_squared, "o", color=color)
        if axes is by_momentum:
            place = (of(point), point.omega_squared)
            axes.annotate(name, place, offset, textcoords="offset points", fontsize=8, color=color)
by_shape.set(xlabel="eccentricity $e$ (1)", xlim=(0, 1.03), ylim=(0, 0.5))
by_shape.set_ylabel("$\\Omega^2 / \\pi G \\rho$ (1)")
by_momentum.set(xlabel="angular momentum, $L / \\sqrt{G M^3 \\bar a}$ (1)", xlim=(0, 1.1))
by_shape.legend(fontsize=8, loc="upper left")
family_figure

# %% [markdown]
# ## Pushed a little
#
# Two spheroids, one on each side of $e = 0.9529$, are simulated from a start that is out of round by a part
# in a million: a body with self-gravity and a pressure that keeps $\det F = 1$. The one trembles forever,
# the other gets longer at the rate that theory has for it, $\sqrt{\Omega^2 - 4 B_{11}}$.

# %%
liquid = pseudorigid.Body(1.0, pseudorigid.SelfGravity(), incompressible=True)
pair = pseudorigid.maclaurin([0.94, 0.96])
F0, V0 = pair.motion(0.0)
push = np.diag([1 + 1e-6, 1 / (1 + 1e-6), 1.0])
time = np.linspace(0, 60, 301)
pushed = liquid.simulate(push @ F0, push @ V0, time, method="kahan_li_6", step=0.1)
semiaxes = np.linalg.svd(pushed.F, compute_uv=False)
oblong = np.log(semiaxes[..., 0] / semiaxes[..., 1])

growth = np.sqrt(-stability(0.96))
late = (time > 35) & (time < 55)
found = np.polyfit(time[late], np.log(oblong[late, 1]), 1)[0]
print(f"grows at {found:.4f}, theory {growth:.4f}; the other stays below {oblong[:, 0].max():.1e}")
assert abs(found / growth - 1) < 0.01
assert oblong[:, 0].max() < 1e-5
assert np.abs(np.linalg.det(pushed.F) - 1).max() < 1e-13

growth_figure = Figure(figsize=(7, 3.3), layout="constrained")
axes = growth_figure.subplots()
axes.semilogy(time, oblong[:, 0], color=BLUE, label="e = 0.94")
axes.semilogy(time, oblong[:, 1], color=PURPLE, label="e = 0.96")
line = oblong[late, 1][0] * np.exp(growth * (time - time[late][0]))
axes.semilogy(time[time > 20], line[time > 20], "k--", lw=0.9, label="theory")
axes.set(xlabel="time ($1 / \\sqrt{\\pi G \\rho}$)", ylabel="out of round, $\\log(a_1 / a_2)$ (1)")
axes.legend(fontsize=8)
growth_figure

# %% [markdown]
# ## Turning without turning
#
# Dedekind saw that the transpose of $F$ obeys the same equation as $F$. Transposed, Jacobi's ellipsoid,
# which turns as if it were solid, becomes one of the same axes whose figure stands still while the liquid
# runs around in it. Riemann found all between: the figure turns at one rate, and the liquid in it at
# another, here without any vorticity at all, as a liquid without friction does that was at rest once.
#
# Below, each moves for one turn of its own, simulated: in gray the figure, and in color three particles in
# space.

# %%
ellipsoids = {
    "Jacobi": sample,
    "Dedekind": pseudorigid.dedekind(0.6),
    "irrotational": pseudorigid.irrotational(0.5),
}
motions = {}
for name, ellipsoid in ellipsoids.items():
    turn = np.linspace(0, 2 * np.pi / max(ellipsoid.w, ellipsoid.l), 201)
    exact, rate = ellipsoid.motion(turn)
    motions[name] = liquid.simulate(exact[0], rate[0], turn, method="kahan_li_6", step=0.1)
    off = np.abs(motions[name].F - exact).max()
    spin, circulation = motions[name].angular_momentum[-1, 2], motions[name].circulation[-1, 2]
    print(f"{name}: off by {off:.0e}; angular momentum {spin:.4f}, circulation {circulation:.4f}")
    assert off < 1e-8

F, still = motions["Jacobi"].F, motions["Dedekind"].F
assert np.allclose(F[::-1], still.mT, atol=1e-8)  # over a whole turn backward
assert np.allclose(still @ still.mT, still[0] @ still[0].mT, atol=1e-8)  # the figure stands
assert motions["Dedekind"].angular_momentum[-1, 2] > 0.5  # and turns
assert abs(motions["irrotational"].circulation[-1, 2]) < 1e-12
assert np.allclose(
    [ellipsoids["irrotational"].w, ellipsoids["irrotational"].l], [0.5157333229, -0.41258665832], rtol=1e-9
)

angle = np.linspace(0, 2 * np.pi, 200)
circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle])
particles = np.array([[1.0, 0, 0], [-0.3, 0.6, 0], [0, -0.3, 0]])
inside_figure = Figure(figsize=(10, 3.8), layout="constrained")
for axes, (name, motion) in zip(inside_figure.subplots(1, 3, sharey=True), motions.items(), strict=True):
    for k, frame in enumerate((0, 25, 50, 75)):
        x, y, _ = motion.F[frame] @ circle
        axes.fill(x, y, facecolor=GRAY, alpha=0.12, lw=0)
        axes.plot(x, y, color=GRAY, lw=1.6 if k == 0 else 0.7)
    for X, color in zip(particles, (VERMILION, BLUE, GREEN), strict=True):
        path = motion.F @ X
        axes.plot(path[:, 0], path[:, 1], color=color, lw=1.3)
        axes.plot(path[0, 0], path[0, 1], "o", color=color, ms=5)
        start, end = path[12, :2], path[13, :2]
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.3})
    axes.set(aspect="equal", xlim=(-1.7, 1.7), ylim=(-1.7, 1.7), title=name, xlabel="x (mean radius)")
inside_figure.axes[0].set_ylabel("y (mean radius)")
inside_figure

# %% [markdown]
# ## How one could tell
#
# A marker tells. The turn that fits the markers best, the polar factor of $F$, goes on in Dedekind's
# ellipsoid although its outline never moves; in the irrotational one the outline turns five times as fast
# as the markers. So forceid takes no turn and no angular momentum from an outline: at the affine level it
# fits $F$ to markers.

# %%
headings = {}
for name, motion in motions.items():
    rotation, _ = pseudorigid.polar(motion.F)
    headings[name] = np.degrees(np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])))
print({name: f"{heading[-1]:.1f} degrees" for name, heading in headings.items()})
assert np.allclose([headings["Jacobi"][-1], headings["Dedekind"][-1]], 360, atol=1e-5)
assert abs(headings["irrotational"][-1] - 72.0) < 0.05

turned_figure = Figure(figsize=(7, 3.2), layout="constrained")
axes = turned_figure.subplots()
for name, color in (("Dedekind", BLUE), ("irrotational", GREEN)):
    passed = motions[name].time
    axes.plot(passed, headings[name], color=color, label=f"{name}, markers")
    axes.plot(passed, np.degrees(passed * ellipsoids[name].w), "--", color=color, label=f"{name}, outline")
axes.set(xlabel="time ($1 / \\sqrt{\\pi G \\rho}$)", ylabel="turn (degrees)", yticks=range(0, 361, 90))
axes.legend(fontsize=8)
turned_figure
