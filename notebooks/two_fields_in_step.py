# %% [markdown]
# # How often must two fields talk to each other?
#
# A structure stands on a soft bed: two fields, each solved by its own solver, which meet at an interface and
# nowhere else. They agree by turns: forces go across, motions come back, until the gaps are closed. How many
# turns does that take, and what is it worth to begin with the **mean motion**: with forces that hold every
# part in equilibrium before anything has been solved?

# %%
# %matplotlib inline
import numpy as np
from matplotlib.figure import Figure
from scipy.sparse.linalg import minres

from forceid.partition.dynamics import TiedParts
from forceid.partition.grids import solid_parts
from forceid.partition.operators.conjugate_gradient import projected_cg
from forceid.partition.saddle import reduced_matrix

BLUE, VERMILION, GREEN, GRAY = "#0072B2", "#D55E00", "#009E73", "#8A8F98"

# %% [markdown]
# ## Two fields
#
# A structure of 1000 Pa above, a bed of 20 Pa below, held at its foot; each is cut into four blocks of 4 x 4
# elements, so that there is some talking to do. Blocks of the structure float: whatever forces are proposed,
# a solver has an answer only if they balance the load. That is the condition $R_b^T \lambda = R^T f$, and the
# start vector $\lambda_\alpha = P_L R_b (R_b^T P_L R_b)^+ R^T f$ is the least $\lambda$ that meets it. No
# stiffness enters.

# %%
columns = 4
fields = solid_parts((columns, 2), 4, young=[20.0, 1000.0] * columns)  # block by block, the bed first
foot, top = fields.place[:, 1] == 0, fields.place[:, 1] == 2
load = np.zeros_like(fields.place)
load[top] = np.array([0.3, -1.0]) * (fields.place[top, :1] / columns) ** 2 / top.sum()
system = fields.system(foot)
f = load[~foot].ravel()
exact, start = system.solve(f), system.start_vector(f)
parts, P = system.loads(f), system.projection
asked = system.resultant(parts)


def share(a, b):
    """Size of a by that of b."""
    return float(np.linalg.norm(a) / np.linalg.norm(b))


unbalanced = share(P.modes.T @ start - asked, asked)
print(f"start vector: {share(start, exact.lam):.0%} of the forces, balance to {unbalanced:.0e}")
assert unbalanced < 1e-13

# %% [markdown]
# ## At rest
#
# Conjugate gradients on the gaps, to $10^{-10}$: from the start vector, with every turn kept in balance by
# $P$; and from nothing, with forces that are equal and opposite ($P_L$) and no word of the mean motion. The
# second converges too, slower, and to forces that are **wrong**: they leave the floating blocks nearly all of
# the load that they should carry. Without a start vector, MINRES on the saddle-point system is right, where
# mean motions are unknowns like the others. With one, a preconditioner pays: the stiffness jumps by fifty
# here, so forces are shared by stiffness.

# %%
found = {
    "none": system.solve_cg(f, preconditioner="none"),
    "lumped, by stiffness": system.solve_cg(f, preconditioner="lumped", weights="stiffness"),
    "dirichlet, by stiffness": system.solve_cg(f, preconditioner="dirichlet", weights="stiffness"),
}
gap = system.topology.B.T @ system.inverse(parts)
alone = projected_cg(system.flexibility, gap, P.balanced, P.averaged, np.copy, 1e-10, 2000)
lam = P.balanced(alone.x)
missed, wrong = share(P.modes.T @ lam - asked, asked), share(lam - exact.lam, exact.lam)

saddle, turns = reduced_matrix(system), []
right = np.concatenate([gap, -asked, np.zeros(len(saddle) - len(gap) - len(asked))])
solved, _ = minres(saddle, right, rtol=1e-10, maxiter=20000, callback=turns.append)
off = share(solved[: len(gap)] - exact.lam, exact.lam)

for name, one in found.items():
    print(f"start vector, preconditioner {name}: {one.iterations.count} iterations, forces off by "
          f"{share(one.lam - exact.lam, exact.lam):.0e}")  # fmt: skip
print(
    f"from nothing: {alone.count} iterations, forces off by {wrong:.0%}, {missed:.0%} of the balance missed"
)
print(f"from nothing, MINRES: {len(turns)} iterations, forces off by {off:.0e}")
counts = {name: one.iterations.count for name, one in found.items()}
assert np.abs(np.array(list(counts.values())) - [103, 22, 14]).max() <= 2
assert alone.count > 130
assert missed > 0.9
assert wrong > 0.9
assert len(turns) > 400
assert max(share(one.lam - exact.lam, exact.lam) for one in found.values()) < 1e-7

# %% [markdown]
# ## In motion
#
# In an implicit time step every block has its mass, and nothing floats: the flexibility is
# $F = B^T (K + 4/\Delta t^2\,M)^{-1} B$, and both iterations end at the right forces. How often the fields
# talk depends on the step. In a short one no block feels its other end: the mean motion is worth nothing, and
# costs a coarse problem. In a long one it is most of what a block does, and without it the iteration has to
# find that out, block by block.

# %%
steps = np.array([1e-3, 1e-2, 0.1, 0.3, 1.0, 3.0, 10.0])
talk = {True: [], False: []}
for step in steps:
    dynamic = tuple(k + 4 / step**2 * m for k, m in zip(system.stiffness, system.mass, strict=True))
    motions = []
    for deflation, into in talk.items():
        u, _, count = TiedParts(system, dynamic, deflation).solve(parts, np.zeros(len(start)))
        into.append(count)
        motions.append(u)
    assert share(motions[0] - motions[1], motions[0]) < 1e-6  # the same motion, either way
print("time step, s:", steps.tolist())
print("iterations from nothing:", talk[False], " with the mean motion:", talk[True])
assert talk[True][0] >= talk[False][0]
assert talk[False][-1] > 3 * talk[True][-1]

figure = Figure(figsize=(9.5, 3.6), layout="constrained")
rest, motion = figure.subplots(1, 2)
for (name, one), color in zip(found.items(), (BLUE, GREEN, GRAY), strict=True):
    residual = one.iterations.residual
    rest.semilogy(residual / residual[0], color=color, label=f"start vector; {name}")
rest.semilogy(alone.residual / alone.residual[0], "--", color=VERMILION, label="from nothing: wrong forces")
rest.set(xlabel="iteration", ylabel="gap, of that at the start (1)", title="at rest")
rest.legend(fontsize=7)
motion.loglog(steps, talk[False], "o--", color=VERMILION, label="from nothing")
motion.loglog(steps, talk[True], "o-", color=BLUE, label="with the mean motion")
motion.set(xlabel="time step (s)", ylabel="iterations", title="in motion", yticks=[20, 50, 100, 300])
motion.set_yticklabels(["20", "50", "100", "300"])
motion.minorticks_off()
motion.legend(fontsize=8)
figure
