"""The plain route beside the smoother: what it costs, how often it objects, how near its cut is to the best.

    python -m evidence.claims.witness [--seeds 20]

Rigid flights under drawn loads (`evidence.subjects.flights.bodies`), 60 to 400 Hz, 0.1 to 2 mm, all mass
known by node or as a whole. The cost is process time of the witness over that of the estimate, in one run
of it. The best cut is that of the same low-pass, half an octave from one to the next, chosen on the truth.
"""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np

from evidence.judged import rms
from evidence.subjects.flights.bodies import INERTIA, MASS, NODES, Setup, fly
from evidence.written import asked
from forceid.config import load_settings
from forceid.estimation import run
from forceid.estimation.witness.plain_route import plain_route
from forceid.estimation.witness.witness import witness_of
from forceid.motion import SmoothingSpline
from forceid.records import Body, Motion, Recording


def noisy_flight(seed: int, whole: bool) -> Recording:
    """A drawn flight with its noise stated."""
    rng = np.random.default_rng(seed)
    frames, rate = int(rng.choice([120, 240, 500, 1000])), float(rng.choice([60, 100, 200, 400]))
    setup = Setup(
        frames, rate, rng.uniform(0, 3), rng.uniform(0, 2), 10 ** rng.uniform(-1, 1),
        10 ** rng.uniform(-3, -1), 10 ** rng.uniform(0.5, 1.7),
    )  # fmt: skip
    flown, noise = fly(setup, rng), 10 ** rng.uniform(-4, -2.7)
    x = flown.position + noise * rng.standard_normal(flown.position.shape)
    known: dict[str, Any] = {"mass": MASS}
    if whole:
        known = {"total_mass": float(MASS.sum()), "mass_center": np.zeros(3), "inertia": INERTIA}
    motion = Motion(flown.time, x, gravity=flown.gravity, noise_std={"position": noise})
    return Recording(Body(NODES, flown.body.position, **known), motion, flown.truth)


def over_best_cut(record: Recording, witness: Any) -> list[float]:
    """Error of force and moment over that of the best cut, by axis."""
    found = []
    for name in ("force", "moment"):
        channel, truth = getattr(plain_route(record.body, record.motion), name), record.truth[name]
        cuts = 2 ** np.arange(-1, np.log2(0.35 * len(channel.time)), 0.5) / float(np.ptp(channel.time))
        paths = (SmoothingSpline(channel.time, cut).second(channel.z) for cut in cuts)
        errors = [rms(path - truth[channel.frame], 0) for path in paths]
        found += list(rms(getattr(witness, name) - truth, 0) / np.min(errors, axis=0))
    return found


def main() -> None:
    """Print what it costs and finds, by method."""
    seeds = asked("evidence.claims.witness", __doc__, page=False, seeds=20).seeds
    spent: list[float] = []

    def timed(*args: Any) -> Any:
        began = process_time()
        found = witness_of(*args)
        spent.append(process_time() - began)
        return found

    run.witness_of = timed
    for method in ("smoother", "savgol", "spline", "difference"):
        shares, objects, ratios, claims = [], 0, [], []
        for seed in range(seeds):
            record = noisy_flight(seed, seed % 2 == 1)
            spent.clear()
            began = process_time()
            result = run.estimate_recording(record, load_settings(method=method))
            shares.append(sum(spent) / (process_time() - began))
            witness: Any = result.witness
            objects += "off-plain-route" in result.verdict.codes
            ratios += over_best_cut(record, witness)
            for name in ("force", "moment"):
                error, std = getattr(witness, name) - record.truth[name], getattr(witness, f"{name}_std")
                claims += list(rms(error, 0) / rms(std, 0))
        low, middle, high = np.quantile(shares, [0, 0.5, 1])
        cost = f"{middle:.1%} of the estimate ({low:.1%} to {high:.1%})"
        print(f"{method}: {cost}, {objects} of {seeds} objected to")
        if method == "smoother":
            best, claim = np.quantile(ratios, [0.5, 0.9]), np.quantile(claims, [0.1, 0.5, 0.9])
            print(f"  error over that of the best cut: median {best[0]:.2f}, nine of ten below {best[1]:.2f}")
            print(f"  error over claim: median {claim[1]:.2f}, eight of ten {claim[0]:.2f} to {claim[2]:.2f}")


if __name__ == "__main__":
    main()
