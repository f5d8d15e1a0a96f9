"""Coefficients of the air from drawn flights: whether intervals hold, and whether the right terms are chosen.

    python -m evidence.drawn.coefficients [--count 100] [--seed 2207] [--jobs 1] [-o docs]

Gliders and frisbees with drawn coefficients, sizes, air, wind and launch, one flight each, flown by Dormand
and Prince under laws of their own; each is estimated from its markers, and a law of more terms than it has is
fitted to the estimate. Beside them baseballs with drag and Magnus force, and the scenes that forceid ships.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from evidence.claims.coverage import SCENES
from evidence.drawn.records.aircraft import Drawn, frisbee, glider, thrown_ball
from evidence.written import asked, each, paged, pictured, tabled
from forceid.config import AeroSetting, load_settings
from forceid.errors import ForceIdError
from forceid.estimation.run import estimate_recording
from forceid.laws import FittedLaw, fit_flights, law_setting
from forceid.records import Estimate, Recording
from forceid.report.plots.style import BLUE, GRAY, VERMILION, label, panels
from forceid.scenes import load_recipe, simulate

DRAW = {"glider": glider, "frisbee": frisbee, "ball": thrown_ball}
TERMS: dict[str, dict[str, list[str]]] = {
    "glider": {
        "lift": ["1", "alpha", "alpha^2", "q"], "drag": ["1", "alpha", "alpha^2"], "side": ["beta", "p", "r"],
        "roll": ["1", "beta", "p", "r"], "pitch": ["1", "alpha", "alpha^2", "q"],
        "yaw": ["1", "beta", "p", "r"],
    },
    "frisbee": {
        "lift": ["1", "alpha", "alpha^2"], "drag": ["1", "alpha", "alpha^2"], "side": ["spin_rate"],
        "roll": ["roll_rate", "spin_rate"], "pitch": ["1", "alpha", "alpha^2", "pitch_rate"],
        "yaw": ["spin_rate"],
    },
    "ball": {"drag": ["1", "spin"], "lift": ["1", "spin"], "side": ["1"], "pitch": ["1"]},
}  # fmt: skip
BALLS = 5  # of the drawn records, one in so many
JUDGED = ("lift", "drag", "pitch")  # CL, CD, Cm
ABOUT = """\
Made by `{command}`, {seconds:.0f} s of CPU. Model gliders fly for 2 s and frisbees for 1.2 s, {gliders} of \
each. Coefficients, sizes, air, wind and launch are drawn. 6 and 9 markers have 0.1 to 0.4 mm of noise at \
100 Hz, stated in half of them. A glider has 14 to 16 of 22 terms that its law offers, a frisbee 9 to 11 of \
14. Held: shares of the true coefficients within their interval of 95 %. One whose term was not chosen \
counts as outside. Error over claim: rms, of those chosen. Terms right: flights whose law has the true terms \
and no other."""


@dataclass(frozen=True)
class JudgedLaw:
    """A drawn flight and the law found: error over claim of every true term, NaN where it was not chosen."""

    kind: str
    true: dict[str, float]
    off: dict[str, float]
    extra: tuple[str, ...]
    factor: float
    refused: str = ""

    @property
    def right(self) -> bool:
        """Whether the law has the true terms and no other."""
        return not self.refused and not self.extra and not np.isnan(list(self.off.values())).any()


def fitted(
    recording: Recording, aero: AeroSetting, terms: dict[str, Any], **more: Any
) -> tuple[Estimate, FittedLaw]:
    """The estimate of a recording, and the law of the air that was found from it."""
    settings = load_settings(model=more.pop("model", "rigid")).model_copy(update={"aero": aero})
    estimate = estimate_recording(recording, settings)
    return estimate, fit_flights([("flight", estimate)], law_setting({"law": terms, **more}, "law"), "law")


def run_flight(job: tuple[str, int, int]) -> JudgedLaw:
    """One drawn flight, estimated and fitted."""
    kind, k, seed = job
    drawn: Drawn = DRAW[kind](np.random.default_rng([seed, list(DRAW).index(kind), k]))
    try:
        _, law = fitted(drawn.recording, drawn.aero, TERMS[kind])
    except ForceIdError as e:
        return JudgedLaw(kind, drawn.true, dict.fromkeys(drawn.true, np.nan), (), 1.96, str(e))
    off = {n: (v - drawn.true.get(n, 0.0)) / s for n, v, s in zip(law.name, law.value, law.std, strict=True)}
    extra = tuple(n for n in law.name if n not in drawn.true)
    return JudgedLaw(kind, drawn.true, {n: off.get(n, np.nan) for n in drawn.true}, extra, law.factor)


def kind_rows(kind: str, of: list[JudgedLaw]) -> list[list[str]]:
    """The rows of a kind: by component, and of all."""
    rows = []
    right = f"{sum(j.right for j in of)} of {len(of)}"
    for name in (*JUDGED, "all"):
        off = [(z, j.factor) for j in of for n, z in j.off.items() if name in ("all", n.split(".")[0])]
        if not off:
            continue
        inside = np.mean([abs(z) < f for z, f in off])
        over = np.sqrt(np.nanmean(np.square([z for z, _ in off])))
        rows.append(
            [
                kind,
                name,
                str(len(off)),
                f"{100 * inside:.1f} %",
                f"{over:.2f}",
                right if name == "all" else "",
            ]
        )
    return rows


def shipped() -> list[list[str]]:
    """The scenes that forceid ships with laws of the air, and their coefficients."""
    from forceid.scenes.flights import flexible_boomerang
    from forceid.scenes.flights import frisbee as shipped_disc

    disc, rows = load_recipe(SCENES / "frisbee.toml"), []
    p = shipped_disc.Parameters()
    aero = AeroSetting(area=p.area, chord=p.diameter, density=p.air_density, axes="disc")
    k, a0 = p.coefficients, np.radians(p.coefficients.alpha0)
    true = {
        "lift.1": k.PL0, "lift.alpha": k.PLa, "drag.1": k.PD0 + k.PDa * a0**2, "drag.alpha": -2 * k.PDa * a0,
        "drag.alpha^2": k.PDa, "roll.roll_rate": k.PTxwx, "roll.spin_rate": k.PTxwz, "pitch.1": k.PTy0,
        "pitch.alpha": k.PTya, "pitch.pitch_rate": k.PTywy, "yaw.spin_rate": -k.PTzwz,
    }  # fmt: skip
    rows += scene_rows("frisbee", fitted(simulate(disc), aero, TERMS["frisbee"])[1], true)
    b = flexible_boomerang.Parameters()
    area = flexible_boomerang.AREA
    aero = AeroSetting(area=float(area.sum()), density=b.air_density)
    strips = {"area": area.tolist()}
    terms = {"strip_lift": ["1", "sin(7)", "cos(7)", "sin(18)", "cos(18)"], "strip_drag": ["1"]}
    slow = 0.2 * b.lift * np.array([np.cos(0.5), np.sin(0.5)])
    true = {
        "strip_lift.1": b.lift, "strip_lift.sin(7)": 0.3 * b.lift, "strip_lift.cos(7)": 0.0,
        "strip_lift.sin(18)": float(slow[0]), "strip_lift.cos(18)": float(slow[1]), "strip_drag.1": b.drag,
    }  # fmt: skip
    thrown = simulate(load_recipe(SCENES / "flexible_boomerang.toml"))
    return rows + scene_rows("boomerang", fitted(thrown, aero, terms, model="auto", strips=strips)[1], true)


def scene_rows(scene: str, law: FittedLaw, true: dict[str, float]) -> list[list[str]]:
    """A row for every coefficient of a scene."""
    found = {n: (v, s) for n, v, s in zip(law.name, law.value, law.std, strict=True)}
    rows = []
    for name in dict.fromkeys((*true, *found)):
        value, std = found.get(name, (np.nan, np.nan))
        said = f"{value:.5g} ± {law.factor * std:.2g}" if name in found else "not chosen"
        rows.append([scene, name, f"{true.get(name, 0.0):.5g}", said])
    return rows


def polar_figure(seed: int) -> Any:
    """The picture: lift and drag of a glider over the angle of attack, as estimated, fitted, and true."""
    drawn = glider(np.random.default_rng([seed, 0, 0]))
    estimate, law = fitted(drawn.recording, drawn.aero, TERMS["glider"])
    assert estimate.aero is not None
    figure, axes = panels(1, 2, (10.0, 3.9))
    alpha = np.degrees(estimate.aero["alpha"])
    grid = np.linspace(*np.radians(np.percentile(alpha, [1, 99])), 100)
    for ax, name, component in ((axes[0, 0], "CL", "lift"), (axes[0, 1], "CD", "drag")):
        ax.plot(alpha, estimate.aero[name], ".", color=GRAY, ms=3, label="estimate, sample by sample")
        found = dict(zip(law.name, law.value, strict=True))
        for of, color, width, said in (
            (found, BLUE, 2.5, "law that was fitted"),
            (drawn.true, VERMILION, 1.0, "law that it flew by"),
        ):
            line = sum(
                of.get(f"{component}.{t}", 0.0) * grid**n for n, t in enumerate(("1", "alpha", "alpha^2"))
            )
            ax.plot(np.degrees(grid), line, color=color, lw=width, label=said)
        label(ax, f"{component.capitalize()} of a glider", f"$C_{name[1]}$", "angle of attack (degrees)")
        low, high = np.min(line), np.max(line)
        ax.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    axes[0, 0].legend(loc="upper left")
    return figure


def main() -> None:
    """Draw, estimate, fit, and write the page."""
    args = asked("evidence.drawn.coefficients", __doc__, count=100, seed=2207, jobs=1)
    jobs = [(kind, k, args.seed) for kind in ("glider", "frisbee") for k in range(args.count)]
    jobs += [("ball", k, args.seed) for k in range(max(1, args.count // BALLS))]
    began = process_time()
    found = list(each(run_flight, jobs, args.jobs))
    rows = [row for kind in DRAW for row in kind_rows(kind, [j for j in found if j.kind == kind])]
    wrong = [j for j in found if not j.right]
    pictured(args.output, "coefficients", polar_figure(args.seed))
    from resource import RUSAGE_CHILDREN, getrusage

    spent = process_time() - began + getrusage(RUSAGE_CHILDREN).ru_utime
    about = ABOUT.format(command=args.command, seconds=spent, gliders=args.count, frisbees=args.count)
    heads = ("flight", "component", "coefficients", "held", "error over claim", "terms right")
    missed = [n for j in wrong for n, z in j.off.items() if np.isnan(z)]
    extra = [n for j in wrong for n in j.extra]
    paged(
        args.output, "coefficients", "Coefficients of the air from flights", about, tabled(heads, rows),
        f"Of {len(found)} laws, {len(wrong)} have other terms than the true ones. "
        f"Left out: {counted(missed)}. Taken beside: {counted(extra)}. "
        f"{sum(bool(j.refused) for j in found)} flights were refused. "
        "Intervals allow for sets of terms nearly as likely.",
        "The scenes that forceid ships (`data/synthetic`), with intervals of 95 %. The boomerang bends. Its "
        "law takes it in its mean shape, strip by strip, with lift that swings at 7 and 18 Hz.",
        tabled(("scene", "coefficient", "true", "found"), shipped()),
        "![Lift and drag of a glider over the angle of attack](coefficients.png)",
    )  # fmt: skip


def counted(names: list[str]) -> str:
    """Names with how often each is there."""
    return ", ".join(f"`{n}` {names.count(n)}" for n in sorted(set(names))) or "none"


if __name__ == "__main__":
    main()
