"""Whether forceid works here: a scene whose loads are known in closed form, from simulation to page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from forceid import compiled
from forceid.config import load_settings
from forceid.estimation import estimate_source
from forceid.files import read_motion, read_result, write_motion, write_result
from forceid.records import Estimate, Recording
from forceid.report import render_page, rms, wrench_numbers
from forceid.scenes import SceneRecipe, simulate

RING = SceneRecipe(scene="spinner", duration=0.6, sample_rate=500.0, noise_std=3e-4, seed=1)
ERROR = 2.0  # error over claim, rms, of one record: about one on average where claims are honest
CLAIM = 0.05  # of the force that acts: this record tells it to 0.012
SAME = 1e-6  # of the claimed sigma: what engines may differ by, rounding of 300 steps


@dataclass(frozen=True)
class Check:
    """One claim about this machine, whether it holds, and what was found."""

    claim: str
    good: bool
    said: str


def checked() -> Iterator[Check]:
    """The checks of the scene, one after the other."""
    recording = simulate(RING)
    with TemporaryDirectory() as name:
        path = Path(name) / "ring.h5"
        write_motion(path, recording)
        yield read_back(recording, read_motion(path))
        estimate, _ = estimate_source(path, load_settings(), path.with_suffix(".kept"))
        yield known_answer(estimate, recording)
        if compiled.engine is not None:
            plain, _ = estimate_source(path, load_settings(engine="numpy"), path.with_suffix(".kept"))
            yield alike(estimate, plain)
        write_result(path.with_suffix(".result.h5"), estimate, recording)
        text = render_page(read_result(path.with_suffix(".result.h5")), recording.truth)
        yield Check("it draws a page", "</html>" in text, f"{len(text) / 1e6:.1f} MB")


def read_back(wrote: Recording, read: Recording) -> Check:
    """Whether a file holds what was written, to the last bit."""
    assert wrote.motion.position is not None
    same = np.array_equal(wrote.motion.position, np.asarray(read.motion.position))
    return Check("a file holds what was written", same, f"{wrote.motion.position.size} readings")


def known_answer(estimate: Estimate, recording: Recording) -> Check:
    """Whether force and moment err by no more than they claim, and the claim is small beside the force."""
    numbers = wrench_numbers(estimate, recording.truth)
    scores = [float(np.sqrt(np.nanmean(np.square(s)))) for s in (numbers.force_score, numbers.moment_score)]
    claim, acts = (float(np.linalg.norm(rms(x))) for x in (estimate.force_std, recording.truth["force"]))
    good = estimate.verdict.level == "ok" and max(scores) < ERROR and claim < CLAIM * acts
    said = (
        f"verdict {estimate.verdict.level}, error over claim {scores[0]:.2f} and {scores[1]:.2f}, "
        f"claim {claim:.2g} N where {acts:.2g} N act"
    )
    return Check("force and moment of a ring in flight are found", good, said)


def alike(estimate: Estimate, other: Estimate) -> Check:
    """Whether two engines find the same, by the claimed sigma."""
    off = max(
        float(
            np.nanmax(
                np.abs(getattr(estimate, load) - getattr(other, load)) / getattr(estimate, f"{load}_std")
            )
        )
        for load in ("force", "moment")
    )
    return Check("the compiled engine and numpy agree", off < SAME, f"{off:.1g} of sigma apart")
