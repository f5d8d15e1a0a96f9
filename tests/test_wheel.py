"""What is handed out: a source archive with all that it is built from, a wheel that works without compiler.

`make wheel` builds with the compiler and without, and runs the demo in empty environments.
"""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DATA = (".cpp", ".hpp", ".toml", ".txt", ".j2", ".css", ".js", ".mplstyle", ".pyi", ".typed")


def built(kind, source, folder):
    """The archive that the build backend makes of a tree, with a compiler that fails."""
    code = f"import sys; from setuptools import build_meta as b; print(b.build_{kind}(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(folder)],
        cwd=source,
        env={**os.environ, "CC": "/bin/false", "CXX": "/bin/false"},
        capture_output=True,
        text=True,
        check=True,
    )
    return folder / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """The source archive of this tree, and the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("dist")
    tree = folder / "tree"
    left_out = shutil.ignore_patterns("*.so", "__pycache__")
    for name in ("config", "forceid", "tests"):
        shutil.copytree(ROOT / name, tree / name, ignore=left_out)
    for path in ROOT.iterdir():
        if path.is_file() and not path.name.startswith("."):
            shutil.copy(path, tree)
    sdist = built("sdist", tree, folder)
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    return sdist, built("wheel", next((folder / "unpacked").iterdir()), folder)


def package_files():
    files = (path for path in (ROOT / "forceid").rglob("*") if path.suffix in (".py", *DATA))
    return {str(path.relative_to(ROOT)) for path in files} | {"forceid/_version.py"}


CONFIGURATIONS = {path.name for path in (ROOT / "config").glob("*.toml")}


def test_the_source_archive_holds_all_that_it_is_built_from(archives):
    with tarfile.open(archives[0]) as archive:
        found = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    assert package_files() | {f"config/{name}" for name in CONFIGURATIONS} <= found
    assert {"pyproject.toml", "setup.py", "README.md", "LICENSE"} <= found


def test_the_wheel_holds_the_package_and_nothing_else(archives):
    found = {name for name in zipfile.ZipFile(archives[1]).namelist() if ".dist-info/" not in name}
    assert found == package_files() | {f"forceid/configurations/{name}" for name in CONFIGURATIONS}


def test_wheel_results_and_package_have_one_version(archives):
    with zipfile.ZipFile(archives[1]) as wheel:
        written = wheel.read("forceid/_version.py").decode()
        assert "forceid/configurations/default.toml" in wheel.namelist()
    named = archives[1].name.split("-")[1]
    assert written.strip() == f'__version__ = "{named}"'


def test_the_wheel_asks_for_an_extra_only_where_a_reader_of_files_needs_one(archives):
    with zipfile.ZipFile(archives[1]) as wheel:
        (name,) = (n for n in wheel.namelist() if n.endswith("/METADATA"))
        lines = wheel.read(name).decode().splitlines()
    asked = [line.removeprefix("Requires-Dist: ") for line in lines if line.startswith("Requires-Dist: ")]
    always = {line.split(">")[0].split("=")[0] for line in asked if "extra ==" not in line}
    assert {"numpy", "scipy", "h5py"} <= always
    assert not {"ezc3d", "pyuff", "nptdms", "npTDMS", "distributed", "sphinx"} & always


def test_the_wheel_of_evidence_holds_every_module_and_brings_two_commands(tmp_path):
    source = tmp_path / "evidence"
    shutil.copytree(ROOT / "evidence", source, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    with zipfile.ZipFile(built("wheel", source, tmp_path)) as wheel:
        names = {name for name in wheel.namelist() if ".dist-info/" not in name}
        (entries,) = (name for name in wheel.namelist() if name.endswith("entry_points.txt"))
        commands = wheel.read(entries).decode().splitlines()
    assert names == {str(path.relative_to(ROOT)) for path in (ROOT / "evidence").rglob("*.py")}
    assert commands[0] == "[forceid.commands]"
    assert [line.split(" = ")[0] for line in commands[1:] if line] == ["chart", "stress"]


@pytest.mark.long
def test_a_wheel_without_compiler_estimates_with_numpy(archives, tmp_path):
    with zipfile.ZipFile(archives[1]) as wheel:
        wheel.extractall(tmp_path / "site")
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import forceid; from forceid.cli.app import main;"
        "print(forceid.__file__); sys.exit(main(['--version']) or main(['estimate', *sys.argv[2:]]))"
    )
    motion, result = ROOT / "data" / "synthetic" / "top.h5", tmp_path / "top.result.h5"
    words = [str(tmp_path / "site"), str(motion), "-o", str(result), "--model", "rigid"]
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    where, version, verdict = done.stdout.splitlines()[:3]
    assert where == str(tmp_path / "site" / "forceid" / "__init__.py")
    assert version == f"forceid {archives[1].name.split('-')[1]}, engine numpy"
    assert verdict == "verdict  ok"
