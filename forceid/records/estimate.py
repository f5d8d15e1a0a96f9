"""An estimate, and what stands beside it: a witness, the load flown again, what the air does."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from forceid.records.arrays import Array, Claims
from forceid.records.loads import Feet, HiddenLoad, Impulses, Interface, Loads, ModalForces
from forceid.records.verdict import Verdict


@dataclass(frozen=True)
class Witness:
    """The plain route beside an estimate: low-passed second derivatives of the mass center and of the turn.

    force (time, 3) N and moment (time, 3) N m about the mass center, world axes, weight excluded, with the
    standard deviation of each below its cut-off; NaN where they are not seen. By axis (3,): the cut-off, Hz;
    band, Hz: up to where both differ most for their errors; how far they are apart there, rms in the middle
    of the record, in N or N m; difference, the same in joint standard errors, and limit, what chance allows.
    """

    force: Array
    moment: Array
    force_std: Array
    moment_std: Array
    cutoff_force: Array
    cutoff_moment: Array
    band_force: Array
    band_moment: Array
    apart_force: Array
    apart_moment: Array
    difference_force: Array
    difference_moment: Array
    limit_force: Array
    limit_moment: Array


@dataclass(frozen=True)
class Flown:
    """What a flight can be flown again from: poses as they were measured, frame by frame, and what they move.

    center (time, 3) m, NaN where not seen; orientation (time, 4) [x y z w], NaN where not known; pose_cov
    (time, 6, 6) of center and rotation (left error, rad), world axes; inertia (time, 3, 3) kg m2 about the
    mass center and internal_momentum (time, 3) kg m2/s of the deformation and of what turns inside, body
    axes; wind (time, 3) m/s, world axes, where it was measured; current_mass (time,) kg where it changes:
    then the inertia is that of the body as stated.
    """

    center: Array
    orientation: Array
    pose_cov: Array
    inertia: Array
    internal_momentum: Array
    wind: Array | None = None
    current_mass: Array | None = None


@dataclass(frozen=True)
class Aero:
    """What the air does to a body, over the time of its estimate, and how sure that is.

    value and std (time, quantity), by `name`: speed m/s against the air, alpha and beta rad, pressure Pa,
    lift, drag and side_force N, CL, CD, CY, Cl, Cm, Cn, advance_ratio and spin_parameter 1. force and moment
    with _std (time, 3) N and N m in wind, stability and body axes, x forward, y to the right, z down.
    coefficient_cov (time, 6, 6) of CL, CD, CY, Cl, Cm, Cn; counts: what the deviations count.
    """

    name: tuple[str, ...]
    value: Array
    std: Array
    force_wind: Array
    moment_wind: Array
    force_stability: Array
    moment_stability: Array
    force_body: Array
    moment_body: Array
    force_wind_std: Array
    moment_wind_std: Array
    force_stability_std: Array
    moment_stability_std: Array
    force_body_std: Array
    moment_body_std: Array
    coefficient_cov: Array
    counts: str

    def __getitem__(self, name: str) -> Array:
        """The values of one quantity (time,)."""
        return np.asarray(self.value[:, self.name.index(name)])


@dataclass(frozen=True)
class Estimate(Claims):
    """The result: applied wrench (weight excluded) with covariance, mean motion and deformation.

    time (time,) s; force (time, 3) N and moment (time, 3) N m, world axes, about `moment_about`;
    wrench_cov (time, 6, 6); known_force (time, 3) N and known_moment (time, 3) N m, about the mass center, of
    the loads that were known beforehand, which act beside these, None without any; center (time, 3) m;
    velocity (time, 3) m/s; orientation (time, 4) [x y z w]; angular_velocity (time, 3) rad/s and
    angular_momentum (time, 3) kg m2/s, world axes; deformation (time, node, 3) m, body axes, about
    mean_shape (node, 3) m; nis (time,) normalized
    innovation squared per degree of freedom, NaN where the method has no innovations; innovation
    (time, channel) whitened innovations, unit variance if the model is right; mass kg and gravity (3,) m/s2
    that the force was computed with. modal: forces on the modes of a body,
    None where those are not known. Of an affine body, stretch (time, 3, 3) and first_moment (time, 3, 3)
    N m, f r^T of all forces on it, those in it too, about the mass center, world axes, row: of the force,
    column: of its arm; first_moment_cov (time, 9, 9) row by row; the applied ones alike, where the material
    is known; F (time, 3, 3) from the reference, F_rate 1/s; spin (time, 3) rad/s of its polar rotation, world
    axes; circulation (time, 3) kg m2/s, reference axes. What cannot be identified is NaN.
    model_choice: a sentence on why this model, ladder: what every level looked at said, as numbers with
    names. hidden: what the estimate leaves out, None where the method does not tell; impulses: of loads that
    come in pieces; witness: what the plain
    route gives beside it; flown: what a flight again begins with; feet: what the ground gives
    each; aero: what the air does, where that was
    asked for. settings: the merged configuration as TOML text; runtime_s: s by
    the clock; timing: s of CPU by stage.
    """

    time: Array
    force: Array
    moment: Array
    wrench_cov: Array
    center: Array
    velocity: Array
    orientation: Array
    angular_velocity: Array
    angular_momentum: Array
    deformation: Array
    mean_shape: Array
    nis: Array
    innovation: Array
    mass: float
    gravity: Array
    node: tuple[str, ...]
    method: str
    model: str
    engine: str
    log_likelihood: float
    moment_about: str
    verdict: Verdict
    mode_amplitude: Array | None = None
    modal: ModalForces | None = None
    stretch: Array | None = None
    first_moment: Array | None = None
    first_moment_cov: Array | None = None
    known_force: Array | None = None
    known_moment: Array | None = None
    applied_first_moment: Array | None = None
    applied_first_moment_cov: Array | None = None
    F: Array | None = None
    F_cov: Array | None = None
    F_rate: Array | None = None
    spin: Array | None = None
    circulation: Array | None = None
    loads: Loads | None = None
    interface: Interface | None = None
    witness: Witness | None = None
    flown: Flown | None = None
    feet: Feet | None = None
    aero: Aero | None = None
    runtime_s: float = 0.0
    timing: dict[str, float] = field(default_factory=dict)
    settings: str = ""
    input_sha256: str = ""
    tuned: dict[str, float] = field(default_factory=dict)
    leakage: dict[str, float] = field(default_factory=dict)
    sensitivity: dict[str, float] = field(default_factory=dict)
    model_choice: str = ""
    ladder: dict[str, float] = field(default_factory=dict)
    hidden: HiddenLoad | None = None
    impulses: Impulses | None = None
