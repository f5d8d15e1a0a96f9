"""Affine bodies whose markers are not centered on the mass center: error over claim, coverage, silent errors.

    python -m evidence.drawn.affine_offsets -o FOLDER [--scenes 8] [--seed 0]

Every scene is drawn: a block that turns, stretches and shears by smooth closed forms under a smooth force.
Its loads follow from m c'' and F'' E F^T of these forms alone. Markers sit at 0, 2, 14 and 47 mm from the
mass center on the mean. The body is told as a whole (total mass and inertia), by all its masses, or with two
masses unmarked.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import estimated_score, stacked, told_whole
from evidence.judged import RULE, silent_share
from evidence.vectors import GRAVITY
from evidence.written import asked, each, paged, table
from forceid.records import Body, Motion, Recording

OFFSETS = (0.0, 0.002, 0.014, 0.047)  # m
TOLD = ("total mass", "lumped", "lumped, 2 unmarked")
SIGMA = 3e-4  # m


def drawn_recording(rng: np.random.Generator, offset: float, told: str) -> Recording:
    """A recording with its force and moment."""
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
    w = 2 * np.pi * rng.uniform(0.5, 3.0, (2, 9))
    strain = 0.04 * np.sin(w[0] * fine[:, None] + rng.uniform(0, 6, 9)).reshape(-1, 3, 3)
    spin = rng.uniform(-1, 1, 3)
    angle = fine[:, None] * spin / np.linalg.norm(spin) * 2 * np.pi * rng.uniform(0.5, 4.0)
    angle = angle + 0.3 * np.sin(w[1, :3] * fine[:, None])
    F = Rotation.from_rotvec(angle).as_matrix() @ (np.eye(3) + strain)
    c = 0.05 * np.sin(w[1, 3:6] * fine[:, None] + rng.uniform(0, 6, 3))
    c += np.outer(fine, rng.uniform(-1, 1, 3))
    t = fine[::every]
    second_F, second_c = (CubicSpline(fine, path)(t, 2) for path in (F, c))
    F, c = F[::every], c[::every]
    E = np.einsum("n,na,nb->ab", mass, X, X)
    N = np.einsum("tij,jk,tlk->til", second_F, E, F)  # force along i, arm along l
    moment = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], 1)
    x = c[:, None] + np.einsum("tab,nb->tna", F, seen) + SIGMA * rng.standard_normal((len(t), 8, 3))
    names = tuple("abcdefgh")
    body = told_whole(names, seen, X, mass) if told == "total mass" else Body(names, X, mass)
    if told == "lumped, 2 unmarked":
        x[:, :2] = np.nan
    truth = {"force": mass.sum() * (second_c - GRAVITY), "moment": moment}
    return Recording(body, Motion(t, x, gravity=GRAVITY, noise_std={"position": SIGMA}), truth)


def offset_row(kind: tuple[str, float], scenes: int, seed: int, model: str) -> dict[str, Any]:
    """An offset and a description: error over claim, coverage, silent."""
    told, offset = kind
    draws = (drawn_recording(np.random.default_rng([seed, scene]), offset, told) for scene in range(scenes))
    scores = [estimated_score(draw, model=model) for draw in draws]
    ratio = np.array([s.over for s in scores])
    ok = sum(s.verdict == "ok" for s in scores)
    force, moment = np.sqrt((ratio**2).mean(0))
    return {
        "body told by": told, "offset (mm)": f"{1e3 * offset:.0f}", "force, error over claim": f"{force:.2f}",
        "moment, error over claim": f"{moment:.2f}",
        "95 % interval holds (%)": f"{100 * stacked(scores, 'inside').mean():.1f}",
        "ok": f"{ok} of {scenes}", "silently wrong": silent_share(s.silent for s in scores),
    }  # fmt: skip


def main() -> None:
    """Draw, estimate, and write the page."""
    given = asked("evidence.drawn.affine_offsets", __doc__, scenes=8, seed=0, model="affine")
    work = partial(offset_row, scenes=given.scenes, seed=given.seed, model=given.model)
    rows = list(each(work, list(product(TOLD, OFFSETS)), 1))
    what = (__doc__ or "").split("]", 2)[2].strip()
    title = "Affine bodies with markers off the mass center"
    paged(given.output, "affine_offsets", title, f"`{given.command}`", what, RULE, table(rows))


if __name__ == "__main__":
    main()
