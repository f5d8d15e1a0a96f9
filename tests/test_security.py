"""What a hostile file could try: to run code, reach other files, swell, write into a page or a terminal."""

import ast
import gzip
import io
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from evidence.attack.bodies import write
from forceid.cli.app import main
from forceid.errors import DataError
from forceid.files import read_motion
from forceid.files.formats import mat
from forceid.partition import matrix_file, read_matrix

ROOT = Path(__file__).parents[1]
RUNS = {"eval", "exec", "compile", "__import__"}
LOADS = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
NAME = "<img src=x onerror=alert(1)><script>alert(2)</script>\"'`${7*7}{{7*7}}"
MB = 1 << 20


def calls():
    """Every call and import in the package, with its file."""
    for path in sorted((ROOT / "forceid").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            yield path.name, node


def test_no_text_is_run_and_no_pickle_is_read():
    for where, node in calls():
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in RUNS, f"{where}: {node.func.id}"
        if isinstance(node, ast.Import | ast.ImportFrom):
            named = [a.name for a in node.names] + [getattr(node, "module", None) or ""]
            assert not LOADS & {name.partition(".")[0] for name in named}, where


def test_no_shell_is_started_and_numpy_loads_no_object():
    for where, node in calls():
        if not isinstance(node, ast.Call):
            continue
        said = ast.unparse(node)
        assert "shell=True" not in said, where
        assert not said.startswith(("os.system(", "os.popen(")), where
        if said.startswith("np.load("):
            assert "allow_pickle=False" in said, where


def test_a_matrix_that_holds_a_pickle_is_refused_unread(tmp_path):
    class Trap:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "ran",))

    np.save(tmp_path / "a.npy", np.array([Trap()], object), allow_pickle=True)
    with pytest.raises(DataError, match=r"a\.npy"):
        read_matrix(tmp_path / "a.npy")
    assert not (tmp_path / "ran").exists()


def test_storage_and_links_outside_of_the_file_are_refused(tmp_path):
    secret = tmp_path / "secret"
    secret.write_bytes(np.arange(180.0).tobytes())
    for k, kind in enumerate(("raw", "link")):
        path = write(tmp_path / f"{kind}.h5", "markers")
        with h5py.File(path, "r+") as f:
            shape = f["motion/position"].shape
            del f["motion/position"]
            if k:
                f["motion/position"] = h5py.ExternalLink(str(secret), "/position")
            else:
                f["motion"].create_dataset("position", shape, "f8", external=[(str(secret), 0, 10**6)])
        with pytest.raises(DataError, match="position"):
            read_motion(path)


@pytest.mark.long
@pytest.mark.parametrize("hidden", ["title", "node"])
def test_no_name_in_a_file_becomes_markup_of_a_page(hidden, tmp_path):
    def named(file):
        if hidden == "title":
            file.attrs["title"] = NAME
        else:
            for group in ("body", "motion"):
                if "node" in file[group]:
                    names = [NAME, *file[f"{group}/node"].asstr()[1:]]
                    del file[f"{group}/node"]
                    file[f"{group}/node"] = names

    path = write(tmp_path / "m.h5", "markers", named)
    result, page = tmp_path / "r.result.h5", tmp_path / "p.html"
    assert main(["estimate", str(path), "-o", str(result), "--method", "difference", "--model", "rigid"]) == 0
    assert main(["report", str(result), "-o", str(page)]) == 0
    text = page.read_text("utf-8")
    assert "<img src=x" not in text
    assert "alert(2)</script>" not in text


def test_a_packed_matrix_swells_to_no_more_than_a_hundred_times_its_size(tmp_path):
    head = b"%%MatrixMarket matrix array real general\n1000000 1\n"
    (tmp_path / "a.mtx.gz").write_bytes(gzip.compress(head + b"\n" * (64 * MB)))
    with pytest.raises(DataError, match=r"a\.mtx\.gz unpacks to more than"):
        read_matrix(tmp_path / "a.mtx.gz")
    numbers = "\n".join(map(str, np.random.default_rng(0).random(9).tolist()))
    text = f"%%MatrixMarket matrix array real general\n3 3\n{numbers}\n"
    (tmp_path / "b.mtx.gz").write_bytes(gzip.compress(text.encode()))
    assert read_matrix(tmp_path / "b.mtx.gz").shape == (3, 3)


def test_a_packed_archive_of_arrays_that_declares_more_than_fits_is_refused(tmp_path, monkeypatch):
    import scipy.sparse as sp

    sp.save_npz(tmp_path / "a.npz", sp.eye(2000, format="csr"))
    assert read_matrix(tmp_path / "a.npz").shape == (2000, 2000)
    monkeypatch.setattr(matrix_file, "memory_limit", lambda: 1000)
    with pytest.raises(DataError, match=r"a\.npz"):
        read_matrix(tmp_path / "a.npz")


def test_a_compressed_part_of_a_mat_file_swells_to_no_more_than_fits(monkeypatch):
    packed = memoryview(zlib.compress(bytes(8 * MB)))
    assert len(mat.inflated(packed, 8 * MB, "a.mat")) == 8 * MB
    monkeypatch.setattr(mat, "memory_limit", lambda: MB)
    with pytest.raises(
        DataError, match=r"a\.mat is damaged: a compressed part unpacks to more than 1\.05 MB"
    ):
        mat.inflated(packed, 8 * MB, "a.mat")
    monkeypatch.undo()
    with pytest.raises(DataError, match="ends before it is whole"):
        mat.inflated(packed[: len(packed) // 2], 8 * MB, "a.mat")


def test_a_name_cannot_steer_the_terminal(tmp_path, capsys):
    path = write(tmp_path / "m\x1b[31m\x07.h5", "markers")
    with h5py.File(path, "r+") as file:
        file["body/mass"][0] = -1.0
    assert main(["inspect", str(path)]) == 3
    said = io.StringIO(capsys.readouterr().err).read()
    assert "\x1b" not in said
    assert "\x07" not in said
