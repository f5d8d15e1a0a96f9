"""A bending plate with three to eight markers on one face: `auto` beside rigid and modal, told and untold.

    python -m evidence.drawn.plate_face -o FOLDER [--seeds 3] [--first 0] [--lines auto]

Two layers of point masses joined by springs vibrate in their lowest modes while the plate flies and turns;
force and moment follow from the momenta of all masses. Told: nothing but total mass and inertia, all masses,
the stiffness beside them, or three modes. Errors of `auto` are told over those of the better of the two,
and over those of `auto` where nothing is told.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from evidence.written import asked, table, written
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

TOLD = ("total mass", "masses", "stiffness", "modes")
GRAVITY = np.array([0.0, 0.0, -9.81])
SIGMA = 3e-4  # m


def plate(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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


def flown(seed: int, markers: int, told: str) -> Recording:
    """A flight of a drawn plate with markers on its upper face, and its truth."""
    rng = np.random.default_rng([seed, markers])
    X, mass, K = plate(rng)
    M = np.repeat(mass, 3)
    square, shape = eigh(K, np.diag(M))
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
    spline = CubicSpline(fine, rho)
    H = np.einsum("n,tna->ta", mass, np.cross(rho, spline(fine, 1)))
    at = slice(None, None, every)
    truth = {
        "force": mass.sum() * (CubicSpline(fine, c)(fine[at], 2) - GRAVITY),
        "moment": CubicSpline(fine, H)(fine[at], 1),
    }
    x = (c[:, None] + rho)[at]
    x = x + SIGMA * rng.standard_normal(x.shape)
    face = len(X) // 2 + rng.permutation(len(X) // 2)[:markers]
    hidden = np.ones(len(X), bool)
    hidden[face] = False
    shown, noise = np.where(hidden[:, None], np.nan, x), {"position": SIGMA}
    motion = Motion(fine[at], shown, gravity=GRAVITY, noise_std=noise)
    names = tuple(f"n{k}" for k in range(len(X)))
    body = Body(names, X, mass)
    if told == "total mass":
        E = np.einsum("n,na,nb->ab", mass, X, X)
        inertia = np.trace(E) * np.eye(3) - E
        whole = {"total_mass": mass.sum(), "mass_center": np.zeros(3), "inertia": inertia}
        body = Body(tuple(names[k] for k in face), X[face], **whole)
        motion = Motion(motion.time, x[:, face], gravity=GRAVITY, noise_std=noise)
    if told == "stiffness":
        body = Body(names, X, mass, stiffness=K)
    if told == "modes":
        body = Body(names, X, mass, mode_shape=Phi, mode_frequency=w / (2 * np.pi))
    return Recording(body, motion, truth)


def errors(recording: Recording, model: str, lines: str) -> tuple[float, float, float, float, str, str]:
    """Rms errors of force and moment, both over their claims, the model taken and the verdict."""
    found = estimate_recording(recording, load_settings(model=model, lines=lines))
    keep = slice(len(found.time) // 8, -(len(found.time) // 8))
    out = []
    for value, std, name in (
        (found.force, found.force_std, "force"),
        (found.moment, found.moment_std, "moment"),
    ):
        off = float(np.sqrt(((value - recording.truth[name])[keep] ** 2).mean()))
        out.append((off, off / float(np.sqrt((std[keep] ** 2).mean()))))
    (f, fc), (m, mc) = out
    return f, m, fc, mc, found.model, found.verdict.level


def study(
    seeds: range, counts: tuple[int, ...], said: tuple[str, ...], lines: str = "auto"
) -> list[dict[str, Any]]:
    """A row a number of markers, a seed and a description, the first of which the others stand against."""
    rows = []
    for markers in counts:
        for seed in seeds:
            untold = None
            for told in said:
                recording = flown(seed, markers, told)
                auto, *others = (errors(recording, m, lines) for m in ("auto", "rigid", "modal"))
                best = [min(other[i] for other in others) for i in (0, 1)]
                untold = untold or auto
                rows.append(
                    {
                        "markers": str(markers), "seed": str(seed), "told": told, "taken": auto[4],
                        "force (N)": auto[0], "over the better": auto[0] / best[0],
                        "over untold": auto[0] / untold[0],
                        "moment (N m)": auto[1], "moment over the better": auto[1] / best[1],
                        "moment over untold": auto[1] / untold[1],
                        "force over claim": auto[2], "moment over claim": auto[3], "verdict": auto[5],
                    }
                )  # fmt: skip
                print({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in rows[-1].items()}, flush=True)
    return rows


def page(rows: list[dict[str, Any]], command: str) -> str:
    """What was found, and every row."""

    def largest(name: str) -> str:
        both = (np.nanmax([row[key] for row in rows]) for key in (name, f"moment {name}"))
        return ", ".join(f"{value:.2f}" for value in both)

    what = (__doc__ or "").split("\n\n", 2)[2].strip()
    refused = sum(row["verdict"] == "refused" for row in rows)
    wrong = [
        r for r in rows if r["verdict"] == "ok" and max(r["force over claim"], r["moment over claim"]) > 2
    ]
    return f"""# A bending plate with markers on one face

`{command}`

{what}

| what | found |
|---|---|
| recordings, of which refused since the markers lie on a line | {len(rows)}, {refused} |
| `auto` over the better of rigid and modal, largest: force, moment | {largest("over the better")} |
| told over told nothing, largest: force, moment | {largest("over untold")} |
| verdict `ok`, error at any frequency over twice the claim | {len(wrong)} |

{table(rows)}
"""


def main() -> None:
    """Fly, estimate, and write the page."""
    given = asked(
        "evidence.drawn.plate_face",
        __doc__,
        seeds=3,
        first=0,
        markers=(3, 4, 5, 6, 7, 8),
        told=tuple(TOLD),
        lines="auto",
    )
    seeds = range(given.first, given.first + given.seeds)
    rows = study(seeds, tuple(given.markers), tuple(given.told), given.lines)
    written(given.output, "plate_face.md", page(rows, given.command))


if __name__ == "__main__":
    main()
