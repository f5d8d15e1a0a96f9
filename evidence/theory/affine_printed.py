"""Every value printed in section 12 of the theory note on pseudo-rigid bodies, beside the one computed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from evidence.theory import theory_note as note
from forceid import pseudorigid as pr
from forceid.pseudorigid.natural_modes import spinning_body

F0 = np.array([[1.1, 0.2, 0.0], [-0.1, 0.95, 0.15], [0.05, 0.0, 1.05]])
V0 = np.array([[0.1, -0.4, 0.3], [0.5, 0.0, -0.2], [-0.1, 0.3, -0.05]])
D0 = np.diag([1.25, 0.8, 1.0])
Y0 = np.array([[0.1, -0.5, 0.2], [0.7, 0.05, -0.3], [0.1, 0.25, -0.15]])
EARS = np.diag([1.0, 1.5, 2.2])
RUBBER = pr.MooneyRivlin(0.6, 0.25, 0.4, 3.0)
MOONEY = pr.Body(1.7, RUBBER)
RIEMANN = pr.Body(1.0, pr.SelfGravity(1.0), incompressible=True)
BODIES = {  # H, J and C of section 12.8
    "neo-hookean": (pr.Body(EARS, pr.NeoHookean(1.0, 0.5, 3.0)), (4.04585369293418, 0.858, 0.718, 1.031)),
    "mooney-rivlin": (
        MOONEY,
        (3.57846812418418, 0.80325, 0.629, 1.5215, 0.7565, 0.64175, 1.564),
    ),
    "gas": (
        pr.Body(1.0, pr.PerfectGas(1.0, 5 / 3)),
        (1.71730364415652, 0.4725, 0.37, 0.895, 0.445, 0.3775, 0.92),
    ),
    "st venant-kirchhoff": (
        pr.Body(EARS, pr.StVenantKirchhoff(1.3, 0.7)),
        (0.5069609375, 0.858, 0.718, 1.031),
    ),
    "riemann": (RIEMANN, (-3.47923390681306, 0.44, 0.125, 1.2, 0.442, 0.2125, 1.22925)),
}
METHODS = ("dop853", "kahan_li_8")


def printed() -> Iterator[tuple[str, Any, Any, float]]:
    """Section and what it is, printed numbers, computed ones, and the relative deviation allowed."""
    given = np.array(note.INDEX)
    yield "12.1 index symbols", given[:, 3:], pr.index_symbols(*given[:, :3].T), 1e-10
    given = np.array(note.MACLAURIN)
    m, modes = pr.maclaurin(given[:, 0]), pr.maclaurin_modes(given[:, 0])
    found = [m.omega_squared, m.energy_ratio, m.angular_momentum, modes.pulsation, modes.discriminant]
    yield "12.2 Maclaurin spheroids", given[:, 1:], np.stack(found, 1), 1e-10
    yield "12.2 fastest, bifurcation", *points(), 1e-10
    spheroid = pr.spheroid_oscillation(1.3)
    yield (
        "12.2 irrotational spheroid",
        [0.766670327997568, 6.26727172211049],
        [spheroid.other, spheroid.period],
        1e-10,
    )
    given = np.array(note.JACOBI)
    m = pr.jacobi(given[:, 0])
    found = [m.axes[:, 2], m.omega_squared, m.angular_momentum]
    yield "12.3 Jacobi ellipsoids", given[:, 1:], np.stack(found, 1), 1e-10
    given = np.array(note.S_TYPE)
    m = pr.riemann_s(given[:, 0], given[:, 1])
    yield "12.4 Riemann S-type", given[:, 2:], np.stack([m.w, m.l, m.f], 1), 1e-10
    given = np.array(note.IRROTATIONAL)
    m = pr.irrotational(given[:, 0])
    yield "12.4 irrotational", given[:, 1:], np.stack([m.axes[:, 2], m.w, m.l], 1), 1e-10
    frequencies = [0.60567073, 0.79521269, 1.16433304, 1.28577618, 1.41303804]
    found = pr.ellipsoid_spectrum(pr.jacobi(0.8)).frequencies
    yield "12.4 spectrum of Jacobi, 8 digits", frequencies, found, 1e-8
    rigid = pr.free_rotation(np.diag([2.0, 3, 4]), np.array([1.0, 0, 1]), np.array([1.0, 5]))
    rates = [
        [0.845956445829557, 0.615746367437572, 0.926186349564864],
        [-0.709932072666369, 0.813221127942975, 0.867180358345473],
    ]
    yield "12.5 free rigid body, rates", rates, rigid.omega, 1e-10
    yield "12.5 free rigid body, rotation", note.RIGID, rigid.L, 1e-10
    yield "12.6 natural frequencies", [2.0] * 5 + [6.58823529411765], natural(), 1e-10
    gas = pr.breathing(pr.GasCloud(1.0, 1.4, trap=1.0), 1.0, 1.3).period
    isochronous = pr.breathing(pr.GasCloud(1.0, 5 / 3, trap=1.0), 1.0, 1.3).period
    yield "12.6 trapped gas", [3.49395922400503, np.pi], [gas, isochronous], 1e-10
    spin = spinning_body(pr.NeoHookean(1.0, 0.5, 3.0), np.eye(3), 0.3)
    values = [1.01380674255519, 1.01380674255519, 0.990733529383202, 0.616682466750217]
    yield "12.6 spinning body", values, [*spin.stretch, spin.angular_momentum], 1e-10
    F = np.array(note.F_STAR)
    yield (
        "12.7 singular values",
        (1.35950668820664, 1.05676095050727, 0.418327453323796),
        pr.bipolar(F)[1],
        1e-10,
    )
    yield "12.7 polar rotation", note.ROTATION_STAR, pr.polar(F)[0], 1e-10
    soft = pr.StVenantKirchhoff(1.3, 0.7)
    yield "12.7 energies", [4.20168643334079, 0.2506], [RUBBER.energy(F), soft.energy(F)], 1e-10
    yield "12.7 force, Mooney-Rivlin", note.RUBBER_STAR, RUBBER.gradient(F), 1e-10
    yield "12.7 force, St Venant-Kirchhoff", note.ST_VENANT_STAR, soft.gradient(F), 1e-10
    for name, (body, kept) in BODIES.items():
        start = (D0, D0 @ Y0) if name == "riemann" else (F0, V0)
        for method in METHODS:
            motion = body.simulate(*start, [0.0, 1.0], method, 0.05)
            yield f"12.8 {name}, {method}", note.MOTIONS[name], [motion.F[1], motion.dF[1]], 1e-10
        found = [motion.energy, *motion.angular_momentum.T, *motion.circulation.T][: len(kept)]
        yield f"12.8 {name}, invariants", np.tile(kept, (2, 1)), np.stack(found, 1), 1e-10


def points() -> tuple[list[float], list[float]]:
    """Fastest spheroid and bifurcation: e, Omega^2, a3, T/|W|, L."""
    values = [0.929955685456233, 0.449331412123914, 0.367671623990250, 0.237902112262586, 0.452446539677806]
    values += [0.812670010611743, 0.374229674786196, 0.582724166181830, 0.137528147873934, 0.303750998834296]
    found = []
    for m in (pr.fastest_spheroid(), pr.jacobi_bifurcation()):
        c = m.axes[2]
        found += [np.sqrt((1 - c) * (1 + c)), m.omega_squared, c, m.energy_ratio, m.angular_momentum]
    return values, [float(x) for x in found]


def natural() -> Any:
    """The six squared frequencies that are no turns."""
    return pr.natural_modes(RUBBER, 1.7 * np.eye(3)).squared[3:]


def deviation(expected: Any, found: Any) -> float:
    """Largest relative deviation of any number."""
    expected, found = np.asarray(expected, float), np.asarray(found, float)
    return float((np.abs(found - expected) / np.maximum(np.abs(expected), 1e-300)).max())
