from dataclasses import replace

import numpy as np
import pytest

import forceid
from forceid.errors import ConfigError, DataError
from forceid.files.formats.sources import import_sources
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.import_settings import ImportSettings, load_import_settings
from forceid.sections import validate

MEAN = {
    "gravity": [0, 0, -9.81],
    "csv": {
        "time": "t_ms",
        "center": ["x", "y", "z"],
        "orientation": ["qx", "qy", "qz", "qw"],
        "units": {"time": "ms", "center": "mm"},
        "group": "toss",
    },
    "body": {
        "total_mass": 0.5,
        "inertia": [[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1e-3]],
        "position": {"low": [0, 0, -0.1], "high": [0, 0, 0.1]},
    },
}


def settings(**more):
    return validate(ImportSettings, MEAN | more, "test:")


def write(path, rows, header="toss,t_ms,x,y,z,qw,qx,qy,qz"):
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def falling(toss, z=(1.0, 0.8, 0.6, 0.4, 0.2)):
    return [f"{toss},{10 * k},1,2,{1000 * h},-2e0,0,0,0" for k, h in enumerate(z)]


def test_columns_become_mean_motion_in_si_with_quaternions_mapped(tmp_path):
    path = write(tmp_path / "a.csv", ["7,0,1,2,3,.6,.0,.8,.0", "7,10,,,,,,,", "7,20,1,2,3,-.6,.8,0,0"])
    ((name, recording),) = import_sources([path], settings(noise_std={"center": 1e-4}))
    assert name == "a-7"
    assert recording.motion.time.tolist() == [0, 0.01, 0.02]
    assert recording.motion.center[0] == pytest.approx([1e-3, 2e-3, 3e-3])
    assert recording.motion.orientation[0] == pytest.approx([0, 0.8, 0, 0.6])
    assert recording.motion.orientation[2] == pytest.approx([-0.8, 0, 0, 0.6])
    assert np.isnan(recording.motion.orientation[1]).all()
    assert recording.body.total_mass == 0.5
    assert recording.body.node == ("low", "high")
    assert recording.motion.noise_std == {"center": 1e-4}
    write_motion(tmp_path / "a.h5", recording)
    assert np.array_equal(
        read_motion(tmp_path / "a.h5").motion.center, recording.motion.center, equal_nan=True
    )


def test_groups_part_the_table_and_select_keeps_some(tmp_path):
    rows = [row.replace("-2e0", "1") for toss in ("10", "2", "4") for row in falling(toss)]
    path = write(tmp_path / "a.csv", rows)
    assert [name for name, _ in import_sources([path], settings())] == ["a-10", "a-2", "a-4"]
    for select, names in ((4, ["a-4"]), (["2", 10], ["a-2", "a-10"])):
        chosen = settings(csv=MEAN["csv"] | {"select": select})
        assert [name for name, _ in import_sources([path], chosen)] == names
    with pytest.raises(DataError, match=r"has no toss '5'; name one that it has; found 10, 2, 4"):
        import_sources([path], settings(csv=MEAN["csv"] | {"select": 5}))


def test_rows_are_kept_until_the_lowest_point_nears_the_plane(tmp_path):
    path = write(tmp_path / "a.csv", [row.replace("-2e0", "1") for row in falling(1)])

    def rows(**until):
        return len(import_sources([path], settings(until=until))[0][1].motion.time)

    assert rows(clearance=0.25) == 4  # the low point is 0.1 m under the center: 0.1 m above 0 in the last row
    assert rows(clearance=0.05) == 5
    assert rows(clearance=0.05, height=0.2) == 3 + 1
    assert rows(clearance=0.5, axis="x", height=-1.0) == 5


def test_a_window_keeps_both_ends(tmp_path):
    path = write(tmp_path / "a.csv", [row.replace("-2e0", "1") for row in falling(1)])
    ((_, recording),) = import_sources([path], settings(start=0.01, stop=0.03))
    assert recording.motion.time.tolist() == [0.01, 0.02, 0.03]


def test_marker_columns_take_mass_by_name_and_shape_from_the_first_complete_frame(tmp_path):
    rows = [f"{k},{k},0,{'' if k == 0 else 0},0,{k + 1},0" for k in range(4)]
    path = write(tmp_path / "a.csv", rows, "t,ax,ay,az,bx,by,bz")
    table = {
        "gravity": [0, 0, 0],
        "csv": {"time": "t", "position": {"a": ["ax", "ay", "az"], "b": ["bx", "by", "bz"]}},
        "body": {"mass": {"b": 2.0}},
    }
    ((_, recording),) = import_sources([path], validate(ImportSettings, table, "test:"))
    assert recording.body.mass.tolist() == [0, 2]
    assert recording.body.position.tolist() == [[1, 0, 0], [0, 2, 0]]
    with pytest.raises(ConfigError, match="unknown name 'c'; did you mean"):
        import_sources([path], validate(ImportSettings, table | {"body": {"mass": {"c": 1.0}}}, "test:"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "holds 0 rows"),
        ("toss,t_ms,x,y,z,qw,qx,qy,qz\n", "holds 1 rows"),
        ("toss,t_ms,x,y,z,qw,qx,qy,qz\n1,2\n", "has 2 cells in row 2, expected 9"),
        ("toss,t_s,x,y,z,qw,qx,qy,qz\n1,2,3,4,5,6,7,8,9\n", "has no column 't_ms'; did you mean 't_s'"),
        (
            "toss,t_ms,x,y,z,qw,qx,qy,qz\n1,2,up,4,5,6,7,8,9\n",
            "a.csv:x holds text .*'up'.*, expected numbers",
        ),
        ("toss,t_ms,x,y,z,qw,qx,qy,qz\n" + 3 * "1,2,3,4,5,1,0,0,0\n", "a.csv:/motion/time goes from"),
        (
            "toss,t_ms,x,y,z,qw,qx,qy,qz\n1,0,3,4,5,2,0,0,0\n",
            "/motion/orientation has 1 quaternions off unit norm",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_refused(tmp_path, content, message):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(DataError, match=message):
        import_sources([path], settings())


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "a.csv").write_bytes(bytes(range(256)))
    with pytest.raises(DataError, match=r"a\.csv is not CSV text"):
        import_sources([tmp_path / "a.csv"], settings())


def test_settings_that_do_not_fit_are_refused(tmp_path):
    path = write(tmp_path / "a.csv", [row.replace("-2e0", "1") for row in falling(1)])
    with pytest.raises(ConfigError, match=r"needs the table \[import\.csv\]"):
        import_sources([path], replace_csv(settings()))
    with pytest.raises(ConfigError, match=r"ends in '\.xls', expected Vicon CSV, .*, uff, unv, tdms"):
        import_sources([tmp_path / "a.xls"], settings())
    with pytest.raises(ConfigError, match="unknown name 'centre'; did you mean 'center'"):
        import_sources([path], settings(noise_std={"centre": 1.0}))
    with pytest.raises(DataError, match="noise_std -1, expected a positive"):
        import_sources([path], settings(noise_std={"center": -1.0}))
    with pytest.raises(ConfigError, match=r"key 'gravity' is missing; add gravity = \[0.0, 0.0, -9.81\]"):
        validate(ImportSettings, {"csv": MEAN["csv"]}, "test:")
    with pytest.raises(ConfigError, match=r"unknown key 'until\.clearence'; did you mean 'clearance'"):
        settings(until={"clearence": 1.0})
    (tmp_path / "a.toml").write_text('method = "spline"\n')
    with pytest.raises(ConfigError, match=r"has no table \[import\]"):
        load_import_settings(tmp_path / "a.toml")


def replace_csv(whole):
    return whole.model_copy(update={"csv": None})


def test_the_identity_of_an_import_is_that_of_its_numbers(tmp_path):
    path = write(tmp_path / "a.csv", [row.replace("-2e0", "1") for row in falling(1)])
    ((_, a),) = import_sources([path], settings())
    ((_, b),) = import_sources([path], settings(title="named"))
    assert a.sha256 == b.sha256
    assert b.title == "named: a-1"
    assert replace(a, title=b.title).history == b.history == f"forceid {forceid.__version__} import a.csv"
