"""What every subject of a chart or a map has: who takes a case on, and what is answered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from forceid.records import Array


@dataclass(frozen=True)
class Answer:
    """Two quantities as the truth of a case has them, what is claimed of their errors, and what is said.

    claimed: of each a deviation of its own shape, or one relative error; None where nothing is claimed. off:
    both errors, where they are of another kind than distances from the truth. chosen: what was settled for,
    in words: a model, a window, a cut. steps: iterations, None where there are none. again: the job once more
    on what was built for this one. told: what a budget says of an input that no motion reveals. over,
    beside: error over claim, and over that of the witness, where these are known better than by found and
    claimed; codes: of the findings that are more than a note.
    """

    found: tuple[Array, Array]
    claimed: tuple[Any, Any] | None = None
    verdict: str = ""
    reasons: tuple[str, ...] = ()
    off: tuple[float, float] | None = None
    chosen: str = ""
    steps: int | None = None
    again: Callable[[], Answer] | None = None
    told: tuple[float, float] = (0.0, 0.0)
    over: tuple[float, ...] | None = None
    beside: tuple[float, ...] = (float("nan"), float("nan"))
    codes: tuple[str, ...] = ()


Job = Callable[[], Answer]


@dataclass(frozen=True)
class Contestant:
    """Who takes a case on: prepare(case) gives the job that is timed, and that answers.

    kind: "peer", or which of ours it is; about: one line on it; line: what joins its points in a picture, its
    name without step or tolerance; key: of its configuration, `about` where that says it all. told: it was
    told the truth of the case, to choose its parameter or its prior by; what it spends on that is not timed.
    slow: left out of the short chart. whole: by how much its time is multiplied, where it does a part of the
    case only.
    """

    name: str
    prepare: Callable[[Any], Job]
    kind: str = "method"
    about: str = ""
    line: str = ""
    key: str = ""
    told: bool = False
    slow: bool = False
    whole: float = 1.0

    @property
    def joined(self) -> str:
        """The line that it stands on in a picture."""
        return self.line or self.name


def at_once(name: str, answer: Callable[[Any], Answer], **more: Any) -> Contestant:
    """Who answers a case with nothing to prepare."""
    return Contestant(name, partial(partial, answer), **more)
