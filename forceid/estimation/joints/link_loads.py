"""What joints and surroundings push parts with, as processes: one load for both parts that a joint holds.

A joint load acts on two parts, with opposite signs and at one place, so their wrenches balance by
construction and no balance has to be enforced. A force has its process along axes that stand in the world, a
moment along the directions that the joint passes, which turn with a part. What keeps a joint together where
accelerations are held follows from the motion and from what drives the parts. A prior of its own would count
twice what no record shows, so that it has one that tells nothing. Source: principal equations 2.8, 4e, 4h;
theory of one model 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.joints.linkage import Linkage
from forceid.estimation.loads.hidden.ringing_body import ringing_alike
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.loads.rough_look import RESOLVED
from forceid.flight.channels import MEAN, Start, load_chain
from forceid.flight.priors.matern import Matern
from forceid.kalman.building.clock import discretize_steps
from forceid.principal import transport_matrix
from forceid.records import Array, Estimate
from forceid.rounding import SINGLE

COMPARED_AT = 3.0  # times its rate, where the axes of a load are compared
UNKNOWN = 10.0  # sizes of a load as first seen, to which its mean is unknown: as at the start of a flight
KEEPING_ORDER = 3  # of a load that keeps a joint: the lowest without kinks, which shake parts inside a step


@dataclass(frozen=True)
class LinkLoad:
    """A force or a moment that a link passes: the process along each of its axes, and what that does.

    Of a unit along an axis, passed (time, 6, axis) is its wrench about the center of all parts, and on_parts
    (time, part * 6, axis) the wrench on every part about its own; mean (axis,): standard deviation of the
    constant beside the process. keeps: whether accelerations tell it: its process is wide, not tuned, and has
    no constant beside.
    """

    link: int
    force: bool
    kernel: Matern
    mean: Array
    passed: Array
    on_parts: Array
    keeps: bool = False

    @property
    def rows(self) -> Array:
        """Rows (axis, axis * state) that read the load out of its constants and processes."""
        output = self.kernel.process.output
        return np.kron(np.eye(len(self.mean)), output if self.keeps else np.concatenate([[1.0], output]))

    def moved(self, by: Array) -> LinkLoad:
        """The same with its kernel moved, for a search: forces by by[:2], moments by by[2:4]."""
        if self.keeps:
            return self
        return replace(self, kernel=self.kernel.moved(by[:2] if self.force else by[2:4]))


@dataclass(frozen=True)
class LoadSteps:
    """A load over steps, all or one for all: states of the constant and of the process along each axis.

    F, Q (step, axis, state, state) and P0 (axis, state, state) of these; Y, H (step, axis, state): what each
    state adds to the second and the first integral of the load; noise (step, axis, 2, 2) of these two, and
    beside (step, axis, 2, state) with that of the states.
    """

    F: Array
    Q: Array
    P0: Array
    Y: Array
    H: Array
    noise: Array
    beside: Array


def load_steps(load: LinkLoad, step: Array) -> LoadSteps:
    """A load over steps (step,) s."""
    chain = load_chain(load.kernel.process, Start(0.0, 0.0, 1.0))
    chain.P0[:, MEAN, MEAN] = load.mean**2
    unique, which = np.unique(np.round(step, 12), return_inverse=True)
    F, Q = discretize_steps(chain, unique)
    if len(unique) > 1:
        F, Q = F[which], Q[which]
    own = slice(MEAN + load.keeps, None)
    return LoadSteps(
        F[..., own, own], Q[..., own, own], chain.P0[:, own, own], F[..., 0, own], F[..., 1, own],
        Q[..., :MEAN, :MEAN], Q[..., :MEAN, own],
    )  # fmt: skip


def link_loads(
    linkage: Linkage, estimates: Sequence[Estimate], order: int, kept: Sequence[int] = ()
) -> list[LinkLoad]:
    """The loads of all links before a record of all parts is seen: as large and as fast as the wrenches on
    the parts call for, each estimated by itself. None where no three samples tell them.

    kept: how many of what each of the first links passes accelerations tell, which come first.
    """
    parts = linkage.arms.shape[1]
    length = float(np.sqrt(np.nanmean((linkage.arms**2).sum(-1)))) or 1.0
    unit = np.tile(np.repeat([1.0, length], 3), parts)[:, None]
    each = [effects(linkage, link) for link in range(len(linkage.links))]
    wrench = np.concatenate([a for e in estimates for a in (e.force, e.moment)], 1)[..., None]
    A = np.concatenate(each, 2)
    known = np.isfinite(A).all((1, 2)) & np.isfinite(wrench).all((1, 2))
    if known.sum() < 3:
        return []
    size = (np.linalg.pinv(A[known] / unit, rcond=SINGLE) @ (wrench[known] / unit))[..., 0]
    time, loads, at = estimates[0].time[known], list[LinkLoad](), 0
    for link, on in enumerate(each):
        told, count = (kept[link] if link < len(kept) else 0), on.shape[2]
        for own in (slice(0, 3), slice(3, told), slice(max(3, told), count)):
            if own.stop > own.start:
                seen, axes = size[:, at + own.start : at + own.stop], np.eye(own.stop - own.start)
                force, keeps = own.start == 0, own.stop <= told
                if force:
                    axes = np.linalg.eigh(np.cov(seen.T))[1]
                kernel, mean = first_guess(time, seen @ axes, order)
                if keeps:
                    kernel = Matern(KEEPING_ORDER, mean, np.full(len(mean), fastest(time)))
                passed = linkage.passes[link][:, :, own] @ axes
                loads.append(LinkLoad(link, force, kernel, mean, passed, on[:, :, own] @ axes, keeps))
        at += count
    return loads


def effects(linkage: Linkage, link: int) -> Array:
    """Wrenches (time, part * 6, column) on the parts, about their own centers, of what a link can pass."""
    ends, passes = linkage.links[link], linkage.passes[link]
    signs = [float(k == ends[1]) - float(k == ends[0]) for k in range(linkage.arms.shape[1])]
    return np.concatenate(
        [sign * (transport_matrix(-linkage.arms[:, k]) @ passes) for k, sign in enumerate(signs)], 1
    )


def first_guess(time: Array, seen: Array, order: int) -> tuple[Matern, Array]:
    """A process as large and as fast as a load that was seen (time, axis) along its axes, and how unknown the
    means (axis,) beside it are.

    Of a Matern process of order p the rate has a variance rate^2 / (2 p - 3) times that of the load.
    """
    varying = seen - seen.mean(0)
    size, span = np.sqrt((varying**2).mean(0)), float(np.ptp(time))
    largest = float(np.abs(seen).max()) or 1.0
    size = np.maximum(size, SINGLE * largest)
    change = np.sqrt((np.gradient(varying, time, axis=0) ** 2).mean(0))
    fast = np.sqrt(max(2 * order - 3, 1)) * change / size
    rate = np.clip(fast, 1.0 / span, fastest(time))
    return widened(Matern(order, size, rate)), np.full(seen.shape[1], UNKNOWN * largest)


def fastest(time: Array) -> float:
    """The largest rate of a load that samples follow, 1/s: one beyond half a turn a sample passes noise."""
    return 0.5 / float(np.median(np.diff(time)))


def widened(kernel: Matern) -> Matern:
    """The kernel without an axis all but still beside the strongest: such an axis would claim what no record
    tells.
    """
    strong = int(kernel.std.argmax())
    fast = COMPARED_AT * kernel.rate[strong]  # where a record still tells them, and a prior begins to
    level = kernel.density(fast * np.ones(1))
    weak = (level < RESOLVED**2 * level[strong]) & (kernel.rate < fast)
    return kernel.of(np.where(weak, strong, np.arange(len(weak)))).scaled(np.where(weak, RESOLVED, 1.0))


def unseen_ringing(
    linkage: Linkage, loads: Sequence[LinkLoad] | None, looks: Sequence[Mapping[str, Whitened]]
) -> Array:
    """Covariance (time, link * 6, link * 6) of loads that ring with the parts that a link holds, by less than
    the markers show.

    looks (part,): how these whiten their channels; loads: that a smoother of all parts takes for the links',
    None for that of each. What is taken for noise is as each of the parts has it, in the mean.
    """
    time, count = len(linkage.center), len(linkage.links)
    cov = np.zeros((time, 6 * count, 6 * count))
    for link, (ends, passes) in enumerate(zip(linkage.links, linkage.passes, strict=True)):
        both = [one for k, one in enumerate(looks) if k in ends and clock_of(one) is not None]
        held = ringing_alike(both, [None] * len(both)) if both else []
        own = slice(6 * link, 6 * link + 6)
        for force, axes in ((True, passes[:, :, :3]), (False, passes[:, :, 3:])):
            name = "force" if force else "moment"
            own_loads = [load for load in loads or () if load.link == link and not load.keeps]
            under = [load for load in own_loads if load.force == force]
            each = [
                one.hidden_under(name, load.kernel.density(2 * np.pi * one.frequency[:, None]))
                for one in held
                for load in under
            ] or [np.full(axes.shape[2], one.hidden(name).mean()) for one in held]
            if each:
                passed = under[0].passed if under else axes
                cov[:, own, own] += passed * np.mean(each, axis=0) @ passed.mT
    return cov


def clock_of(looks: Mapping[str, Whitened]) -> Array | None:
    """The times (time,) s at which both loads of a part are seen, None where these differ."""
    clocks = [look.channel.time for look in looks.values()]
    return clocks[0] if len(clocks) == 2 and np.array_equal(clocks[0], clocks[1]) else None
