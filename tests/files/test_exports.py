"""What is exported reads back in the library of its format, to the last digits."""

import io

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from forceid.cli.app import main
from forceid.config import AeroSetting, load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.run import estimate_recording
from forceid.files import FORMATS, export, write_motion, write_result
from forceid.scenes import load_recipe, simulate

EXACT = 1e-9


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """An estimate with air, and its file."""
    folder = tmp_path_factory.mktemp("told")
    recipe = folder / "toss.toml"
    recipe.write_text('scene = "frisbee"\nduration = 0.2\nsample_rate = 200.0\nnoise_std = 3e-4\nseed = 4\n')
    recording = simulate(load_recipe(recipe))
    settings = load_settings(method="savgol").model_copy(update={"aero": AeroSetting(area=0.05, axes="disc")})
    estimate = estimate_recording(recording, settings)
    write_result(folder / "toss.result.h5", estimate, recording)
    return estimate, folder / "toss.result.h5"


def same(found, want):
    """Alike to 1e-9 of the largest."""
    return np.allclose(found, want, rtol=EXACT, atol=EXACT * np.nanmax(np.abs(want)), equal_nan=True)


def judged(table, estimate):
    assert same(table["time"], estimate.time)
    for axis, k in zip("xyz", range(3), strict=True):
        assert same(table[f"force_{axis}"], estimate.force[:, k])
        assert same(table[f"moment_std_{axis}"], estimate.moment_std[:, k])
    assert same(table["cov_force_y_moment_z"], estimate.wrench_cov[:, 1, 5])
    assert same(table["aero_CL"], estimate.aero["CL"])
    assert same(table["deformation_rim_2_y"], estimate.deformation[:, 1, 1])


def test_csv_and_storage_read_back_in_pandas(told, tmp_path):
    estimate, _ = told
    export(tmp_path / "a.csv", estimate, "csv")
    judged(pd.read_csv(tmp_path / "a.csv"), estimate)
    export(tmp_path / "a.sto", estimate, "sto")
    head, _, rest = (tmp_path / "a.sto").read_text().partition("endheader\n")
    table = pd.read_csv(io.StringIO(rest), sep="\t")
    assert f"nRows={len(table)}" in head
    assert f"nColumns={len(table.columns)}" in head
    judged(table, estimate)


def test_an_external_load_has_force_point_and_torque(told, tmp_path):
    estimate, _ = told
    export(tmp_path / "a.mot", estimate, "mot")
    table = pd.read_csv(tmp_path / "a.mot", sep="\t", skiprows=6)
    assert same(table[["force_vx", "force_vy", "force_vz"]], estimate.force)
    assert same(table[["force_px", "force_py", "force_pz"]], estimate.center)
    assert same(table[["torque_x", "torque_y", "torque_z"]], estimate.moment)


def test_an_external_load_about_another_point_is_refused(told, tmp_path):
    from dataclasses import replace

    with pytest.raises(ConfigError, match="expected the mass center"):
        export(tmp_path / "a.mot", replace(told[0], moment_about="rim_1"), "mot")


def test_mat_reads_back_in_scipy_with_the_groups_of_the_result(told, tmp_path):
    estimate, _ = told
    export(tmp_path / "a.mat", estimate, "mat")
    found = loadmat(tmp_path / "a.mat", simplify_cells=True)
    assert same(found["estimate"]["force"], estimate.force)
    assert same(found["estimate"]["wrench_cov"], estimate.wrench_cov)
    assert same(found["aero"]["CD"], estimate.aero["CD"])
    assert found["estimate"]["verdict"] == estimate.verdict.level
    assert list(found["estimate"]["node"]) == list(estimate.node)


def test_parquet_reads_back_with_units(told, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    estimate, _ = told
    export(tmp_path / "a.parquet", estimate, "parquet")
    judged(parquet.read_table(tmp_path / "a.parquet").to_pandas(), estimate)
    schema = parquet.read_schema(tmp_path / "a.parquet")
    assert schema.field("moment_x").metadata[b"unit"] == b"N m"


def test_c3d_reads_back_as_number_and_rest(told, tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    estimate, _ = told
    export(tmp_path / "a.c3d", estimate, "c3d")
    found = ezc3d.c3d(str(tmp_path / "a.c3d"))
    labels = found["parameters"]["ANALOG"]["LABELS"]["value"]
    read = dict(zip(labels, found["data"]["analogs"][0], strict=True))
    for k, axis in enumerate("xyz"):
        assert same(read[f"force_{axis}"] + read[f"force_{axis}.rest"], estimate.force[:, k])
        assert np.allclose(read[f"moment_{axis}"], estimate.moment[:, k], rtol=1e-6)
    points = dict(
        zip(
            found["parameters"]["POINT"]["LABELS"]["value"],
            found["data"]["points"].swapaxes(0, 1),
            strict=True,
        )
    )
    assert same((points["center"] + points["center.rest"])[:3].T, estimate.center)
    assert found["parameters"]["POINT"]["RATE"]["value"][0] == pytest.approx(200.0)


def test_c3d_takes_even_times_alone(told, tmp_path):
    pytest.importorskip("ezc3d")
    from dataclasses import replace

    uneven = replace(told[0], time=told[0].time ** 1.1)
    with pytest.raises(DataError, match="expected even ones"):
        export(tmp_path / "a.c3d", uneven, "c3d")


def test_the_command_names_formats_and_loses_no_file(told, tmp_path, capsys):
    _, path = told
    out = tmp_path / "toss.csv"
    assert main(["export", str(path), "-o", str(out)]) == 0
    before = out.read_bytes()
    assert main(["export", str(path), "-o", str(out)]) == 2
    assert out.read_bytes() == before
    assert main(["export", str(path), "-o", str(out), "--force"]) == 0
    assert main(["export", str(path), "-f", "xls"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert "already" in said[0]
    assert all(name in said[1] for name in FORMATS)
    assert main(["export", str(tmp_path / "none.h5"), "-f", "csv"]) == 3


def test_only_results_are_exported(told, tmp_path):
    recipe = tmp_path / "p.toml"
    recipe.write_text('scene = "particle"\nduration = 0.1\nsample_rate = 100.0\nnoise_std = 1e-4\nseed = 1\n')
    write_motion(tmp_path / "p.h5", simulate(load_recipe(recipe)))
    assert main(["export", str(tmp_path / "p.h5"), "-f", "csv"]) == 3
