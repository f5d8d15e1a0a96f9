"""One load of a solved flight, and what shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.model import CENTER, POSE, ROTATION, Flight
from forceid.flight.path.linear import linear_flight, seen_part
from forceid.flight.path.reference import Reference
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.engines import Engine
from forceid.kalman.model import Filtered, StateSpace
from forceid.records import Array
from forceid.rounding import ROUNDED
from forceid.significance import TENTH

MOVED = {"force": CENTER, "moment": ROTATION}  # channels of a pose, by the load that moves them


@dataclass(frozen=True)
class OneLoad:
    """A load of a flight about a reference (None where no rotation is seen).

    linked: whether errors link what it moves with what the other load does: the one that is known well tells
    the errors of the other, and both are looked at.
    """

    name: str
    flight: Flight
    about: Reference | None
    linked: bool

    @property
    def channels(self) -> slice:
        """Of a pose, those that are looked at."""
        return POSE if self.linked else MOVED[self.name]

    @property
    def own(self) -> slice:
        """Of these, those that the load moves."""
        first = MOVED[self.name].start - self.channels.start
        return slice(first, first + 3)

    def shown(self, priors: dict[str, LoadPrior]) -> tuple[StateSpace, Array]:
        """A model whose first states the load moves, and what it sees (time, channel)."""
        if self.about is None or not self.linked:
            return seen_part(self.flight, priors[self.name], None if self.name == "force" else self.about)
        alone = replace(self.flight, sensors=None, modes=None)
        about = self.about.restated(priors["moment"])
        model, z = linear_flight(alone, priors["force"], priors["moment"], about)
        order = np.arange(len(model.x0))
        if self.name == "moment":
            both = sum(prior.states for prior in priors.values())
            order[:both] = np.roll(order[:both], -priors["force"].states)
        return model.reordered(order), z

    def filtered(self, priors: dict[str, LoadPrior], engine: Engine) -> tuple[StateSpace, Filtered]:
        """The model that shows the load under priors, and what a filter makes of the record."""
        model, z = self.shown(priors)
        return model, engine.filter(model, z)

    def told(self, innovation: Array) -> Array:
        """Two looks (time, 3 + 3), world axes, at what whitened innovations (time, channel) say of it.

        As they are; and through the transpose of what a load at a sample moves, of size one. A body that
        tumbles answers a load of one frequency with several: there it stands at its own. And there counts
        what one channel says of the errors of another.
        """
        seen = np.isfinite(innovation).all(1)
        pushes = np.full((len(innovation), 3), np.nan)
        root = clear_root(self.flight.pose_cov[seen, self.channels, self.channels])
        pushes[seen] = np.linalg.solve(root.mT, innovation[seen][..., None])[:, self.own, 0]
        if self.name == "moment" and self.about is not None:
            R = self.about.rotation[seen]
            J = R @ self.flight.inertia[seen] @ R.mT
            pushes[seen] = np.linalg.solve(J, pushes[seen][..., None])[..., 0]
        pushes /= max(np.abs(pushes[seen]).max(initial=0.0), np.finfo(float).tiny)
        var, axes = np.linalg.eigh(pushes[seen].T @ pushes[seen] / max(seen.sum(), 1))
        if var[-1] > 0:
            pushes = pushes @ (axes / np.sqrt(np.maximum(var, ROUNDED * var[-1]))) @ axes.T
        return np.concatenate([innovation[:, self.own], pushes], 1)


def errors_link(flight: Flight) -> bool:
    """Whether errors link mass center and rotation: one known takes a tenth off the variance of the other.

    Off that of the combination of its axes that says most, in most frames.
    """
    cov = flight.pose_cov[np.isfinite(flight.pose_cov).all((1, 2))]
    if not len(cov):
        return False
    both = (clear_root(cov[:, own, own]) for own in (CENTER, ROTATION))
    left = np.linalg.solve(next(both), cov[:, CENTER, ROTATION])
    shared = np.linalg.solve(next(both), left.mT)
    return bool(np.median(np.linalg.norm(shared, 2, axis=(1, 2))) ** 2 > TENTH)


def clear_root(cov: Array) -> Array:
    """Lower root (..., channel, channel) of a covariance, also of one that rounding leaves no clear root."""
    one = np.eye(cov.shape[-1])
    return np.asarray(np.linalg.cholesky(cov * (1 + ROUNDED * one) + np.finfo(float).tiny * one))
