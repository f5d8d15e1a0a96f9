"""The model ladder: rigid, modal with few shapes, affine, more shapes; the smallest that is enough.

What markers show beyond the rigid motion is one data set for every level: its part inside the shapes of a
level moves under a dynamic prior, its part outside is noise. So levels compare by likelihood, without any
flight solved. From the level that explains the motion best the choice descends to the smallest one that
leaves force and moment where they are, within their standard error. Source: principal equations 4g.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from scipy.special import chdtri

from forceid.config import Settings
from forceid.estimation.beyond_rigid import (
    CHANCE,
    beyond_rigid,
    correlation,
    dynamic_gain,
    often_seen,
    principal_axes,
)
from forceid.estimation.flight_smoother import Solution
from forceid.estimation.kinematics import Kinematics, kinematics
from forceid.estimation.load_changes import (
    changes,
    channels_of,
    distance,
    load_under,
    loads_seen,
    own_prior,
)
from forceid.kalman.engines import Engine
from forceid.kalman.robust import unswap
from forceid.records import Array, Body, Motion

ENOUGH = 1.0  # standard errors: a force that moves by less has not moved
NEAR = 1.5  # standard errors: by a look without the flight, a level worth solving
RUNGS = (1, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32)  # modes tried
FOUND = 1.3  # chi-square per degree of freedom that the error of a noise found in the record may make
SAME = 0.1  # standard errors: solutions this near are one
FEW = 20  # frames below which nothing is told apart


@dataclass(frozen=True)
class Step:
    """A level of the ladder and what the record says of it.

    modes: its shapes; chi_square: of what it leaves, per degree of freedom; nis: with its amplitudes
    predicted; color: largest autocorrelation of what it leaves; vetoed: by one of these; evidence: log
    marginal likelihood over that of the rigid level; force_change, moment_change: rms over the central three
    quarters on going to the explaining level, in standard errors of that; force_step, moment_step: on going
    one step up, as a look without the flight shows it; seconds that the look took.
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
    force_step: float = 0.0
    moment_step: float = 0.0
    seconds: float = 0.0

    @property
    def change(self) -> float:
        """The larger of the changes of force and moment."""
        return max(self.force_change, self.moment_change)

    @property
    def name(self) -> str:
        """As in "modal, 3 modes".

        >>> Step("modal", 1, 1.0, 1.0, 0.0, False, 9.0).name
        'modal, 1 mode'
        """
        return f"modal, {self.modes} mode{'s'[: self.modes > 1]}" if self.model == "modal" else self.model


@dataclass(frozen=True)
class Ladder:
    """The level taken, every step looked at from the bottom, and a sentence on the choice."""

    level: Step
    steps: tuple[Step, ...]
    sentence: str

    def numbers(self) -> dict[str, float]:
        """Of every step: its modes, evidence, chi-square and what it changes, as numbers with names."""
        found = {}
        for i, step in enumerate(self.steps, 1):
            head = f"ladder_{i}_{step.model}"
            found[f"{head}_modes"] = float(step.modes)
            found[f"{head}_taken"] = float(step is self.level)
            found[f"{head}_evidence"] = step.evidence
            found[f"{head}_chi_square"] = step.chi_square
            found[f"{head}_force_change"] = step.force_change
            found[f"{head}_moment_change"] = step.moment_change
        return found


@dataclass(frozen=True)
class Rung:
    """A level before it is judged: settings that ask for it, and its kinematics."""

    settings: Settings
    kinematics: Kinematics
    seconds: float


def climb(
    body: Body,
    motion: Motion,
    settings: Settings,
    engine: Engine,
    solve: Callable[[Settings], Solution],
) -> tuple[Ladder, Solution] | None:
    """The ladder of a recording and the solution at the level taken; None where there is nothing to climb.

    solve: the estimate under settings that name the level. It runs for the level taken, and, where that is
    below the level that explains the motion, for both without lines first: the smaller one has to prove
    itself. The wrench covariance of a smaller one allows for its distance.
    """
    if motion.position is not None:
        motion = replace(motion, position=unswap(motion.position)[0])
    rungs = levels(body, motion, settings)
    if len(rungs) < 2:
        return None
    steps = weigh(motion, rungs, free_shapes(body, rungs[0].kinematics), engine)
    if not steps:
        return None
    best = explaining(steps)
    steps = with_changes(steps, rungs, best, motion.gravity, engine)
    solutions: dict[tuple[int, bool], Solution] = {}

    def solved(i: int, lines: bool) -> Solution:
        if (i, lines) not in solutions:
            level = rungs[i].settings
            solutions[i, lines] = solve(level if lines else level.model_copy(update={"lines": "none"}))
        return solutions[i, lines]

    lines = settings.lines != "none" and settings.method in ("smoother", "filter")

    def proved(i: int) -> tuple[float, float]:
        change = changes(solved(i, False), solved(best, False))
        if lines and max(change) <= ENOUGH:
            # what leaks into the poses as a vibration may pass for a line of the load
            found = changes(solved(i, True), solved(i, False))
            if max(found) > SAME:
                return changes(solved(i, True), solved(best, True))
        return change

    taken = best
    for i in range(best):
        if steps[i].change > NEAR:
            continue
        force, moment = proved(i)
        steps[i] = replace(steps[i], force_change=force, moment_change=moment)
        if steps[i].change <= ENOUGH:
            taken = i
            break
    solution = allowing(solved(taken, lines), steps[taken])
    return Ladder(steps[taken], tuple(steps), sentence_of(steps, taken, best)), solution


def allowing(solution: Solution, step: Step) -> Solution:
    """The solution with an error that allows for what the level leaves out: its step to the best one."""
    room = np.sqrt(1 + np.repeat([step.force_change, step.moment_change], 3) ** 2)
    cov = solution.state.wrench_cov * np.outer(room, room)
    return replace(solution, state=replace(solution.state, wrench_cov=cov))


def levels(body: Body, motion: Motion, settings: Settings) -> list[Rung]:
    """Levels of a recording by their degrees of freedom; the rigid one alone where nothing else is seen."""

    def rung(**level: object) -> Rung:
        began = perf_counter()
        asked = settings.model_copy(update=level)
        return Rung(asked, kinematics(body, motion, asked), perf_counter() - began)

    rigid = rung(model="rigid")
    kin = rigid.kinematics
    room = 3 * int(kin.seen.sum()) - 6
    if not kin.attitude or motion.position is None or room < 1 or settings.modes == 0:
        return [rigid]
    most = rung(model="modal")
    found = len(most.kinematics.shapes)
    counts = [m for m in RUNGS if m < found]
    several = [rung(model="modal", modes=m) for m in counts] if settings.modes is None else []
    several += [most] if found else []
    stretched = rung(model="affine")
    if stretched.kinematics.shapes.shape[0] <= room:
        several.append(stretched)
    # of two levels with as many degrees of freedom the affine one has less to choose
    several.sort(key=lambda r: (len(r.kinematics.shapes), r.settings.model == "modal"))
    return [rigid, *several]


def free_shapes(body: Body, kin: Kinematics) -> bool:
    """Whether the shapes of a modal level are found in the record, and do not come with the body."""
    hidden = bool((kin.inertia.weight[~kin.seen] > 0).any())
    return body.mode_shape is None and not (hidden and body.stiffness is not None)


def weigh(motion: Motion, rungs: list[Rung], free: bool, engine: Engine) -> list[Step]:
    """Every level with its static and dynamic evidence from one residual; none where the record is too short.

    The changes are not yet known.
    """
    kin = rungs[-1].kinematics
    assert motion.position is not None
    kept = often_seen(motion.position, kin.seen)
    y, U = beyond_rigid(motion.position, kin, kept)
    var = kin.noise["position"] ** 2
    frames = int(np.isfinite(y).all(1).sum())
    stated, steps = all(kin.stated.values()), []
    if frames < FEW or not y.shape[1]:
        return []
    for rung in rungs:
        began = perf_counter()
        shapes = rung.kinematics.shapes[:, kept].reshape(-1, len(U))
        inside = principal_axes(y, shapes @ U)
        q, left = y @ inside, y - y @ inside @ inside.T
        gain, nis = dynamic_gain(kin.time, q, var, engine)
        modes, dof = q.shape[1], y.shape[1] - q.shape[1]
        # every shape has a size and a rate to tune, and a direction unless that is given
        chosen = 2 * modes
        if rung.settings.model == "modal" and free:
            chosen += modes * y.shape[1] - modes * (modes + 1) // 2
        chi = float(np.nansum(left**2) / var / frames / max(dof, 1)) if dof else 1.0
        limit = float(chdtri(max(dof, 1) * frames, CHANCE) / (max(dof, 1) * frames))
        color, colored = correlation(left, dof)
        total = (chi * dof + nis * modes) / y.shape[1]
        steps.append(
            Step(
                rung.settings.model,
                len(rung.kinematics.shapes),
                chi,
                total,
                color,
                bool(chi > (limit if stated else max(limit, FOUND)) or colored),
                gain - 0.5 * chosen * float(np.log(frames)),
                seconds=rung.seconds + perf_counter() - began,
            )
        )
    return steps


def explaining(steps: list[Step]) -> int:
    """The level of most evidence; where that is vetoed, the next above that is not, if there is one."""
    best = int(np.argmax([s.evidence for s in steps]))
    above = (i for i in range(best, len(steps)) if not steps[i].vetoed)
    return next(above, best)


def with_changes(
    steps: list[Step], rungs: list[Rung], best: int, gravity: Array, engine: Engine
) -> list[Step]:
    """Steps with how far force and moment move from each to the best and to the next, by their channels.

    First under the priors of the best level: a smoother is linear in the poses, so one model serves all. A
    level that passes then gets priors of its own, which follow what deformation leaks into its poses.
    """
    top = loads_seen(rungs[best].kinematics, gravity, engine)
    found: list[Step] = []
    before: list[Array] = []
    for step, rung in zip(steps, rungs, strict=True):
        began = perf_counter()
        channels = channels_of(rung.kinematics, gravity, engine)
        loads = [load_under(t.prior, c, t, engine) for c, t in zip(channels, top, strict=True)]
        change = [distance(load, t.load, t.std) for load, t in zip(loads, top, strict=True)]
        if max(change) <= NEAR and rung is not rungs[best]:
            own = [load_under(own_prior(c, engine), c, t, engine) for c, t in zip(channels, top, strict=True)]
            further = [distance(load, t.load, t.std) for load, t in zip(own, top, strict=True)]
            change = [max(pair) for pair in zip(change, further, strict=True)]
        if found:
            force, moment = (distance(a, b, t.std) for a, b, t in zip(before, loads, top, strict=True))
            found[-1] = replace(found[-1], force_step=force, moment_step=moment)
        before = loads
        spent = step.seconds + perf_counter() - began
        found.append(replace(step, force_change=change[0], moment_change=change[1], seconds=spent))
    return found


def sentence_of(steps: list[Step], taken: int, best: int) -> str:
    """What was taken and why, and what the next step would cost."""
    level = steps[taken]
    said = f"the model is {level.name}, chi-square {level.chi_square:.2f} per degree of freedom"
    if level.evidence:
        said += f", log evidence {level.evidence:+.0f} over rigid"
    if taken != best:
        said += (
            f"; {steps[best].name} explains the markers better, but moves force and moment by only "
            f"{level.force_change:.2f} and {level.moment_change:.2f} standard errors"
        )
    elif taken:
        below = steps[taken - 1]
        said += (
            f"; {below.name} would move force and moment by {below.force_change:.2g} and "
            f"{below.moment_change:.2g} standard errors"
        )
    if taken + 1 < len(steps):
        upper = steps[taken + 1]
        said += (
            f"; the next step, {upper.name}, would move force and moment by {level.force_step:.2g} and "
            f"{level.moment_step:.2g} standard errors, and take {upper.seconds:.1g} s"
        )
    return said
