"""Logs of flight controllers, and analog channels beside markers, from files written by other code."""

import struct

import numpy as np
import pytest
from laboratory import refusal

from forceid.cli.app import main
from forceid.errors import DataError
from forceid.files import import_sources, load_import_settings, settings_for
from forceid.files.formats.logs.blackbox import read_blackbox
from forceid.files.formats.logs.ulog import read_ulog

TIME = np.arange(200) / 250
RATE, FORCE = np.sin(np.outer(TIME, [1.0, 2.0, 3.0])), 9.0 + np.cos(np.outer(TIME, [3.0, 2.0, 1.0]))
BODY = {"total_mass": 1.0, "inertia": np.eye(3).tolist(), "sensor_position": {"imu": [0.0, 0.0, 0.0]}}


def message(kind, payload):
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def ulog(rate=RATE, force=FORCE):
    """A ULog by its specification (docs.px4.io, ULog File Format): two topics at rates of their own."""
    said = [
        message("B", bytes(40)),
        message("F", b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"),
        message("F", b"vehicle_attitude:uint64_t timestamp;float[4] q;"),
        message("A", struct.pack("<BH", 0, 0) + b"sensor_combined"),
        message("A", struct.pack("<BH", 0, 1) + b"vehicle_attitude"),
    ]
    for k, (w, f) in enumerate(zip(rate, force, strict=True)):
        stamp = 7_000_000 + 4000 * k
        said.append(message("D", struct.pack("<HQ6f", 0, stamp, *w, *f)))
        if k % 5 == 0:
            said.append(message("D", struct.pack("<HQ4f", 1, stamp, 1.0, 0.0, 0.0, 0.0)))
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 6_000_000) + b"".join(said)


def blackbox(units=True):
    """A table as blackbox_decode writes it, with a column of text."""
    turn, pull = (" (deg/s)", " (g)") if units else ("", "")
    names = [f"gyroADC[{k}]{turn}" for k in range(3)] + [f"accSmooth[{k}]{pull}" for k in range(3)]
    lines = [", ".join(["loopIteration", "time (us)", *names, "flightModeFlags (flags)"])]
    for k, (w, f) in enumerate(zip(np.degrees(RATE), FORCE / 9.80665, strict=True)):
        cells = [k, 55158008 + 4000 * k, *(f"{v:.9f}" for v in (*w, *f)), "ANGLE_MODE|ARM"]
        lines.append(", ".join(map(str, cells)))
    return "\n".join(lines) + "\n"


def settings(**more):
    return load_import_settings(None, gravity=(0.0, 0.0, -9.81), **({"body": BODY} | more))


@pytest.mark.parametrize("kind", ["ulog", "blackbox"])
def test_a_log_needs_no_word_on_its_channels(tmp_path, kind):
    path = tmp_path / ("a.ulg" if kind == "ulog" else "a.csv")
    path.write_bytes(ulog()) if kind == "ulog" else path.write_text(blackbox())
    ((_, recording),) = import_sources([path], settings())
    motion = recording.motion
    np.testing.assert_allclose(motion.angular_velocity[:, 0], RATE, atol=1e-6)
    np.testing.assert_allclose(motion.specific_force[:, 0], FORCE, rtol=1e-6)
    np.testing.assert_allclose(motion.time - motion.time[0], TIME, atol=1e-9)
    assert "left out" in recording.history


@pytest.mark.parametrize("kind", ["ulog", "blackbox"])
def test_init_writes_settings_for_a_log_that_lack_only_the_body(tmp_path, kind):
    path = tmp_path / ("a.ulg" if kind == "ulog" else "a.csv")
    path.write_bytes(ulog()) if kind == "ulog" else path.write_text(blackbox())
    text = settings_for([path])
    assert {"ulog": "ULog", "blackbox": "Blackbox CSV"}[kind] in text
    told = text.replace("total_mass = nan", "total_mass = 1.0").replace("nan, 0.0", "0.01, 0.0")
    (tmp_path / "a.toml").write_text(told.replace(" nan]]", " 0.01]]").replace("0.0, nan, ", "0.0, 0.01, "))
    assert main(["import", str(path), "-o", str(tmp_path / "a.h5"), "-c", str(tmp_path / "a.toml")]) == 0
    assert main(["inspect", str(tmp_path / "a.h5")]) == 0


def test_a_topic_is_taken_on_a_clock_of_its_own_beside_another(tmp_path):
    (tmp_path / "a.ulg").write_bytes(ulog())
    channels = {
        "angular_velocity": {"imu": [f"sensor_combined/gyro_rad[{k}]" for k in range(3)]},
        "specific_force": {"imu": [f"vehicle_attitude/q[{k}]" for k in range(3)]},
        "units": {"specific_force": "m/s^2"},
    }
    ((_, recording),) = import_sources([tmp_path / "a.ulg"], settings(channels=channels))
    np.testing.assert_allclose(recording.motion.specific_force[::5, 0, 0], 1.0)
    assert np.isnan(recording.motion.specific_force[1::5]).all()
    assert np.isfinite(recording.motion.angular_velocity).all()


def test_counts_without_a_unit_and_damaged_logs_are_refused_in_one_line(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(blackbox(units=False))
    assert "states no unit" in refusal(lambda: import_sources([path], settings()))
    units = {"specific_force": "g", "angular_velocity": "deg/s"}
    said = {name: {"imu": columns["imu"]} for name, columns in read_blackbox(path).sensor.items()}
    ((_, told),) = import_sources([path], settings(channels=said | {"units": units}))
    np.testing.assert_allclose(told.motion.specific_force[:, 0], FORCE, rtol=1e-6)
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog()[:12])
    with pytest.raises(DataError, match="is not a whole ULog file") as error:
        read_ulog(path)
    assert "\n" not in str(error.value)


def test_analog_channels_of_a_c3d_file_are_sensors_beside_its_markers(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    made, frames = ezc3d.c3d(), 40
    points = np.ones((4, 4, frames))
    points[:3] = 1000 * np.random.default_rng(0).uniform(-1, 1, (3, 4, frames))
    made["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    made["parameters"]["POINT"]["LABELS"]["value"] = list("abcd")
    made["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    made["parameters"]["ANALOG"]["RATE"]["value"] = [250.0]
    made["parameters"]["ANALOG"]["LABELS"]["value"] = ["acc x", "acc y", "acc z", "trigger"]
    made["parameters"]["ANALOG"]["UNITS"]["value"] = ["g", "g", "g", "V"]
    made["data"]["points"] = points
    made["data"]["analogs"] = np.vstack([FORCE.T / 9.80665, np.zeros(200)])[None]
    made.write(str(tmp_path / "a.c3d"))
    body = {"mass": dict.fromkeys("abcd", 1.0), "sensor_position": {"imu": [0.0, 0.0, 0.0]}}
    channels = {"specific_force": {"imu": ["acc x", "acc y", "acc z"]}}
    ((_, recording),) = import_sources([tmp_path / "a.c3d"], settings(body=body, channels=channels))
    motion = recording.motion
    np.testing.assert_allclose(motion.specific_force[:, 0], FORCE, rtol=1e-6)
    np.testing.assert_allclose(motion.position[::5], 1e-3 * points[:3].transpose(2, 1, 0), rtol=1e-6)
    assert np.isnan(motion.position[1::5]).all()
    assert "left out analog channels trigger" in recording.history
