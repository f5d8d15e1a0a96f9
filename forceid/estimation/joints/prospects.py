"""What can be told of the forces between parts, before any is estimated: the record of it, and its words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from forceid.records import Array, Finding
from forceid.significance import WHOLE

OPEN_SHARE = 0.02  # of a unit wrench: less is rounding, or noise of the poses


@dataclass(frozen=True)
class PartProspect:
    """A part: mass kg, how many of its nodes carry markers, whether a load from outside is solved for, and
    what can be identified of its wrench, up to which frequency (Hz).
    """

    name: str
    mass_kg: float
    nodes: int
    seen_nodes: int
    external: bool
    force: bool
    moment: bool
    force_bandwidth_hz: float | None
    moment_bandwidth_hz: float | None


@dataclass(frozen=True)
class JointProspect:
    """A joint at a place of the reference shape (m): how many resultants it passes, and how many are told.

    open: those that are not, about the joint in the axes of the part before it.
    """

    name: str
    parts: tuple[str, str]
    kind: str
    driven: bool
    at: tuple[float, ...]
    passes: int
    told: int
    open: tuple[str, ...]


@dataclass(frozen=True)
class JointProspects:
    """Parts and joints; resultants: components that joints and loads from outside can pass, of which `told`
    are; spare: balances beyond these, which test masses and joints; loops: independent ones of the joints;
    trading: joints that trade wrenches unseen. findings: that the verdict of the joints will hold.
    """

    part: tuple[PartProspect, ...]
    joint: tuple[JointProspect, ...]
    resultants: int
    told: int
    spare: int
    loops: int
    trading: tuple[tuple[str, ...], ...]
    findings: tuple[Finding, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sentences of the findings."""
        return tuple(finding.text for finding in self.findings)

    @property
    def summary(self) -> list[str]:
        """The same for people, a line each."""
        shape = "in a tree" if not self.loops else f"with {self.loops} loop{'s' * (self.loops > 1)}"
        spare = f"; {self.spare} balances are left to test them" if self.spare else "; no balance tests them"
        lines = [f"part     {said_of_part(part)}" for part in self.part]
        lines += [f"joint    {said_of_joint(joint)}" for joint in self.joint]
        lines.append(
            f"joints   {len(self.part)} parts, {len(self.joint)} joint{'s' * (len(self.joint) > 1)} {shape}: "
            f"{self.told} of {self.resultants} resultants are told{spare}"
        )
        ways = ("through it that loads from outside balance", "round them")
        lines += [
            f"open     {', '.join(names)}: wrenches {ways[len(names) > 1]} leave no trace"
            for names in self.trading
        ]
        return lines + [f"note     {text}" for text in self.warnings]


def said_of_part(part: PartProspect) -> str:
    """A part in one line."""
    told = "force and moment" if part.moment else "force"
    seen = f"{told} can be identified" if part.force else "nothing can be identified"
    pairs = (("force", part.force_bandwidth_hz), ("moment", part.moment_bandwidth_hz))
    if reach := [f"{name} to {f:.2g} Hz" for name, f in pairs if f is not None]:
        seen += f", {', '.join(reach)}"
    outside = ", a load from outside acts on it" if part.external else ""
    return (
        f"{part.name}: {part.mass_kg:.4g} kg, {part.nodes} nodes, {part.seen_nodes} with markers{outside}; "
        f"{seen}"
    )


def said_of_joint(joint: JointProspect) -> str:
    """A joint in one line."""
    first, second = joint.parts
    place = ", ".join(f"{x + 0.0:.3g}" for x in joint.at)
    line = (
        f"{joint.name}, {first} on {second}: {'driven ' * joint.driven}{joint.kind} at ({place}) m, passes "
        f"{joint.passes} resultants, "
    )
    if joint.open:
        return f"{line}{joint.told} told; open: {listed(joint.open)} in the axes of {first}"
    return f"{line}all told"


def undetermined_components(block: Array) -> tuple[str, ...]:
    """The components that lie in the span of block (6, k), force before moment; the rest of it is counted.

    >>> undetermined_components(np.eye(6)[:, :4])
    ('force x', 'force y', 'force z', 'moment x')
    >>> undetermined_components(np.array([[1.0, 0, 0, 0, 0, 0.2]]).T)
    ('1 combination of them',)
    """
    inside = (column_space(block) ** 2).sum(1) > WHOLE
    names = [f"{kind} {axis}" for kind in ("force", "moment") for axis in "xyz"]
    found = [name for name, held in zip(names, inside, strict=True) if held]
    if rest := column_space(block).shape[1] - len(found):
        found.append(f"{rest} combination{'s' * (rest > 1)} of them")
    return tuple(found)


def column_space(block: Array) -> Array:
    """Orthonormal columns that span those of block (6, k), as far as these have a share in it."""
    U, s, _ = np.linalg.svd(block, full_matrices=False)
    return np.asarray(U[:, s > OPEN_SHARE])


def listed(components: Sequence[str]) -> str:
    """Components in one phrase.

    >>> listed(("force x", "force y", "moment z", "1 combination of them"))
    'force x, y; moment z; 1 combination of them'
    """
    said: dict[str, list[str]] = {}
    for component in components:
        kind, _, axis = component.partition(" ")
        said.setdefault(kind, []).append(axis)
    return "; ".join(f"{kind} {', '.join(axes)}" for kind, axes in said.items())


def trading_joints(null_space: Array) -> list[tuple[int, ...]]:
    """Joints that trade wrenches with each other unseen, by number; null_space (joint, 6, k).

    >>> loop = np.eye(6) / np.sqrt(2)
    >>> trading_joints(np.stack([loop, np.zeros((6, 6)), -loop]))
    [(0, 2)]
    """
    size = np.einsum("iak,jbk->ijab", null_space, null_space)
    linked = np.abs(size).max((2, 3), initial=0.0) > OPEN_SHARE
    _, group = connected_components(linked, directed=False)
    found = [tuple(np.flatnonzero(group == k).tolist()) for k in np.unique(group)]
    return [joints for joints in found if linked[joints[0], joints[0]]]
