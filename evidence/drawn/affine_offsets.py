"""Affine bodies whose markers are not centered on the mass center: error over claim, coverage, silent errors.

    python -m evidence.drawn.affine_offsets -o FOLDER [--scenes 8] [--seed 0]

Every scene is drawn: a block that turns, stretches and shears by smooth closed forms under a smooth force.
Its loads follow from m c'' and F'' E F^T of these forms alone. Markers sit at 0, 2, 14 and 47 mm from the
mass center on the mean. The body is told as a whole (total mass and inertia), by all its masses, or with two
masses unmarked.
Silent: verdict `ok`, and an rms error over the central three quarters of more than twice the claim.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from evidence.written import asked, table, written
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

OFFSETS = (0.0, 0.002, 0.014, 0.047)  # m
TOLD = ("total mass", "lumped", "lumped, 2 unmarked")
GRAVITY = np.array([0.0, 0.0, -9.81])


def drawn(rng: np.random.Generator, offset: float, told: str) -> tuple[Recording, np.ndarray, np.ndarray]:
    """A recording, its force and its moment (time, 3)."""
    fine, every = np.arange(0, 1.2, 1e-4), 40  # 250 Hz
    size = rng.uniform(0.05, 0.2, 3)
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3)
    X = corners * size + 0.02 * rng.standard_normal((8, 3))
    mass = rng.uniform(0.05, 0.2, 8)
    X -= mass @ X / mass.sum()
    if told == "total mass":
        toward = rng.standard_normal(3)
        seen = X - X.mean(0) + offset * toward / np.linalg.norm(toward)
    elif offset:  # the masses are made unequal until their mean is that far from the markers'
        toward = rng.standard_normal(3)
        X = X - X.mean(0)
        pull = X @ toward / np.linalg.norm(X @ toward)
        mass = 0.1 * (1 + pull * min(offset / np.linalg.norm(pull @ X / 8), 0.9 / np.abs(pull).max()))
        X -= mass @ X / mass.sum()
        seen = X
    else:
        mass, X = np.full(8, 0.1), X - X.mean(0)
        seen = X
    E = np.einsum("n,na,nb->ab", mass, X, X)
    w = 2 * np.pi * rng.uniform(0.5, 3.0, (2, 9))
    strain = 0.04 * np.sin(w[0] * fine[:, None] + rng.uniform(0, 6, 9)).reshape(-1, 3, 3)
    spin = rng.uniform(-1, 1, 3)
    angle = fine[:, None] * spin / np.linalg.norm(spin) * 2 * np.pi * rng.uniform(0.5, 4.0)
    angle = angle + 0.3 * np.sin(w[1, :3] * fine[:, None])
    F = Rotation.from_rotvec(angle).as_matrix() @ (np.eye(3) + strain)
    c = 0.05 * np.sin(w[1, 3:6] * fine[:, None] + rng.uniform(0, 6, 3))
    c += np.outer(fine, rng.uniform(-1, 1, 3))
    second_F = CubicSpline(fine, F)(fine[::every], 2)
    second_c = CubicSpline(fine, c)(fine[::every], 2)
    t, F, c = fine[::every], F[::every], c[::every]
    N = np.einsum("tij,jk,tlk->til", second_F, E, F)  # force along i, arm along l
    moment = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], 1)
    sigma = 3e-4
    x = c[:, None] + np.einsum("tab,nb->tna", F, seen) + sigma * rng.standard_normal((len(t), 8, 3))
    names = tuple("abcdefgh")
    if told == "total mass":
        inertia = np.trace(E) * np.eye(3) - E
        body = Body(names, seen, total_mass=mass.sum(), mass_center=np.zeros(3), inertia=inertia)
    else:
        body = Body(names, X, mass)
    if told == "lumped, 2 unmarked":
        x[:, :2] = np.nan
    motion = Motion(t, x, gravity=GRAVITY, noise_std={"position": sigma})
    keep = slice(len(t) // 8, -(len(t) // 8))
    return Recording(body, motion), (mass.sum() * (second_c - GRAVITY))[keep], moment[keep]


def study(scenes: int, seed: int, model: str) -> list[dict[str, Any]]:
    """A row an offset and a description: error over claim, coverage, silent."""
    rows = []
    for told in TOLD:
        for offset in OFFSETS:
            ratio, inside, silent, ok = [], [], 0, 0
            for scene in range(scenes):
                rng = np.random.default_rng([seed, scene])
                recording, force, moment = drawn(rng, offset, told)
                found = estimate_recording(recording, load_settings(model=model))
                keep = slice(len(found.time) // 8, -(len(found.time) // 8))
                each = []
                for value, std, truth in (
                    (found.force, found.force_std, force),
                    (found.moment, found.moment_std, moment),
                ):
                    off, std = (value[keep] - truth), std[keep]
                    each.append(float(np.sqrt((off**2).mean() / (std**2).mean())))
                    inside.append(float((np.abs(off) < 1.96 * std).mean()))
                ratio.append(each)
                good = found.verdict.level == "ok"
                ok += good
                silent += good and max(each) > 2
            force_ratio, moment_ratio = np.sqrt((np.array(ratio) ** 2).mean(0))
            rows.append(
                {
                    "body told by": told, "offset (mm)": f"{1e3 * offset:.0f}",
                    "force, error over claim": f"{force_ratio:.2f}",
                    "moment, error over claim": f"{moment_ratio:.2f}",
                    "95 % interval holds (%)": f"{100 * np.mean(inside):.1f}", "ok": f"{ok} of {scenes}",
                    "silently wrong": str(silent),
                }
            )  # fmt: skip
            print(rows[-1], flush=True)
    return rows


def page(rows: list[dict[str, Any]], command: str) -> str:
    """What was done, and every row."""
    return f"""# Affine bodies with markers off the mass center

`{command}`

{(__doc__ or "").split("]", 2)[2].strip()}

{table(rows)}
"""


def main() -> None:
    """Draw, estimate, and write the page."""
    given = asked("evidence.drawn.affine_offsets", __doc__, scenes=8, seed=0, model="affine")
    rows = study(given.scenes, given.seed, given.model)
    written(given.output, "affine_offsets.md", page(rows, given.command))


if __name__ == "__main__":
    main()
