"""The bound of a record: what a smoother attains that is told the prior, the noise, the body and its shape.

Its posterior deviation, on the record as it would be without the fault: the same instants and the same
markers seen, but the true clock, labels, body and independent errors. Source: principal equations 4f.
"""

from __future__ import annotations

import numpy as np

from evidence.subjects.flights.bodies import PLACE, Flown
from evidence.subjects.flights.drawn_loads import LOAD_ORDER
from forceid.errors import ForceIdError
from forceid.estimation.loads.channels import angular_channel
from forceid.flight.channels import start_of
from forceid.flight.model import Flight
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.smoother import smooth_flight
from forceid.kalman.engines import engine
from forceid.motion import fit_pose
from forceid.records import Array, Flags

LEAST_SIZE = 1e-6  # of a load's size, along a direction that it does not have


def bound(
    flight: Flown, seen: Flags, noise: float, place: Array = PLACE, mixed: Array | None = None
) -> Array:
    """Least covariance (time, 6, 6) of the wrench; NaN where the markers do not fix a pose.

    seen (time, node): which markers; noise (m): independent errors; place (node, 3) m: where they are; mixed
    (3, 3): directions, as columns, along which the components of the force were drawn.
    """
    R, center, setup = flight.rotation, flight.truth["center"], flight.setup
    x = center[:, None] + np.einsum("tab,nb->tna", R, place)
    pose = fit_pose(
        np.where(seen[..., None], x, np.nan), place, np.ones(len(place)), noise**2 * np.eye(place.size)
    )
    known = np.isfinite(pose.rotation).all((1, 2))
    T, mass = len(flight.time), float(flight.body.mass.sum())  # type: ignore[union-attr]
    nothing = np.full((T, 6, 6), np.nan)
    if known.sum() < 5:
        return nothing
    cov = np.where(np.isfinite(pose.cov), pose.cov, np.eye(6))
    fallen = pose.center - 0.5 * flight.time[:, None] ** 2 * flight.gravity
    fallen -= fallen[known][0]
    turned = angular_channel(flight.time, pose.rotation, cov[:, 3:, 3:], flight.inertia, flight.h)
    path = turned.moved
    priors = []
    axes, size, _ = np.linalg.svd(np.eye(3) if mixed is None else mixed)
    loads = (
        (setup.force_std * np.maximum(size, LEAST_SIZE), axes, flight.time, fallen, 1 / mass),
        (setup.moment_std * np.ones(3), np.eye(3), turned.time, path, 1.0),
    )
    for std, along, time, z, gain in loads:
        kernel = Matern(LOAD_ORDER, std, np.full(3, setup.load_rate))
        priors.append(LoadPrior(Tuned(kernel), along, start_of(time, z, gain)))
    whole = Flight(
        flight.time, pose.center, pose.rotation, cov, mass, flight.inertia, flight.h, flight.gravity
    )
    try:
        return smooth_flight(whole, priors[0], priors[1], engine("auto")).wrench_cov
    except ForceIdError:
        return nothing
