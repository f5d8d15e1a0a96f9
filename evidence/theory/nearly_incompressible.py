"""Nearly incompressible bodies, lambda 1e2 to 1e8: which integrator, which step, what is lost.

    OPENBLAS_NUM_THREADS=1 python -m evidence.theory.nearly_incompressible -o docs [--quick]

Natural Mooney-Rivlin bodies, mu_L = 1, E = I, T = 2, from a deformed isochoric start with tr F^-1 F' = 0
(quiet) and with a compressional rate 0.5 on top (loud). Writes nearly_incompressible.md and .png. The truth
is DOP853 at rtol 1e-12 up to lambda = 1e6; beyond, the quiet truth is the constrained motion, which differs
by about 1/lambda (drawn). Source: pseudo-rigid bodies, sections 9 and 10.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib import rc_context

from evidence.written import asked, each, paged, pictured, tabled
from forceid.pseudorigid.body import Body
from forceid.pseudorigid.constrained import multiplier
from forceid.pseudorigid.materials import MooneyRivlin
from forceid.pseudorigid.reference import reference
from forceid.report.style import BLUE, GRAY, GREEN, INK, PURPLE, STYLE, VERMILION, label, panels

A, B, END, LOUD = 0.35, 0.15, 2.0, 0.5
ABLE = 1e6  # lambda up to which the truth is integrated
F0 = np.array([[1.1, 0.2, 0.0], [-0.1, 0.95, 0.15], [0.05, 0.0, 1.05]])
Y0 = np.array([[0.1, -0.5, 0.2], [0.7, 0.05, -0.3], [0.1, 0.25, -0.15]])


FOUND = """\
| start | take | step | lost |
|---|---|---|---|
| without compression, lambda < 1e5; with compiled steps any | Blanes-Moan of order 6 | 3 rad of the fastest vibration | F by 1e-6 |
| without compression, lambda > 1e5 | RATTLE of order 6, det F = 1 | that of the soft motion | F by 0.15/lambda |
| with compression | Blanes-Moan of order 6 | 3 rad of the fastest vibration | F by 3e-5; cost grows as sqrt(lambda) |

The fastest vibration is sqrt((3 lambda + 2 mu)/mu_E). Volume vibrates where the start does not carry the
pressure that det F = 1 asks for: 0.27 here, at any lambda, and F by 1/lambda.
Compiled steps resolve the vibration in less CPU than RATTLE takes in numpy, up to lambda = 1e8.

RATTLE knows no compressional energy: with it F is off by 2e-2 at any lambda, the extra potential of section 10
of the note. Implicit midpoint and the energy-conserving rule are stable at any step and cost nearly the same at
any lambda. But their motion does not lie on det F = const: each step leaves it by h^2, which comes back as
vibration that is not there. Pressure is off by lambda h^2 and the midpoint energy by lambda h^4; it does not
decay. F stays right to h^2 with midpoint; the energy-conserving rule, which must put that vibration into the
rest of the motion, loses F beyond lambda = 1e5, and angular momentum to the rounding of its equations."""  # noqa: E501
ABOUT = "`{command}`: natural Mooney-Rivlin, mu = 1, E = I, T = 2."
HEADS = (
    "start", "integrator", "lambda", "steps", "CPU s", "error of F(2)", "det F - 1", "H", "J", "pressure"
)  # fmt: skip
SHOWN = (
    ("quiet", "error", "error of F(2), quiet start"),
    ("loud", "error", "error of F(2), start with compression"), ("quiet", "cpu", "CPU time (s)"),
    ("quiet", "energy", "energy error"), ("quiet", "pressure", "pressure off the multiplier"),
    ("quiet", "momentum", "angular momentum error"),
)  # fmt: skip
Row = tuple[str, int, dict[str, float]]  # start, which way, numbers


@dataclass(frozen=True)
class Way:
    """An integrator and its step: s, or rad of the fastest vibration."""

    name: str
    method: str
    step: float
    color: str
    phase: bool = False
    constrained: bool = False


WAYS = (
    Way("Verlet, 1 rad a step", "verlet", 1.0, VERMILION, phase=True),
    Way("Blanes-Moan 6, 3 rad a step", "blanes_moan_6", 3.0, PURPLE, phase=True),
    Way("implicit midpoint, h = 0.02", "implicit_midpoint", 0.02, BLUE),
    Way("energy-conserving, h = 0.02", "energy", 0.02, GRAY),
    Way("RATTLE, h = 0.02", "verlet", 0.02, GREEN, constrained=True),
    Way("RATTLE of order 6, h = 0.2", "kahan_li_6", 0.2, INK, constrained=True),
)


def body(lam: float, constrained: bool = False) -> Body:
    """Mooney-Rivlin of the first Lame constant lam; or its limit."""
    held, free = MooneyRivlin(A, B, incompressible=True), MooneyRivlin.natural(A, B, lam / 4 - B)
    return Body(1.0, held if constrained else free)


def start(loud: bool) -> tuple[Any, Any]:
    """F0 with det 1 and dF0, with or without a rate of volume."""
    F = F0 / np.cbrt(np.linalg.det(F0))
    return F, F @ (Y0 - np.trace(Y0) / 3 * np.eye(3) + (LOUD / 3 if loud else 0.0) * np.eye(3))


def truth(lam: float, loud: bool) -> Any:
    """F at END of the compressible body, or None where it takes too long."""
    if lam > ABLE:
        return None if loud else body(lam, True).simulate(*start(False), [0.0, END], "kahan_li_8", 0.02).F[-1]
    return reference(body(lam).system, *start(loud), np.array([0.0, END]), rtol=1e-12).F[-1]


def run(way: Way, lam: float, loud: bool, exact: Any) -> dict[str, float]:
    """Error of F(T), CPU, steps, and what was lost of volume, energy, momentum and pressure."""
    F, V = start(loud and not way.constrained)
    given = body(lam, way.constrained)
    step = way.step / float(body(lam).system.vibration(F)) if way.phase else way.step
    count = max(1, int(np.ceil(END / step)))
    began = time.process_time()
    out = given.simulate(F, V, np.linspace(0.0, END, min(count, 100) + 1), way.method, step)
    cost = time.process_time() - began
    J = np.linalg.det(out.F)
    W: Any = given.material
    # RATTLE gives the multiplier itself: nothing to compare
    pressure = -(2 * W.c * J - W.d / J) if out.pressure is None else np.full_like(J, np.nan)
    limit = multiplier(body(lam, True).system, out.F, out.dF)
    off = {
        "error": np.nan if exact is None else out.F[-1] - exact, "volume": J - 1,
        "energy": out.energy - out.energy[0], "momentum": out.angular_momentum - out.angular_momentum[0],
        "pressure": pressure - limit,
    }  # fmt: skip
    return {"lambda": lam, "cpu": cost, "steps": count} | {k: float(np.abs(v).max()) for k, v in off.items()}


def runs(job: tuple[float, str]) -> list[Row]:
    """Every way at one lambda from one start; none where the truth takes too long."""
    lam, kind = job
    exact = truth(lam, kind == "loud")
    if kind == "loud" and exact is None:
        return []
    return [(kind, k, run(way, lam, kind == "loud", exact)) for k, way in enumerate(WAYS)]


def line(kind: str, way: int, r: dict[str, float]) -> list[str]:
    """A run in the table."""
    errors = (f"{r[k]:.1e}" for k in ("error", "volume", "energy", "momentum", "pressure"))
    return [kind, WAYS[way].name, f"{r['lambda']:.0e}", f"{r['steps']:.0f}", f"{r['cpu']:.2g}", *errors]


@rc_context(STYLE)
def draw(rows: list[Row]) -> Any:
    """Errors, cost and what is lost, against lambda."""
    figure, axes = panels(2, 3, (12.0, 6.8))
    for ax, (kind, key, title) in zip(np.ravel(axes), SHOWN, strict=True):
        for k, way in enumerate(WAYS):
            found = [r for start, own, r in rows if start == kind and own == k]
            x, y = ([r[name] for r in found] for name in ("lambda", key))
            ax.loglog(x, np.maximum(y, 1e-17), "o-", color=way.color, ms=3, lw=1.2, label=way.name)
        if (kind, key) == ("quiet", "error"):
            lam = np.array([1e2, 1e8])
            ax.loglog(lam, 1 / lam, ":", color="black", lw=1, label="1/lambda")
        label(ax, title, x="lambda / mu")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def main() -> None:
    """Run every way at every lambda, both starts."""
    args = asked("evidence.theory.nearly_incompressible", __doc__, quick=False)
    jobs = list(product(10.0 ** np.arange(2, 6 if args.quick else 9), ("quiet", "loud")))
    rows = [row for some in each(runs, jobs, 1) for row in some]
    about, lines = ABOUT.format(command=args.command), [line(*row) for row in rows]
    name, title = "nearly_incompressible", "Nearly incompressible bodies"
    paged(args.output, name, title, about, FOUND, tabled(HEADS, lines))
    pictured(args.output, name, draw(rows), dpi=150)


if __name__ == "__main__":
    main()
