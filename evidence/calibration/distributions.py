"""What a drawn record is made of: every distribution, with its unit, in this one place.

They are what laboratories, sports grounds and machines have, as far as one can say it beforehand. None was
chosen by what forceid makes of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Span = tuple[float, float]

SIZES: Span = (0.02, 3.0)  # m, longest edge of the body, evenly in its logarithm
EDGES: Span = (0.15, 1.0)  # the other edges over the longest
DENSITIES: Span = (50.0, 2000.0)  # kg/m3 in the box of the edges, evenly in the logarithm
SOFT_EDGES: Span = (0.5, 1.0)  # of a body that deforms
SOFT_SHARE = 0.1  # of the records: the body deforms affinely
SWINGS: Span = (1.0, 30.0)  # Hz, of such a body, evenly in the logarithm, a tenth of the rate at most
STRAINS: Span = (0.002, 0.05)  # at the start, evenly in the logarithm
LOSSES: Span = (0.005, 0.05)  # damping ratio of its swings

MARKERS: Span = (3, 20)  # evenly in the logarithm; five at least of a body that deforms
PLACES = {"anywhere": 0.6, "one face": 0.25, "near a line": 0.15}  # of the markers
FLAT: Span = (0.0, 0.1)  # of the size: height of the markers over their face
THIN: Span = (0.01, 0.1)  # of the size: distance of the markers from their line

RATES: Span = (50.0, 1000.0)  # Hz, evenly in the logarithm
SAMPLES: Span = (100, 1500)  # evenly in the logarithm
SPEEDS: Span = (0.0, 10.0)  # m/s at the start, evenly
SPINS: Span = (0.1, 30.0)  # rad/s at the start, evenly in the logarithm
TURN = 0.3  # rad a sample at the start, at most
WEIGHTLESS = 0.2  # of the records

LOADS = {
    "none": 0.1, "smooth": 0.22, "oscillating": 0.15, "steps": 0.13, "impacts": 0.12, "body-fixed": 0.14,
    "of the state": 0.14,
}  # fmt: skip
SHOWN: Span = (0.3, 1000.0)  # what a load moves within its time, over the error of a pose; in the logarithm
STRONGEST = 100.0  # m/s2, of a load at most; of a moment the same half the size from the center
FORGETS: Span = (2.0, 60.0)  # times in a record that a smooth load forgets itself, in the logarithm
LINES: Span = (1, 3)  # oscillations
CYCLES = 3.0  # in a record, of the slowest one; the fastest has FASTEST of the sample rate
FASTEST = 0.4
STEPS: Span = (1, 4)  # changes of level in a record
IMPACTS: Span = (1, 3)
PULSES: Span = (0.002, 0.02)  # s, of an impact, evenly in the logarithm
JUMPS: Span = (0.05, 3.0)  # m/s, change of velocity, evenly in the logarithm
DRAGS: Span = (0.02, 2.0)  # of the weight, at the start, evenly in the logarithm
TETHERED = 0.4  # of the loads of the state: a spring to a point within a meter a coordinate, else drag
SWUNG: Span = (0.5, 8.0)  # swings of it in a record
BESIDE = 0.5  # of oscillations, steps and impacts: a smooth load acts beside
FALLS = 1.5  # s: in a longer record a constant force carries the weight, and where no load acts there is none
ROOM = 20.0  # m that a body comes from its start by its first velocity, at most
TURNED, FLOWN = 0.5, 50.0  # rad a sample, m: beyond them, loads and spin are halved, and it flies anew
HALVED = 20  # times at most

NOISES: Span = (5e-5, 2e-3)  # m, standard deviation of a coordinate, evenly in the logarithm
ERRORS = {
    "white": 0.42, "colored": 0.11, "low-passed": 0.11, "outliers": 0.1, "gaps": 0.12, "rounded": 0.08,
    "shared": 0.06,
}  # fmt: skip
REMEMBERED: Span = (2.0, 20.0)  # samples over which colored and shared errors last, in the logarithm
COLORED = 0.5  # of the variance that is colored, or shared
CUTS: Span = (0.05, 0.3)  # of the sample rate, of the low-pass that positions went through, both ways
OUTLIERS: Span = (0.002, 0.03)  # of the readings, in the logarithm
WILD: Span = (10.0, 300.0)  # times the noise that an outlier is off, in the logarithm
MISSING: Span = (0.01, 0.1)  # of the record that a run misses; of up to half of the markers
DIGITS = (1e-4, 1e-3)  # m, the step of rounded readings

STATED = {"right": 0.35, "wrong": 0.15, "nothing": 0.5}  # of the noise
MISSTATED: Span = (1.5, 4.0)  # times too large or too small

TOLD = {
    "masses of nodes": 0.3, "as a whole": 0.58, "wrong, and said so": 0.06, "wrong": 0.06,
}  # fmt: skip
MASS_OFF, CENTER_OFF, INERTIA_OFF = 0.02, 0.01, 0.03  # standard deviations: of itself, of the size, of itself


def log_even(rng: np.random.Generator, span: Span) -> float:
    """A number drawn evenly in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(span))))


def choice(rng: np.random.Generator, shares: dict[str, float]) -> str:
    """One of the names, with its share."""
    return str(rng.choice(list(shares), p=list(shares.values())))


def count(rng: np.random.Generator, span: Span) -> int:
    """A whole number, both ends included, evenly."""
    return int(rng.integers(int(span[0]), int(span[1]) + 1))


def direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector of any direction."""
    way = rng.standard_normal(3)
    return np.asarray(way / np.linalg.norm(way))


@dataclass(frozen=True)
class Drawn:
    """The kinds that a record is of, by which results are counted, and its plain numbers.

    load, error, told, place, stated: names of the tables above; soft: the body deforms; weight: it has any;
    held: a constant force carries it; rate Hz; noise m; size m.
    """

    load: str
    error: str
    told: str
    place: str
    stated: str
    soft: bool
    weight: bool
    held: bool
    rate: float
    samples: int
    noise: float
    size: float
    markers: int


def drawn_kinds(rng: np.random.Generator, frames: Span = SAMPLES) -> Drawn:
    """All that is drawn of a record, of so many frames, before the details of body and load."""
    soft = bool(rng.random() < SOFT_SHARE)
    least = 5 if soft else MARKERS[0]
    load, rate, samples = choice(rng, LOADS), log_even(rng, RATES), round(log_even(rng, frames))
    long, weight = samples / rate > FALLS, bool(rng.random() >= WEIGHTLESS)
    weight = weight and not (long and load == "none")
    return Drawn(
        load, choice(rng, ERRORS), choice(rng, TOLD), "anywhere" if soft else choice(rng, PLACES),
        choice(rng, STATED), soft, weight, weight and long, rate, samples, log_even(rng, NOISES),
        log_even(rng, SIZES), round(log_even(rng, (least, MARKERS[1]))),
    )  # fmt: skip


def shares(of: dict[str, float]) -> str:
    """Names with their shares in words."""
    return ", ".join(f"{name} {100 * share:.0f} %" for name, share in of.items())


def between(span: Span, unit: str = "") -> str:
    """A span in words."""
    return f"{span[0]:g} to {span[1]:g}{' ' * bool(unit)}{unit}"


WORDS = {
    "body": f"rigid, in {100 * SOFT_SHARE:.0f} % deforming affinely (St. Venant and Kirchhoff, "
    f"{between(SWINGS, 'Hz')}, strains of {between(STRAINS)} at the start); longest edge "
    f"{between(SIZES, 'm')}, inertia of any principal axes, {between(DENSITIES, 'kg/m3')}",
    "what is told of it": f"{shares(TOLD)}; wrong by {100 * MASS_OFF:.0f} % in mass, "
    f"{100 * INERTIA_OFF:.0f} % in inertia and {100 * CENTER_OFF:.0f} % of the size in the center (standard "
    "deviations)",
    "markers": f"{between(MARKERS)}; {shares(PLACES)} (within {between(THIN)} of the size off it)",
    "motion": f"{between(SPEEDS, 'm/s')} and {between(SPINS, 'rad/s')} at the start; weight in "
    f"{100 * (1 - WEIGHTLESS):.0f} %, carried by a constant force beside in records of over {FALLS:g} s",
    "loads": f"{shares(LOADS)}; each moves the body by {between(SHOWN)} times the error of a pose within the "
    f"time in which it changes; blows of {between((1e3 * PULSES[0], 1e3 * PULSES[1]), 'ms')} and "
    f"{between(JUMPS, 'm/s')}; drag of {between(DRAGS)} times the weight, or a spring",
    "camera": f"{between(RATES, 'Hz')}, {between(SAMPLES)} samples",
    "errors": f"{between((1e3 * NOISES[0], 1e3 * NOISES[1]), 'mm')}; {shares(ERRORS)}",
    "what is told of them": f"{shares(STATED)}; wrong by {between(MISSTATED)} times",
}
