"""What describes the package agrees with pyproject.toml, and pyright accepts what users write."""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

import forceid

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
EVIDENCE = tomllib.loads((ROOT / "evidence/pyproject.toml").read_text())
ABOUT = PROJECT["project"]
USER = """\
import numpy as np

import forceid
from forceid import kalman, partition, pseudorigid

tree = forceid.open_motion("throw.h5")
result = forceid.estimate(tree, method="smoother")
verdict = result["estimate"].attrs["verdict"]
error = forceid.summarize(result).force_error
x = np.zeros((5, 3))
S = forceid.summation_operator(x)
p = forceid.mass_properties(np.ones(5), x)
sizes = (p.mass, p.center.shape, p.inertia.shape, S.shape, forceid.distribute(np.zeros(6), x).shape)
one = np.eye(1)
model = kalman.StateSpace(one, one, one, one, np.zeros(1), one)
smoothed = kalman.smooth(model, np.zeros((4, 1))).x.shape
L, U = pseudorigid.polar(np.eye(3))
energy = pseudorigid.NeoHookean(1.0, 1.0).energy(np.eye(3))
system = partition.PartitionedSystem
print(forceid.__version__)
"""


def bare(requirement):
    """A requirement as name and bound."""
    return tuple(re.fullmatch(r"([\w.-]+?)(?:-base)? *(>=[\d.]+)", requirement).groups())


def test_citation_and_metadata_say_what_the_package_says():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    codemeta = json.loads((ROOT / "codemeta.json").read_text())
    assert citation["title"] == codemeta["name"] == ABOUT["name"]
    assert citation["abstract"] == codemeta["description"] == ABOUT["description"]
    assert citation["license"] == codemeta["license"].rpartition("/")[2] == ABOUT["license"]
    assert citation["keywords"] == codemeta["keywords"] == ABOUT["keywords"]
    people = [author["name"] for author in ABOUT["authors"]]
    assert [a["name"] for a in citation["authors"]] == people == [codemeta["author"][0]["name"]]


def test_the_conda_recipe_needs_what_the_package_needs():
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())["requirements"]
    assert [bare(word) for word in recipe["run"][1:]] == [bare(word) for word in ABOUT["dependencies"]]
    assert bare(recipe["run"][0]) == ("python", ABOUT["requires-python"])
    built = [bare(word) for word in recipe["host"][2:]]
    assert built == [bare(word) for word in PROJECT["build-system"]["requires"]]


def test_the_version_without_git_is_one_number_everywhere():
    without = PROJECT["tool"]["setuptools_scm"]["fallback_version"]
    assert without == EVIDENCE["tool"]["setuptools_scm"]["fallback_version"]
    assert f'__version__ = "{without}"' in (ROOT / "forceid/__init__.py").read_text()
    assert f'default="{without}"' in (ROOT / "conda/recipe.yaml").read_text()
    assert re.match(r"\d+\.\d+\.", forceid.__version__)


def test_wheels_are_built_for_the_four_systems_and_tested_by_make_test():
    jobs = {
        name: yaml.safe_load((ROOT / f".github/workflows/{name}.yml").read_text())["jobs"]
        for name in ("test", "wheels")
    }
    systems = {"ubuntu-latest", "ubuntu-24.04-arm", "macos-latest", "windows-latest"}
    assert systems <= set(jobs["test"]["test"]["strategy"]["matrix"]["os"])
    assert systems <= set(jobs["wheels"]["wheels"]["strategy"]["matrix"]["os"])
    assert any("make test " in step.get("run", "") for step in jobs["test"]["test"]["steps"])


def test_nothing_is_compiled_for_the_processor_of_the_builder():
    sources = [ROOT / "setup.py", ROOT / "pyproject.toml", *(ROOT / ".github").rglob("*.yml")]
    assert not [path.name for path in sources if re.search(r"-m(arch|tune|cpu)=", path.read_text())]


@pytest.mark.long
@pytest.mark.skipif(not (find_spec("pyright") and shutil.which("node")), reason="needs pyright and node")
@pytest.mark.parametrize("mode", ["standard", "strict"])
def test_pyright_accepts_what_users_write(mode, tmp_path):
    (tmp_path / "use.py").write_text(USER)
    settings = {"include": ["use.py"], "extraPaths": [str(ROOT)], "typeCheckingMode": mode}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    words = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
