"""Results do not depend on threads and kernels of BLAS by more than a millionth of their sigma."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

SHELF = Path(__file__).parents[1] / "data/synthetic"
SAME = 1e-6  # of sigma
NEEDS = {"Prescott": "sse2", "Haswell": "avx2", "SkylakeX": "avx512f"}
CPU = Path("/proc/cpuinfo")
RUNS = [*(("", n) for n in ("2", "4")), *((kernel, "1") for kernel in NEEDS)]


def estimated(name, kernel, threads, folder):
    """Force and moment (time, 6) with their sigma, and the verdict."""
    env = {**os.environ, "OPENBLAS_NUM_THREADS": threads, **({"OPENBLAS_CORETYPE": kernel} if kernel else {})}
    output = folder / f"{name}{kernel}{threads}.result.h5"
    words = [sys.executable, "-m", "forceid", "estimate", str(SHELF / f"{name}.h5"), "-o", str(output)]
    subprocess.run(words, env=env, capture_output=True, check=True)
    with h5py.File(output) as f:
        both = [
            np.hstack([f[f"estimate/{x}{end}"][...] for x in ("force", "moment")]) for end in ("", "_std")
        ]
        return *both, f["estimate"].attrs["verdict"]


@pytest.fixture(scope="module", params=["top", "two_blocks"])
def plain(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kernels")
    return request.param, folder, estimated(request.param, "", "1", folder)


@pytest.mark.long
@pytest.mark.parametrize(("kernel", "threads"), RUNS)
def test_a_result_is_the_same_under_any_threads_and_kernel(plain, kernel, threads):
    if kernel and not (CPU.is_file() and NEEDS[kernel] in CPU.read_text().split()):
        pytest.skip(f"this processor has no {NEEDS.get(kernel)}")
    name, folder, (wrench, sigma, verdict) = plain
    found, _, said = estimated(name, kernel, threads, folder)
    assert said == verdict
    assert np.nanmax(np.abs(found - wrench) / sigma) < SAME
