"""The levels of a model, rigid, modal with few shapes, affine, more shapes; what a record says of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from forceid.config import Settings
from forceid.estimation.body.deformation_residual import (
    Beyond,
    correlation,
    dynamic_gain,
    principal_axes,
)
from forceid.estimation.body.kinematics import Kinematics, at_level
from forceid.estimation.body.markers import MarkerSet
from forceid.estimation.verdict.innovations import NIS_BAND
from forceid.kalman.engines import Engine
from forceid.records import Array, Body
from forceid.significance import CHANCE

RUNGS = (1, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32)  # modes tried


@dataclass(frozen=True)
class LevelCandidate:
    """A level before it is judged: the settings that ask for it, its shapes (mode, node, 3), its kinematics.

    The kinematics are None where the shapes are the first of those that the markers show: nobody looked yet.
    """

    settings: Settings
    shapes: Array
    markers: MarkerSet
    kinematics: Kinematics | None = None

    @property
    def seen(self) -> Kinematics:
        """The kinematics of the markers at this level."""
        return self.kinematics or at_level(self.markers, self.settings)


@dataclass(frozen=True)
class Step:
    """A level of the ladder and what the record says of it.

    modes: its shapes; chi_square: of what it leaves, per degree of freedom; nis: mean squared innovation of
    its amplitudes over the variance predicted; color: largest autocorrelation of what it leaves; vetoed: by
    one of these three; evidence: log marginal likelihood over that of the rigid level; force_change,
    moment_change: rms over the central three quarters on going to the explaining level, in standard errors,
    NaN where nobody looked.
    """

    model: str
    modes: int
    chi_square: float
    nis: float
    color: float
    vetoed: bool
    evidence: float
    force_change: float = float("nan")
    moment_change: float = float("nan")

    @property
    def change(self) -> float:
        """The larger of the changes of force and moment."""
        return max(self.force_change, self.moment_change)

    @property
    def name(self) -> str:
        """As in "modal, 3 modes"."""
        return f"modal, {self.modes} mode{'s'[: self.modes > 1]}" if self.model == "modal" else self.model


def brings_modes(body: Body, kin: Kinematics) -> bool:
    """Whether a body brings all of its modes, or those that take its unmarked mass along."""
    hidden = bool((kin.inertia.weight[~kin.seen] > 0).any())
    return body.stiffness is not None or (hidden and body.mode_shape is not None)


def levels(markers: MarkerSet, settings: Settings, most: Kinematics) -> list[LevelCandidate]:
    """Levels by their degrees of freedom; `most`: kinematics at the modal one with all shapes that show.

    Of a body that brings its modes the rigid one and that one: a mode that nothing moves is as good as left
    out, and what does not show among the shapes may still move the poses.
    """
    body = markers.body
    own = body.mode_shape is not None

    def level(**asked: object) -> LevelCandidate:
        at = settings.model_copy(update=asked)
        kin = at_level(markers, at)
        return LevelCandidate(at, kin.shapes, markers, kin)

    rigid = settings.model_copy(update={"model": "rigid"})
    found, room = len(most.shapes), 3 * int(most.seen.sum()) - 6
    if brings_modes(body, most):
        modal = LevelCandidate(settings.model_copy(update={"model": "modal"}), most.shapes, markers, most)
        return [LevelCandidate(rigid, most.shapes[:0], markers), modal]
    several = []
    for m in RUNGS if settings.modes is None else ():
        if m < found:
            at = {"model": "modal", "modes": m}
            # of the body's own modes, fewer are not always the first of more
            several.append(
                level(**at)
                if own
                else LevelCandidate(settings.model_copy(update=at), most.shapes[:m], markers)
            )
    if found:
        several.append(
            LevelCandidate(settings.model_copy(update={"model": "modal"}), most.shapes, markers, most)
        )
    stretched = level(model="affine")
    if 0 < len(stretched.shapes) <= room:
        several.append(stretched)
    # of two levels with as many degrees of freedom the affine one has less to choose
    several.sort(key=lambda r: (len(r.shapes), r.settings.model == "modal"))
    return [LevelCandidate(rigid, most.shapes[:0], markers, None if found else most), *several]


@dataclass(frozen=True)
class Span:
    """The amplitudes of a level: its orthonormal axes (freedom, mode) in what moves beyond the rigid motion.

    columns (mode,): of the amplitudes of all levels.
    """

    axes: Array
    columns: list[int]


def spans_of(beyond: Beyond, candidates: list[LevelCandidate]) -> tuple[list[Span], Array]:
    """Axes of every level, and the amplitudes (time, column) of all; shared where one goes on from another.

    Along its own axes a level has amplitudes that do not correlate, as separate priors take for granted.
    """
    spans: list[Span] = []
    modal, first = Span(np.zeros((beyond.y.shape[1], 0)), []), np.zeros((0, *candidates[0].shapes.shape[1:]))
    values: list[Array] = []
    for candidate in candidates:
        nested = candidate.settings.model == "modal" and np.array_equal(candidate.shapes[: len(first)], first)
        below = modal if nested else replace(modal, axes=modal.axes[:, :0], columns=[])
        directions = beyond.of(candidate.shapes)
        more = directions - directions @ below.axes @ below.axes.T
        axes = principal_axes(beyond.y, more[len(first) if nested else 0 :])
        columns = [len(values) + k for k in range(axes.shape[1])]
        values.extend((beyond.y @ axes).T)
        span = Span(np.concatenate([below.axes, axes], 1), [*below.columns, *columns])
        spans.append(span)
        if candidate.settings.model == "modal":
            modal, first = span, candidate.shapes
    return spans, np.stack(values, 1) if values else np.zeros((len(beyond.y), 0))


def weigh(
    beyond: Beyond, candidates: list[LevelCandidate], free: bool, stated: bool, engine: Engine
) -> list[Step]:
    """Every level with its static and dynamic evidence from one residual; changes are not yet known.

    free: shapes of modal levels were found in the record, each a direction chosen; stated: the noise was.
    """
    spans, q = spans_of(beyond, candidates)
    gain, each_nis = dynamic_gain(beyond.time, q, beyond.var, engine)
    frames, freedom = beyond.frames, beyond.y.shape[1]
    steps = []
    for candidate, span in zip(candidates, spans, strict=True):
        left = beyond.y - beyond.y @ span.axes @ span.axes.T
        modes, dof = len(span.columns), freedom - len(span.columns)
        # every shape has a size and a rate to tune, and a direction unless that is given
        chosen = 2 * modes
        if candidate.settings.model == "modal" and free:
            chosen += modes * freedom - modes * (modes + 1) // 2
        chi = float(np.nansum(left**2) / beyond.var / frames / dof) if dof else 1.0
        nis = float(each_nis[span.columns].mean()) if modes else 1.0
        color, colored = correlation(left, dof, beyond.memory)
        vetoed = colored or chi > chance(dof * frames, stated) or nis > chance(modes * frames, stated)
        evidence = float(gain[span.columns].sum()) - 0.5 * chosen * float(np.log(frames))
        steps.append(Step(candidate.settings.model, len(candidate.shapes), chi, nis, color, vetoed, evidence))
    return steps


def chance(dof: int, stated: bool) -> float:
    """What a mean square per degree of freedom may reach by chance; more where the noise is not stated."""
    limit = float(chdtri(dof, CHANCE) / dof) if dof else np.inf
    return limit if stated else max(limit, NIS_BAND[1])


def explaining(steps: list[Step], first: int = 0) -> int:
    """The level of most evidence, from a first one on that leaves noise, where one is known.

    Else, where that of most evidence is vetoed, the next above that is not, if one is likelier than rigid.
    """
    best = int(np.argmax([s.evidence for s in steps]))
    if first:
        return max(best, first)
    above = (i for i in range(best, len(steps)) if not steps[i].vetoed and steps[i].evidence >= 0)
    return next(above, best)
