"""The compiled passes: built where a C++ compiler is, and done without where none is."""

from glob import glob

from setuptools import setup

try:
    from pybind11.setup_helpers import Pybind11Extension
except ImportError:  # no build requirement installed: the numpy engine is complete
    extensions = []
else:
    # no -march: one build runs on every processor, and holds what the better ones gain by (processor.hpp)
    flags = ["-O3", "-g0", "-Wno-ignored-attributes", "-Wno-array-bounds", "-Wno-psabi"]
    extensions = [
        Pybind11Extension(
            f"forceid.{name}".replace("/", "."),
            [f"forceid/{name}.cpp"],
            cxx_std=17,
            extra_compile_args=flags + own,
            depends=[*glob("forceid/*.hpp"), *glob("forceid/*/*.hpp")],
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

setup(ext_modules=extensions, options={"build_ext": {"parallel": True}})
