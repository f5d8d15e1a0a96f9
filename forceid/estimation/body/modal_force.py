"""Generalized forces g = Phi^T f of the loads on a body whose modes have known mass and stiffness.

In body axes, with r = X + Phi q about the mass center and Phi in the mass gauge,

    g = m_k (q'' + 2 zeta w q' + w^2 q) + Phi^T M (omega' x r + omega x (omega x r) + 2 omega x Phi q').

X is the reference shape, at which the body is free of stress. The acceleration of the center and gravity push
all masses alike, and Phi^T M holds no translation: they do nothing. Source: principal equations 4d to 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from forceid.estimation.body.deforming.deformation_shapes import own_shapes
from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.tracks.noise_axes import uneven
from forceid.flight.channels import driven, load_chain, search_box, start_of
from forceid.flight.priors.matern import Matern
from forceid.flight.smoother import FlightState
from forceid.flight.tuning import ORDERS, points_of, tune_loads
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.model import StateSpace
from forceid.motion import exp, fit_frames
from forceid.principal import cross_matrix
from forceid.records import Array, Indices, ModalForces
from forceid.rounding import SINGLE
from forceid.significance import OUTLIER, PATIENCE, TENTH

MODE_ORDERS = ORDERS[:-1]  # orders tried of a load: each state of a mode is one of a joint smoother
HALVINGS = 8  # of the size of a load that does not show, down to where it matters to no claim
FRAME_FITS = 3  # of the fit of a frame: each leaves the square of what the last was off


@dataclass(frozen=True)
class Oscillators:
    """Modes as they answer a force: shape (mode, node, 3) of unit norm.

    By mode: which it is of the body; size of the shape as that gives it; mass kg; spring (mode, 2), stiffness
    1/s2 and damping 1/s over that; weighed (mode, node, 3) kg, Phi^T M; rest (dof, dof) m2: covariance of the
    other modes; var m2 of the amplitudes.
    """

    which: Indices
    shape: Array
    size: Array
    mass: Array
    spring: Array
    weighed: Array
    rest: Array
    var: Array


def modal_forces(kin: Kinematics, state: FlightState, engine: Engine, causal: bool) -> ModalForces | None:
    """Forces on the modes of a body that its record shows; None where they cannot be told.

    That is, where mass or stiffness is not known, or where of a body not marked throughout the
    modes left out may move the markers too, by more than their noise or a tenth of what is told.

    Each mode is an oscillator of its own frequency and damping under a load of tuned smoothness; all are
    smoothed together, from what every frame says of them beside its pose.
    """
    held = oscillators(kin)
    if held is None:
        return None
    markers = kin.markers
    assert markers is not None
    observed, rows = readings(kin, held)
    if not np.isfinite(observed).all(1).any():
        return None
    amplitude, rate, force, cov = driven_amplitudes(kin.time, observed, rows, held, engine, causal)
    force, size = force + spin_forces(kin, state, held, amplitude, rate), held.size
    told, left = unseen_motion(kin, held, force)
    if not all_mass_seen(kin) and left > min(markers.noise_std, TENTH * told):
        return None
    return ModalForces(size[:, None, None] * held.shape, size * force, size[:, None] * size * cov)


def oscillators(kin: Kinematics) -> Oscillators | None:
    """The modes that the record of a body at the modal level shows, with what is known of each."""
    markers, nodal = kin.markers, kin.inertia.nodal
    if kin.model != "modal" or markers is None or nodal is None or markers.modes is None:
        return None
    if markers.modes.compliance is None:
        return None
    given, none = markers.body.mode_shape, np.zeros((0, *kin.shape.shape))
    own = partial(own_shapes, markers, markers.modes, principal=none, principal_var=np.zeros(0))
    most = None if given is None else len(given)
    if most is None and (shown := own(None)) is not None:  # with the modes below, which may move too
        most = max(int(shown.which.max(initial=-1)) + 1, len(kin.shapes))
    found = own(most)
    if found is None or not len(found.which):
        return None
    shape = split_rigid(found.shape, markers.X, nodal)[1]
    flat = shape.reshape(len(shape), -1)
    weighed = flat * np.repeat(nodal, 3) if nodal.ndim == 1 else flat @ nodal
    square = 1 / markers.modes.compliance[found.which]
    size, ratio = np.ones(len(square)), None if given is None else markers.body.mode_damping
    if given is not None:  # forces are told on the shapes as they are given
        size = np.linalg.norm(split_rigid(given, markers.X, nodal)[1], axis=(1, 2))[found.which]
    damping = 0.0 if ratio is None else 2 * ratio[found.which] * np.sqrt(square)
    return Oscillators(
        found.which,
        shape,
        size,
        np.einsum("ki,ki->k", weighed, flat),
        np.stack([square, np.broadcast_to(damping, square.shape)], 1),
        weighed.reshape(shape.shape),
        found.rest,
        found.var,
    )


def all_mass_seen(kin: Kinematics) -> bool:
    """Whether every mass carries a marker, so that no mode passes for another one or for mean motion."""
    return not bool((kin.inertia.weight[~kin.seen] > 0).any())


def unseen_motion(kin: Kinematics, held: Oscillators, force: Array) -> tuple[float, float]:
    """How far (m, rms of a coordinate of a marker) modes answer loads of a size: those told, the others."""
    markers = kin.markers
    assert markers is not None
    assert markers.modes is not None
    assert markers.modes.compliance is not None
    loose = markers.modes.compliance * np.linalg.norm(markers.modes.shape, axis=(1, 2))
    moved = ((loose[:, None, None] * markers.modes.shape[:, markers.seen]) ** 2).mean((1, 2))
    power = moved * np.nanmean(force**2)
    told = np.isin(np.arange(len(power)), held.which)
    return float(np.sqrt(power[told].sum())), float(np.sqrt(power[~told].sum()))


def readings(kin: Kinematics, held: Oscillators) -> tuple[Array, Array]:
    """What every frame says of the amplitudes: observed (time, mode) = rows q + noise of unit variance.

    Fitted again about the shape of each frame: what a bent body turns its markers by is then no reading.
    """
    markers, pose = kin.markers, kin.pose
    assert markers is not None
    noise = markers.noise_std**2 * np.eye(kin.shape.size) + held.rest
    q, loose = np.zeros((len(kin.time), len(held.mass))), np.diag(1 / held.var)
    for _ in range(FRAME_FITS):
        bent = np.einsum("tab,knb,tk->tna", pose.rotation, held.shape, q)
        frames = fit_frames(
            markers.tracks - bent, pose, markers.X, held.shape, noise, markers.filled, uneven(markers.root)
        )
        observed, rows = frames.observed + np.einsum("tij,tj->ti", frames.rows, q), frames.rows
        told = rows.mT @ np.nan_to_num(observed)[..., None]
        was, q = q, np.linalg.solve(rows.mT @ rows + loose, told)[..., 0]
        off = np.einsum("tik,tk->ti", frames.leak, q - was)
        turned = np.full_like(frames.rotation, np.nan)
        seen = np.isfinite(off).all(1) & np.isfinite(frames.rotation).all((1, 2))
        turned[seen] = exp(-off[seen, 3:]) @ frames.rotation[seen]
        pose = replace(pose, center=frames.center - off[:, :3], rotation=turned)
    return observed, rows


def driven_amplitudes(
    time: Array, observed: Array, rows: Array, held: Oscillators, engine: Engine, causal: bool
) -> tuple[Array, Array, Array, Array]:
    """Amplitudes and rates (time, mode), and the loads that drive them, with covariance (time, mode, mode).

    observed (time, mode) = rows q + noise of unit variance, rows (time, mode, mode).
    """
    whole, step = np.isfinite(observed).all(1), np.diff(time)
    inverse = np.full_like(rows, np.nan)
    inverse[whole] = np.linalg.inv(rows[whole])
    q, var = np.einsum("tij,tj->ti", inverse, observed), (inverse**2).sum(2)
    models, count, none = [], len(held.mass), np.zeros(1)
    noise = np.nan_to_num(var, nan=1.0)
    for k, kernel in enumerate(load_kernels(time, q, noise, held, engine)):
        start = start_of(time, q[:, [k]], 1 / held.mass[k], held.spring[k, 0])
        chain = load_chain(kernel.process, start, spring=held.spring[k])
        models.append(driven(chain, 1 / held.mass[k], noise[:, [k]], none, step).one(0))
    size = [len(model.x0) for model in models]
    first = np.cumsum([0, *size[:-1]])
    read = np.zeros((3, count, sum(size)))  # amplitude, rate, load
    for k, at in enumerate(first):
        read[0, k, at] = read[1, k, at + 1] = 1 / held.mass[k]
        read[2, k, at + 2 : at + 4] = 1.0
    F, Q, P0 = (block_diagonal(*(getattr(m, name) for m in models)) for name in ("F", "Q", "P0"))
    H = rows @ read[0]
    steady = whole.all() and not np.ptp(rows, axis=0).any()
    joint = StateSpace(F, Q, H[0] if steady else H, np.eye(count), np.zeros(sum(size)), P0)
    path = (engine.filter if causal else engine.smooth)(joint, observed)
    amplitude, rate, force = (path.x @ a.T for a in read)
    return amplitude, rate, force, read[2] @ path.P @ read[2].T


def load_kernels(time: Array, q: Array, noise_var: Array, held: Oscillators, engine: Engine) -> list[Matern]:
    """The prior of the load on each mode, from its amplitudes q (time, mode) with noise_var.

    Where none shows, one as those that show in the mean, or as small as the record asks for: it may hide.
    """
    found, shows, none = [], [], np.zeros(1)
    for k, (mass, spring) in enumerate(zip(held.mass, held.spring, strict=True)):
        z = q[:, [k]]
        tuned = tune_loads(
            time, z, 1 / mass, noise_var[:, [k]], none, orders=MODE_ORDERS, engine=engine, spring=spring[None]
        )
        kernel = tuned.kernel
        assert isinstance(kernel, Matern)
        least = search_box(time, z, 1 / mass, kernel.order, spring[0])[0][0]
        found.append(kernel)
        shows.append(points_of(kernel)[0, 0] > least + SINGLE)
    seen = [kernel for kernel, show in zip(found, shows, strict=True) if show]
    if not seen:
        return found
    strongest = max(seen, key=lambda kernel: float(kernel.std[0]))
    mean = np.sqrt(np.mean([kernel.std[0] ** 2 for kernel in seen]))
    sizes = mean * np.append(0.5 ** np.arange(HALVINGS), 1e-9)
    likelihood = for_tuning(engine).log_likelihood
    for k in (k for k, show in enumerate(shows) if not show):
        mass, spring, z = held.mass[k], held.spring[k], q[:, [k]]
        some = Matern(strongest.order, sizes, np.repeat(strongest.rate, len(sizes)))
        chain = load_chain(some.process, start_of(time, z, 1 / mass, spring[0]), spring=spring)
        wide = np.repeat(noise_var[:, [k]], len(sizes), 1)
        model = driven(chain, 1 / mass, wide, np.zeros(len(sizes)), np.diff(time))
        value = likelihood(model, np.repeat(z, len(sizes), 1)[..., None], OUTLIER)
        found[k] = some.of(np.array([np.argmax(value > value[-1] - PATIENCE)]))
    return found


def spin_forces(
    kin: Kinematics, state: FlightState, held: Oscillators, amplitude: Array, rate: Array
) -> Array:
    """What moves the modes beside, as the body turns: (time, mode) N."""
    markers = kin.markers
    assert markers is not None
    omega = np.einsum("tba,tb->ta", state.rotation, state.omega)
    turn = cross_matrix(omega)
    carried = cross_matrix(np.gradient(omega, kin.time, axis=0)) + turn @ turn
    shape = np.einsum("kna,nb->kab", held.weighed, markers.X)
    shapes = np.einsum("kna,lnb->klab", held.weighed, held.shape)
    return np.asarray(
        np.einsum("tab,kab->tk", carried, shape)
        + np.einsum("tab,klab,tl->tk", carried, shapes, amplitude)
        + 2 * np.einsum("tab,klab,tl->tk", turn, shapes, rate)
    )
