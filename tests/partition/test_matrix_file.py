"""Matrices of another program: every format gives the same numbers, and every way to be wrong one line."""

import gzip

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid.errors import DataError
from forceid.partition.matrix_file import read_matrix

HEAD = "%%MatrixMarket matrix"
BLOCKS = ("csr", "csc", "coo", "bsr", "dia")


def stiffness(n=12, seed=1):
    A = sp.random_array((n, n), density=0.3, rng=np.random.default_rng(seed))
    return sp.csr_array(A + A.T + sp.eye_array(n))


def put_group(file, K, where="K", **attrs):
    group = file.create_group(where)
    for name in ("data", "indices", "indptr"):
        group[name] = getattr(K, name)
    group.attrs.update({"shape": K.shape} | attrs)
    return group


@pytest.fixture
def written(tmp_path):
    """The same matrix in every form, by how its source is named."""
    K = stiffness()
    scipy.io.mmwrite(tmp_path / "sparse.mtx", K)
    scipy.io.mmwrite(tmp_path / "general.mtx", K, symmetry="general")
    scipy.io.mmwrite(tmp_path / "dense.mtx", K.toarray())
    (tmp_path / "zipped.MTX.gz").write_bytes(gzip.compress((tmp_path / "sparse.mtx").read_bytes()))
    for name in BLOCKS:
        sp.save_npz(tmp_path / f"{name}.npz", K.asformat(name))
    np.save(tmp_path / "dense.npy", K.toarray())
    with h5py.File(tmp_path / "body.h5", "w") as f:
        f["body/stiffness"] = K.toarray()
        put_group(f, K)
        put_group(f, K.tocsc(), "deep/er/columns", **{"encoding-type": "csc_matrix"})
        group = put_group(f, K, "shape_inside")
        del group.attrs["shape"]
        group["shape"] = K.shape
    return K, tmp_path


@pytest.mark.parametrize(
    "name",
    [
        *("sparse.mtx", "general.mtx", "dense.mtx", "zipped.MTX.gz", "dense.npy"),
        *(f"{name}.npz" for name in BLOCKS),
        *(f"body.h5:/{at}" for at in ("body/stiffness", "K", "deep/er/columns", "shape_inside")),
    ],
)
def test_every_form_is_read_to_the_last_digit_as_sparse_rows(written, name):
    K, folder = written
    found = read_matrix(f"{folder}/{name}")
    assert isinstance(found, sp.csr_array)
    assert found.dtype == np.float64
    assert np.array_equal(found.toarray(), K.toarray())


def test_a_path_serves_as_well_as_its_name(written):
    K, folder = written
    assert np.array_equal(read_matrix(folder / "sparse.mtx").toarray(), K.toarray())
    assert np.array_equal(read_matrix(folder / "body.h5:" / "K").toarray(), K.toarray())


@settings(deadline=None, derandomize=True, max_examples=40)
@given(st.integers(1, 6), st.integers(0, 10**6), st.sampled_from(["general", "symmetric", "skew-symmetric"]))
def test_market_files_say_what_scipy_reads_in_them(tmp_path_factory, n, seed, symmetry):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) * 10.0 ** rng.integers(-300, 300, (n, n)) * (rng.random((n, n)) < 0.7)
    K = A if symmetry == "general" else np.tril(A) + np.tril(A).T if symmetry == "symmetric" else A - A.T
    path = tmp_path_factory.mktemp("market") / "K.mtx"
    for written in (K, sp.coo_array(K)):
        scipy.io.mmwrite(path, written, symmetry=symmetry)
        by_scipy = scipy.io.mmread(path)
        by_scipy = by_scipy.toarray() if sp.issparse(by_scipy) else by_scipy
        found = read_matrix(path, square=False).toarray()
        assert np.array_equal(found, by_scipy)
        assert np.array_equal(found, K)


def market(tmp_path, text, name="K.mtx"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_entries_that_repeat_are_added_as_element_by_element_writers_mean_them(tmp_path):
    path = market(tmp_path, f"{HEAD} coordinate real general\n2 2 4\n1 1 2.0\n1 1 3.0\n1 2 -1\n2 1 -1\n")
    assert read_matrix(path).toarray().tolist() == [[5.0, -1.0], [-1.0, 0.0]]


@pytest.mark.parametrize("digits", [25, 40])
def test_more_digits_than_a_number_holds_are_read(tmp_path, digits):
    path = market(tmp_path, f"{HEAD} coordinate real general\n1 1 1\n1 1 {'3.' + '1' * digits}")
    assert read_matrix(path)[0, 0] == pytest.approx(28 / 9, rel=1e-15)


def test_comments_and_empty_lines_are_passed_over(tmp_path):
    text = (
        f"{HEAD} coordinate integer symmetric\n% nodes of the wing \xe9\n\n2 2 2\n\n1 1 3\n% one\n2 1 -1\n\n"
    )
    assert read_matrix(market(tmp_path, text)).toarray().tolist() == [[3.0, -1.0], [-1.0, 0.0]]


def test_units_of_a_motion_file_become_newton_per_meter_and_kilogram(tmp_path):
    with h5py.File(tmp_path / "body.h5", "w") as f:
        f["body/stiffness"] = np.eye(2)
        f["body/stiffness"].attrs["units"] = "N/mm"
        f["body/mass_matrix"] = np.eye(2)
        f["body/mass_matrix"].attrs["units"] = "g"
    assert read_matrix(f"{tmp_path}/body.h5:/body/stiffness")[0, 0] == 1000.0
    assert read_matrix(f"{tmp_path}/body.h5:/body/mass_matrix")[0, 0] == 0.001


def test_an_oblong_matrix_is_read_where_no_stiffness_is_asked_for(tmp_path):
    np.save(tmp_path / "L.npy", np.eye(3)[:2])
    assert read_matrix(tmp_path / "L.npy", square=False).shape == (2, 3)
    with pytest.raises(
        DataError, match=r"L.npy has shape \(2, 3\), expected a square matrix; give the stiff"
    ):
        read_matrix(tmp_path / "L.npy")


def test_a_diagonal_matrix_has_no_triangle_alone(tmp_path):
    np.save(tmp_path / "M.npy", np.diag([1.0, 2.0]))
    assert read_matrix(tmp_path / "M.npy").nnz == 2


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("", "begins with '', expected '%%MatrixMarket matrix coordinate real symmetric'"),
        ("1 1 1\n1 1 2.0\n", "begins with '1 1 1', expected"),
        (f"{HEAD} coordinate complex general\n1 1 1\n1 1 2 3\n", "begins with .*complex general"),
        (f"{HEAD} coordinate pattern general\n1 1 1\n1 1\n", "begins with .*pattern general"),
        (f"{HEAD} sparse real general\n1 1 1\n1 1 2.0\n", "begins with .*sparse real general"),
        (f"{HEAD} coordinate real general\n% only comments\n", "has the size line ''"),
        (f"{HEAD} coordinate real general\n-2 2 1\n1 1 2.0\n", "has the size line '-2 2 1'"),
        (f"{HEAD} array real general\n2 x\n", "cannot be read .*'x'"),
        (
            f"{HEAD} coordinate real symmetric\n2 3 1\n1 1 2.0\n",
            "holds 1 entries, expected symmetric ones, 2 3 1",
        ),
        (f"{HEAD} coordinate real symmetric\n2 2 2\n1 2 -1\n2 1 -1\n", "holds both triangles, expected the"),
        (
            f"{HEAD} coordinate real general\n2 2 2\n1 1 2.0\n",
            "holds 1 entries, expected general ones, 2 2 2",
        ),
        (f"{HEAD} coordinate real general\n2 2 2\n", "holds 0 entries, expected general ones, 2 2 2"),
        (
            f"{HEAD} coordinate real general\n2 2 1\n1 1 2.0\n2 2 1\n",
            "holds 2 entries, expected general ones, 2 2 1",
        ),
        (f"{HEAD} coordinate real general\n2 2 1\n1 1 3.9E-", "could not convert string '3.9E-'"),
        (f"{HEAD} coordinate real general\n2 2 1\n1 1 1.0D+03\n", "could not convert string '1.0D.03'"),
        (f"{HEAD} coordinate real general\n2 2 2\n1 1 1.0\n2 2\n", "number of columns changed from 3 to 2"),
        (f"{HEAD} coordinate real general\n2 2 1\n0 1 1.0\n", "cannot be read .negative"),
        (
            f"{HEAD} coordinate real general\n2 2 1\n1 3 1.0\n",
            "cannot be read .*exceeds matrix dimension",
        ),
        (f"{HEAD} coordinate real general\n2 2 1\n1.5 1 1.0\n", "has an entry between two rows or columns"),
        (
            f"{HEAD} coordinate real general\n2 2 1\n1 1 nan\n",
            "1 numbers that are not finite, the first in row 0",
        ),
        (f"{HEAD} coordinate real general\n2 2 2\n1 1 1\n2 2 1e999\n", "not finite, the first in row 1"),
        (
            f"{HEAD} coordinate real general\n2 2 2\n1 1 1\n2 1 3\n",
            "holds the lower triangle alone, expected",
        ),
        (
            f"{HEAD} coordinate real general\n9 9 99999999\n1 1 1\n",
            "holds 1 entries, expected general ones, 9 9 99999999",
        ),
        (
            f"{HEAD} coordinate real general\n99999999 99999999 1\n1 1 1\n",
            r"shape \(99999999, 99999999\) for 1",
        ),
        (
            f"{HEAD} array real general\n999999 999999\n1\n",
            "holds 1 entries, expected general ones, 999999 999999",
        ),
    ],
)
def test_a_market_file_that_is_no_matrix_is_told_in_one_line(tmp_path, body, told):
    path = market(tmp_path, body)
    with pytest.raises(DataError, match=told) as caught:
        read_matrix(path)
    line = str(caught.value)
    assert line.startswith(f"{path} ")
    assert "\n" not in line
    assert caught.value.next_step


def test_a_zipped_file_cut_short_is_told(written):
    _, folder = written
    whole = (folder / "zipped.MTX.gz").read_bytes()
    (folder / "cut.mtx.gz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DataError, match=r"cut.mtx.gz cannot be read .* write or copy it again"):
        read_matrix(folder / "cut.mtx.gz")


def test_a_skew_matrix_turns_its_sign_across_the_diagonal(tmp_path):
    path = market(tmp_path, f"{HEAD} coordinate real skew-symmetric\n2 2 1\n2 1 5\n")
    assert read_matrix(path, square=False).toarray().tolist() == [[0.0, -5.0], [5.0, 0.0]]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("none.mtx", r"none.mtx cannot be read \(no such file\); give the path of a matrix: .mtx"),
        ("none.h5:/body/stiffness", r"none.h5 cannot be read \(no such file\)"),
        ("", r"cannot be read \(not a file\)"),
        ("body.h5", "body.h5 is HDF5, expected the place of a matrix in it; give .*body.h5:/body/stiffness"),
        ("K.txt", "K.txt ends in '.txt', expected .mtx, .mtx.gz, .npz, .npy, or file.h5:/group/name"),
        ("K.txt:/body", "K.txt is not an HDF5 file"),
        (
            "body.h5:/body/stifness",
            "body.h5:/body/stifness is missing, expected a matrix; did you mean 'stiff",
        ),
        ("body.h5:/bodies/stiffness", "body.h5:/bodies is missing, .* did you mean 'body'"),
        ("body.h5:/body/stiffness/x", "body.h5:/body/stiffness/x is missing"),
        (
            "body.h5:/body",
            r"body.h5:/body lacks data, expected data, indices, indptr and shape; found \['stiff",
        ),
        ("body.h5:/", "body.h5 is HDF5, expected the place"),
    ],
)
def test_a_source_that_names_no_matrix_is_told_with_what_would(written, name, told):
    _, folder = written
    (folder / "K.txt").write_text("1 2\n")
    with pytest.raises(DataError, match=told):
        read_matrix(f"{folder}/{name}")


@pytest.mark.parametrize(
    ("array", "told"),
    [
        (np.array([[1.0, None]]), "cannot be read .*objects"),
        (np.array([["a", "b"]]), "holds text, expected real numbers"),
        (np.eye(2) * 1j, "holds complex numbers, expected real numbers"),
        (np.eye(2, dtype=bool), "holds booleans, expected real numbers"),
        (np.ones(3), r"has shape \(3,\), expected rows and columns"),
        (np.ones((2, 2, 2)), r"has shape \(2, 2, 2\), expected rows and columns"),
        (np.zeros((0, 0)), "cannot be read|expected rows and columns"),
        (np.array([[np.nan, 1.0], [1.0, np.inf]]), "holds 2 numbers that are not finite, the first in row 0"),
    ],
)
def test_an_array_that_is_no_matrix_is_told(tmp_path, array, told):
    np.save(tmp_path / "K.npy", array, allow_pickle=True)
    with pytest.raises(DataError, match=told) as caught:
        read_matrix(tmp_path / "K.npy")
    assert "\n" not in str(caught.value)


def test_an_array_whose_shape_is_beyond_its_file_is_told_without_memory(tmp_path):
    np.save(tmp_path / "K.npy", np.eye(4))
    whole = (tmp_path / "K.npy").read_bytes()
    (tmp_path / "K.npy").write_bytes(whole.replace(b"(4, 4), ", b"(9e5, 9)"))
    with pytest.raises(DataError, match=r"K.npy cannot be read"):
        read_matrix(tmp_path / "K.npy")
    (tmp_path / "K.npy").write_bytes(whole.replace(b"(4, 4), }      ", b"(999999, 9999)}"))
    with pytest.raises(DataError, match=r"K.npy cannot be read \(mmap length is greater than file size\)"):
        read_matrix(tmp_path / "K.npy")


RIGHT = {
    "format": b"csr",
    "shape": [2, 2],
    "data": [1.0, 2.0],
    "indices": np.array([0, 1], np.int32),
    "indptr": np.array([0, 1, 2], np.int32),
}


@pytest.mark.parametrize(
    ("replaced", "told"),
    [
        ({"indices": np.array([0, 7], np.int32)}, "cannot be read .*indices must be < 2"),
        ({"indices": np.array([0, -9], np.int32)}, "cannot be read"),
        ({"indptr": np.array([0, 9, 2], np.int32)}, "cannot be read"),
        ({"shape": [10**12, 2]}, "cannot be read"),
        ({"shape": [3, 3]}, "cannot be read"),
        ({"shape": [2, 2, 2]}, "cannot be read|expected rows and columns"),
        ({"data": [1.0, np.nan]}, "1 numbers that are not finite, the first in row 1"),
        ({"data": np.array([1, None])}, "cannot be read .Object arrays"),
        ({"data": [1.0 + 1j, 2.0]}, "holds complex numbers, expected real numbers"),
        ({"format": b"abc"}, "cannot be read"),
        ({"format": None}, "cannot be read .*does not contain a sparse"),
        ({"format": b"dia", "offsets": [0], "data": [[1.0, 2.0]], "shape": [10**9, 10**9]}, "declares shape"),
    ],
)
def test_a_sparse_file_that_is_no_matrix_is_told_before_its_indices_are_trusted(tmp_path, replaced, told):
    np.savez(tmp_path / "right.npz", **RIGHT)
    assert read_matrix(tmp_path / "right.npz").toarray().tolist() == [[1.0, 0.0], [0.0, 2.0]]
    np.savez(tmp_path / "K.npz", **{k: v for k, v in (RIGHT | replaced).items() if v is not None})
    with pytest.raises(DataError, match=told) as caught:
        read_matrix(tmp_path / "K.npz")
    assert "\n" not in str(caught.value)


def test_a_shape_that_its_entries_could_never_fill_is_not_given_memory(tmp_path):
    sp.save_npz(tmp_path / "K.npz", sp.coo_array(([1.0], ([0], [0])), shape=(10**8, 10**8)))
    with pytest.raises(DataError, match=r"declares shape \(100000000, 100000000\) for 1 entries"):
        read_matrix(tmp_path / "K.npz")


@pytest.mark.parametrize("name", ["csr.npz", "dense.npy", "sparse.mtx"])
def test_what_does_not_fit_in_memory_is_told_before_it_is_used(written, monkeypatch, name):
    _, folder = written
    monkeypatch.setattr("forceid.partition.matrix_file.memory_limit", lambda: 200)
    with pytest.raises(DataError, match=r"declares|holds .* GB, expected less here"):
        read_matrix(folder / name)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("shape", None, "K lacks shape, expected data, indices, indptr and shape"),
        ("shape", [13, 12], r"makes no matrix of shape \[13, 12\]: index pointer"),
        ("shape", [12, 11], r"makes no matrix of shape \[12, 11\]: .*indices"),
        ("shape", [12.5, 12], r"makes no matrix of shape \[12.5, 12.0\]"),
        ("shape", [-12, -12], r"makes no matrix of shape \[-12, -12\]|declares shape"),
        ("shape", [12], r"makes no matrix of shape \[12\]"),
        ("shape", [10**15, 12], "declares shape .* expected a shape that they fill"),
    ],
)
def test_a_group_whose_shape_does_not_agree_is_told(written, name, value, told):
    _, folder = written
    with h5py.File(folder / "body.h5", "a") as f:
        del f["K"].attrs[name]
        if value is not None:
            f["K"].attrs[name] = value
    with pytest.raises(DataError, match=told):
        read_matrix(f"{folder}/body.h5:/K")


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("indptr", None, "K lacks indptr, expected data, indices, indptr and shape"),
        ("indices", np.ones(3), "makes no matrix|cannot be read"),
        ("indptr", np.eye(2, dtype=int), "makes no matrix|cannot be read"),
        ("indices", np.ones(3, int), r"makes no matrix .* indices and data should have the same size"),
        ("indices", np.dtype(int), "K/indices is a group or a type, expected a variable"),
        ("data", np.array([b"a", b"b"]), "holds text|makes no matrix"),
        ("data", np.ones((2, 2)), r"has shape|makes no matrix"),
    ],
)
def test_a_group_that_is_no_matrix_is_told_by_variable(written, name, value, told):
    _, folder = written
    with h5py.File(folder / "body.h5", "a") as f:
        del f["K"][name]
        if value is not None:
            f["K"][name] = value
    with pytest.raises(DataError, match=told):
        read_matrix(f"{folder}/body.h5:/K")


def odd_variables(f):
    f["text"] = np.array([[b"a", b"b"]])
    f["complex"] = np.eye(2) * 1j
    f["line"] = np.ones(3)
    f["none"] = np.zeros((0, 0))
    f["type"] = np.dtype(float)
    f["nan"] = np.array([[1.0, np.nan], [np.nan, 1.0]])
    f["link"] = h5py.ExternalLink("other.h5", "/K")
    f["loop"] = h5py.SoftLink("/loop")
    f.create_dataset("empty", shape=(10**6, 10**6), dtype=float, chunks=(100, 100))


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("text", "/text holds text, expected real numbers"),
        ("complex", "/complex holds complex numbers, expected real numbers"),
        ("line", r"/line has shape \(3,\), expected \(row = 3"),
        ("none", r"/none has shape \(0, 0\), expected rows and columns"),
        ("type", "/type is a group or a type, expected a variable"),
        ("nan", "/nan holds 2 numbers that are not finite, the first in row 0"),
        ("link", "/link is a link to another file"),
        ("loop", "is damaged|/loop is missing"),
        ("empty", "/empty declares 8000000000000 bytes but stores 0"),
    ],
)
def test_a_variable_that_is_no_matrix_is_told(tmp_path, name, told):
    with h5py.File(tmp_path / "odd.h5", "w") as f:
        odd_variables(f)
    with pytest.raises(DataError, match=told):
        read_matrix(f"{tmp_path}/odd.h5:/{name}")


@pytest.mark.parametrize(
    "name", ["sparse.mtx", "zipped.MTX.gz", "csr.npz", "dia.npz", "dense.npy", "body.h5:/K"]
)
def test_a_file_with_any_bytes_changed_or_cut_is_a_matrix_or_one_line(written, name):
    _, folder = written
    file, _, inside = name.partition(":")
    whole, rng, told, refused = (folder / file).read_bytes(), np.random.default_rng(7), 0, 0
    for k in range(60):
        odd = bytearray(whole[: rng.integers(len(whole))] if k % 3 == 0 else whole)
        for place in rng.integers(max(len(odd), 1), size=3 if odd else 0):
            odd[place] = rng.integers(256)
        bad = folder / f"bad{file[file.index('.') :]}"
        bad.write_bytes(bytes(odd))
        try:
            found = read_matrix(f"{bad}:{inside}" if inside else bad)
            assert found.shape[0] == found.shape[1]
        except DataError as e:
            told += "\n" not in str(e)
            refused += 1
    assert told == refused >= 20
