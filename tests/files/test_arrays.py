import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import forceid
from forceid.errors import ConfigError, DataError
from forceid.files.stored.hdf5 import read_motion

G = [0.0, 0.0, -9.81]
NAMES = ("nose", "left_wing", "tail")
MASS = dict(zip(NAMES, (0.1, 0.2, 0.15), strict=True))
SHAPE = np.array([[0.2, 0, 0], [-0.1, 0.15, 0], [-0.1, -0.15, 0.05]])


def flight(n=60, seed=0):
    """Times and markers of a body that turns and is pushed, with noise."""
    time = np.arange(n) / 100
    turn = 3.0 * time
    R = np.zeros((n, 3, 3))
    R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = (
        np.cos(turn), -np.sin(turn), np.sin(turn), np.cos(turn), 1,
    )  # fmt: skip
    center = np.stack([2 * time, np.sin(5 * time), 1 + time - 3 * time**2], 1)
    noise = 1e-3 * np.random.default_rng(seed).standard_normal((n, 3, 3))
    return time, center[:, None] + np.einsum("tij,nj->tni", R, SHAPE) + noise


TIME, POSITION = flight()


def made(position, time=None, **more):
    return forceid.motion(position, time, **{"mass": MASS, "gravity": G} | more)


def wide(form="{} {}", position=POSITION):
    columns = {form.format(n, a): position[:, k, i] for k, n in enumerate(NAMES) for i, a in enumerate("xyz")}
    return pd.DataFrame(columns)


def long(position=POSITION):
    rows = [(t, n, *position[j, k]) for j, t in enumerate(TIME) for k, n in enumerate(NAMES)]
    return pd.DataFrame(rows, columns=["time", "node", "x", "y", "z"])


def array(dims=("time", "node", "axis"), names=("time", "node", "axis")):
    coords = dict(zip(names, (TIME, list(NAMES), ["x", "y", "z"]), strict=True))
    called = dict(zip(("time", "node", "axis"), names, strict=True))
    return xr.DataArray(POSITION, coords, names).transpose(*(called[dim] for dim in dims))


OTHER = {"time": "frame", "node": "keypoint", "axis": "space"}
LEVELS = pd.MultiIndex.from_product([["me"], NAMES, ["x", "y", "z"]])
WAYS = {
    "numpy": lambda: made(POSITION, TIME, nodes=NAMES),
    "numpy, node first": lambda: made(
        POSITION.transpose(1, 2, 0), TIME, dims=("node", "axis", "time"), nodes=NAMES
    ),
    "numpy in the order of Fortran": lambda: made(np.asfortranarray(POSITION), TIME, nodes=NAMES),
    "lists": lambda: made(POSITION.tolist(), TIME.tolist(), nodes=NAMES, mass=list(MASS.values())),
    "DataFrame, wide": lambda: made(wide().assign(time=TIME)),
    "DataFrame, wide, index": lambda: made(wide("{}.{}").set_index(pd.Index(TIME))),
    "DataFrame, wide, named": lambda: made(
        wide("p_{1}({0})").assign(t=TIME), "t", columns="p_{axis}({name})"
    ),
    "DataFrame, columns turned round": lambda: made(
        wide("{}_{}").assign(time=TIME).iloc[:, ::-1], nodes=NAMES
    ),
    "DataFrame, levels": lambda: made(pd.DataFrame(POSITION.reshape(-1, 9), TIME, LEVELS)),
    "DataFrame, long": lambda: made(long()),
    "DataFrame, long, shuffled": lambda: made(
        pd.concat([long()[:3], long()[3:].sample(frac=1, random_state=0)]).rename(columns={"node": "marker"}),
        names={"node": "marker"},
    ),
    "DataFrame, long, levels of rows": lambda: made(long().set_index(["time", "node"])),
    "DataArray": lambda: made(array()),
    "DataArray, any order": lambda: made(array(("axis", "time", "node"))),
    "DataArray, any names": lambda: made(array(("node", "axis", "time"), tuple(OTHER.values())), names=OTHER),
    "DataArray, axes in any order": lambda: made(array().isel(axis=[2, 0, 1])),
    "DataArray of mass": lambda: made(
        array(), mass=xr.DataArray(list(MASS.values()), {"node": list(NAMES)}, ("node",))
    ),
    "Series of mass": lambda: made(array(), mass=pd.Series(MASS)),
    "Dataset": lambda: forceid.motion(
        xr.Dataset({"position": array(("axis", "node", "time")), "mass": ("node", list(MASS.values()))}),
        gravity=G,
    ),
    "Dataset, any names": lambda: made(
        xr.Dataset({"track": array(("node", "axis", "time"), tuple(OTHER.values()))}, attrs={"gravity": G}),
        gravity=None,
        names=OTHER | {"position": "track"},
    ),
}


@pytest.fixture(scope="module")
def from_file(tmp_path_factory):
    """The file, and its estimate."""
    path = tmp_path_factory.mktemp("arrays") / "a.h5"
    forceid.save(made(POSITION, TIME, nodes=NAMES), path)
    return read_motion(path), forceid.estimate(forceid.open_motion(path))


@pytest.mark.parametrize("way", WAYS)
def test_arrays_tables_and_files_give_the_same_force_to_the_bit(way, from_file):
    recording, result = from_file
    tree = WAYS[way]()
    assert tuple(tree["body/node"].values) == NAMES
    assert np.array_equal(tree["motion/position"].values, recording.motion.position)
    if way in ("numpy, node first", "DataFrame, long, shuffled", "DataArray, any names", "Dataset"):
        own = forceid.estimate(tree)  # the others hand over the same bits in one block, as is asserted
        for name in ("force", "moment", "force_std"):
            assert np.array_equal(own[f"estimate/{name}"].values, result[f"estimate/{name}"].values)
    for name in ("position", "mass"):
        assert np.array_equal(tree[f"body/{name}"].values, getattr(recording.body, name))
    assert np.array_equal(tree["motion/time"].values, recording.motion.time)
    assert tree["motion/position"].values.flags.c_contiguous
    assert result["estimate/force"].notnull().all()


def test_a_long_table_without_a_row_has_a_gap():
    tree = made(long().drop(index=7))
    gaps = np.isnan(tree["motion/position"].values).any(2)
    assert gaps.sum() == 1
    assert gaps[2, 1]


def test_dates_and_durations_are_seconds_from_the_first():
    start = np.datetime64("2024-05-01T12:00:00.000000000")
    dates = start + (TIME * 1e9).round().astype("m8[ns]")
    index = pd.DatetimeIndex(dates)
    for clock in (dates, dates - start, index, index.tz_localize("Europe/Berlin"), xr.DataArray(dates)):
        assert made(POSITION, clock, nodes=NAMES)["motion/time"].values == pytest.approx(TIME, abs=1e-12)
    tree = made(array().assign_coords(time=dates))
    assert tree["motion/time"].values == pytest.approx(TIME, abs=1e-12)
    assert made(wide().set_index(index))["motion/time"].values == pytest.approx(TIME, abs=1e-12)


def test_a_rate_stands_for_a_clock():
    assert made(POSITION, rate=100.0, nodes=NAMES)["motion/time"].values == pytest.approx(TIME)
    assert made(wide(), rate=100.0)["motion/time"].values == pytest.approx(TIME)
    tree = made(array().drop_vars("time").transpose("node", ...), rate=100.0)
    assert tree["motion/time"].values == pytest.approx(TIME)


class Unit(str):
    """A unit as one of pint writes itself."""

    __slots__ = ()

    def __format__(self, how):
        assert how == "~C"
        return str(self)


class Quantity:
    """What a quantity of pint shows of itself."""

    def __init__(self, magnitude, units="mm"):
        self.magnitude, self.units = magnitude, Unit(units)

    def __array__(self, *_):
        raise AssertionError("its unit is stripped")


def test_units_are_brought_to_si_as_in_a_file():
    millimeters = 1e3 * POSITION
    in_mm = {"units": {"position": "mm"}}
    array_in_mm = xr.DataArray(millimeters, dims=("time", "node", "axis"))
    for given, more in (
        (millimeters, {"noise_std": 1.0} | in_mm),
        (millimeters, {"noise_std": Quantity(1e-3, "m")} | in_mm),
        (array_in_mm.assign_attrs(units="mm"), {"noise_std": 1.0}),
        (Quantity(millimeters), {"noise_std": 1e-3}),
    ):
        tree = made(given, TIME, nodes=NAMES, **more)
        assert np.array_equal(tree["motion/position"].values, 1e-3 * millimeters)
        assert np.array_equal(tree["body/position"].values, 1e-3 * millimeters[0])
        assert tree["motion/position"].attrs["noise_std"] == 1e-3


def test_quantities_of_pint_bring_their_units_wherever_they_are():
    plain = made(POSITION, TIME, nodes=NAMES, noise_std=1e-3)
    mass = {name: Quantity(1e3 * kg, "g") for name, kg in MASS.items()}
    told = made(
        Quantity(POSITION, "m"), Quantity(1e3 * TIME, "ms"), nodes=NAMES, mass=mass,
        gravity=Quantity(np.array([0.0, 0.0, -9.81]), "m/s**2"), noise_std=Quantity(1.0, "mm"),
    )  # fmt: skip
    for group in ("motion", "body"):
        for name, values in plain[group].data_vars.items():
            assert told[group][name].values == pytest.approx(values.values, rel=1e-14)
    assert told["motion/time"].values == pytest.approx(TIME, rel=1e-14)
    assert told["motion"].attrs["gravity"] == pytest.approx(G)
    assert told["motion/position"].attrs["noise_std"] == 1e-3
    with pytest.raises(DataError, match="arrays:mass has units 'm', expected 'kg'"):
        made(POSITION, TIME, nodes=NAMES, mass=Quantity([1, 1, 1], "m"))


def test_a_pose_comes_from_columns_of_a_table():
    angle = 0.5 * TIME
    table = pd.DataFrame({"t": TIME, "px": TIME, "py": 0.0, "pz": 1.0, "qx": 0.0, "qy": 0.0})
    table = table.assign(qz=np.sin(angle / 2), qw=np.cos(angle / 2), note="text")
    tree = forceid.motion(
        table, "t", center=["px", "py", "pz"], orientation=["qx", "qy", "qz", "qw"], gravity=G,
        total_mass=2.0, mass_center=[0, 0, 0], inertia=np.diag([1.0, 2.0, 2.5]),
    )  # fmt: skip
    assert tree["motion/center"].values[-1] == pytest.approx([TIME[-1], 0, 1])
    result = forceid.estimate(tree, method="spline")
    assert result["estimate/force"].values.mean(0) == pytest.approx([0, 0, 19.62], abs=0.05)


def test_sensors_and_noise_come_by_their_names():
    read = np.random.default_rng(1).standard_normal((60, 1, 3))
    tree = made(
        POSITION, TIME, nodes=NAMES, specific_force=read.transpose(0, 1, 2), sensor_position=[[0, 0, 0.01]],
        noise_std={"specific_force": 0.1},
    )  # fmt: skip
    assert np.array_equal(tree["motion/specific_force"].values, read)
    assert tree["motion/specific_force"].attrs["noise_std"] == 0.1


def test_two_coordinates_are_a_motion_in_a_plane():
    planar = made(POSITION[..., :2], TIME, nodes=NAMES, gravity=[0, -9.81])
    assert (planar["motion/position"].values[..., 2] == 0).all()
    flat = wide().drop(columns=[f"{n} z" for n in NAMES]).assign(time=TIME)
    assert made(flat)["motion/position"].identical(planar["motion/position"])


def likely():
    columns = pd.MultiIndex.from_product([NAMES, ["x", "y", "likelihood"]])
    return pd.DataFrame(POSITION.reshape(-1, 9), TIME, columns)


def bodies():
    columns = pd.MultiIndex.from_product([["me", "you"], ["a", "b"], ["x", "y", "z"]])
    return pd.DataFrame(np.ones((60, 12)), TIME, columns)


REFUSED = {
    "gravity": (lambda: made(POSITION, TIME, gravity=None), "lacks gravity.*gravity=\\[0, 0, -9.81\\]"),
    "clock": (lambda: made(POSITION), "say no times of the samples; add time=..., or rate= in Hz"),
    "table clock": (lambda: made(wide()), "say no times"),
    "shape": (
        lambda: made(POSITION.transpose(1, 0, 2), TIME, nodes=NAMES),
        "has shape 3 x 60 x 3, .* with time = 60; say the order",
    ),
    "dims": (lambda: made(POSITION, TIME, dims=("t", "node", "axis")), "dims are t, node, axis"),
    "text": (lambda: made(POSITION.astype(str), TIME, nodes=NAMES), "holds text, expected real numbers"),
    "objects": (lambda: made([[["a"]]], [0.0], nodes=NAMES), "holds text"),
    "variable": (lambda: made(POSITION, TIME, masses=[1]), "unknown variable 'masses'; did you mean 'mass'"),
    "node": (lambda: made(POSITION, TIME, nodes=NAMES, mass={"tial": 1}), "'tial'; did you mean 'tail'"),
    "unnamed": (lambda: made(POSITION, TIME), "mass is given by name.*add nodes"),
    "dimension": (lambda: made(array(names=("time", "keypoint", "space"))), "names={'node': 'keypoint'"),
    "variables": (lambda: made(xr.Dataset({"position": array(), "p": array()})), "'p', which is no variable"),
    "column": (lambda: made(wide().assign(time=TIME, frame=1)), "'frame', expected.*drop"),
    "axis": (lambda: made(wide().assign(time=TIME).drop(columns="tail z")), "no axis z of 'tail'"),
    "twice": (lambda: made(pd.concat([long(), long()[:1]])), "two rows of one node and time"),
    "more": (lambda: made(long().assign(seen=1)), "'seen', expected time, node, x, y, z"),
    "words": (lambda: made(wide().assign(time=TIME).replace({POSITION[3, 0, 0]: "?"})), "holds text"),
    "no points": (lambda: made(pd.DataFrame({"a": TIME}), TIME), "no columns of points, found a"),
    "no mass": (lambda: made(POSITION, TIME, mass=None), "holds no mass"),
    "no column": (lambda: made(wide(), "tme"), "no column 'tme'"),
    "likelihood": (lambda: made(likely()), "has columns 'likelihood' beside x, y and z; drop them"),
    "bodies": (lambda: made(bodies()), r"names points by 2 levels \(me, a\); select one body"),
    "axes": (lambda: made(bodies().rename(columns={"x": "u"})), "no level of columns with x, y and z"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_taken_is_refused_in_one_line_that_says_what_to_do(case):
    make, said = REFUSED[case]
    with pytest.raises((DataError, ConfigError), match=said) as refusal:
        make()
    assert "\n" not in str(refusal.value)
    assert refusal.value.next_step


def test_an_array_in_place_of_a_motion_is_told_how_to_become_one():
    with pytest.raises(DataError, match=r"is of type ndarray, .*; build it: forceid.motion"):
        forceid.estimate(POSITION)
    with pytest.raises(DataError, match=r"is of type str, .*; open it: forceid.open_motion\('a.h5'\)"):
        forceid.inspect("a.h5")


def test_motion_is_called_the_same_before_and_after_the_package_of_its_name_is_loaded():
    code = "import forceid; a = forceid.motion; import forceid.motion; print(a is forceid.motion, "
    code += "callable(forceid.motion), forceid.motion.fit_rotation.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "fit_rotation"]
    import forceid.motion

    assert forceid.motion(POSITION, TIME, mass=[1, 1, 1], gravity=G)["motion/time"].size == 60


def test_importing_forceid_loads_no_array_library_but_what_it_did():
    code = "import sys, forceid; print(*({'numpy', 'xarray', 'pandas', 'scipy'} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
