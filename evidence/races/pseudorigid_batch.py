"""Trajectories a second of 1000 affine bodies at once, against scipy.integrate.solve_ivp one by one.

    python -m evidence.races.pseudorigid_batch [--bodies 1000] [--peers 12] [--rounds 3] [--numpy]

Mooney-Rivlin bodies of the theory note, section 12.8, from random starts, T = 10. For every error asked for,
each side takes its cheapest method and step (or tolerance) whose largest error in F(T) over all bodies is no
more. The right-hand side given to scipy is written out in Python floats, the fastest for one body that we
found (the same through numpy is reported too). CPU time of one process; peers are timed on some of the bodies
and counted in proportion, the best of all rounds each.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.written import asked, tabled
from forceid.pseudorigid import integrators
from forceid.pseudorigid.body import Body
from forceid.pseudorigid.materials import MooneyRivlin

A, B, C, D, MU = 0.6, 0.25, 0.4, 3.0, 1.7
END = 10.0
LONG = 0.4  # s, beyond which finer steps are not tried
ERRORS = (1e-4, 1e-6, 1e-8, 1e-10)
FIRST = {"verlet": 0.1, "suzuki_4": 0.3, "blanes_moan_4": 0.4, "blanes_moan_6": 0.7, "kahan_li_8": 0.7}  # s
PEERS = ("RK45", "DOP853", "LSODA")
BODY = Body(MU, MooneyRivlin(A, B, C, D))


@dataclass(frozen=True)
class Ratio:
    """At an error: method, step, error of both sides; CPU s a trajectory: ours, theirs, theirs in numpy."""

    error: float
    label: tuple[str, ...]
    cost: tuple[float, ...]


def starts(bodies: int) -> tuple[Any, Any]:
    """Random F0 and dF0 (body, 3, 3): stretches 0.85 to 1.15, rates of deviation 0.4."""
    rng = np.random.default_rng(7)
    L, R = (Rotation.random(bodies, rng=rng).as_matrix() for _ in range(2))
    return (L * rng.uniform(0.85, 1.15, (bodies, 1, 3))) @ R, 0.4 * rng.standard_normal((bodies, 3, 3))


def by_floats(t: float, y: Any) -> list[float]:
    """F'' = -dW/dF / mu in scalars."""
    p, q, r, s, u, v, w, x, z, *V = y.tolist()
    cp, cq, cr = u * z - v * x, v * w - s * z, s * x - u * w
    cs, cu, cv = r * x - q * z, p * z - r * w, q * w - p * x
    cw, cx, cz = q * v - r * u, r * s - p * v, p * u - q * s
    J = p * cp + q * cq + r * cr
    a, b, c = p * p + q * q + r * r, p * s + q * u + r * v, p * w + q * x + r * z
    d, e, f = s * s + u * u + v * v, s * w + u * x + v * z, w * w + x * x + z * z
    k, g = -2 * B / MU, -(2 * C * J - D / J) / MU
    m = -(2 * A + 2 * B * (a + d + f)) / MU
    a, d, f, b, c, e = m - k * a, m - k * d, m - k * f, -k * b, -k * c, -k * e
    V += [
        a * p + b * s + c * w + g * cp, a * q + b * u + c * x + g * cq, a * r + b * v + c * z + g * cr,
        b * p + d * s + e * w + g * cs, b * q + d * u + e * x + g * cu, b * r + d * v + e * z + g * cv,
        c * p + e * s + f * w + g * cw, c * q + e * u + f * x + g * cx, c * r + e * v + f * z + g * cz,
    ]  # fmt: skip
    return V


def by_numpy(t: float, y: Any) -> Any:
    """The same with numpy and the material of forceid."""
    return np.concatenate([y[9:], BODY.system.acceleration(y[:9].reshape(3, 3)).ravel()])


def together(F: Any, V: Any, method: str, step: float) -> Any:
    """F(T) of all bodies by forceid."""
    return BODY.simulate(F, V, [0.0, END], method, step).F[-1]


def one_by_one(F: Any, V: Any, method: str, rtol: float, rhs: Callable[..., Any] = by_floats) -> Any:
    """F(T) of bodies by scipy."""
    out = np.empty_like(F)
    for i in range(len(F)):
        y = np.concatenate([F[i].ravel(), V[i].ravel()])
        out[i] = solve_ivp(rhs, (0.0, END), y, method, rtol=rtol, atol=rtol).y[:9, -1].reshape(3, 3)
    return out


def cpu(run: Callable[[], Any]) -> float:
    """CPU seconds of one run."""
    return timed(run)[1]


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a run gives, and its CPU seconds."""
    began = time.process_time()
    out = run()
    return out, time.process_time() - began


def candidates(bodies: int, peers: int, rounds: int) -> tuple[list[Any], list[Any]]:
    """(error, CPU seconds a trajectory, label) of every method and step, ours and theirs."""
    F, V = starts(bodies)
    exact = together(F, V, "kahan_li_8", 0.025)
    check = np.abs(exact[:3] - BODY.simulate(F[:3], V[:3], [0.0, END], "dop853").F[-1]).max()
    print(f"truth: kahan_li_8 at h = 0.025, off DOP853 at rtol 1e-13 by {check:.1e}", file=sys.stderr)
    ours, theirs = [], []
    for method in FIRST:
        for step in FIRST[method] * 2.0 ** -np.arange(0.0, 9.0, 0.5):
            run = partial(together, F, V, method, step)
            out, cost = timed(run)
            error = np.abs(out - exact).max()
            if np.isfinite(error):
                ours.append([error, cost / bodies, f"{method} h = {step:.3g}", run, bodies])
            if cost > LONG or error < ERRORS[-1]:
                break
    some = slice(0, peers)
    for method in PEERS:
        for rtol in 10.0 ** -np.arange(4.0, 12.6, 0.5):
            run = partial(one_by_one, F[some], V[some], method, rtol)
            out, cost = timed(run)
            error = np.abs(out - exact[some]).max()
            theirs.append([error, cost / peers, f"{method} rtol = {rtol:.1e}", run, peers])
            if cost > LONG or error < ERRORS[-1]:
                break
    return ours, theirs


def cheapest(found: list[Any], error: float) -> Any:
    """The cheapest that reaches an error."""
    return min((c for c in found if c[0] <= error), key=lambda c: c[1], default=None)


def ratios(bodies: int, peers: int, rounds: int) -> list[Ratio]:
    """One line for every error that both sides reach."""
    ours, theirs = candidates(bodies, peers, rounds)
    F, V = (X[:peers] for X in starts(bodies))
    found = []
    for error in ERRORS:
        us, them = cheapest(ours, error), cheapest(theirs, error)
        if us is None or them is None:
            continue
        method, _, _, rtol = them[2].split()
        plain = partial(one_by_one, F, V, method, float(rtol), by_numpy)
        costs = np.array(
            [[cpu(us[3]) / us[4], cpu(them[3]) / them[4], cpu(plain) / peers] for _ in range(rounds)]
        ).min(0)
        labels = tuple(f"{side[2]}, {side[0]:.1e}" for side in (us, them))
        found.append(Ratio(error, labels, tuple(costs)))
    return found


def table(found: list[Ratio]) -> str:
    """The lines in markdown."""
    rows = []
    for r in found:
        ours, theirs, plain = r.cost
        rows.append(
            (f"{r.error:.0e}", r.label[0], f"{1 / ours:.0f}", r.label[1], f"{1 / theirs:.1f}",
             f"{theirs / ours:.0f}", f"{plain / ours:.0f}")
        )  # fmt: skip
    heads = ("error", "forceid", "trajectories/s", "solve_ivp", "trajectories/s", "ratio")
    return tabled((*heads, "ratio, right-hand side in numpy"), rows) + "\n"


def main() -> None:
    """Ratios at equal error."""
    taken = {"bodies": 1000, "peers": 12, "rounds": 3, "numpy": False}
    args = asked("evidence.races.pseudorigid_batch", __doc__, page=False, **taken)
    if args.numpy:
        integrators.compiled = None
    print(table(ratios(args.bodies, args.peers, args.rounds)))


if __name__ == "__main__":
    main()
