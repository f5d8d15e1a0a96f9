"""A bending plate with three to eight markers on one face: `auto` beside rigid and modal, told and untold.

    python -m evidence.drawn.plate_face -o FOLDER [--seeds 3] [--first 0] [--lines auto]

Two layers of point masses joined by springs vibrate in their lowest modes while the plate flies and turns;
force and moment follow from the momenta of all masses. Told: nothing but total mass and inertia, all masses,
the stiffness beside them, or three modes. Errors of `auto` are told over those of the better of the two,
and over those of `auto` where nothing is told. Error over claim: within the band.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import FORCE, MOMENT, estimated_score, told_whole
from evidence.judged import RULE, UNBANDED, silent_share, unbanded
from evidence.vectors import GRAVITY
from evidence.written import asked, each, paged, tabled
from forceid.records import Array, Body, Motion, Recording

TOLD = ("total mass", "masses", "stiffness", "modes")
SIGMA = 3e-4  # m


def plate(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Positions (node, 3) m of two layers, masses (node,) kg, and stiffness (dof, dof) N/m of the springs."""
    nx, ny, step = 5, 4, 0.08
    grid = np.array([[i, j, k] for k in range(2) for i in range(nx) for j in range(ny)], float)
    X = grid * [step, step, 0.03] + 0.004 * rng.standard_normal((len(grid), 3))
    mass = rng.uniform(0.008, 0.012, len(X))
    K = np.zeros((3 * len(X), 3 * len(X)))
    for a in range(len(X)):
        for b in range(a):
            arm = X[a] - X[b]
            if (length := np.linalg.norm(arm)) < 1.6 * step:
                n = np.outer(arm, arm) / length**2 * 4e4
                for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                    K[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] += sign * n
    return X - mass @ X / mass.sum(), mass, K


def plate_flight(seed: int, markers: int, told: str) -> Recording:
    """A flight of a drawn plate with markers on its upper face, and its truth."""
    rng = np.random.default_rng([seed, markers])
    X, mass, K = plate(rng)
    square, shape = eigh(K, np.diag(np.repeat(mass, 3)))
    w, Phi = np.sqrt(square[6:9]), shape[:, 6:9].T.reshape(3, -1, 3)
    fine, every = np.arange(0, 1.0, 1e-4), 20  # 500 Hz
    q = np.zeros((len(fine), 3))
    for k in range(3):
        size = 0.004 / np.abs(Phi[k]).max() / (k + 1)
        slow = 2 * np.pi * rng.uniform(0.5, 3.0)
        q[:, k] = size * (0.5 * np.sin(slow * fine) + np.exp(-fine) * np.sin(w[k] * fine + rng.uniform(0, 6)))
    rate = 2 * np.pi * rng.uniform(0.5, 2.5, 6)
    R = Rotation.from_rotvec(np.outer(fine, rng.uniform(-6, 6, 3)) + 0.3 * np.sin(rate[:3] * fine[:, None]))
    c = 0.04 * np.sin(rate[3:] * fine[:, None]) + np.outer(fine, rng.uniform(-1, 1, 3))
    rho = np.einsum("tab,tnb->tna", R.as_matrix(), X + np.einsum("tk,kna->tna", q, Phi))
    H = np.einsum("n,tna->ta", mass, np.cross(rho, CubicSpline(fine, rho)(fine, 1)))
    at = slice(None, None, every)
    truth = {
        "force": mass.sum() * (CubicSpline(fine, c)(fine[at], 2) - GRAVITY),
        "moment": CubicSpline(fine, H)(fine[at], 1),
    }
    x = (c[:, None] + rho)[at]
    x = x + SIGMA * rng.standard_normal(x.shape)
    face = len(X) // 2 + rng.permutation(len(X) // 2)[:markers]
    names = tuple(f"n{k}" for k in range(len(X)))
    if told == "total mass":
        body, shown = told_whole(tuple(names[k] for k in face), X[face], X, mass), x[:, face]
    else:
        modes = {"mode_shape": Phi, "mode_frequency": w / (2 * np.pi)}
        known = {"stiffness": {"stiffness": K}, "modes": modes}
        body = Body(names, X, mass, **known.get(told, {}))
        shown = np.where(np.isin(np.arange(len(X)), face)[:, None], x, np.nan)
    return Recording(body, Motion(fine[at], shown, gravity=GRAVITY, noise_std={"position": SIGMA}), truth)


def plate_rows(kind: tuple[int, int], said: tuple[str, ...], lines: str) -> list[dict[str, Any]]:
    """A row a description of one plate, the first of which the others stand against."""
    (markers, seed), rows, untold = kind, [], None
    for told in said:
        recording = plate_flight(seed, markers, told)
        auto, *others = (estimated_score(recording, model=m, lines=lines) for m in ("auto", "rigid", "modal"))
        untold = untold or auto
        force, moment = (
            (own, own / min(other.error(of) for other in others), own / untold.error(of))
            for of, own in ((of, auto.error(of)) for of in (FORCE, MOMENT))
        )
        rows.append({
            "markers": str(markers), "seed": str(seed), "told": told, "taken": auto.model,
            "force (N)": force[0], "over the better": force[1], "over untold": force[2],
            "moment (N m)": moment[0], "moment over the better": moment[1], "moment over untold": moment[2],
            "force over claim": auto.over[0], "moment over claim": auto.over[1],
            "verdict": auto.verdict, "silent": auto.silent,
            "unbanded": unbanded(auto.verdict, auto.plain),
        })  # fmt: skip
    return rows


def totals(rows: list[dict[str, Any]]) -> str:
    """What the rows add up to."""

    def largest(name: str) -> str:
        both = (np.nanmax([row[key] for row in rows]) for key in (name, f"moment {name}"))
        return ", ".join(f"{value:.2f}" for value in both)

    refused = sum(row["verdict"] == "refused" for row in rows)
    return tabled(("what", "found"), [
        ["recordings, of which refused since the markers lie on a line", f"{len(rows)}, {refused}"],
        ["`auto` over the better of rigid and modal, largest: force, moment", largest("over the better")],
        ["told over told nothing, largest: force, moment", largest("over untold")],
        ["silently wrong", silent_share(row["silent"] for row in rows)],
        [UNBANDED, str(sum(row["unbanded"] for row in rows))],
    ])  # fmt: skip


def by_told(rows: list[dict[str, Any]]) -> str:
    """Errors of `auto` by what is told: medians, and the largest."""
    numbers = "force (N)", "moment (N m)", "force over claim", "moment over claim"
    lines = []
    for told in dict.fromkeys(row["told"] for row in rows):
        some = [row for row in rows if row["told"] == told]
        values = (np.array([row[name] for row in some]) for name in numbers)
        both = (f"{np.nanmedian(v):.3g} (to {np.nanmax(v):.3g})" for v in values)
        verdicts = (str(sum(r["verdict"] == v for r in some)) for v in ("ok", "degraded", "refused"))
        modal = f"{sum(row['taken'] == 'modal' for row in some)} of {len(some)}"
        lines.append([told, modal, *both, ", ".join(verdicts)])
    return tabled(("told", "modal taken", *numbers, "ok, degraded, refused"), lines)


def main() -> None:
    """Fly, estimate, and write the page."""
    taken = {"seeds": 3, "first": 0, "markers": (3, 4, 5, 6, 7, 8), "told": TOLD, "lines": "auto"}
    given = asked("evidence.drawn.plate_face", __doc__, **taken)
    kinds = list(product(given.markers, range(given.first, given.first + given.seeds)))
    work = partial(plate_rows, said=tuple(given.told), lines=given.lines)
    rows = [row for some in each(work, kinds, 1) for row in some]
    what, title = (__doc__ or "").split("\n\n", 2)[2].strip(), "A bending plate with markers on one face"
    markers = f"{min(given.markers)} to {max(given.markers)} markers"
    told = f"Errors of `auto` by what is told, {markers}: medians, and the largest."
    paged(
        given.output, "plate_face", title, f"`{given.command}`", what, RULE, totals(rows), told, by_told(rows)
    )  # fmt: skip


if __name__ == "__main__":
    main()
