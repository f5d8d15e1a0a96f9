import sys
import tomllib

import numpy as np
import pytest
from laboratory import (
    POSITION,
    SHAPE,
    SPECIFIC_FORCE,
    TIME,
    brought,
    nodes,
    refusal,
    response,
    units,
    write_uff,
)

from forceid.errors import ConfigError, DataError
from forceid.files.formats.sources import settings_for
from forceid.files.formats.uff import read_uff

MASS = {"mass": dict.fromkeys("1234", 0.02)}
WHOLE = {"total_mass": 1.0, "inertia": np.eye(3).tolist()}
PATTERN = {"displacement": "displacement.{name}{axis}"}


def displacements(unit="mm", **more):
    return [
        response(n + 1, d + 1, 1000 * POSITION[:, n, d], 8, unit, **more) for n in range(4) for d in range(3)
    ]


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("kind", [15, 2411])
def test_displacements_of_nodes_become_marker_tracks(tmp_path, binary, kind):
    path = write_uff(tmp_path / "a.uff", [units(1.0), nodes(kind), *displacements(binary=binary)])
    recording = brought(path, PATTERN, body=MASS)
    assert recording.body.node == ("1", "2", "3", "4")
    assert np.allclose(recording.body.position, SHAPE, atol=1e-5)  # dataset 15 keeps six digits
    assert np.allclose(recording.motion.position, SHAPE + POSITION, atol=1e-5)
    assert np.allclose(recording.motion.time, TIME, atol=1e-7)


def test_units_without_a_label_are_those_of_the_units_dataset(tmp_path):
    inches = units(39.37007874015748)  # file units in a meter
    path = write_uff(tmp_path / "a.unv", [inches, nodes(), *displacements("NONE")])
    motion = brought(path, PATTERN, body=MASS).motion
    assert np.allclose(motion.position, 0.0254 * (SHAPE + 1000 * POSITION), rtol=1e-9)


def test_accelerations_become_sensors_with_their_sign_place_and_standard_gravity(tmp_path):
    sets = [response(2, (-1) ** d * (d + 1), SPECIFIC_FORCE[:, d], 12, "g") for d in range(3)]
    path = write_uff(tmp_path / "a.uff", [units(1.0), nodes(), *sets])
    recording = brought(path, {"specific_force": "acceleration.{name}{axis}"}, body=WHOLE)
    assert np.allclose(
        recording.motion.specific_force[:, 0], 9.80665 * SPECIFIC_FORCE * [1, -1, 1], rtol=1e-9
    )
    assert np.allclose(recording.body.sensor_position, SHAPE[1:2], rtol=1e-15)


def test_positions_and_accelerations_of_one_node_do_not_clash(tmp_path):
    more = [response(1, d + 1, SPECIFIC_FORCE[:, d], 12, "m/s^2") for d in range(3)]
    path = write_uff(tmp_path / "a.uff", [units(1.0), nodes(), *displacements(), *more])
    table = PATTERN | {"specific_force": "acceleration.{name}{axis}"}
    motion = brought(path, table, body=MASS).motion
    assert motion.position.shape == (40, 4, 3)
    assert np.allclose(motion.specific_force[:, 0], SPECIFIC_FORCE, rtol=1e-9)


def test_init_tells_displacements_from_accelerations_and_leaves_out_what_the_file_knows(tmp_path):
    more = [response(n, d + 1, SPECIFIC_FORCE[:, d], 12, "m/s^2") for n in (1, 2) for d in range(3)]
    path = write_uff(tmp_path / "a.uff", [units(1.0), nodes(), *displacements(), *more])
    text = settings_for([path])
    proposed = tomllib.loads(text.replace("nan", "0.02"))["import"]
    assert proposed["channels"] == PATTERN | {"specific_force": "acceleration.{name}{axis}"}
    assert proposed["body"] == MASS  # places of nodes and sensors are those of the file
    assert brought(path, **{k: proposed[k] for k in ("channels", "body")}).motion.position.shape == (40, 4, 3)


def spectra():
    return [response(1, 1, np.ones(4), 12, "g", func_type=4)]


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (
            lambda: [nodes(), *displacements("NONE")],
            r"displacement\.1X states no unit.*'m'; say which: import\.channels\.units\.displacement",
        ),
        (lambda: [nodes(), *displacements()], r"has no place of node '1' in m.*units\.geometry"),
        (lambda: [units(1.0), *displacements()], r"has no place of node '1' in m.*\[import\.body\] position"),
        (
            lambda: [units(1.0), nodes(), *displacements("kg")],
            "displacement.1X has units 'kg', expected 'm'; correct it, or say",
        ),
        (
            lambda: [units(1.0), nodes(), *displacements()[:-1]],
            "has no axis z of '4', found displacement.4X, displacement.4Y",
        ),
        (lambda: [*displacements(), displacements()[3]], "holds 'displacement.2X' twice"),
        (
            lambda: [units(1.0), nodes(), *displacements()[:-1], response(4, 3, np.ones(30), 8, "m")],
            "displacement.4Z has 30 samples, expected 40 as 'displacement.1X' has",
        ),
        (
            lambda: [
                units(1.0),
                nodes(),
                *displacements()[:-1],
                response(4, 3, np.ones(40), 8, "m", x=np.arange(40) / 100),
            ],
            "displacement.4Z has another clock than 'displacement.1X'",
        ),
        (lambda: [units(1.0), nodes()], r"holds no function \(dataset 58\)"),
        (spectra, r"holds no time response \(function type 1\), found 1 functions of type \[4\]"),
        (
            lambda: [units(1.0), nodes(), response(1, 1, np.ones(40), 12, "g")],
            r"has no time response like 'displacement.*did you mean 'acceleration\.1X'",
        ),
    ],
)
def test_datasets_that_do_not_fit_are_refused_in_one_line(tmp_path, sets, message):
    path = write_uff(tmp_path / "a.uff", sets())
    with pytest.raises(DataError, match=message) as error:
        brought(path, PATTERN, body=MASS)
    assert "\n" not in str(error.value)


def test_a_unit_that_is_missing_can_be_stated(tmp_path):
    path = write_uff(tmp_path / "a.uff", [nodes(), *displacements("NONE")])
    table = PATTERN | {"units": {"displacement": "mm", "geometry": "m"}}
    assert np.allclose(brought(path, table, body=MASS).motion.position, SHAPE + POSITION, rtol=1e-9)


@pytest.mark.parametrize("binary", [0, 1])
def test_a_universal_file_that_is_damaged_never_ends_in_another_error(tmp_path, binary):
    whole = write_uff(
        tmp_path / "whole.uff", [units(1.0), nodes(), *displacements(binary=binary)]
    ).read_bytes()
    rng = np.random.default_rng(0)
    path = tmp_path / "a.uff"
    refused = 0
    for k in range(40):
        data = bytearray(whole)
        if k % 2:
            del data[int(rng.integers(1, len(data))) :]
        else:
            data[int(rng.integers(3000))] = int(rng.integers(256))
        path.write_bytes(data)
        said = refusal(lambda: brought(path, PATTERN, body=MASS))
        refused += said != ""
        assert "\n" not in said
    assert refused >= 20
    path.write_text("t,x\n1,2\n")
    with pytest.raises(DataError, match=r"a\.uff does not end in a line -1"):
        read_uff(path)
    with pytest.raises(DataError, match=r"no such file.*give the path of a UFF file"):
        read_uff(tmp_path / "no.uff")


def test_uff_without_pyuff_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(
        ConfigError, match=r"needs the package pyuff; install it: pip install 'forceid\[uff\]'"
    ):
        read_uff(tmp_path / "a.uff")
