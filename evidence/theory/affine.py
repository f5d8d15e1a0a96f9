"""Affine bodies: the level that `auto` takes, and error, claim and coverage of force, moment, first moments.

    python -m evidence.theory.affine -o docs [--count 60] [--seed 0] [--jobs 1]

Bodies of 6 to 15 unequal masses are drawn, with a law that lets them swing at 2 to 8 Hz:
Saint Venant and Kirchhoff, neo-Hookean, or a spring on every strain. They spin at 0.2 to 1.2 turns a second.
A force of three sines and first moments of nine, up to 5 Hz, turn with the body. scipy's DOP853 flies them by
equations that stand here. Those that stretch by less than 0.35 or more than 1.8 are left out. Markers sit
on all masses, 0.1 to 1 mm, 250 or 500 Hz. The body is told by its masses, or as a whole, and the noise is
stated or not.

Every flight is estimated under model = "auto", "rigid", "affine" and "modal". Errors are over the central
three quarters. A level is enough where force and moment are within 1.2 of the best of all levels; the
smallest of those is affine (12 numbers), unless rigid is. First moments count for all frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import FORCE, MOMENT, scored, told_whole
from evidence.judged import RULE, judged_part, over_claim, samples_a_second, silent_share, silently_wrong
from evidence.vectors import EYE, GRAVITY
from evidence.written import asked, each, paged, pictured, table
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Body, Estimate, Motion, Recording, deviation
from forceid.report.plots.style import BLUE, STYLE, draw_band, draw_estimate, draw_line, label
from forceid.significance import QUANTILE

LAWS, LEVELS = ("neo-Hookean", "St. Venant-Kirchhoff", "springs"), ("rigid", "affine", "modal")
LEAST, MOST, ENOUGH = 0.35, 1.8, 1.2  # stretch; errors over those of the best level
NEAR_COLLAPSE = 0.15  # det F: a flight that comes so near to a collapse ends there
ENTRIES = [f"{f}{arm}" for f in "xyz" for arm in "xyz"]  # force along, arm along


@dataclass(frozen=True)
class Push:
    """A force of three sines and first moments of nine: sizes, rad/s and phases, force first."""

    size: tuple[float, float]
    w: Array
    phase: Array

    def force(self, t: Any) -> Array:
        """Force (..., 3) N, world axes."""
        return np.asarray(self.size[0] * np.sin(np.multiply.outer(t, self.w[:3]) + self.phase[:3]))

    def first(self, t: float, F: Array) -> Array:
        """First moments (3, 3) J, arms in the reference, which turn with the body."""
        return np.asarray(
            polar(F)[0] @ (self.size[1] * np.sin(self.w[3:] * t + self.phase[3:]).reshape(3, 3))
        )


def stressed(law: str, lam: float, mu: float, F: Array) -> Array:
    """First Piola-Kirchhoff stress (3, 3) J."""
    if law == "springs":
        return np.asarray(mu * (F - polar(F)[0]))
    if law == "neo-Hookean":
        J, cof = np.linalg.det(F), np.linalg.inv(F).T
        return np.asarray(mu * (F - cof) + lam * (J * J - J) * cof)
    strain = 0.5 * (F.T @ F - EYE)
    return np.asarray(F @ (lam * np.trace(strain) * EYE + 2 * mu * strain))


def drawn(seed: int, index: int) -> tuple[Recording, str, tuple[float, float]]:
    """A flight with the truth of force, moment and first moments; its law, and its least and most stretch."""
    rng, law = np.random.default_rng([seed, index]), LAWS[index % 3]
    nodes = int(rng.integers(6, 16))
    X, mass = rng.standard_normal((nodes, 3)) * rng.uniform(0.08, 0.16, 3), rng.uniform(0.03, 0.2, nodes)
    X -= mass @ X / mass.sum()
    E = (mass * X.T) @ X
    mean, least = np.trace(E) / 3, np.linalg.eigvalsh(E)[0]
    mu = mean * (2 * np.pi * rng.uniform(2, 8)) ** 2
    lam = mu * rng.uniform(0.5, 2)
    size = rng.uniform(0.3, 3) * mass.sum(), rng.uniform(0.05, 0.4) * mu * min(1.0, 3 * least / mean)
    push = Push(size, 2 * np.pi * rng.uniform(0.3, 5, 12), rng.uniform(0, 6, 12))
    rate, duration, sigma = rng.choice([250, 500]), rng.uniform(1, 2), rng.choice([1e-4, 3e-4, 1e-3])

    def rates(t: float, y: Array) -> Array:
        F, inverse = y[6:15].reshape(3, 3), np.linalg.inv(E)
        K = push.first(t, F) - stressed(law, lam, mu, F)
        return np.concatenate([y[3:6], push.force(t) / mass.sum() + GRAVITY, y[15:], (K @ inverse).ravel()])

    def folded(_: float, y: Array) -> float:
        return float(np.linalg.det(y[6:15].reshape(3, 3)) - NEAR_COLLAPSE)

    folded.terminal = True  # type: ignore[attr-defined]
    F0 = Rotation.random(rng=rng).as_matrix() @ (EYE + rng.uniform(-0.15, 0.15) * np.diag([1, -0.5, -0.5]))
    spin = 2 * np.pi * rng.uniform(0.2, 1.2) * (v := rng.standard_normal(3)) / np.linalg.norm(v)
    V0 = np.cross(EYE, spin).T @ F0 + rng.uniform(0, 0.8) * rng.standard_normal((3, 3))
    start = np.concatenate([np.zeros(3), rng.uniform(-1, 1, 3), F0.ravel(), V0.ravel()])
    time = np.arange(0, duration, 1 / rate)
    flown = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-11, events=folded)
    time, c, F = flown.t, flown.y[:3].T, flown.y[6:15].T.reshape(-1, 3, 3)
    N = np.array([(push.first(t, f) - stressed(law, lam, mu, f)) @ f.T for t, f in zip(time, F, strict=True)])
    moment = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], 1)
    x = c[:, None] + np.einsum("tab,nb->tna", F, X) + sigma * rng.standard_normal((len(time), nodes, 3))
    names = tuple(f"n{i}" for i in range(nodes))
    body = told_whole(names, X, X, mass) if index % 4 == 1 else Body(names, X, mass)
    motion = Motion(time, x, gravity=GRAVITY, noise_std={"position": float(sigma)} if index % 4 != 2 else {})
    truth = {"force": push.force(time), "moment": moment, "first_moment": N}
    stretch = np.linalg.svd(F, compute_uv=False)
    return Recording(body, motion, truth), law, (float(stretch.min()), float(stretch.max()))


def judged(index: int, seed: int) -> dict[str, Any] | None:
    """A flight under every level; None where it stretches too far."""
    recording, law, (least, most) = drawn(seed, index)
    if least < LEAST or most > MOST:
        return None
    truth = recording.truth
    scores, seconds, first, held = {}, 0.0, np.nan, np.nan
    for level in ("auto", *LEVELS):
        began = process_time()
        found = estimate_recording(recording, load_settings(model=level))
        scores[level] = scored(
            found, truth["force"], truth["moment"], verdict=found.verdict.level, model=found.model
        )
        if level == "auto":
            seconds = process_time() - began
            if found.first_moment is not None and found.first_moment_cov is not None:
                error = (found.first_moment - truth["first_moment"]).reshape(-1, 9)
                std = deviation(found.first_moment_cov)
                first = over_claim(error, std, np.full(9, np.inf), samples_a_second(found.time))
                held = np.mean(judged_part(np.abs(error) <= QUANTILE * std))
    auto, each_level = scores["auto"], [scores[level] for level in LEVELS]
    best = [np.nanmin([s.error(of) for s in each_level]) for of in (FORCE, MOMENT)]
    worse = [[s.error(of) / b for of, b in zip((FORCE, MOMENT), best, strict=True)] for s in each_level]
    enough = next(k for k, one in zip(LEVELS, worse, strict=True) if max(one) <= ENOUGH)
    return {
        "law": law, "least": least, "most": most, "level": auto.model, "verdict": auto.verdict,
        "worse": [auto.error(of) / b for of, b in zip((FORCE, MOMENT), best, strict=True)],
        "smallest": auto.model == enough, "seconds": seconds,
        "claim": [*auto.over, first],
        "silent": silently_wrong(auto.verdict, auto.over, auto.beside, [first]),
        "inside": [auto.inside[FORCE].mean(), auto.inside[MOMENT].mean(), held],
    }  # fmt: skip


def table_row(name: str, cases: list[dict[str, Any]]) -> dict[str, Any]:
    """A line of the table."""
    worse, claim, inside = (np.array([c[k] for c in cases]) for k in ("worse", "claim", "inside"))

    def spread(values: Array) -> str:
        return f"{np.nanmedian(values):.2f} (to {np.nanmax(values):.2f})"

    return {
        "law": name, "flights": len(cases),
        "error over that of the best level: force, moment": f"{spread(worse[:, 0])}, {spread(worse[:, 1])}",
        "smallest level that is enough": f"{sum(c['smallest'] for c in cases)}",
        "error over claim: force": spread(claim[:, 0]), "moment": spread(claim[:, 1]),
        "first moments": spread(claim[:, 2]),
        "95 % holds (%): force, moment, first moments": ", ".join(
            f"{100 * v:.1f}" for v in np.nanmean(inside, 0)
        ),
        "ok, degraded, refused": ", ".join(
            str(sum(c["verdict"] == level for c in cases)) for level in ("ok", "degraded", "refused")
        ),
        "silently wrong": silent_share(c["silent"] for c in cases),
        "CPU, s, median": f"{np.median([c['seconds'] for c in cases]):.1f}",
    }  # fmt: skip


@rc_context(STYLE)
def moment_figure(recording: Recording, estimate: Estimate) -> Figure:
    """Nine first moments of a flight with their bands and truth, and their errors below."""
    found, true = np.asarray(estimate.first_moment), recording.truth["first_moment"]
    std = np.sqrt(np.diagonal(np.asarray(estimate.first_moment_cov), axis1=1, axis2=2)).reshape(found.shape)
    figure = Figure(figsize=(10.0, 8.6), layout="constrained")
    panels = figure.subplots(6, 3, sharex=True, height_ratios=3 * (2.0, 1.0))
    for k, entry in enumerate(ENTRIES):
        i, j = divmod(k, 3)
        above, below = panels[2 * i, j], panels[2 * i + 1, j]
        half, off = 2 * std[:, i, j], found[:, i, j] - true[:, i, j]
        draw_estimate(above, estimate.time, found[:, i, j], half, true[:, i, j])
        draw_band(below, estimate.time, -1e3 * half, 1e3 * half, color=BLUE, alpha=0.22)
        draw_line(below, estimate.time, 1e3 * off, color=BLUE)
        most = 3e3 * float(np.median(half))
        below.set_ylim(-most, most)
        label(above, f"$N_{{{entry}}}$", "N m" if j == 0 else "", "")
        label(below, "", "mN m" if j == 0 else "", "time (s)" if i == 2 else "")
    figure.suptitle("First moments of force, truth dashed; errors in their two-sigma bands below")
    return figure


def main() -> None:
    """Draw, estimate, and write the page."""
    given = asked("evidence.theory.affine", __doc__, count=60, seed=0, jobs=1)
    found = each(partial(judged, seed=given.seed), range(given.count), given.jobs)
    cases = [case for case in found if case is not None]
    rows = [table_row(law, own) for law in LAWS if (own := [c for c in cases if c["law"] == law])]
    what = (__doc__ or "").split("]\n", 1)[1].strip()
    shown = next(
        r for k in range(given.count) if (r := drawn(given.seed, k)) and r[2][0] > LEAST and r[2][1] < MOST
    )
    estimate = estimate_recording(shown[0], load_settings(model="affine"))
    pictured(given.output, "affine", moment_figure(shown[0], estimate), dpi=110)
    picture = "![Nine first moments of a flight](affine.png)"
    title = "First moments of force on affine bodies"
    paged(
        given.output,
        "affine",
        title,
        f"`{given.command}`",
        what,
        RULE,
        table([*rows, table_row("all", cases)]),
        picture,
    )


if __name__ == "__main__":
    main()
