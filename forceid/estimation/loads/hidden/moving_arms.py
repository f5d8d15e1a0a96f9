"""What a moment may do unseen because its arms move: forces act on points that deform with the body.

First moments K of the forces, with arms in the reference, make the moment of K G^T, where G is the map of the
deformation. However slowly K varies, a part dG of G that is faster than the smooth moment is followed shakes
the moment by that of K dG^T. Of K the record tells the antisymmetric part alone, by the moment; a symmetric
part of entries as large belongs to the claim. Entries alike have the variance k = <T.T> / 6, and so

    cov(dT) = k (tr(M) I - M),   M = <dG dG^T>.

Source: pseudo-rigid bodies, section 1; theory of one model, section 2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.body.deforming.affine_maps import affine_shapes_of
from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.smoother import FlightState
from forceid.records import Array


def widened_by_arms(state: FlightState, kin: Kinematics, amplitude: Array, band: float) -> FlightState:
    """The state with a moment that may shake with its arms.

    amplitude (time, mode) m: of the shapes of kin; band Hz: up to which the moment is followed.
    """
    if kin.markers is None or not len(kin.shapes):
        return state
    strain = np.einsum("tk,kab->tab", amplitude, affine_shapes_of(kin).by_amplitude)
    M = fast_square(kin.time, strain, band)
    shaken = state.rotation @ (np.trace(M) * np.eye(3) - M) @ state.rotation.mT
    cov = state.wrench_cov.copy()
    cov[:, 3:, 3:] += np.nanmean((state.moment**2).sum(1)) / 6 * shaken
    return replace(state, wrench_cov=cov)


def fast_square(time: Array, strain: Array, band: float) -> Array:
    """Mean of dG dG^T (3, 3), of the part dG of strain (time, 3, 3) above band Hz.

    >>> t = np.arange(400) / 400
    >>> swing = np.sin(2 * np.pi * 40 * t)[:, None, None] * np.diag([1.0, 0.0, 0.0])
    >>> fast_square(t, swing, 20.0)[0].round(2).tolist(), fast_square(t, swing, 60.0)[0].round(2).tolist()
    ([0.5, 0.0, 0.0], [0.0, 0.0, 0.0])
    """
    taper = np.sin(np.pi * (np.arange(len(time)) + 0.5) / len(time)) ** 2
    taper /= np.sqrt((taper**2).mean())
    waves = np.fft.rfft(taper[:, None, None] * (strain - strain.mean(0)), axis=0)
    fast = waves[np.fft.rfftfreq(len(time), float(np.median(np.diff(time)))) > band]
    return np.asarray(2 * np.einsum("fab,fcb->ac", fast, fast.conj()).real / len(time) ** 2)
