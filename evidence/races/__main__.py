"""Every workload beside its peers in one run: tables and numbers in a folder."""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
import warnings
from importlib import import_module, metadata
from pathlib import Path

from evidence.races.paired import run
from evidence.races.table import goals_table, lines, write_benchmarks

WORKLOADS = {
    "w1": "one_signal",
    "w2": "many_signals",
    "w3": "resultants",
    "w4": "rotations",
    "w5": "second_derivative",
    "w6": "files",
    "flight": "flight",
    "tuning": "tuned_smoother",
    "start": "start",
}
RACED_LIBRARIES = (
    "forceid", "numpy", "scipy", "filterpy", "statsmodels", "pykalman", "simdkalman", "dynamax", "jax",
    "pynumdiff", "xarray", "h5netcdf", "h5py",
)  # fmt: skip
ROUNDS, BUDGET = 5, 0.5
QUICK_ROUNDS, QUICK_BUDGET = 3, 0.05


def preamble(machine: dict[str, object], rounds: int) -> str:
    """What was run, on what, and how to read it."""
    return (
        "# Speed beside the peers\n\n"
        f"`{machine['command']}`, {machine['date']}, {machine['processor']}, Python {machine['python']}, "
        f'engine "auto" = {machine["engine"]}.\n\nVersions: {machine["versions"]}.\n\n'
        f"Process CPU time on one thread, {rounds} rounds in which every contestant takes its turn. Ratios "
        "are formed within a round, and larger is faster. Who is slow is timed on a shorter stretch, and "
        "counted in proportion. Answers are compared before timing, relative to the largest "
        "entry of each quantity.\n"
    )


def machine_facts(args: argparse.Namespace) -> dict[str, object]:
    """Versions and machine."""
    from forceid import kalman

    info = Path("/proc/cpuinfo")
    cpu = [s for s in info.read_text().splitlines() if s.startswith("model name")] if info.exists() else []
    return {
        "command": "make bench" + (" BENCH=--quick" if args.quick else ""),
        "date": time.strftime("%Y-%m-%d"),
        "processor": f"{os.cpu_count()} x {cpu[0].split(':')[1].strip() if cpu else platform.machine()}",
        "python": platform.python_version(),
        "engine": kalman.engine("auto").name,
        "versions": ", ".join(f"{name} {installed_version(name)}" for name in RACED_LIBRARIES),
    }


def installed_version(name: str) -> str:
    """The installed version, or that there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def main() -> int:
    """Run what was asked for; the exit code says only that it ran."""
    parser = argparse.ArgumentParser(prog="evidence.races", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("bench"), help="folder of the results")
    parser.add_argument("--quick", action="store_true", help="smaller jobs, fewer rounds: under 90 s")
    parser.add_argument("--only", nargs="+", choices=list(WORKLOADS), default=list(WORKLOADS))
    args = parser.parse_args()
    warnings.simplefilter("ignore")  # the peers deprecate, and miss optional parts
    rounds, budget = (QUICK_ROUNDS, QUICK_BUDGET) if args.quick else (ROUNDS, BUDGET)
    machine = machine_facts(args) | {"rounds": rounds}
    print(preamble(machine, rounds), flush=True)
    outcomes = []
    for name in args.only:
        began = time.perf_counter()
        for race in import_module(f"evidence.races.{WORKLOADS[name]}").races(args.quick):
            outcomes.append(run(race, rounds, budget))
            print(lines(outcomes[-1]), flush=True)
        write_benchmarks(
            args.output, preamble(machine, rounds), machine, outcomes
        )  # a later crash loses nothing
        print(f"({name}: {time.perf_counter() - began:.0f} s)\n", file=sys.stderr, flush=True)
    print(goals_table(outcomes))
    return 0


if __name__ == "__main__":
    sys.exit(main())
