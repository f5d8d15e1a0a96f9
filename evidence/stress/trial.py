"""One case of a failure by everyone who takes it on: error, claim, bound and verdict."""

from __future__ import annotations

import warnings
from time import process_time
from typing import Any

import numpy as np

from evidence.judged import UNKNOWN
from evidence.stress.cell import Trial, plain_pair, ratio
from evidence.stress.failure import Failure
from evidence.stress.subjects import Subject
from evidence.subject import Contestant
from forceid.errors import ForceIdError


def attempt(
    subject: Subject, failure: Failure, level: float, seed: int, who: tuple[Contestant, ...]
) -> dict[str, Any]:
    """The trials of one case, as plain numbers under the names of contestants."""
    case = failure.make(level, np.random.default_rng([seed, 2026]))
    bound, found = subject.bound(case), {}
    for one in who:
        began = process_time()
        trial = tried(subject, case, bound, one)
        found[one.name] = {**vars(trial), "seconds": process_time() - began}
    return {"failure": failure.name, "level": level, "seed": seed, "trials": found}


def tried(subject: Subject, case: Any, bound: tuple[float, float], who: Contestant) -> Trial:
    """What one contestant makes of a case."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            found = who.prepare(case)()
            refused = found.verdict == "refused"
            error = UNKNOWN if refused else subject.errors(case, found)
    except ForceIdError as refusal:
        return Trial("refused", UNKNOWN, UNKNOWN, bound, str(refusal))
    except Exception as crash:  # an error that is none of ours is a finding, and the map goes on
        peer = who.kind == "peer" and isinstance(crash, np.linalg.LinAlgError)  # which is how those refuse
        said = f"{type(crash).__name__}: {crash}"
        return Trial("refused" if peer else "crashed", UNKNOWN, UNKNOWN, bound, said)
    claimed = UNKNOWN if refused else found.claimed or subject.promised(case)
    over = UNKNOWN if refused else found.over or plain_pair(ratio(error, claimed))
    reason = next(iter(found.reasons), "")
    return Trial(
        found.verdict or "ok", error, claimed, bound, reason, found.told, over, found.beside, found.codes
    )
