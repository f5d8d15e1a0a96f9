"""The compiled passes: built where a C++ compiler is, and done without where none is."""

import platform

from setuptools import setup

try:
    from pybind11.setup_helpers import Pybind11Extension
except ImportError:  # no build requirement installed: the numpy engine is complete
    extensions = []
else:
    # for the processor it is compiled on; it checks that when loaded
    flags = ["-O3", "-march=native", "-Wno-ignored-attributes", "-Wno-array-bounds"]
    if platform.machine() in ("x86_64", "AMD64"):
        flags.append("-mprefer-vector-width=512")
    extensions = [
        Pybind11Extension(
            f"forceid.{name}".replace("/", "."),
            [f"forceid/{name}.cpp"],
            cxx_std=17,
            extra_compile_args=flags + own,
            optional=True,
        )
        for name, own in {
            "kalman/_compiled": [],
            "kalman/_flight": [],
            "motion/_poses": [],
            "pseudorigid/_polar": ["-ffp-contract=off"],  # exact errors of sums
            "pseudorigid/_splitting": [],
        }.items()
    ]

setup(ext_modules=extensions)
