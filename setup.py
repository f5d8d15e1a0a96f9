"""The compiled engine, built where a C++ compiler is, done without where none is; `config/` for the wheel."""

from glob import glob

from setuptools import find_packages, setup

try:
    from pybind11.setup_helpers import ParallelCompile, Pybind11Extension
except ImportError:  # no build requirement installed: what is written in numpy is complete
    extensions = []
else:
    ParallelCompile().install()
    extensions = [
        Pybind11Extension(
            "forceid.compiled._engine",
            sorted(glob("forceid/compiled/*.cpp")),
            cxx_std=17,
            # no -march: one build runs on every processor, and holds what the better ones gain by
            extra_compile_args=["-O3", "-g0", "-Wno-ignored-attributes", "-Wno-array-bounds", "-Wno-psabi"],
            depends=glob("forceid/*/*.hpp"),
            optional=True,
        )
    ]

setup(
    ext_modules=extensions,
    packages=[*find_packages(include=["forceid*"]), "forceid.configurations"],
    package_dir={"forceid.configurations": "config"},
)
