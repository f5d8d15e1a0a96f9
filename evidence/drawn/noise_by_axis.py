"""A record whose axes are not equally noisy, beside the same one with equal noise on all of them.

    python -m evidence.drawn.noise_by_axis -o FOLDER [--records 20] [--first 0] [--stated] [--space]

Bodies of 4 to 8 markers, or a mass center alone, move in a plane under drawn smooth loads, at 60 to 400 Hz
with noise of 0.1 to 2 mm; the noise of the third axis is that of the others, none, or ten
times as large; or the first axis alone has any.
Told is nothing but the masses. The force in the plane is compared with the truth and with its claim.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.written import asked, tabled, written
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Body, Motion, Recording

GRAVITY = np.array([0.0, -9.81, 0.0])
NOISE = {
    "equal": (1.0, 1.0, 1.0),
    "flat": (1.0, 1.0, 0.0),
    "alone": (1.0, 0.0, 0.0),
    "loud": (1.0, 1.0, 10.0),
}


def smooth(rng: np.random.Generator, time: Array, fastest: float, terms: int = 6) -> tuple[Array, Array]:
    """A drawn load (time,) of standard deviation one, waves up to `fastest` Hz, and its second integral."""
    w = 2 * np.pi * rng.uniform(0.1, fastest, terms)
    a, phase = rng.standard_normal(terms) / np.sqrt(terms / 2), rng.uniform(0, 2 * np.pi, terms)
    wave = np.cos(np.outer(time, w) + phase)
    return wave @ a, -wave @ (a / w**2)


def flown(seed: int, noise: str, stated: bool = False, planar: bool = True) -> Recording:
    """A record of a drawn body and its truth; of a seed, the same for every noise."""
    rng = np.random.default_rng(seed)
    count, markers = int(rng.integers(150, 350)), int(rng.integers(3, 9))
    rate, sigma = rng.uniform(60, 400), 1e-3 * np.exp(rng.uniform(np.log(0.1), np.log(2.0)))
    time, mass = np.arange(count) / rate, rng.uniform(0.3, 3.0, markers)
    fastest = rng.uniform(2.0, 5.0) / time[-1]
    amount = np.exp(rng.uniform(np.log(3.0), np.log(100.0), 3))  # sizes of the load, m/s2
    pairs = [smooth(rng, time, fastest) for _ in range(3)]
    load = amount * np.stack([p[0] for p in pairs], 1)
    center = amount * np.stack([p[1] for p in pairs], 1) + np.outer(time, rng.uniform(-2, 2, 3))
    X = rng.uniform(-0.2, 0.2, (markers, 3))
    X -= mass @ X / mass.sum()
    turn = np.zeros((count, 3))
    turn[:, 2] = rng.uniform(-2, 2) * time + 0.5 * np.sin(2 * np.pi * rng.uniform(0.3, 1.0) * fastest * time)
    errors = sigma * np.array(NOISE[noise]) * rng.standard_normal((count, markers, 3))
    if planar:
        load[:, 2] = center[:, 2] = 0.0
    truth = {"force": mass.sum() * (load - GRAVITY)}
    names = tuple(f"m{k}" for k in range(markers))
    if markers == 3:  # a mass center alone
        told = {"center": sigma} if stated else {}
        motion = Motion(time, center=center + errors[:, 0], gravity=GRAVITY, noise_std=told)
        return Recording(Body((), total_mass=mass.sum()), motion, truth)
    R = Rotation.from_rotvec(turn).as_matrix()
    x = center[:, None] + np.einsum("tab,nb->tna", R, X) + errors
    motion = Motion(time, x, gravity=GRAVITY, noise_std={"position": sigma} if stated else {})
    return Recording(Body(names, X, mass), motion, truth)


def in_plane(recording: Recording, axes: tuple[int, ...] = (0, 1)) -> tuple[float, float, str]:
    """Rms error (N) of the force along `axes`, that over its claim, and the verdict."""
    found = estimate_recording(recording, load_settings())
    off = (found.force - recording.truth["force"])[:, axes]
    rms, claim = (float(np.sqrt(np.mean(v**2))) for v in (off, found.force_std[:, axes]))
    return rms, rms / claim, found.verdict.level


def study(seeds: range, stated: bool, planar: bool) -> list[list[str]]:
    """A row for every kind of noise; prints a line for every record."""
    errors = {noise: [] for noise in NOISE}
    for seed in seeds:
        for noise, found in errors.items():
            found.append(in_plane(flown(seed, noise, stated, planar)))
        last = ", ".join(f"{n} {f[-1][0]:.3g} N ({f[-1][1]:.2f}, {f[-1][2]})" for n, f in errors.items())
        print(f"{seed}: {last}", flush=True)
    lines = []
    for noise, found in errors.items():
        ratio = np.array([one[0] / equal[0] for one, equal in zip(found, errors["equal"], strict=True)])
        over = np.array([one[1] for one in found])
        ok = sum(one[2] == "ok" for one in found)
        shown = (f"{of:.2f}" for of in (np.median(ratio), np.sqrt(np.mean(ratio**2)), ratio.max()))
        claims = f"{np.sqrt(np.mean(over**2)):.2f}", f"{over.min():.2f} to {over.max():.2f}"
        lines.append([noise, *shown, *claims, f"{ok} of {len(found)}"])
    return lines


def main() -> None:
    """Fly, estimate, and write the page."""
    given = asked("evidence.drawn.noise_by_axis", __doc__, records=20, first=0, stated=False, space=False)
    rows = study(range(given.first, given.first + given.records), given.stated, not given.space)
    heads = ["noise", "error over that of equal noise: median", "rms", "largest"]
    heads += ["error over claim: rms", "range", "verdict ok"]
    page = f"# Noise by axis\n\n{tabled(heads, rows)}\n"
    written(given.output, "noise_by_axis.md", page)
    print(page)


if __name__ == "__main__":
    main()
