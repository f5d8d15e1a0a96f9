# %% [markdown]
# # What force passes between the parts?
#
# A body is made of parts. Each of them moves, and what moves it is what is applied to it and what its
# neighbors do to it. So motion and mass tell what passes between the parts, without any stiffness: exactly
# where the parts form a tree, up to what circulates where they form a loop. The first three cells are the
# examples of the lecture that forceid comes from, with its errors corrected; then a measured hinge, a tree,
# and a loop.

# %%
# %matplotlib inline
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh, null_space

import forceid
from forceid.partition import link_resultants, topology
from forceid.partition.grids import bar, gathered, solid_parts
from forceid.partition.saddle import deficiency, four_field, reduced_matrix

BLUE, VERMILION, GREEN, GRAY = "#0072B2", "#D55E00", "#009E73", "#8A8F98"
here = Path(__file__).parent if "__file__" in globals() else Path.cwd()

# %% [markdown]
# ## The lecture's bar
#
# A free bar of 2 kg and 1.5 m at 45 degrees is pushed across its end by 1 N and cut in two: what does the
# near piece do to the far one? Its consistent mass, (m/6) [2 1; 1 2] for each axis, has the exact inertia, as
# the lecture says. Lumped at the ends, the same 2 kg have three times the inertia about the middle, and the
# bar turns a third as fast: at the middle the force even points the other way.

# %%
m, length, beta = 2.0, 1.5, np.pi / 4
along, across = np.array([np.cos(beta), np.sin(beta)]), np.array([-np.sin(beta), np.cos(beta)])
ends = np.outer([0.0, length], along)


def bar_mass(place, mass, lumped):
    return mass / 2 * np.eye(4) if lumped else bar(place, 1.0, mass)[1]


def through_cuts(cuts, lumped):
    """What the near piece does to the far one at each cut, along `across`, N."""
    S, load = forceid.summation_operator(ends), np.array([*across, 0.0, 0.0])
    rigid = np.linalg.solve(S.T @ bar_mass(ends, m, lumped) @ S, S.T @ load)
    found = []
    for cut in cuts:
        wrench = []
        for a, b in ((0.0, cut), (cut, 1.0)):
            piece = np.outer([a * length, b * length], along)
            S = forceid.summation_operator(piece)
            applied = load if a == 0 else 0 * load
            wrench.append(S.T @ (applied - bar_mass(piece, m * (b - a), lumped) @ S @ rigid))
        found.append(link_resultants([(0, 1)], wrench).wrench[0, :2] @ across)
    return np.array(found)


by_end, by_middle, lumped_end, lumped_middle = (
    forceid.mass_properties(bar_mass(ends, m, lumped), ends, about=about).matrix
    for lumped in (False, True)
    for about in (ends[0], ends.mean(axis=0))
)
print("about the end", by_end[0, 2], by_end[2, 2], "middle", by_middle[2, 2])
assert np.allclose([by_end[0, 2], by_end[2, 2], by_middle[2, 2]], [-1.060660172, 1.5, 0.375], rtol=1e-9)
assert np.allclose([lumped_end[2, 2], lumped_middle[2, 2]], [2.25, 1.125], rtol=1e-12)

cuts = np.linspace(0.01, 0.99, 99)
exact = (1 - cuts) * (1 - 3 * cuts)  # of a uniform bar
assert np.allclose(through_cuts(cuts, lumped=False), exact, atol=1e-12)
assert np.allclose([through_cuts([0.5], lumped)[0] for lumped in (False, True)], [-0.25, 0.25], atol=1e-12)

bar_figure = Figure(figsize=(7, 3.6), layout="constrained")
axes = bar_figure.subplots()
axes.plot(cuts * length, through_cuts(cuts, False), color=BLUE, label="consistent mass: exact")
axes.plot(cuts * length, through_cuts(cuts, True), color=VERMILION, label="lumped mass")
axes.plot(cuts[::7] * length, exact[::7], "k.", label="uniform bar, by hand")
axes.axhline(0, color=GRAY, lw=0.8)
axes.set(xlabel="distance of the cut from the pushed end (m)", ylabel="force on the far piece (N)")
axes.set_title("A free bar pushed across its end by 1 N")
axes.legend()
bar_figure

# %% [markdown]
# ## The three-mass boomerang
#
# Masses of 30, 50 and 40 g at (0, 0), (0.3, 0) and (0.3, -0.25) m, a spring between the first two along x and
# one between the last two along y. M is 6 x 6, and the two springs leave four motions free, one more than a
# rigid body has: node 2 is a hinge, and a rotational spring of 40 N m/rad makes the body whole. The moment
# about node 1 takes arms from node 1, l2 (f_y2 + f_y3) - (y3 - y1) f_x3: its last term changes sign where
# node 3 lies above.
#
# What passes through the springs follows from the accelerations alone, mass by mass.

# %%
mass, springs = np.array([0.03, 0.05, 0.04]), (2000.0, 1500.0)
x = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, -0.25]])
f = np.array([0.4, -0.2, 0.1, 0.7, -0.3, 0.5])
u = np.array([0.001, -0.0005, 0.0014, 0.0003, -0.0002, 0.0009])
M, K = np.diag(np.repeat(mass, 2)), np.zeros((6, 6))
for k, (i, j) in zip(springs, ((0, 2), (3, 5)), strict=True):
    K[np.ix_([i, j], [i, j])] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
a = np.linalg.solve(M, f - K @ u)
assert np.allclose(a, [40, -20 / 3, -14, 32, -7.5, -10], rtol=1e-9)

whole = forceid.mass_properties(mass, x)
about_1, about_c = (forceid.summation_operator(x, p) for p in (x[0], whole.center))
assert np.allclose(whole.center, [0.225, -0.25 / 3], rtol=1e-9)
assert np.isclose(whole.inertia, 0.003691666667, rtol=1e-9)
assert np.allclose(about_1.T @ f, [0.2, 1, 0.285], rtol=1e-9)
assert np.allclose(about_1.T @ (f - M @ a), 0, atol=1e-15)  # stiffness has left the resultant
for y3 in (-0.25, 0.25):
    moment = (forceid.summation_operator([*x[:2], [0.3, y3]], x[0]).T @ f)[2]
    assert np.isclose(moment, 0.3 * (f[3] + f[5]) - y3 * f[4], rtol=1e-12)
assert np.isclose((about_c.T @ f)[2] / whole.inertia, 11.73814898, rtol=1e-9)

across_12, across_23 = (np.array([-d[1], d[0]]) / (d @ d) for d in np.diff(x, axis=0))
bend = np.concatenate([across_12, -across_12 - across_23, across_23])
K_whole = K + 40.0 * np.outer(bend, bend)
frequency = np.sqrt(eigh(K_whole, M, eigvals_only=True)[3:]) / (2 * np.pi)
assert (null_space(K).shape[1], null_space(K_whole).shape[1]) == (4, 3)
assert np.allclose(frequency, [30.438025, 43.448509, 54.105279], rtol=1e-7)

surplus = (f - M @ a).reshape(3, 2)  # what each mass hands on
wrench = [forceid.summation_operator(x[[n]], x[0]).T @ surplus[n] for n in range(3)]
passed = link_resultants([(0, 1), (1, 2)], wrench).wrench[:, :2]
stretch = [springs[0] * (u[0] - u[2]), springs[1] * (u[3] - u[5])]
print("from motion, N:", passed.round(6).tolist(), " by the springs, N:", np.round(stretch, 6).tolist())
assert np.allclose(passed, [[stretch[0], 0], [0, stretch[1]]], atol=1e-12)

boomerang_figure = Figure(figsize=(7, 4.6), layout="constrained")
axes = boomerang_figure.subplots()
axes.plot(*x.T, "-", color=GRAY, lw=1)
axes.plot(*x.T, "o", color="k", ms=5)
held = np.array([-passed[0], passed[0] - passed[1], passed[1]])
arrows = ((f.reshape(3, 2), BLUE, "applied f"), (-(M @ a).reshape(3, 2), GREEN, "inertia $-m\\,\\ddot u$"),
          (held, VERMILION, "from the neighbors"))  # fmt: skip
for vectors, color, label in arrows:
    axes.quiver(
        *x.T, *vectors.T, color=color, angles="xy", scale_units="xy", scale=10, width=0.006, label=label
    )
for n, (place, shift) in enumerate(zip(x, ((-8, -18), (8, 8), (10, -4)), strict=True), start=1):
    axes.annotate(f"node {n}", place, shift, textcoords="offset points", ha="right" if n == 1 else "left")
axes.quiver([-0.15], [-0.3], [1], [0], color="k", angles="xy", scale_units="xy", scale=10, width=0.005)
axes.text(-0.15, -0.29, "1 N", va="bottom")
axes.set(xlim=(-0.22, 0.46), ylim=(-0.45, 0.12), aspect="equal", xlabel="x (m)", ylabel="y (m)")
axes.set_title("At every mass the three forces add up to nothing")
axes.legend(loc="lower center", ncols=3)
boomerang_figure

# %% [markdown]
# ## The two-partition figure
#
# The lecture's L_1 has 9 rows and 10 columns: every degree of freedom but the third. It passes every test of
# a Boolean matrix, yet it keeps one of the two degrees of freedom of node 2: no node of a mesh does. An
# illustration, then; a body of whole nodes is two unit bricks of 2 x 2 x 2 elements, held at x = 0, with
# (0, 0.4, -1) N on the far face. Held, neither form of its equations is singular; free, both are, by six.
#
# Force and moment through the interface are the same with stiffness and without. Node by node they are not.

# %%
L_1 = np.delete(np.eye(10), 2, axis=0)
printed = topology([L_1, np.eye(10)[2:6]])
kept = set(printed.glob[0].tolist())
torn = [n + 1 for n in range(5) if len(kept & {2 * n, 2 * n + 1}) == 1]
print("L_1", L_1.shape, "keeps half of node", torn)
assert torn == [2]

bricks = solid_parts((2, 1, 1), 2)
load, tip = np.zeros_like(bricks.place), bricks.place[:, 0] == 2
load[tip] = np.array([0, 0.4, -1.0]) / tip.sum()
fixed = bricks.place[:, 0] == 0
system = bricks.system(fixed)
found, start = system.solve(load[~fixed].ravel()), system.start_vector(load[~fixed].ravel())
sizes = [np.linalg.norm(found.lam), np.linalg.norm(start), np.linalg.norm(found.u_f), found.energy]
assert [float(f"{v:.9g}") for v in sizes] == [1.44324905, 1.34329611, 0.0391347975, 0.0182470011]
assert [deficiency(form(system)) for form in (four_field, reduced_matrix)] == [0, 0]
assert [deficiency(form(bricks.system())) for form in (four_field, reduced_matrix)] == [6, 6]

first, place = system.topology.rows[0], bricks.place[bricks.place[:, 0] == 1]
passed, least = (
    -lam[first].reshape(-1, 3) for lam in (found.lam, start)
)  # what the far brick does to the near
arm = place - place.mean(axis=0)
for name, forces in (("with stiffness", passed), ("without", least)):
    moment = np.cross(arm, forces).sum(0)
    print(f"{name}: force {forces.sum(0).round(9) + 0.0} N, moment {moment.round(9) + 0.0} N m")
assert np.allclose(passed.sum(0), [0, 0.4, -1], atol=1e-12)
assert np.allclose(np.cross(arm, passed - least).sum(0), 0, atol=1e-12)

partition_figure = Figure(figsize=(9.5, 3.4), layout="constrained")
matrix, shear, normal = partition_figure.subplots(1, 3, width_ratios=(1.1, 1, 1))
matrix.imshow(L_1, cmap="Greys", vmin=0, vmax=1.6, extent=(0.5, 10.5, 9.5, 0.5))
matrix.axvspan(2.5, 4.5, color=VERMILION, alpha=0.25, lw=0)
matrix.set(
    xticks=range(1, 11), yticks=range(1, 10), xlabel="assembled degree of freedom", ylabel="row of $L_1$"
)
matrix.set_title("$L_1$ as printed: half of node 2")
for forces, color, label in ((passed, BLUE, "with stiffness"), (least, VERMILION, "without: a guess")):
    shear.quiver(*place[:, 1:].T, *forces[:, 1:].T, color=color, angles="xy", scale_units="xy", scale=0.6,
                 width=0.012, label=label)  # fmt: skip
    offset = 0.03 if color == BLUE else -0.03
    normal.plot(forces[:, 0], place[:, 2] + offset, "o", color=color, label=label)
shear.quiver([0.75], [-0.75], [0.2], [0], color="k", angles="xy", scale_units="xy", scale=0.6, width=0.012)
shear.text(0.75, -0.72, "0.2 N", va="bottom")
shear.set(xlim=(-0.3, 1.3), ylim=(-0.85, 1.3), xlabel="y (m)", ylabel="z (m)", title="across the interface")
normal.axvline(0, color=GRAY, lw=0.8)
normal.set(xlabel="force along x on a node (N)", ylabel="z (m)", title="through the interface")
normal.legend(fontsize=8, loc="upper left")
partition_figure

# %% [markdown]
# ## A hinge between two blocks
#
# Two blocks on a hinge with a spring and a damper tumble in free flight; a camera sees eight markers on each,
# 200 times a second, to 0.3 mm. The dashed line is the truth, which the estimator never saw; the band is two
# standard deviations as claimed.

# %%
flight = forceid.open_motion(here.parent / "data" / "synthetic" / "two_blocks.h5")
result = forceid.estimate(flight, config=here.parent / "config" / "two_blocks.toml")
hinge, verdict = result["interface"].sel(joint="hinge"), result["interface"].attrs["verdict"]
truth = flight["truth"].joint_force.isel(joint=0)
off, std = (hinge.force - truth).values, hinge.force_std.values
inner = slice(16, -16)  # the central four fifths
rms, claimed = (float(np.sqrt(np.mean(v[inner] ** 2))) for v in (off, std))
covered = np.mean(np.abs(off) < 2 * std)
print(f"{verdict}: error {rms:.4f} N rms, claimed {claimed:.4f} N; {covered:.0%} in the band")
assert verdict == "ok"
assert bool(hinge.determined == 1)
assert rms <= min(0.003, 1.5 * claimed)
assert covered >= 0.9

hinge_figure = Figure(figsize=(9, 6), layout="constrained")
for (force, error), n in zip(hinge_figure.subplots(3, 2, sharex=True), range(3), strict=True):
    force.plot(hinge.time, hinge.force[:, n], color=BLUE, label="estimate")
    force.plot(hinge.time, truth[:, n], "k--", lw=0.9, label="truth")
    force.set_ylabel(f"$F_{'xyz'[n]}$ on the right block (N)")
    error.fill_between(hinge.time, -2e3 * std[:, n], 2e3 * std[:, n], color=BLUE, alpha=0.25, lw=0)
    error.plot(hinge.time, 1e3 * off[:, n], color=BLUE)
    error.axhline(0, color="k", ls="--", lw=0.9)
    error.set_ylabel("estimate less truth (mN)")
force.legend(loc="upper right")
for axes in (force, error):
    axes.set_xlabel("time (s)")
hinge_figure

# %% [markdown]
# ## A tree of four
#
# Four plates in a row fly freely, pushed here and there. From their accelerations alone the resultant on each
# of the three interfaces is exact, to rounding. How it spreads along an interface is another matter: without
# stiffness that is the least spread that fits.

# %%
rng = np.random.default_rng(4)


def in_flight(parts):
    """A free body pushed at every node: its system, what passes by its stiffness, and what motion tells."""
    system, S = parts.system(), forceid.summation_operator(parts.place)
    push = rng.normal(size=system.topology.size)
    mass = sum(L.T @ M @ L for L, M in zip(parts.boolean, parts.mass, strict=True))
    acceleration = S @ np.linalg.solve(S.T @ (mass @ S), S.T @ push)
    u = system.solve(push, relief=True).u
    exact = system.interface_forces(push, acceleration, u, motions=S)
    return system, exact, system.interface_forces(push, acceleration, motions=S)


row = solid_parts((4, 1), 4)
system, exact, told = in_flight(row)
carried, wrench = exact.resultant.wrench, told.resultant.wrench
error = np.abs(wrench - carried).max() / np.abs(carried).max()
spread = np.linalg.norm(told.lam - exact.lam) / np.linalg.norm(exact.lam)
print(f"resultants off by {error:.1e}, forces point by point by {spread:.0%}; loops {told.resultant.loops}")
assert error < 1e-12
assert spread > 0.1
assert told.resultant.loops == 0
assert told.resultant.determined.all()

row_figure = Figure(figsize=(9, 3.6), layout="constrained")
left, right = row_figure.subplots(1, 2, width_ratios=(1.2, 1))
for k, (name, color) in enumerate(
    zip(("$F_x$ (N)", "$F_y$ (N)", "$M$ (N m)"), (VERMILION, GREEN, BLUE), strict=True)
):
    at = np.arange(3) + 0.25 * (k - 1)
    left.bar(at, carried[:, k], 0.22, color=color, alpha=0.45, label=f"{name}, truth")
    left.plot(at, wrench[:, k], "o", color=color, ms=5, label=f"{name}, from motion")
left.axhline(0, color=GRAY, lw=0.8)
left.set(
    xticks=range(3), xticklabels=["1 on 2", "2 on 3", "3 on 4"], ylabel="resultant (N; N m about the origin)"
)
left.set_title("what passes: exact")
left.legend(fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.12))
top = system.topology
y = np.concatenate(row.position)[top.B.tocsc().indices[top.rows[0]][::2] // 2, 1]
order = np.argsort(y)
right.plot(y[order], exact.lam[top.rows[0]][::2][order], "o-", color=BLUE, label="truth")
right.plot(y[order], told.lam[top.rows[0]][::2][order], "s--", color=VERMILION, label="from motion: a guess")
right.set(
    xlabel="y along the first interface (m)", ylabel="$F_x$ on a node (N)", title="how it spreads: not told"
)
right.legend(fontsize=8)
row_figure

# %% [markdown]
# ## A loop of four
#
# Four strips make a square frame. One and the same wrench may run around it and move nothing, whatever it is:
# a frame put together under stress flies just as well. These three components, two of force (with the moments
# that keep its line of action) and one of moment, are no estimate but a null space; all that is across it is
# exact. Hinges in place of welds let no moment pass, and with three of them the frame has nothing left to
# hide.

# %%
strips = [((3, 1), (0, 0)), ((3, 1), (0, 2)), ((1, 1), (0, 1)), ((1, 1), (2, 1))]
K, M, at = [], [], []
for size, corner in strips:
    boxes = solid_parts(size, 3)
    for matrices, into in ((boxes.stiffness, K), (boxes.mass, M)):
        into.append(sum(L.T @ each @ L for L, each in zip(boxes.boolean, matrices, strict=True)))
    at.append(boxes.place + np.array(corner, dtype=float))
frame = gathered(K, M, at)
system, exact, told = in_flight(frame)
loop, carried = told.resultant, exact.resultant.wrench.ravel()
hidden = np.linalg.norm(loop.null_space.T @ carried) / np.linalg.norm(carried)
error = np.abs(loop.estimable @ (loop.wrench.ravel() - carried)).max() / np.abs(carried).max()
print(
    f"loops {loop.loops}, open {loop.null_space.shape[1]} of {carried.size}; {hidden:.0%} of the truth hidden"
)
print(f"the rest is off by {error:.1e}; links {loop.links}, determined {loop.determined.tolist()}")
assert (loop.loops, loop.null_space.shape[1]) == (1, 3)
assert error < 1e-12
assert not loop.determined.any()

sense = np.array([1, -1, -1, 1])  # of links 1-3, 1-4, 2-3, 2-4, once around
around = np.kron(sense[:, None], np.eye(3))
assert np.allclose(loop.null_space @ (loop.null_space.T @ around), around, atol=1e-10)

corners = np.array([[0.5, 1.0], [2.5, 1.0], [0.5, 2.0], [2.5, 2.0]])
pins = [np.array([[1.0, 0], [0, 1.0], [-p[1], p[0]]]) for p in corners]
left_open = [
    link_resultants(loop.links, np.zeros((4, 3)), passes=[*pins[:n], *[None] * (4 - n)]).null_space.shape[1]
    for n in range(5)
]
print("open components with 0 to 4 hinges:", left_open)
assert left_open == [3, 2, 1, 0, 0]

loop_figure = Figure(figsize=(9.5, 3.7), layout="constrained")
above = sense * [1, 1, -1, -1]  # what the strip above a joint is given
for n, (axes, name) in enumerate(zip(loop_figure.subplots(1, 3), ("$F_x$", "$F_y$", "$M$"), strict=True)):
    for (size, corner), shade in zip(strips, ("#DCE6F0", "#DCE6F0", "#F3E3D7", "#F3E3D7"), strict=True):
        box = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size + corner
        axes.fill(*box.T, facecolor=shade, edgecolor=GRAY)
    for p, up in zip(corners, above, strict=True):
        for side, color in ((1, BLUE), (-1, VERMILION)):
            turn, middle = up * side, p + ([0, 0.18 * side] if n != 1 else [0.12 * side, 0.3 * side])
            if n == 2:
                sign = "$\\circlearrowleft$" if turn > 0 else "$\\circlearrowright$"
                axes.text(*middle, sign, color=color, size=20, ha="center", va="center")
            else:
                half, arrow = np.eye(2)[n] * 0.3 * turn, {"arrowstyle": "-|>", "color": color, "lw": 1.8}
                axes.annotate("", middle + half, middle - half, arrowprops=arrow)
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title=name, xlim=(-0.2, 3.2), ylim=(-0.2, 3.2))
loop_figure.suptitle(
    "What runs around and moves nothing: on the strip above a joint (blue), below it (orange)"
)
loop_figure
