"""Joint forces of chains in flight: error beside its bound and its claim, and calibration.

    python -m evidence.drawn.joints -o docs [--seeds 5] [--first 200]

Writes joints.md, and a table of pairs of elastic nets beside. The bound is the deviation that the same
smoother claims when it is told the priors of the true wrenches on the parts; every record is drawn anew, with
axes, swing and spin of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from time import process_time

import numpy as np

from evidence.drawn.records.joined_nets import MASSES, joined_nets
from evidence.judged import (
    LOADS,
    RULE,
    UNBANDED,
    judged_part,
    over_claim,
    scores,
    silent_share,
    silently_wrong,
    unbanded,
)
from evidence.subjects.flights.true_prior import fitted_prior
from evidence.written import asked, paged, table
from forceid.config import Settings
from forceid.estimation.joints.constraints import stacked_constraints
from forceid.estimation.joints.forces import joint_forces
from forceid.estimation.joints.holding import constraints_of
from forceid.estimation.joints.link_loads import LinkLoad, link_loads
from forceid.estimation.joints.linkage import at_joints, carried_over, linkage_of, split
from forceid.estimation.joints.linked_flight import LinkedFlight, linked_parts
from forceid.estimation.joints.linked_smoothing import smooth_linked
from forceid.estimation.joints.linked_tuning import bending_of
from forceid.estimation.joints.parts import parts_of
from forceid.estimation.joints.together import moment_unplaced
from forceid.estimation.methods.problem import Solution
from forceid.estimation.run import estimate_whole
from forceid.flight.tuning import FREE
from forceid.kalman.engines import engine
from forceid.records import Array, Estimate, Motion, Recording
from forceid.scenes.flights import hinged

NOISE, RATE = 3e-4, 200.0
CHAINS = {
    "two blocks, driven hinge": (2, 0.1, 0.6, True, 300),
    "two blocks, hinge with a spring": (2, 0.0, 0.6, True, 200),
    "two blocks, free hinge": (2, 0.0, 0.0, False, 200),
    "three blocks, driven hinge and ball": (3, 0.1, 0.6, True, 200),
}

NETS = {"soft": (6.0, 12.0), "stiff": (400.0, 400.0)}  # Hz, of the softest mode of a net

ALL_FREQUENCIES = np.full(6, np.inf)  # Hz: joints claim no band

Solved = dict[str, tuple[Estimate, Solution | None]]


def chain(seed: int, blocks: int, drive: float, stiffness: float) -> hinged.Parameters:
    """A chain of hinge and ball, thrown and driven in a way of its own."""
    rng, joints = np.random.default_rng(100 + seed), blocks - 1
    return hinged.Parameters(
        mass=(0.4, 0.25, 0.3)[:blocks],
        size=((0.24, 0.12, 0.08), (0.18, 0.1, 0.06), (0.2, 0.1, 0.08))[:blocks],
        joint=("hinge", "ball")[:joints],
        axis=tuple(tuple(row) for row in rng.standard_normal((joints, 3)).tolist()),
        stiffness=(stiffness,) * joints, damping=(0.004 if stiffness else 0.0,) * joints,
        swing=tuple(rng.uniform(-8, 8, joints)), spin=tuple(rng.uniform(-6, 6, 3)),
        turn=tuple(rng.uniform(-1, 1, 3)), drive=drive, drawn_frequency=2.0, drawn_seed=seed,
    )  # fmt: skip


def settings_of(p: hinged.Parameters, driven: bool) -> Settings:
    """What is a part and what a joint."""
    names, ends = "abc"[: len(p.mass)], np.cumsum(np.array(p.size)[:, 0])
    part = [{"name": n, "nodes": [f"{n}{k}" for k in range(1, 9)]} for n in names]
    joint = [
        {
            "name": f"joint {j}", "parts": tuple(names[j : j + 2]), "at": (ends[j], 0.0, 0.0), "kind": kind,
            "axis": p.axis[j], "driven": driven,
        }
        for j, kind in enumerate(p.joint)
    ]  # fmt: skip
    return Settings.model_validate({"part": part, "joint": joint, "model": "rigid"})


def told_smoother(recording: Recording, settings: Settings, solved: Solved) -> tuple[Array, Array]:
    """Wrenches (time, joint, 6) of the smoother that is told the priors of the true wrenches on the parts,
    and the covariance (time, joint, 6, 6) that it claims.
    """
    parts, joints = parts_of(recording, settings)
    passes, truth = engine(), recording.truth
    estimates, solutions = ([solved[part.name][k] for part in parts] for k in (0, 1))
    linkage = linkage_of(parts, joints, estimates, solutions)
    wrench = np.zeros((len(estimates[0].time), 6 * len(parts)))
    for j, joint in enumerate(joints):
        for end, sign in ((joint.before, -1), (joint.behind, 1)):
            F = sign * truth["joint_force"][:, j]
            arm = truth["joint_point"][:, j] - estimates[end].center
            M = sign * truth["joint_moment"][:, j] + np.cross(arm, F)
            wrench[:, 6 * end : 6 * end + 6] += np.concatenate([F, M], 1)
    linked = linked_parts(solutions)
    ties, kept, _ = constraints_of(linkage, joints, parts, linked, estimates, solutions)
    loads = told_loads(estimates[0].time, link_loads(linkage, estimates, FREE, kept), wrench)
    tied = stacked_constraints(ties, len(wrench), len(parts))
    flight = LinkedFlight(linked, loads, tied, moment_unplaced(linkage, estimates))
    w, C = smooth_linked(flight, bending_of(flight), passes)
    to_joints = -split(linkage) @ carried_over(linkage)
    g = np.einsum("tij,tj->ti", to_joints, w.reshape(len(w), -1)).reshape(len(w), len(joints), 6)
    force, moment, cov = at_joints(linkage, g, to_joints @ C @ to_joints.swapaxes(1, 2))
    return np.concatenate([force, moment], -1), cov


def told_loads(time: Array, loads: Sequence[LinkLoad], wrench: Array) -> list[LinkLoad]:
    """Loads of links with the priors that the true wrenches (time, part * 6) on the parts call for."""
    true = (np.linalg.pinv(np.concatenate([load.on_parts for load in loads], 2)) @ wrench[..., None])[..., 0]
    found, at = list[LinkLoad](), 0
    for load in loads:
        count, first = load.on_parts.shape[2], at
        at += count
        if load.keeps:
            found.append(load)
            continue
        seen = np.pad(true[:, first:at], ((0, 0), (0, 3 - count)))
        tuned, axes = fitted_prior(time, seen)
        passed, on_parts = (
            np.pad(a, ((0, 0), (0, 0), (0, 3 - count))) @ axes for a in (load.passed, load.on_parts)
        )
        mean = np.full(3, 10 * float(np.abs(seen).max() or 1.0))
        found.append(LinkLoad(load.link, load.force, tuned.kernel, mean, passed, on_parts))
    return found


def flights(name: str, seeds: range) -> Iterator[tuple[list[Array], float, bool, float]]:
    """Of every record: error, claim and bound, each (joint, 2) of force and moment; NEES; whether it is
    silently wrong; process time, s.
    """
    blocks, drive, stiffness, driven, count = CHAINS[name]
    for seed in seeds:
        p, time = chain(seed, blocks, drive, stiffness), np.arange(count) / RATE
        flight, settings = hinged.fly(p, time), settings_of(p, driven)
        x = flight.position + NOISE * np.random.default_rng(seed).standard_normal(flight.position.shape)
        motion = Motion(time, x, gravity=flight.gravity, noise_std={"position": NOISE})
        recording, solved = Recording(flight.body, motion, flight.truth), Solved()

        def solve(
            recording: Recording, settings: Settings, kept: Solved = solved
        ) -> tuple[Estimate, Solution | None]:
            kept[recording.title] = estimate_whole(recording, settings)
            return kept[recording.title]

        began = process_time()
        found = joint_forces(recording, settings, solve)
        took = process_time() - began
        _, told_cov = told_smoother(recording, settings, solved)
        truth = np.concatenate([flight.truth["joint_force"], flight.truth["joint_moment"]], -1)
        off = np.concatenate([found.force, found.moment], -1) - truth
        claimed = np.diagonal(found.wrench_cov, axis1=2, axis2=3)
        limit = np.diagonal(told_cov, axis1=2, axis2=3)
        sizes = [joint_rms(judged_part(a)) for a in (off, np.sqrt(claimed), np.sqrt(np.maximum(limit, 0)))]
        ratios = scores(found, [flight.truth[f"joint_{load}"] for load in LOADS], ALL_FREQUENCIES, RATE)
        silent = silently_wrong(found.verdict.level, ratios["over"])
        yield sizes, joint_nees(judged_part(off), judged_part(found.wrench_cov)), silent, took


def joint_rms(a: Array) -> Array:
    """Root mean square (joint, 2) of force and moment of (time, joint, 6)."""
    return np.sqrt(np.square(a).reshape(*a.shape[:2], 2, 3).mean((0, 3)))


def joint_nees(off: Array, cov: Array) -> float:
    """Squared error by the claimed covariance per direction that a joint can pass at all."""
    size = np.sqrt(np.diagonal(cov, axis1=2, axis2=3).mean(0))
    unit = np.where(size > 1e-9, size, 1.0)
    value, axes = np.linalg.eigh(cov / unit[:, :, None] / unit[:, None, :])
    along = np.einsum("tjik,tji->tjk", axes, off / unit)
    open_ = value > 1e-6
    return float(np.where(open_, along**2 / np.where(open_, value, 1.0), 0.0).sum() / open_.sum())


def between_nets(stiffness: str, seeds: range) -> dict[str, str | float]:
    """A row on the forces between nets that are not stated to be rigid."""
    settings = nets_on_a_ball()
    ratios, levels, silent, began = [], [], [], process_time()
    for seed in seeds:
        recording = joined_nets(seed, NETS[stiffness], NOISE)
        found = joint_forces(recording, settings, estimate_whole)
        off = found.force - recording.truth["joint_force"]  # a ball passes no moment
        ratios.append(over_claim(off[:, 0], found.force_std[:, 0], ALL_FREQUENCIES[:3], RATE))
        levels.append(found.verdict.level)
        silent.append(silently_wrong(levels[-1], ratios[-1:]))
    return {
        "nets": f"{stiffness}, {NETS[stiffness][0]:g} to {NETS[stiffness][1]:g} Hz", "pairs": len(seeds),
        "error over claim": f"{np.median(ratios):.2g} ({min(ratios):.2g} to {max(ratios):.2g})",
        "ok, degraded, refused": ", ".join(str(levels.count(v)) for v in ("ok", "degraded", "refused")),
        "silently wrong": silent_share(silent), "CPU s a pair": (process_time() - began) / len(seeds),
    }  # fmt: skip


def alone(stiffness: str, seeds: range) -> dict[str, str | float]:
    """A row on the parts of such pairs, each estimated by itself: the other one is what pulls at it."""
    settings = nets_on_a_ball()
    ratios, levels, silent, fast, said = [], [], [], [], 0
    for seed in seeds:
        recording = joined_nets(seed, NETS[stiffness], NOISE)
        clean = joined_nets(seed, NETS[stiffness], 0.0).motion.position
        assert clean is not None
        for k, part in enumerate(parts_of(recording, settings)[0]):
            mass = part.recording.body.mass
            x = clean[:, k * MASSES : (k + 1) * MASSES]
            force = (2 * k - 1) * recording.truth["joint_force"][:, 0]
            moment = np.cross(x[:, -1] - np.average(x, axis=1, weights=mass), force)
            found, _ = estimate_whole(part.recording, Settings())
            judged = scores(found, (force, moment))
            ratios.append(judged["over"])
            levels.append(found.verdict.level)
            silent.append(silently_wrong(levels[-1], judged["over"], judged["beside"]))
            fast.append(unbanded(levels[-1], judged["plain"]))
            said += "body-rings" in found.verdict.codes
    each = np.array(ratios)
    row: dict[str, str | float] = {"parts": f"{stiffness}, {len(each)} parts"}
    for name, column in zip(("force", "moment"), each.T, strict=True):
        row[f"{name} error over claim"] = (
            f"{np.median(column):.2g} ({column.min():.2g} to {column.max():.2g})"
        )
    return row | {
        "`body-rings`": said,
        "ok, degraded, refused": ", ".join(str(levels.count(v)) for v in ("ok", "degraded", "refused")),
        "silently wrong": silent_share(silent), UNBANDED: sum(fast),
    }  # fmt: skip


def nets_on_a_ball() -> Settings:
    """Two nets that a ball joint holds together."""
    part = [{"name": net, "nodes": [f"{net}{k}" for k in range(MASSES)]} for net in "ab"]
    joint = {"name": "ball", "parts": ("a", "b"), "at": (0.0, 0.0, 0.0), "kind": "ball"}
    return Settings.model_validate({"part": part, "joint": [joint]})


def main() -> None:
    """The study."""
    given = asked("evidence.drawn.joints", __doc__, seeds=5, first=200)
    rows = []
    for name in CHAINS:
        found = list(flights(name, range(given.first, given.first + given.seeds)))
        sizes, nees, silent, took = zip(*found, strict=True)
        error, claim, limit = np.sqrt(np.square(sizes).mean((0, 2)))
        rows.append(
            {
                "chain": name, "force error, N": error[0], "over bound": error[0] / limit[0],
                "over claim": error[0] / claim[0], "moment error, N m": error[1],
                "over its bound": error[1] / limit[1], "over its claim": error[1] / claim[1],
                "NEES": float(np.mean(nees)), "of single records": f"{min(nees):.2f} to {max(nees):.2f}",
                "silently wrong": silent_share(silent),
                "CPU s a record": float(np.mean(took)),
            }
        )  # fmt: skip
        print(rows[-1], flush=True)
    about = (
        f"`{given.command}`: {given.seeds} records of each chain, eight markers a block, {1e3 * NOISE:g} mm, "
        f"{RATE:g} Hz; rms over the central three quarters. Bound: what the same smoother claims when it is "
        "told the priors of the true wrenches on the parts. NEES: per direction that the joint can pass."
    )
    pairs = range(given.first, given.first + 3 * given.seeds)
    nets = [between_nets(name, pairs) for name in NETS]
    apart = [alone(name, pairs) for name in NETS]
    print(nets, apart)
    beside = (
        "Pairs of elastic nets on a ball joint, nine masses with markers each, not stated to be rigid. "
        "Soft ones ring by less than the noise shows."
    )
    each = (
        "The parts of these pairs, each alone. `body-rings`: a resonance of force, moment and shape is seen, "
        "and the claims allow for it."
    )
    body = "\n\n".join([table(rows), RULE, beside, table(nets), each, table(apart)])
    paged(given.output, "joints", "Forces in the joints of chains in flight", about, body)


if __name__ == "__main__":
    main()
