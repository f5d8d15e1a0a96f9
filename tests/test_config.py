import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid.config import LoadSetting, Settings, load_settings
from forceid.errors import ConfigError
from forceid.import_settings import ImportSettings, load_import_settings
from forceid.laws import law_setting
from forceid.sections import key_paths, read_toml, to_toml, validate

CONFIG = Path(__file__).parents[1] / "config"


def test_the_default_configuration_holds_every_key_at_its_default():
    assert load_settings(CONFIG / "default.toml") == Settings()
    text = (CONFIG / "default.toml").read_text()
    for key in (path.rpartition(".")[2] for path in key_paths(Settings)):
        heads = (line.lstrip("# ") for line in text.splitlines())
        assert any(
            h.startswith((f"{key} =", f"[{key}]")) or re.match(rf"\[\w+\.{key}\]", h) for h in heads
        ), key


@pytest.mark.parametrize("name", sorted(path.name for path in CONFIG.glob("*.toml")))
def test_every_configuration_serves_estimate_and_those_of_sources_import(name):
    assert load_settings(CONFIG / name).method in ("difference", "savgol", "spline", "filter", "smoother")
    if "[import]" in (CONFIG / name).read_text():
        assert load_import_settings(CONFIG / name).title


def test_the_jump_squat_table_names_the_whole_body():
    table = load_import_settings(CONFIG / "jump_squat.toml")
    assert sum(segment.mass_fraction for segment in table.segment) == pytest.approx(1.0, abs=1e-12)
    assert table.gravity == (0.0, -9.81, 0.0)
    assert table.noise_std == {"position": 0.001}


numbers = st.floats(-1e6, 1e6)
vectors = st.tuples(numbers, numbers, numbers)


@settings(deadline=None, derandomize=True)
@given(
    st.builds(
        Settings,
        method=st.sampled_from(["savgol", "smoother"]),
        gravity=st.none() | vectors,
        moment_about=vectors | st.text(),
        modes=st.none() | st.integers(0, 9),
        noise_std=st.dictionaries(st.text(), numbers),
        load=st.lists(
            st.builds(LoadSetting, name=st.text(), direction=vectors, point=vectors | st.text())
        ).map(tuple),
    )
)
def test_settings_come_back_from_their_toml(tmp_path_factory, record):
    path = tmp_path_factory.mktemp("toml") / "a.toml"
    path.write_text(to_toml(record), encoding="utf-8")
    assert load_settings(path) == record


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('metod = "savgol"', r"unknown key 'metod'; did you mean 'method'\?"),
        (
            '[[load]]\nname = "a"\ndirecton = [1, 0, 0]',
            r"unknown key 'load\.0\.directon'; did you mean 'direction'",
        ),
        ('method = "magic"', "key 'method': .*'smoother', found 'magic'"),
        ("gravity = [0, 1]", r"key 'gravity\.2': Field required"),
        ("gravity = [0, 0, nan]", r"key 'gravity\.2': .*finite number, found nan"),
        ("modes = -1", "key 'modes': .*greater than or equal to 0, found -1"),
        ("method = ", "is not valid TOML"),
    ],
)
def test_a_wrong_configuration_is_one_line_that_names_file_and_key(tmp_path, text, message):
    path = tmp_path / "a.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message) as error:
        load_settings(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)
    assert error.value.exit_code == 2


def test_a_misspelled_required_key_is_named_before_the_one_it_hides():
    with pytest.raises(ConfigError, match="unknown key 'nam'; did you mean 'name'"):
        validate(LoadSetting, {"nam": "a", "direction": (1, 0, 0)}, "a.toml")


@pytest.mark.parametrize(
    ("table", "key", "meant"),
    [
        ({"plate": {"plate": ["1"]}}, "plate", "plates"),
        ({"plates": {"plates": ["1"]}}, "plates.plates", "plate"),
        ({"inertia": [1, 2, 3]}, "inertia", "body.inertia"),
        ({"body": {"total_mas": 1.0}}, "body.total_mas", "total_mass"),
        ({"segment": [{"clearance": 1.0}]}, "segment.0.clearance", "until.clearance"),
    ],
)
def test_the_key_that_is_meant_is_one_that_may_stand_there_or_comes_with_its_table(table, key, meant):
    with pytest.raises(ConfigError) as error:
        validate(ImportSettings, {"gravity": (0, 0, -9.81), **table}, "a.toml: [import]")
    assert str(error.value) == f"a.toml: [import] unknown key '{key}'; did you mean '{meant}'?"


def test_a_configuration_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"no\.toml cannot be read"):
        load_settings(tmp_path / "no.toml")


def test_one_file_serves_import_estimate_and_coefficients(tmp_path):
    text = 'model = "rigid"\n[import]\ntitle = "a"\n[law]\ndrag = ["1"]\n[aero]\narea = 0.1\n'
    (tmp_path / "a.toml").write_text(text)
    assert load_settings(tmp_path / "a.toml").aero.area == 0.1
    assert law_setting(read_toml(tmp_path / "a.toml"), "a.toml").law == {"drag": ("1",)}


def test_overrides_that_are_none_leave_the_file_alone(tmp_path):
    (tmp_path / "a.toml").write_text('method = "spline"\nmodel = "rigid"\n[import]\nanything = 1\n')
    record = load_settings(tmp_path / "a.toml", method=None, model="affine")
    assert (record.method, record.model) == ("spline", "affine")
