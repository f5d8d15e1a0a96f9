"""What affine bodies keep, converge with, and where their charts and paths end: the numbers of the page.

Source: pseudo-rigid bodies, sections 2, 5, 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.theory.affine_printed import D0, F0, MOONEY, RIEMANN, V0, Y0
from evidence.theory.crossings import crossing, near_crossings, smooth_without_limit
from forceid import pseudorigid as pr
from forceid.errors import EstimationError
from forceid.pseudorigid.bipolar_path import turn_of_bases
from forceid.pseudorigid.ellipsoids import turn as about_z
from forceid.pseudorigid.matching import SIGNED, nearest_signed
from forceid.pseudorigid.splittings import COMPOSITIONS, SPLITTINGS

MU, FULL = 1.7 * np.eye(3), np.array([[1.0, 0.2, 0.0], [0.2, 1.5, -0.1], [0.0, -0.1, 2.2]])
FORMS = {
    "left": (pr.left_reduced, FULL),
    "two-sided": (pr.two_sided, MU),
    "general": (pr.general_reduced, FULL),
}
STEPS = {
    "blanes_moan_6": 0.2,
    "verlet": 0.05,
    "implicit_midpoint": 0.05,
    "energy": 0.05,
    "kahan_li_8": 0.26,
}  # s, the longest
SOLID = pr.Body(np.diag([1.0, 1.5, 2.2]), pr.MooneyRivlin(0.5, 0.25, incompressible=True))


@dataclass(frozen=True)
class Kept:
    """A long run: time (time,), largest change of J and C, energy less its start, largest |det F - 1|."""

    name: str
    time: Any
    momentum: float
    circulation: float
    energy: Any
    volume: float | None

    @property
    def trend(self) -> float:
        """Change of the energy over the run, by a line through its tenths, over its spread."""
        tenths = [part.mean() for part in np.array_split(self.energy[:-1], 10)]
        return float(abs(np.polyfit(range(10), tenths, 1)[0]) * 9 / np.std(self.energy))


def invariants() -> list[Kept]:
    """Verlet to T = 2000 at h = 0.05; Riemann's ellipsoid and a spinning rubber of det F = 1 to T = 100."""
    spun = np.array([[0.1, -0.9, 0.2], [1.1, 0.05, -0.3], [0.1, 0.25, -0.15]])
    rubber = pr.Body(1.7, pr.MooneyRivlin(0.6, 0.25, incompressible=True))
    runs = (
        ("Mooney-Rivlin, Verlet, h = 0.05, T = 2000", MOONEY, F0, V0, 2000, 0.05),
        ("Riemann ellipsoid, RATTLE, h = 0.01, T = 100", RIEMANN, D0, D0 @ Y0, 100, 0.01),
        ("spinning rubber of det F = 1, RATTLE, h = 0.05, T = 500", rubber, D0, D0 @ spun, 500, 0.05),
    )
    return [kept(*run) for run in runs]


def kept(name: str, body: Any, F: Any, V: Any, end: int, step: float) -> Kept:
    """What one run keeps."""
    motion = body.simulate(F, V, np.linspace(0, end, round(end / step) + 1), "verlet", step)
    J, C = (float(np.abs(x - x[0]).max()) for x in (motion.angular_momentum, motion.circulation))
    volume = float(np.abs(np.linalg.det(motion.F) - 1).max()) if body.constrained else None
    return Kept(name, motion.time, J, C, motion.energy - motion.energy[0], volume)


@dataclass(frozen=True)
class Order:
    """Errors (step,) of F at the end for steps (step,), s; the nominal order."""

    name: str
    nominal: int
    step: Any
    error: Any

    @property
    def measured(self) -> float:
        """Slope between the first two steps, each half of the one before."""
        return float(np.log2(self.error[0] / self.error[1]))


def orders() -> list[Order]:
    """Every integrator with a step: Mooney-Rivlin, and, of RATTLE, rubber with det F = 1, E = diag."""
    out = []
    names = [*SPLITTINGS, "implicit_midpoint", "energy"]
    for body, F, V, methods, end in (
        (MOONEY, F0, V0, names, 5.2),
        (SOLID, D0, D0 @ Y0, list(COMPOSITIONS), 4.0),
    ):
        held = body.constrained
        exact = body.simulate(F, V, [0.0, end], "kahan_li_8", 0.02).F[-1]
        for name in methods:
            longest = 0.25 if held and name == "kahan_li_8" else STEPS.get(name, 0.1)
            steps = longest / 2.0 ** np.arange(4)
            error = [np.abs(body.simulate(F, V, [0.0, end], name, h).F[-1] - exact).max() for h in steps]
            nominal = SPLITTINGS[name].order if name in SPLITTINGS else 2
            label = f"RATTLE, {name}" if held else name
            out.append(Order(label, nominal, steps, np.array(error)))
    return out


@dataclass(frozen=True)
class Reduced:
    """One body in one reduced form: deviation of F from the master system up to `refused` (s), or the end.

    nearest: the closest that two stretches came, of the longest; refused: NaN where the form held.
    """

    form: str
    random: bool
    nearest: float
    deviation: float
    refused: float
    reason: str


def reduced(bodies: int) -> list[Reduced]:
    """Random bodies, T = 1.5, and bodies whose stretches are made to come as near as 0.1 to 0."""
    out = []
    for name, (form, E) in FORMS.items():
        body = pr.Body(E, pr.MooneyRivlin(0.6, 0.25, 0.4, 3.0))
        rng = np.random.default_rng(17)
        for _ in range(bodies):
            F = np.diag([1.3, 1.0, 0.8]) + 0.1 * rng.standard_normal((3, 3))
            out.append(one_reduced(name, form, body, F, 0.5 * rng.standard_normal((3, 3)), 1.5, True))
        for least in (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 0.0):
            out.append(one_reduced(name, form, body, *meeting(body, least), 0.9, False))
    return out


def meeting(body: Any, least: float) -> tuple[Any, Any]:
    """A start after 0.5 s of which two stretches differ by `least`, while their axes turn."""
    B = np.array([[0.2, 0.5, -0.3], [-0.1, 0.2, 0.4], [0.3, 0.1, -0.2]])
    back = body.simulate(np.diag([1 + least / 2, 1 - least / 2, 0.8]), -B, [0.0, 0.5], "dop853")
    return back.F[-1], -back.dF[-1]


def one_reduced(name: str, form: Any, body: Any, F: Any, V: Any, end: float, random: bool) -> Reduced:
    """One body in one form."""
    time, refused, reason = np.linspace(0.0, end, 37), np.nan, ""
    try:
        found = form.simulate(body.second_moment, body.material, F, V, time).F
    except EstimationError as refusal:
        refused, reason = float(str(refusal).split("t = ")[1].split()[0]), str(refusal)
        time = np.linspace(0.0, 0.9999 * refused, 37)
        found = form.simulate(body.second_moment, body.material, F, V, time).F
    exact = body.simulate(F, V, time, "dop853").F
    a = np.linalg.svd(exact, compute_uv=False)
    near = float((-np.diff(a, axis=1).max(1) / a[:, 0]).min())
    return Reduced(name, random, near, float(np.abs(found - exact).max()), refused, reason)


@dataclass(frozen=True)
class Paths:
    """Near-crossings, all (path,): miss in steps; flagged: not `continuous` throughout.

    marked: not `defined` throughout. changed: the path says it is continuous, and eight times as many frames,
    continuous themselves, tell of another signed permutation between frames that are sure. turn: the largest
    from frame to frame that is not flagged, rad. crossed: told as such, though they miss each other in truth.
    """

    miss: Any
    flagged: Any
    marked: Any
    changed: Any
    turn: Any
    crossed: Any

    @property
    def silent(self) -> Any:
        """Changed, and neither flagged nor marked."""
        return self.changed & ~self.marked & ~self.flagged


def crossings(count: int, fine: int = 8, frames: int = 48, block: int = 500) -> Paths:
    """Random near-crossings, followed in their frames and, to judge that, in `fine` times as many."""
    rng = np.random.default_rng(29)
    parts = [one_block(rng, min(block, count - k), fine, frames) for k in range(0, count, block)]
    return Paths(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def one_block(rng: np.random.Generator, count: int, fine: int, frames: int) -> tuple[Any, ...]:
    """Those of `Paths` for some of the motions."""
    F, miss = near_crossings(count, rng, fine * (frames - 1) + 1)
    few, many = pr.bipolar_path(F[:, ::fine]), pr.bipolar_path(F)
    sure = few.defined.all(-1) & many.defined.all(-1)[:, ::fine]
    G = np.swapaxes(many.L[:, ::fine], -1, -2) @ few.L + many.R[:, ::fine] @ np.swapaxes(few.R, -1, -2)
    number = nearest_signed(G.reshape(-1, 3, 3)).reshape(G.shape[:2])
    first = number[np.arange(count), sure.argmax(1)][:, None]
    changed = (sure & (number != first)).any(1)
    changed &= many.continuous.all(1) & few.continuous.all(1)
    turn = np.where(few.continuous, np.linalg.norm(turn_of_bases(few.L, few.R), axis=-1), 0.0).max(1)
    marked = ~few.defined.all((1, 2))
    crossed = few.crossed.sum(1) % 2 == 1
    return miss / fine, ~few.continuous.all(1), marked, changed, turn, crossed


def test_path() -> list[tuple[int, float, float, int, int]]:
    """Frames; largest error of D and of the bases on the path of section 2; undefined, flagged frames."""
    out = []
    for frames in (40, 41, 200, 401, 4001):
        t = np.linspace(-0.2, 0.2, frames)
        path = pr.bipolar_path(crossing(t))
        D = np.stack([1 + t / 2, 1 - t / 2, np.ones_like(t)], -1)
        Q = about_z(-t) @ path.L  # one signed permutation, if L = R_z(t) Q
        P = SIGNED[nearest_signed(Q[:1])][0]
        size = np.abs(P).T @ D[..., None]
        out.append(
            (frames, float(np.abs(path.D - size[..., 0]).max()), float(np.abs(Q - P).max()),
             int((~path.defined.all(1)).sum()), int((~path.continuous).sum()))
        )  # fmt: skip
    return out


def counterexample() -> list[tuple[int, int, float, float]]:
    """Frames, how many are flagged, the largest |t| of these, the largest turn of the others, rad."""
    out = []
    for frames in (200, 2000, 20000):
        t = np.linspace(-0.5, 0.5, frames)
        path = pr.bipolar_path(smooth_without_limit(t))
        flagged = ~path.continuous
        turns = np.linalg.norm(turn_of_bases(path.L, path.R), axis=-1)
        out.append(
            (frames, int(flagged.sum()), float(np.abs(t[flagged]).max(initial=0.0)),
             float(turns[~flagged].max()))
        )  # fmt: skip
    return out
