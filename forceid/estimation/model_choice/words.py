"""The level that was chosen, every step that was looked at, and a sentence on why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.model_choice.levels import Step
from forceid.flight.priors.matern import UNTOLD_ORDER
from forceid.flight.priors.protocol import KERNEL
from forceid.flight.vibration import ModeState


@dataclass(frozen=True)
class LevelChoice:
    """The model taken, a sentence on why, the step taken and all steps from the bottom, if there are any."""

    model: str
    sentence: str
    level: Step | None = None
    steps: tuple[Step, ...] = ()

    @property
    def left(self) -> float | None:
        """Chi-square that the rigid level leaves over that of the one of most evidence; None without steps.

        >>> steps = (Step("rigid", 0, 12.0, 1.0, 0.0, True, 0.0), Step("modal", 2, 1.5, 1.0, 0.0, False, 9.0))
        >>> LevelChoice("rigid", "", steps[0], steps).left
        8.0
        """
        if not self.steps:
            return None
        return self.steps[0].chi_square / max(max(self.steps, key=lambda s: s.evidence).chi_square, 1.0)

    def numbers(self) -> dict[str, float]:
        """Of every step: evidence, chi-square, NIS, and what it would change, as numbers with names."""
        found: dict[str, float] = {}
        for step in self.steps:
            head = f"modal_{step.modes}" if step.model == "modal" else step.model
            values = {
                "taken": float(step is self.level),
                "vetoed": float(step.vetoed),
                "evidence": step.evidence,
                "chi_square": step.chi_square,
                "nis": step.nis,
                "autocorrelation": step.color,
                "force_change": step.force_change,
                "moment_change": step.moment_change,
            }
            found |= {f"{head}_{name}": value for name, value in values.items() if np.isfinite(value)}
        return found


def without_choice(model: str, why: str) -> LevelChoice:
    """The choice where there is none."""
    return LevelChoice(model, f"the model is {model}: {why}")


def sentence_of(steps: list[Step], taken: int, best: int) -> str:
    """What was taken and why, and what the next step would cost."""
    level, top = steps[taken], steps[best]
    said = f"the model is {level.name}, chi-square {level.chi_square:.2f} per degree of freedom"
    if level.modes:
        said += f", log evidence {level.evidence:+.0f} over rigid"
    if taken != best:
        return said + (
            f"; {top.name} explains more of the markers, chi-square {top.chi_square:.2f}, log evidence "
            f"{top.evidence - level.evidence:+.0f} over this, but would move force and moment by only "
            f"{level.force_change:.2g} and {level.moment_change:.2g} standard errors; it costs "
            f"{cost(level, top)}"
        )
    below = next((s for s in steps[taken - 1 :: -1] if taken and np.isfinite(s.change)), None)
    if below is not None:
        said += (
            f"; with {below.name} force and moment would be off by {below.force_change:.2g} and "
            f"{below.moment_change:.2g} standard errors"
        )
    if taken + 1 < len(steps):
        upper = steps[taken + 1]
        said += f"; the next step, {upper.name}, costs {cost(level, upper)}"
        said += f" and has log evidence {upper.evidence - level.evidence:+.0f} over this"
        if np.isfinite(upper.change):
            said += (
                f", and would move force and moment by {upper.force_change:.2g} and "
                f"{upper.moment_change:.2g} standard errors"
            )
    elif level.modes:
        said += "; no further shape stands out of the noise"
    return said


def cost(level: Step, upper: Step) -> str:
    """What a step up costs: arithmetic as the cube of the states, that of the modes and some of the loads.

    >>> cost(Step("modal", 1, 1.0, 1.0, 0.0, False, 9.0), Step("modal", 3, 1.0, 1.0, 0.0, False, 9.0))
    '2 more amplitudes a frame and 1.7 times the arithmetic'
    """
    more = upper.modes - level.modes
    loads = 2 * (KERNEL + 3 * UNTOLD_ORDER)  # states of force and moment
    times = ((loads + len(ModeState) * upper.modes) / (loads + len(ModeState) * level.modes)) ** 3
    return f"{more} more amplitude{'s'[: more > 1]} a frame and {times:.2g} times the arithmetic"
