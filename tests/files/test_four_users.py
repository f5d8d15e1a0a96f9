"""Four users, each with the files of a laboratory and a question, through the real command line.

A person in a capture, a flight laboratory, an engineer with accelerometers, a data scientist. Nobody writes
a parser, and nobody writes more than ten lines of settings.
"""

import json
import subprocess
import sys

import captures
import h5py
import numpy as np
import pytest
import test_person_tables as person
from scipy.integrate import solve_ivp

from forceid.principal import summation_operator

pytestmark = pytest.mark.long
AREA, DENSITY, DRAG = 0.03, 1.2, 0.6  # m2, kg/m3, of a body that does not lift
WITHIN = 4.0  # claims: less than one in ten thousand errs by more


def forceid(folder, *words, code=0):
    """What a command prints; it ends with a code."""
    command = [sys.executable, "-m", "forceid", *map(str, words)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


def filled_in(folder, source, *more, **values):
    """The settings that --init proposes for a file, with what no file says filled in; at most ten lines."""
    forceid(folder, "import", "--init", source, "-o", "lab.toml")
    text = (folder / "lab.toml").read_text()
    for name, value in values.items():
        assert f"{name} = nan" in text or f"{name} = [" in text or f"{name} = {{" in text
        lines = [f"{name} = {value}" if line.startswith(f"{name} = ") else line for line in text.splitlines()]
        text = "\n".join(lines) + "\n"
    text = "\n".join([*more, text])
    (folder / "lab.toml").write_text(text)
    own = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert "nan" not in "".join(line.partition("#")[0] for line in own)
    assert len(own) <= 10
    return folder / "lab.toml"


class Dragged(captures.Throw):
    """The same body, thrown fast through air that drags it."""

    def __init__(self):
        super().__init__(160)
        mass = self.mass.sum()

        def rates(_, s):
            v = s[3:]
            drag = -0.5 * DENSITY * AREA * DRAG * np.linalg.norm(v) * v
            return np.concatenate([v, captures.GRAVITY + drag / mass])

        start, span = [0, 0, 1.5, 14.0, 1.0, 3.0], (0, self.time[-1])
        path = solve_ivp(rates, span, start, "DOP853", t_eval=self.time, rtol=1e-10, atol=1e-12).y.T
        self.position += (path[:, :3] - self.center)[:, None]
        self.center = path[:, :3]
        self.force = mass * (np.array([rates(0, s)[3:] for s in path]) - captures.GRAVITY)


def test_a_flight_laboratory_has_the_drag_of_a_body_from_each_of_three_exports(tmp_path):
    throw, found = Dragged(), {}
    (tmp_path / "air.toml").write_text(
        f'[aero]\narea = {AREA}\ndensity = {DENSITY}\naxes = "ball"\n[law]\ndrag = ["1"]\n'
    )
    writers = {"vicon.csv": captures.vicon, "motive.csv": captures.motive, "qualisys.tsv": captures.qualisys}
    for name, write in writers.items():
        write(tmp_path / name, throw)
        mass = "{ nose = 0.1, left = 0.15, right = 0.15, tail = 0.2 }"
        settings = filled_in(tmp_path, name, mass=mass)
        forceid(tmp_path, "import", name, "-o", "throw.h5", "-c", settings)
        forceid(tmp_path, "estimate", "throw.h5", "-o", "throw.result.h5", "-c", "air.toml", "--force")
        with h5py.File(tmp_path / "throw.result.h5") as f:
            force, std, up = (f["estimate"][k][...] for k in ("force", "force_std", "center"))
            value, each = f["aero/CD"][...], f["aero/CD_std"][...]
        true = captures.y_up(throw.force) if name == "motive.csv" else throw.force
        assert len(up) == len(true)
        assert np.sqrt(np.mean(((force - true) / std)[20:-20] ** 2)) < 2.0
        assert np.abs(value - DRAG)[20:-20].max() < WITHIN * each[20:-20].max()
        law = forceid(tmp_path, "coefficients", "throw.result.h5", "-c", "air.toml", "--json")
        (one,) = json.loads(law)["coefficient"]
        found[name] = one["value"], one["std"]
        assert abs(one["value"] - DRAG) < WITHIN * one["std"] < 0.1 * DRAG
        (tmp_path / "lab.toml").unlink()
        (tmp_path / "throw.h5").unlink()
    value = [value for value, _ in found.values()]
    assert np.ptp(value) < 0.1 * max(std for _, std in found.values())  # one flight, whoever wrote it


def test_a_person_of_known_mass_and_height_is_pushed_by_the_ground(tmp_path):
    rng, t = np.random.default_rng(4), np.arange(200) / 100
    lift = 0.05 * np.sin(2 * np.pi * 1.2 * t)
    moves = np.outer(lift, [0, 0, 1]) + 2e-4 * rng.standard_normal((200, 3))
    person.trc(tmp_path / "squat.trc", person.plug_in_gait(), moves)
    settings = filled_in(tmp_path, "squat.trc", mass=person.MASS, height=person.HEIGHT)
    settings.write_text(settings.read_text().replace("[0.0, -9.81, 0.0]", "[0.0, 0.0, -9.81]", 1))
    forceid(tmp_path, "import", "squat.trc", "-o", "squat.h5", "-c", settings)
    said = json.loads(forceid(tmp_path, "estimate", "squat.h5", "--json"))
    assert said["verdict"] in ("ok", "degraded")
    forceid(tmp_path, "export", "squat.result.h5", "-f", "mot")
    table = np.genfromtxt(next(tmp_path.glob("*.mot")), skip_header=_head(tmp_path), names=True)
    push = person.MASS * (9.81 - lift * (2 * np.pi * 1.2) ** 2)
    name = next(n for n in table.dtype.names if n.endswith("vz") or n.endswith("force_z"))
    error = (table[name] - push)[25:-25]
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.ptp(push)


def _head(folder):
    lines = next(folder.glob("*.mot")).read_text().splitlines()
    return next(k for k, line in enumerate(lines) if line.startswith("time"))


def test_an_engineer_with_nine_accelerometers_has_the_force_at_the_mount(tmp_path):
    rng, t = np.random.default_rng(1), np.arange(600) / 1000
    mass, J = 4.0, np.diag([0.03, 0.05, 0.075])
    X = np.array([[x, y, 0.01 * (x + y > 0)] for x in (-0.3, 0, 0.3) for y in (-0.2, 0, 0.2)])
    w = 2 * np.pi * np.array([11.0, 17.0, 23.0])
    pull = np.sin(t[:, None] * w) * [2, 3, 5] + [0, 0, 9.81]
    turn = np.sin(t[:, None] * w[::-1]) * [8, 6, 4]
    read = pull[:, None] + np.cross(turn[:, None], X) + 0.02 * rng.standard_normal((600, 9, 3))
    names = [f"a{k + 1}" for k in range(9)]
    heads = ",".join(["time", *(f"{n} {a}" for n in names for a in "xyz")])
    table = np.column_stack([t, read.reshape(600, -1)])
    np.savetxt(tmp_path / "panel.csv", table, "%.6f", ",", header=heads, comments="")
    places = ", ".join(f"{n} = {x.tolist()}" for n, x in zip(names, X, strict=True))
    told = {"total_mass": mass, "inertia": J.tolist(), "sensor_position": f"{{ {places} }}"}
    settings = filled_in(tmp_path, "panel.csv", **told)
    forceid(tmp_path, "import", "panel.csv", "-o", "panel.h5", "-c", settings)
    forceid(tmp_path, "estimate", "panel.h5")
    with h5py.File(tmp_path / "panel.result.h5") as f:
        force, moment = f["estimate/force"][...], f["estimate/moment"][...]
    by_hand = np.linalg.lstsq(summation_operator(X), read.reshape(600, -1).T, rcond=None)[0].T
    for found, true, hand in ((force, mass * pull, mass * by_hand[:, :3]), (moment, turn @ J, None)):
        size = np.sqrt(np.mean(true**2))
        assert np.sqrt(np.mean((found - true) ** 2)) < 0.01 * size
        assert hand is None or np.sqrt(np.mean((found - hand) ** 2)) < 0.01 * size


SCRIPT = """
import numpy as np, pandas as pd, forceid
tracks = pd.read_csv("tracks.csv", index_col=0, header=[0, 1])
motion = forceid.motion(tracks, mass={"nose": 0.1, "left": 0.15, "right": 0.15, "tail": 0.2},
                        gravity=[0, 0, -9.81])
result = forceid.estimate(motion, prior={"force": {"rate": 12.0}})
table = result.forceid.to_dataframe()
table.to_csv("force.csv")
forceid.save(result, "mine.result.h5")
print(result["estimate"].attrs["verdict"])
"""


def test_a_data_scientist_goes_from_a_table_to_a_table(tmp_path):
    throw = captures.Throw(120)
    heads = [["", *(n for n in throw.names for _ in "xyz")], ["time", *("xyz" * 4)]]
    rows = np.column_stack([throw.time, throw.position.reshape(120, 12)])
    lines = [",".join(head) for head in heads] + [",".join(f"{v:.9g}" for v in row) for row in rows]
    (tmp_path / "tracks.csv").write_text("\n".join(lines))
    (tmp_path / "own.py").write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, "own.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    table = np.genfromtxt(tmp_path / "force.csv", delimiter=",", names=True)
    for k, axis in enumerate("xyz"):
        error = (table[f"force_{axis}"] - throw.force[:, k])[10:-10]
        assert np.sqrt(np.mean((error / table[f"force_std_{axis}"][10:-10]) ** 2)) < 2.0
    forceid(tmp_path, "report", "mine.result.h5", "-o", "mine.html")
    assert (tmp_path / "mine.html").stat().st_size < 2_000_000
