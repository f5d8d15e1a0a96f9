"""What forceid finds on this machine: versions, engine, BLAS, compiler, threads, memory, readers of files."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import forceid
from forceid import compiled
from forceid.kalman.engines import engine, instructions
from forceid.memory import memory_limit
from forceid.threads import blas_libraries

NEEDED = ("numpy", "scipy", "h5py", "xarray", "matplotlib", "pydantic", "typer")
OPTIONAL = ("ezc3d", "pyuff", "npTDMS", "pyulog", "distributed", "forceid-evidence")
ASKED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "FORCEID_ENGINE_ARCH")
COMPILERS = ("c++", "g++", "clang++", "cl")


def found() -> dict[str, str]:
    """What there is, by subject.

    >>> sorted(found())[:4]
    ['blas', 'compiler', 'engine', 'extras']
    """
    chosen = engine("auto").name
    built = getattr(compiled.engine, "compiler", "")
    here = next((word for word in COMPILERS if shutil.which(word)), "none")
    asked = [f"{name}={os.environ[name]}" for name in ASKED if name in os.environ]
    return {
        "forceid": f"{forceid.__version__}, {Path(forceid.__file__).parent}",
        "python": f"{platform.python_version()}, {sys.executable}",
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}",
        "packages": ", ".join(f"{name} {installed(name)}" for name in NEEDED),
        "extras": ", ".join(f"{name} {installed(name)}" for name in OPTIONAL),
        "engine": ", ".join([chosen, *instructions(chosen)]),
        "compiler": f"{f'{built} built the engine, ' if built else ''}{here} on this machine",
        "blas": "; ".join(blas_libraries()) or "none found",
        "threads": ", ".join([f"{cores()} cores for this process", *asked]),
        "memory": f"{memory_limit() / 2**30:.1f} GB for one piece of work",
    }


def installed(package: str) -> str:
    """The version of a package, or that there is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def cores() -> int:
    """The processor's cores that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed else os.cpu_count() or 1
