"""What can be told of the forces between parts, before any is estimated: the record of it, and its words."""

from __future__ import annotations

from dataclasses import dataclass

from forceid.estimation.joints.null_space import listed
from forceid.records import Finding


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
