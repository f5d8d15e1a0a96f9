import re
import sys

import h5py
import numpy as np
import pytest
from laboratory import (
    MASS,
    NAMES,
    POSITION,
    RATE,
    SHAPE,
    SPECIFIC_FORCE,
    TIME,
    brought,
    nodes,
    refusal,
    response,
    units,
    write_tdms,
    write_uff,
)  # fmt: skip
from scipy.io import savemat

from forceid.cli.app import main
from forceid.errors import ConfigError, DataError
from forceid.files.formats.tdms import read_tdms

WHOLE = {"total_mass": 1.0, "inertia": np.eye(3).tolist(), "sensor_position": {"imu": [0, 0, 0]}}
PATTERN = {"position": "capture/{name}_{axis}"}


def tracks(unit="mm", step=1 / RATE, **more):
    clock = {"wf_increment": step} if step else {}
    stated = {"unit_string": unit} if unit else {}
    return {
        f"{name}_{axis}": (1000 * POSITION[:, n, d], {**stated, **clock, **more})
        for n, name in enumerate(NAMES)
        for d, axis in enumerate("xyz")
    }


def test_tracks_take_unit_and_clock_from_the_properties_of_their_channels(tmp_path):
    path = write_tdms(tmp_path / "a.tdms", tracks(wf_start_offset=2.0))
    recording = brought(path, PATTERN)
    assert recording.body.node == NAMES
    assert np.allclose(recording.motion.position, POSITION, rtol=1e-14)
    assert np.allclose(recording.motion.time, 2.0 + TIME, rtol=1e-15)


def test_accelerometer_channels_become_a_sensor_and_g_is_standard_gravity(tmp_path):
    channels = {
        f"a{d}": (SPECIFIC_FORCE[:, d], {"unit_string": "g", "wf_increment": 1 / RATE}) for d in range(3)
    }
    path = write_tdms(tmp_path / "a.tdms", channels, "daq")
    table = {"specific_force": {"imu": [f"daq/a{d}" for d in range(3)]}}
    motion = brought(path, table, body=WHOLE).motion
    assert np.allclose(motion.specific_force[:, 0], 9.80665 * SPECIFIC_FORCE, rtol=1e-14)


def test_sensors_at_rates_of_their_own_share_a_clock_on_which_they_are_read_now_and_then(tmp_path):
    fast = np.arange(5 * len(TIME)) / (5 * RATE)
    pulled = np.sin(np.outer(fast, [1.0, 2.0, 3.0]))
    channels = tracks() | {
        f"a{d}": (pulled[:, d], {"unit_string": "m/s^2", "wf_increment": 1 / (5 * RATE)}) for d in range(3)
    }
    path = write_tdms(tmp_path / "a.tdms", channels)
    table = PATTERN | {"specific_force": {"imu": [f"capture/a{d}" for d in range(3)]}}
    motion = brought(path, table, body={"mass": MASS, "sensor_position": {"imu": [0, 0, 0]}}).motion
    assert np.allclose(motion.time, fast, atol=1e-12)
    assert np.allclose(motion.specific_force[:, 0], pulled)
    assert np.allclose(motion.position[::5], POSITION)
    assert np.isnan(motion.position[1::5]).all()


def test_settings_state_g_of_an_accelerometer_as_the_file_does(tmp_path):
    bare = {f"a{d}": (SPECIFIC_FORCE[:, d], {"wf_increment": 1 / RATE}) for d in range(3)}
    path = write_tdms(tmp_path / "a.tdms", bare, "daq")
    table = {"specific_force": {"imu": [f"daq/a{d}" for d in range(3)]}, "units": {"specific_force": "g"}}
    motion = brought(path, table, body=WHOLE).motion
    assert np.allclose(motion.specific_force[:, 0], 9.80665 * SPECIFIC_FORCE, rtol=1e-14)


def test_scaled_integers_and_time_stamps_are_read_as_what_they_mean(tmp_path):
    scale = {
        "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 0.01,
        "NI_Scale[0]_Linear_Y_Intercept": 1.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        "NI_Scaling_Status": "unscaled", "unit_string": "m/s^2",
    }  # fmt: skip
    counts = (100 * SPECIFIC_FORCE).astype(np.int16)
    stamps = np.datetime64("2026-11-22T10:00:00", "us") + np.round(1e6 * TIME).astype("timedelta64[us]")
    channels = {f"a{d}": (counts[:, d], scale) for d in range(3)} | {"clock": (stamps, {})}
    path = write_tdms(tmp_path / "a.tdms", channels, "daq")
    table = {"specific_force": {"imu": [f"daq/a{d}" for d in range(3)]}, "time": "daq/clock"}
    motion = brought(path, table, body=WHOLE).motion
    assert np.allclose(motion.specific_force[:, 0], 1.0 + 0.01 * counts, rtol=1e-12)
    assert np.allclose(motion.time, TIME, atol=1e-8)


@pytest.mark.parametrize(
    ("channels", "table", "message"),
    [
        (
            tracks(unit=""),
            {},
            r"capture/nose_x states no unit.*say which: import\.channels\.units\.position = \"m\"",
        ),
        (tracks(unit="V"), {}, r"has units 'V', expected 'm'; correct it, or say which"),
        (tracks(step=0), {}, r"nose_x says no times of the samples; add import\.channels\.time"),
        (
            tracks() | {"top_z": (np.ones(30), {"unit_string": "m"})},
            {},
            "capture/top_z has 30 samples, expected 40 as 'capture/nose_x' has",
        ),
        (
            tracks() | {"top_z": (np.ones(40), {"unit_string": "m", "wf_increment": 0.1})},
            {},
            "capture/top_z has another clock",
        ),
        (
            tracks(),
            {"position": "captures/{name}_{axis}"},
            "has no channel like 'captures/.*did you mean 'capture/",
        ),
        (tracks(), {"time": "capture/times"}, "has no channel 'capture/times'; did you mean 'capture/"),
        ({"note": (np.array(["a", "b"], object), {})}, {}, "holds no channel of numbers"),
        ({"x": (np.zeros(0), {})}, {}, "holds no channel of numbers"),
    ],
)
def test_channels_that_do_not_fit_are_refused_in_one_line(tmp_path, channels, table, message):
    path = write_tdms(tmp_path / "a.tdms", channels)
    with pytest.raises(DataError, match=message) as error:
        brought(path, PATTERN | table)
    assert "\n" not in str(error.value)


def test_a_tdms_file_that_is_damaged_never_ends_in_another_error(tmp_path):
    whole = write_tdms(tmp_path / "whole.tdms", tracks()).read_bytes()
    rng = np.random.default_rng(0)
    path = tmp_path / "a.tdms"
    refused = 0
    for k in range(60):
        data = bytearray(whole)
        if k % 2:
            del data[int(rng.integers(1, len(data))) :]
        else:
            data[int(rng.integers(1500))] = int(rng.integers(256))
        path.write_bytes(data)
        said = refusal(lambda: brought(path, PATTERN))
        refused += said != ""
        assert "\n" not in said
    assert refused >= 30
    path.write_text("time\tx\n")
    with pytest.raises(DataError, match=r"a\.tdms is not a whole TDMS file"):
        read_tdms(path)
    with pytest.raises(DataError, match=r"no such file.*give the path of a TDMS file"):
        read_tdms(tmp_path / "no.tdms")


def test_tdms_without_its_reader_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(
        ConfigError, match=r"needs the package nptdms; install it: pip install 'forceid\[tdms\]'"
    ):
        read_tdms(tmp_path / "a.tdms")


def test_the_channels_in_the_help_of_import_are_ones_that_work(tmp_path, capsys):
    assert main(["import", "--help"]) == 0
    said = capsys.readouterr().out.splitlines()
    table = {}
    for line in said:
        if found := re.match(r"\s*(?:(mat|uff|tdms) +)?((?!import)[\w.]+ = \".+?\")", line):
            table.setdefault(found[1] or list(table)[-1], []).append(f"import.channels.{found[2]}")
    assert list(table) == ["mat", "uff", "tdms"]
    rigid = "import.body.inertia = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nimport.body.total_mass = 1"
    masses = "import.body.mass = { nose = 0.1 }"
    trial = {"t": TIME, "markers": {name: 1000 * POSITION[:, k] for k, name in enumerate(NAMES)}}
    savemat(tmp_path / "a.mat", {"trial": trial})
    moved = [response(n + 1, d + 1, POSITION[:, n, d], 8, "m") for n in range(4) for d in range(3)]
    felt = [response(2, d + 1, SPECIFIC_FORCE[:, d], 12, "g") for d in range(3)]
    write_uff(tmp_path / "a.uff", [units(1.0), nodes(), *moved, *felt])
    write_tdms(tmp_path / "a.tdms", tracks(), "Markers")
    for kind, lines in table.items():
        config, out = tmp_path / f"{kind}.toml", tmp_path / f"{kind}.h5"
        body = rigid if kind == "uff" else masses
        config.write_text("\n".join(["import.gravity = [0, 0, -9.81]", body, *lines]))
        assert main(["import", str(tmp_path / f"a.{kind}"), "-o", str(out), "-c", str(config)]) == 0
        with h5py.File(out) as f:
            expected = POSITION + (SHAPE if kind == "uff" else 0)
            assert np.allclose(f["motion/position"][:], expected, atol=1e-9)
