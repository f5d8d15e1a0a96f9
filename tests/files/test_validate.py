"""Every way in which a motion file can be wrong gives one line that names file and variable."""

import h5py
import numpy as np
import pytest
from recordings import markers, mean_motion

from forceid.errors import DataError
from forceid.files.checks.agreement import check_agreement
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.records import Body


def put(name, data):
    """Replace a variable by other data, with its attributes but no dimension scales."""

    def edit(f):
        attrs = dict(f[name].attrs) if name in f else {}
        if name in f:
            del f[name]
        f.create_dataset(name, data=data)
        for key in ("units", "noise_std"):
            if key in attrs:
                f[name].attrs[key] = attrs[key]

    return edit


def values(name, index, value):
    def edit(f):
        data = f[name][()]
        data[index] = value
        f[name][...] = data

    return edit


def attr(name, key, value):
    return lambda f: f[name].attrs.__setitem__(key, value)


def drop(name):
    return lambda f: f.__delitem__(name)


def external(f):
    del f["motion/position"]
    f["motion/position"] = h5py.ExternalLink("other.h5", "/position")


def virtual(f):
    del f["motion/position"]
    layout = h5py.VirtualLayout((20, 4, 3), float)
    layout[:] = h5py.VirtualSource("other.h5", "x", (20, 4, 3))
    f.create_virtual_dataset("motion/position", layout)


def huge(shape, chunks):
    def edit(f):
        del f["motion/position"]
        f.create_dataset("motion/position", shape, float, chunks=chunks)

    return edit


def group_for_variable(f):
    del f["motion/position"]
    f.create_group("motion/position")


N = np.nan
MARKERS = [
    ("no motion", drop("motion"), "/motion is missing, found body, truth"),
    ("no body", drop("body"), "/body is missing"),
    ("no time", drop("motion/time"), "/motion/time is missing, expected the times"),
    ("no measurement", drop("motion/position"), "/motion holds no measurement"),
    ("misspelled", lambda f: f["motion"].move("position", "positions"), "did you mean 'position"),
    ("no reference shape", drop("body/position"), "/body/position is missing, expected the reference shape"),
    ("no mass", drop("body/mass"), "/body holds no mass"),
    (
        "wrong shape",
        put("motion/position", np.zeros((20, 4, 2))),
        r"/motion/position has shape \(20, 4, 2\), expected",
    ),
    ("wrong rank", put("motion/position", np.zeros((20, 12))), r"\(time = 20, node = 4, axis = 3\)"),
    ("transposed", put("motion/position", np.zeros((3, 4, 20))), "/motion/position has shape"),
    ("units", attr("motion/position", "units", "kg"), "/motion/position has units 'kg', expected 'm'"),
    ("clock", values("motion/time", 5, 0.0), r"/motion/time goes from 0\.04 to 0 s at index 5"),
    (
        "NaN clock",
        values("motion/time", 5, N),
        "/motion/time holds 1 times that are not finite, first at index 5",
    ),
    ("short", put("motion/time", np.zeros(0)), "/motion/position has shape"),
    ("all lost", values("motion/position", ..., N), "/motion/position holds nothing but NaN"),
    ("infinite", values("motion/position", (1, 1, 1), np.inf), "/motion/position holds 1 infinite"),
    ("zero mass", values("body/mass", ..., 0.0), "/body/mass has total mass 0 kg"),
    ("negative mass", values("body/mass", 1, -0.1), r"/body/mass is -0\.1 kg at node 'marker_1'"),
    ("NaN body", values("body/position", (0, 0), N), "/body/position holds 1 values that are not finite"),
    (
        "complex",
        put("motion/position", np.zeros((20, 4, 3), complex)),
        "/motion/position holds complex|compound",
    ),
    ("text", put("motion/time", np.array([b"0.1"] * 20)), "/motion/time holds text"),
    ("strings", put("body/mass", ["1"] * 4), "/body/mass holds text or objects"),
    ("booleans", put("body/mass", np.ones(4, bool)), "/body/mass holds booleans"),
    ("a group", group_for_variable, "/motion/position is a group"),
    (
        "noise",
        attr("motion/position", "noise_std", 0.0),
        "/motion/position has noise_std 0, expected a positive",
    ),
    ("noise NaN", attr("motion/position", "noise_std", N), "/motion/position has noise_std nan"),
    (
        "noise text",
        attr("motion/position", "noise_std", "1 mm"),
        "/motion/position has noise_std '1 mm', expected one",
    ),
    (
        "gravity of two",
        attr("motion", "gravity", [0.0, -9.81]),
        "/motion has gravity .* expected three numbers",
    ),
    ("gravity text", attr("motion", "gravity", "down"), "/motion has gravity 'down', expected three numbers"),
    ("gravity NaN", attr("motion", "gravity", [0, 0, N]), "/motion has gravity .* expected three finite"),
    (
        "other nodes",
        put("motion/node", [f"marker_{k}" for k in (1, 0, 2, 3)]),
        "/motion/node holds 'marker_1' where",
    ),
    (
        "twice",
        lambda f: [put(f"{g}/node", ["a", "a", "b", "c"])(f) for g in ("body", "motion")],
        "/body/node names 'a'",
    ),
    ("few names", put("body/node", ["a", "b"]), "/body/node names 2 nodes, expected 4"),
    ("truth rows", put("truth/force", np.zeros((7, 3))), "/truth/force has shape"),
    ("schema", attr("/", "forceid_schema", "9"), "has forceid_schema '9'"),
    ("external link", external, "/motion/position is a link to another file"),
    ("virtual", virtual, "/motion/position keeps its values in another file"),
    ("never written", huge((20, 4, 3), (20, 4, 3)), "/motion/position declares 1920 bytes but stores 0"),
    ("absurd", huge((20, 10**12, 3), (20, 4, 3)), "/motion/position declares"),
]
MEAN = [
    (
        "norm",
        values("motion/orientation", 3, [0, 0, 0, 2.0]),
        "/motion/orientation has 1 quaternions .* norm 2,",
    ),
    ("zero norm", values("motion/orientation", ..., 0.0), "/motion/orientation has 20 quaternions"),
    ("no orientation", drop("motion/orientation"), "/motion/orientation is missing, expected beside center"),
    ("no center", drop("motion/center"), "/motion/center is missing, expected beside orientation"),
    ("stiffness", values("body/stiffness", (0, 1), 99.0), "/body/stiffness is not symmetric"),
    ("mass matrix", values("body/mass_matrix", (0, 1), 1.0), "/body/mass_matrix is not symmetric"),
    (
        "matrix size",
        put("body/stiffness", np.eye(5)),
        r"/body/stiffness has shape \(5, 5\), expected \(dof = 12, dof_2 = 12\)",
    ),
    (
        "inertia",
        values("body/inertia", ..., np.diag([-1.0, 1, 1])),
        "/body/inertia has principal moment -1 kg m2",
    ),
    ("total mass", put("body/total_mass", 0.0), "/body/total_mass has total mass 0 kg"),
    ("mode shape", put("body/mode_shape", np.zeros((2, 3, 3))), "/body/mode_shape has shape"),
    (
        "frequency",
        put("body/mode_frequency", np.zeros(3)),
        r"/body/mode_frequency has shape \(3,\), expected \(mode = 2\)",
    ),
    ("damping NaN", values("body/mode_damping", 0, N), "/body/mode_damping holds 1 values"),
    ("sensors", put("motion/specific_force", np.zeros((20, 2, 3))), "/motion/specific_force has shape"),
    ("gram", attr("motion/specific_force", "units", "gram"), "/motion/specific_force has units 'gram'"),
]
CASES = [pytest.param(markers, *c[1:], id=c[0]) for c in MARKERS] + [
    pytest.param(mean_motion, *c[1:], id=c[0]) for c in MEAN
]


@pytest.mark.parametrize(("make", "edit", "message"), CASES)
def test_one_line_names_file_and_variable(tmp_path, make, edit, message):
    path = tmp_path / "bad.h5"
    write_motion(path, make())
    with h5py.File(path, "r+") as f:
        edit(f)
    with pytest.raises(DataError, match=message) as error:
        read_motion(path)
    line = str(error.value)
    assert line.startswith(f"{path}:/") or line.startswith(f"{path} ")
    assert "\n" not in line
    assert "; " in line, "an error names the next step"


def test_rigid_body_without_inertia_is_told_what_is_missing(tmp_path):
    path = tmp_path / "bad.h5"
    write_motion(path, mean_motion())
    with h5py.File(path, "r+") as f:
        del f["body/mass_matrix"], f["body/inertia"]
    with pytest.raises(DataError, match="/body lacks inertia"):
        read_motion(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"not HDF5 at all", "is not an HDF5 file"), (b"", "is not an HDF5 file"), (None, "cannot be read")],
)
def test_what_is_not_hdf5_is_refused(tmp_path, content, message):
    path = tmp_path / "bad.h5"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError, match=rf"bad\.h5 {message}"):
        read_motion(path)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.99])
def test_a_truncated_file_is_refused(tmp_path, share):
    path = tmp_path / "bad.h5"
    write_motion(path, markers())
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(DataError, match=r"bad\.h5 is cut short"):
        read_motion(path)


def test_damaged_bytes_give_a_data_error_or_a_recording(tmp_path):
    path = tmp_path / "bad.h5"
    write_motion(path, markers())
    whole, rng, refused = path.read_bytes(), np.random.default_rng(0), []
    for _ in range(150):
        damaged = bytearray(whole)
        for k in rng.integers(0, len(whole), rng.integers(1, 30)):
            damaged[k] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_motion(path)
        except DataError as error:
            refused.append(str(error))
    assert len(refused) > 100
    assert not any("\n" in line for line in refused)


def test_integers_stand_for_real_numbers(tmp_path):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    with h5py.File(path, "r+") as f:
        put("motion/position", np.arange(240).reshape(20, 4, 3))(f)
        put("body/mass", np.ones(4, np.uint8))(f)
    recording = read_motion(path)
    assert recording.motion.position.dtype == recording.body.mass.dtype == np.float64
    assert recording.motion.position[1, 0, 2] == 14.0


def test_a_mass_matrix_of_mass_on_a_point_agrees_with_its_total():
    """Its inertia is zero, and less than that by rounding."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        share, place = rng.standard_normal(9), rng.standard_normal((9, 3))
        share /= share.sum()
        body = Body(
            tuple("abcdefghi"), place, mass_matrix=0.3 * np.kron(np.outer(share, share), np.eye(3)),
            total_mass=0.3,
        )  # fmt: skip
        check_agreement(body, "motion.h5:/body")
