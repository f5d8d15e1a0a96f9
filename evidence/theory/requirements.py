"""What must hold of any body: telling more makes nothing worse, `auto` is no worse than any level.

    python -m evidence.theory.requirements -o docs [--count 200] [--seed 900] [--jobs 2]

Nets of masses and springs, drawn, with markers on all nodes or on five of them, 0.1 to 1 mm of noise, stated
or not. Each is estimated as a body known as a whole, by its masses, and by masses and stiffness; by masses at
every level as well. Rms errors over the central three quarters. A ratio counts as kept below its limit, or
where both errors are below a tenth of the larger claim. *Missed beyond claims*: missed, and the error of
force or moment is above 1.3 claims; within that, the other estimate had better luck.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.drawn.records.scored import FORCE, MOMENT, RecordScore, estimated_score
from evidence.drawn.records.spring_net import drawn_net
from evidence.judged import RULE, UNBANDED, silent_share, unbanded
from evidence.vectors import GRAVITY
from evidence.written import asked, each, paged, table
from forceid.principal import mass_properties
from forceid.records import Body, Motion, Recording

LEVELS = ("rigid", "affine", "modal")
TELLS = ("whole", "masses", "stiffness")
OF_CLAIM = 1.3  # error over claim that the fourth requirement allows
Scores = dict[str, RecordScore]


def scores_of(seed: int, first: int) -> tuple[float, int, Scores]:
    """The lowest mode (Hz), how many markers, and the scores of one net, by what is told and by level."""
    rng = np.random.default_rng([first, seed])
    net = drawn_net(rng)
    n, noise = len(net.mass), float(np.exp(rng.uniform(np.log(1e-4), np.log(1e-3))))
    seen = np.sort(rng.choice(n, 5, replace=False)) if rng.random() < 0.5 else np.arange(n)
    x = np.full(net.x.shape, np.nan)
    x[:, seen] = net.x[:, seen] + noise * rng.standard_normal(net.x[:, seen].shape)
    stated = {"position": noise} if rng.random() < 0.5 else {}
    truth = {"force": net.force, "moment": net.moment}
    names, p = tuple(f"n{k}" for k in range(n)), mass_properties(net.mass, net.shape)
    known = {"total_mass": float(p.mass), "mass_center": p.center, "inertia": p.inertia}
    bodies = {
        "whole": Body(tuple(names[k] for k in seen), net.shape[seen], **known),
        "masses": Body(names, net.shape, net.mass),
        "stiffness": Body(names, net.shape, net.mass, stiffness=net.stiffness),
    }

    def score(tell: str, **settings: Any) -> RecordScore:
        tracks = x[:, seen] if tell == "whole" else x
        motion = Motion(net.time, tracks, gravity=GRAVITY, noise_std=stated)
        return estimated_score(
            Recording(bodies[tell], motion, truth), internal_momentum=(0, 0, 0), **settings
        )

    found = {tell: score(tell) for tell in TELLS} | {level: score("masses", model=level) for level in LEVELS}
    return net.lowest, len(seen), found


def ratios(found: Scores, name: str, others: Sequence[str]) -> list[float]:
    """Errors of force and moment over the least of others; one where neither matters beside the claims."""
    ratio = []
    for part in (FORCE, MOMENT):
        mine, least = found[name].error(part), min(found[other].error(part) for other in others)
        claim = np.sqrt(found[name].claimed[part].mean())
        ratio.append(mine / least if max(mine, least) > 0.1 * claim else 1.0)
    return ratio


def kept(every: Sequence[Scores], name: str, others: Sequence[str], limit: float) -> dict[str, str]:
    """A line of the table: how often errors over the least of others stay below a limit, and what they are.

    Missed beyond claims: where an error is above 1.3 claims as well; else the other one had better luck.
    """
    a = np.array([ratios(found, name, others) for found in every])
    over = np.array([found[name].plain for found in every])
    missed = ~(a <= limit).all(1)
    force, moment = np.exp(np.nanmean(np.log(a), axis=0))
    return {
        "limit": f"{limit:g}", "kept in records": f"{(~missed).sum()} of {len(a)}",
        "missed beyond claims": str((missed & ~(over <= OF_CLAIM).all(1)).sum()),
        "geometric mean: force, moment": f"{force:.2f}, {moment:.2f}", "median": f"{np.nanmedian(a):.2f}",
        "90 %": f"{np.nanquantile(a, 0.9):.2f}", "largest": f"{np.nanmax(a):.3g}",
    }  # fmt: skip


def main() -> None:
    """Draw, estimate, and write the page."""
    given = asked("evidence.theory.requirements", __doc__, count=200, seed=900, jobs=2)
    every = [
        found for *_, found in each(partial(scores_of, first=given.seed), range(given.count), given.jobs)
    ]
    rows = [
        {"requirement": "masses told, over the body as a whole"} | kept(every, "masses", ["whole"], 1.1),
        {"requirement": "stiffness told, over masses alone"} | kept(every, "stiffness", ["masses"], 1.1),
        {"requirement": "auto, over the best of all levels"} | kept(every, "masses", LEVELS, 1.2),
    ]
    claims = []
    for tell in TELLS:
        over = np.array([f[tell].over for f in every])
        median = np.nanmedian(over, axis=0)
        claims.append(
            {
                "told": tell,
                "force, error over claim": f"{median[0]:.2f}",
                "moment, error over claim": f"{median[1]:.2f}",
                "largest": f"{np.nanmax(over):.2f}",
                "ok": f"{sum(f[tell].verdict == 'ok' for f in every)} of {len(every)}",
                "silently wrong": silent_share(f[tell].silent for f in every),
                UNBANDED: str(sum(unbanded(f[tell].verdict, f[tell].plain) for f in every)),
                "not known": str(np.isnan(over).any(1).sum()),
                "longest (s)": f"{max(f[tell].seconds for f in every):.1f}",
            }
        )
    what = (__doc__ or "").split("]", 3)[3].strip()
    paged(
        given.output,
        "requirements",
        "What must hold of any body",
        f"`{given.command}`",
        what,
        table(rows),
        RULE,
        table(claims),
    )


if __name__ == "__main__":
    main()
