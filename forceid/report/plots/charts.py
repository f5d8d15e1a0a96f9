"""The charts of a result, each beside the figure of the same name: what the page draws where scripts run."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from forceid.records import AXES, Array, Estimate, HiddenLoad, Interface, Loads, deviation
from forceid.report.numbers import INTERVAL, mean, truth_at
from forceid.report.plots.chart import Chart, Curve, Panel, numbers, over_time
from forceid.report.plots.figures import MOST_LOADS, joint_truth
from forceid.report.whiteness import channels, correlogram

DOTS = 6000  # innovations drawn, over all channels
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # entries of a symmetric tensor
MOST_MODES = 6  # amplitudes drawn


def wrench_chart(estimate: Estimate, truth: Mapping[str, Array] | None = None) -> Chart:
    """Force and moment with two-sigma bands; the truth and the plain route as layers of their own."""
    e, witness = estimate, estimate.witness
    edges = () if e.impulses is None else tuple(e.impulses.start[1:].tolist())
    about = "mass center" if e.moment_about == "mass_center" else e.moment_about
    panels = []
    for name, title, unit in (("force", "Force", "N"), ("moment", f"Moment about the {about}", "N m")):
        others = [("truth", truth_at(e, truth or {}, name))]
        if witness is not None and (name == "force" or e.moment_about == "mass_center"):
            others.append(("plain route", getattr(witness, name)))
        half = 2 * getattr(e, f"{name}_std")
        panels.append(
            over_time(title, f"{name} ({unit})", e.time, getattr(e, name), half, others=others, edges=edges)
        )
    return Chart(panels, hidden=("plain route",))


def motion_chart(estimate: Estimate) -> Chart:
    """Translation on the left, rotation on the right."""
    e = estimate
    moving = e.center - e.center[np.argmax(np.isfinite(e.center).all(axis=1))]
    rows = (
        ("Center, from its start", "position (m)", moving),
        ("Angular velocity", "rate (rad/s)", e.angular_velocity),
        ("Velocity of the center", "velocity (m/s)", e.velocity),
        ("Angular momentum", "momentum (kg m²/s)", e.angular_momentum),
    )
    return Chart([over_time(title, y, e.time, values) for title, y, values in rows])


def deformation_chart(estimate: Estimate) -> Chart:
    """How far the nodes are from the mean shape, and what the model says of the shape."""
    e = estimate
    size = 1e3 * np.sqrt(mean(np.moveaxis(np.sum(e.deformation**2, axis=-1), 1, 0)))
    panels = [over_time("Rms over the nodes", "deformation (mm)", e.time, size[:, None], names=("rms",))]
    if e.stretch is not None:
        strain = np.stack([e.stretch[:, i, j] - (i == j) for i, j in PAIRS], axis=-1)
        names = [AXES[i] + AXES[j] for i, j in PAIRS]
        panels.append(over_time("Stretch less one", "stretch (1)", e.time, strain, names=names))
    elif e.mode_amplitude is not None:
        q = 1e3 * e.mode_amplitude[:, :MOST_MODES]
        title = f"Modes 1 to {q.shape[1]} of {e.mode_amplitude.shape[1]}"
        names = [f"mode {k + 1}" for k in range(q.shape[1])]
        panels.append(over_time(title, "amplitude (mm)", e.time, q, names=names))
    return Chart(panels)


def loads_chart(estimate: Estimate, loads: Loads) -> Chart:
    """The applied loads that were asked for, with two-sigma bands; at most eight."""
    asked = tomllib.loads(estimate.settings).get("load", [])
    unit = {load["name"]: "N m" for load in asked if load.get("kind") == "moment"}
    half = 2 * deviation(loads.load_cov)
    return Chart(
        [
            over_time(
                name, f"load ({unit.get(name, 'N')})", estimate.time, loads.load[:, k : k + 1],
                half[:, k : k + 1], ("load",),
            )
            for k, name in enumerate(loads.name[:MOST_LOADS])
        ]
    )  # fmt: skip


def first_moments_chart(
    estimate: Estimate, moments: Array, cov: Array, truth: Mapping[str, Array] | None = None
) -> Chart:
    """First moments (time, 3, 3) with two-sigma bands: a panel a direction of force, a curve an arm."""
    half = 2 * deviation(cov).reshape(moments.shape)
    true = truth_at(estimate, truth or {}, "first_moment")
    return Chart(
        [
            over_time(
                f"Of the force along {axis}", "first moment (N m)", estimate.time, moments[:, i], half[:, i],
                others=[("truth", true[:, i])],
            )
            for i, axis in enumerate(AXES)
        ]
    )  # fmt: skip


def joint_chart(time: Array, found: Interface, k: int, truth: Mapping[str, Array] | None = None) -> Chart:
    """Force and moment of joint k with 95 % bands, and the truth where it is known."""
    true = joint_truth(time, found, k, truth or {})
    return Chart(
        [
            over_time(
                title, f"{name} ({unit})", time, getattr(found, name)[:, k],
                INTERVAL * getattr(found, f"{name}_std")[:, k],
                others=[("truth", true[:, 3 * c : 3 * c + 3])],
            )
            for c, (name, title, unit) in enumerate(
                (("force", "Force", "N"), ("moment", "Moment about the joint", "N m"))
            )
        ]
    )  # fmt: skip


def hidden_chart(hidden: HiddenLoad) -> Chart:
    """Amplitude over frequency of a load that half of all records would not show; the band is shaded."""
    panels = []
    for first, (name, unit) in enumerate((("Force", "N"), ("Moment", "N m"))):
        own = slice(3 * first, 3 * first + 3)
        amplitude, band = hidden.amplitude[:, own], np.nan_to_num(hidden.band[own])
        known = np.isfinite(amplitude).any()
        at = hidden.frequency.tolist()
        panels.append(
            Panel(
                f"{name} that may hide",
                f"amplitude ({unit})",
                "frequency (Hz)",
                numbers(hidden.frequency),  # type: ignore[arg-type]
                [Curve(a, numbers(amplitude[:, k]), color=a) for k, a in enumerate(AXES)] if known else [],
                log="xy",
                shaded=((at[0], float(band.max())),) if band.max() > 0 else (),
                edges=tuple(band[band > 0].tolist()),
                say="" if known else "not identifiable",
            )
        )
    return Chart(panels)


def innovations_chart(estimate: Estimate) -> Chart:
    """Innovations over time and against the unit normal, the NIS, and the autocorrelation."""
    white = channels(estimate.innovation)
    step = max(1, white.size // DOTS)
    thin = white[::step]
    names = [f"channel {k + 1}" for k in range(white.shape[1])]
    series = over_time("Whitened innovations", "innovation (sigma)", estimate.time[::step], thin, names=names)
    dots = [replace(curve, kind="dots", name="channels", color="first") for curve in series.curves]
    edges = np.linspace(-5, 5, 51)
    density, _ = np.histogram(np.clip(white[np.isfinite(white)], -5, 5), edges, density=True)
    middle = 0.5 * (edges[1:] + edges[:-1])
    normal = np.exp(-(middle**2) / 2) / np.sqrt(2 * np.pi)
    rho = [correlogram(column) for column in white.T]
    bound = 2 / np.sqrt(max(1, int(np.isfinite(white).sum(axis=0).min())))
    return Chart(
        [
            replace(series, curves=dots, levels=(-2.0, 2.0)),
            Panel(
                "Against the unit normal", "density (1)", "innovation (sigma)", numbers(middle),  # type: ignore[arg-type]
                [
                    Curve("channels", numbers(density), kind="bars", color="first"),
                    Curve("unit normal", numbers(normal), color="ink"),
                ],
            ),
            over_time(
                "NIS per degree of freedom", "NIS (1)", estimate.time, estimate.nis[:, None], names=("NIS",),
                levels=(1.0,),
            ),
            Panel(
                "Autocorrelation, each channel", "correlation (1)", "lag (samples)",
                list(range(1, len(rho[0]) + 1)),
                [Curve("channels", numbers(r), kind="dots", color="first") for r in rho],
                levels=(-float(bound), 0.0, float(bound)),
            ),
        ]
    )  # fmt: skip
