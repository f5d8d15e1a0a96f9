"""Deformation smoothed in time, and the inertia and angular momentum of the shape that it makes."""

import closed_forms as cf
import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.body.deformation import inertia_along, smooth_deformation
from forceid.estimation.body.kinematics import kinematics, shape_at
from forceid.kalman.engines import engine


def seen(recording):
    return kinematics(recording.body, recording.motion, load_settings())


@pytest.mark.parametrize("known", ["mass", "mass_matrix"])
def test_inertia_and_angular_momentum_are_those_of_the_nodes(known):
    lumped = np.array([0.06, 0.02, 0.04, 0.01, 0.03, 0.04])
    given = lumped if known == "mass" else np.kron(np.diag(lumped), np.eye(3))
    recording = cf.waved(cf.waved(cf.toss(body=cf.star(**{known: given}))), "top", rate=50.0)
    kin = seen(recording)
    q, dq = np.random.default_rng(0).standard_normal((2, 120, len(kin.shapes))) * 0.01
    inertia, h = inertia_along(kin, q, dq)
    x, v = shape_at(kin, q), np.einsum("tk,kna->tna", dq, kin.shapes)
    rho = x - np.average(x, axis=1, weights=lumped)[:, None]
    square = np.einsum("n,tna,tnb->tab", lumped, rho, rho)
    np.testing.assert_allclose(
        inertia, np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
    )
    np.testing.assert_allclose(h, np.einsum("n,tna->ta", lumped, np.cross(rho, v)), atol=1e-16)
    assert len(kin.shapes) == 2
    assert np.abs(h).max() > 1e-7  # two shapes out of step carry momentum even in the mass gauge


def test_body_known_as_a_whole_keeps_its_inertia():
    body = cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA)
    kin = seen(cf.toss(body=body))
    inertia, h = inertia_along(kin, kin.amplitude, kin.amplitude)
    np.testing.assert_array_equal(inertia, np.tile(cf.INERTIA, (120, 1, 1)))
    assert (h == 0).all()


def test_amplitude_and_rate_are_smoothed_and_gaps_bridged():
    recording = cf.toss(breath=0.05)
    x = recording.motion.position.copy()
    x[50:53] = np.nan
    kin = seen(cf.seen_as(recording, x))
    found = smooth_deformation(kin, engine())
    pattern = recording.body.position
    scale = np.einsum("kna,na->k", kin.shapes, pattern)[0]
    size, speed = cf.size_at(kin.time, 0.05), 1.5 * np.cos(30 * kin.time)
    amplitude = found.amplitude[:, 0] - found.amplitude[:, 0].mean()
    raw = kin.amplitude[:, 0] - np.nanmean(kin.amplitude[:, 0])
    wanted = scale * (size - size.mean())
    assert cf.rms(amplitude - wanted) < 0.7 * cf.rms(raw - wanted)
    assert cf.rms(found.rate[5:-5, 0] - scale * speed[5:-5]) < 0.05 * abs(scale) * 1.5
    assert np.isfinite(found.amplitude).all()
