"""Generalized forces g = Phi^T f of the loads on a body whose modes have known mass and stiffness.

In body axes, with r = X + Phi q about the mass center and Phi in the mass gauge,

    g = m_k (q'' + 2 zeta w q' + w^2 q) + Phi^T M (omega' x r + omega x (omega x r) + 2 omega x Phi q').

X is the reference shape, at which the body is free of stress. The acceleration of the center and gravity push
all masses alike, and Phi^T M holds no translation: they do nothing. Source: principal equations 4d to 4f.
"""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.smoother import FlightState
from forceid.flight.vibration import ModeState
from forceid.principal import cross_matrix
from forceid.records import Array, ModalForces


def modal_forces(kin: Kinematics, state: FlightState, deformation: Deformation) -> ModalForces | None:
    """Forces on the elastic modes of a body; None where their mass or stiffness is not known.

    The loads that the smoother found on the modes, with their covariance, and what holds the mean shape,
    times the modal mass; and what moves the modes beside as the body turns.
    """
    markers, nodal, elastic = kin.markers, kin.inertia.nodal, kin.elastic
    if markers is None or nodal is None or elastic is None or deformation.load_cov is None:
        return None
    assert deformation.path is not None
    assert deformation.prior is not None
    shape = split_rigid(kin.shapes, markers.X, nodal)[1]
    flat = shape.reshape(len(shape), -1)
    weighed = flat * np.repeat(nodal, 3) if nodal.ndim == 1 else flat @ nodal
    mass = np.einsum("ki,ki->k", weighed, flat)
    load = deformation.path[:, ModeState.LOAD :: deformation.prior.states]
    answered = deformation.answered
    if answered is not None and answered.spring is not None and answered.brake is not None:
        load = load - np.asarray(answered.spring * deformation.amplitude + answered.brake * deformation.rate)
    bent = np.einsum("kna,na->k", weighed.reshape(shape.shape), kin.shape - markers.X) / mass
    turning = spin_forces(
        kin, state, weighed.reshape(shape.shape), shape, deformation.amplitude + bent, deformation.rate
    )
    cov, each = deformation.load_cov.copy(), range(len(mass))
    frames = max(int(np.isfinite(kin.pose.center).all(1).sum()), 1)
    cov[:, each, each] += (elastic.frequency**2 * markers.noise_std) ** 2 / frames  # of the mean shape
    if elastic.damping is None:  # known to about itself
        cov[:, each, each] += (2 * deformation.prior.damping * deformation.rate) ** 2
    size = elastic.told
    return ModalForces(
        size[:, None, None] * shape,
        size * (mass * (load + elastic.frequency**2 * bent) + turning),
        np.outer(size * mass, size * mass) * cov,
        None if deformation.with_wrench is None else size * mass * deformation.with_wrench,
    )


def spin_forces(
    kin: Kinematics, state: FlightState, weighed: Array, shape: Array, amplitude: Array, rate: Array
) -> Array:
    """What moves modes of shape (mode, node, 3) beside, as the body turns: (time, mode) N.

    weighed (mode, node, 3) kg: Phi^T M; amplitude, rate (time, mode): about the reference shape.
    """
    markers = kin.markers
    assert markers is not None
    omega = np.einsum("tba,tb->ta", state.rotation, state.omega)
    turn = cross_matrix(omega)
    carried = cross_matrix(np.gradient(omega, kin.time, axis=0)) + turn @ turn
    still = np.einsum("kna,nb->kab", weighed, markers.X)
    moving = np.einsum("kna,lnb->klab", weighed, shape)
    return np.asarray(
        np.einsum("tab,kab->tk", carried, still)
        + np.einsum("tab,klab,tl->tk", carried, moving, amplitude, optimize=True)
        + 2 * np.einsum("tab,klab,tl->tk", turn, moving, rate, optimize=True)
    )
