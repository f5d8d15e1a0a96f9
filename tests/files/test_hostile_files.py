"""Files made to harm: each is refused with one line, in little memory, before anything of it is unpacked."""

import resource

import h5py
import numpy as np
import pytest
from recordings import estimate, markers

from forceid.errors import DataError
from forceid.files.result import read_result, write_result
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.files.stored.heap import check_heaps, fingerprint

ROOM = 150_000  # kB that reading one may add to the peak


def bomb(name, shape, **options):
    """Zeros that take no room where compressed."""

    def edit(f):
        del f[name]
        f.create_dataset(name, shape, float, chunks=True, compression="gzip", compression_opts=9, **options)
        f[name].id.write_direct_chunk((0,) * len(shape), b"\0" * 100_000)

    return edit


def one_huge_chunk(f):
    del f["motion/position"]
    made = f.create_dataset(
        "motion/position",
        (20, 4, 3),
        float,
        maxshape=(None, None, None),
        chunks=(20, 4_000_000, 3),
        compression="gzip",
    )
    made.id.write_direct_chunk((0, 0, 0), b"\0" * 4_000_000)


def deep(f):
    node = f["motion"]
    for _ in range(3000):
        node = node.create_group("deeper")


def wide(f):
    for k in range(8_000):
        f["motion"][f"n{k}"] = h5py.SoftLink("/motion/time")
    del f["motion/time"]


def circle(f):
    del f["motion/position"]
    f["motion/position"] = f["motion"]


def dangling(f):
    del f["motion/position"]
    f["motion/position"] = h5py.SoftLink("/nowhere")


def by_two_links(f):
    f["hop"] = h5py.ExternalLink("other.h5", "/motion/position")
    del f["motion/position"]
    f["motion/position"] = h5py.SoftLink("/hop")


def one_text_many_times(f):
    del f["body/node"], f["motion/node"]
    made = f.create_dataset("body/node", (40_000,), h5py.string_dtype())
    made[0] = "x" * 100_000
    raw = made.id.get_offset()
    f.flush()
    with open(f.filename, "rb") as stored:
        stored.seek(raw)
        first = stored.read(16)
    f.attrs["patch"] = np.frombuffer(raw.to_bytes(8, "little") + first, np.uint8)


def objects(f):
    del f["motion/position"]
    f.create_dataset("motion/position", (20, 4, 3), h5py.ref_dtype)


def opaque(f):
    del f["motion/position"]
    f["motion/position"] = np.zeros((20, 4, 3), np.void(b"x" * 16).dtype)


def nested(f):
    del f["motion/position"]
    kind = np.dtype(float)
    for _ in range(60):
        kind = np.dtype([("a", kind)])
    f["motion/position"] = np.zeros((20, 4, 3), kind)


def long_attribute(f):
    f["motion"].attrs.create("remark", np.zeros(300_000))


def many_texts_in_an_attribute(f):
    f["motion"].attrs["remark"] = ["x" * 1000] * 3000


HOSTILE = [
    ("positions", bomb("motion/position", (20_000_000, 4, 3)), "declares .* bytes but stores"),
    ("a chunk", one_huge_chunk, "is stored in chunks of 1.92 GB"),
    ("links", wide, "/motion/time is missing"),
    ("a circle", circle, "/motion/position is a group"),
    ("a dangling link", dangling, "is damaged"),
    ("two links", by_two_links, "is a link to another file"),
    ("references", objects, "declares|text or objects"),
    ("opaque", opaque, "compound records"),
    ("nested", nested, "compound records"),
    ("attribute", long_attribute, "@remark holds 300000 values"),
    ("texts", many_texts_in_an_attribute, "@remark holds 3000 values"),
]


@pytest.mark.parametrize(("edit", "message"), [pytest.param(*c[1:], id=c[0]) for c in HOSTILE])
def test_it_is_refused_with_one_line_in_little_memory(tmp_path, edit, message):
    path = tmp_path / "bad.h5"
    write_motion(tmp_path / "other.h5", markers())
    write_motion(path, markers())
    with h5py.File(path, "r+", libver="latest") as f:
        edit(f)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError, match=message) as error:
        read_motion(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM
    assert "\n" not in str(error.value)


def test_groups_three_thousand_deep_beside_the_data_do_no_harm(tmp_path):
    path = tmp_path / "deep.h5"
    write_motion(path, markers())
    with h5py.File(path, "r+") as f:
        deep(f)
    assert len(read_motion(path).motion.time) == 20


def test_one_long_text_named_many_times_is_not_unpacked(tmp_path):
    path = tmp_path / "bad.h5"
    write_motion(path, markers())
    with h5py.File(path, "r+") as f:
        one_text_many_times(f)
        patch = f.attrs["patch"].tobytes()
    at, first = int.from_bytes(patch[:8], "little"), patch[8:]
    data = bytearray(path.read_bytes())
    data[at : at + 16 * 40_000] = first * 40_000
    path.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError, match=r"/body/node holds more text than the \d+ bytes of the file"):
        read_motion(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM


@pytest.mark.parametrize("kind", ["motion", "result"])
def test_blank_bytes_among_the_texts_do_not_stop_the_reader(tmp_path, kind):
    path = tmp_path / "bad.h5"
    if kind == "motion":
        write_motion(path, markers())
    else:
        write_result(path, estimate())
    data = bytearray(path.read_bytes())
    heap = data.index(b"GCOL\x01")
    check_heaps(path)
    data[heap + 16 : heap + 200] = bytes(184)  # HDF5 2.0 turns forever on this
    path.write_bytes(data)
    with pytest.raises(DataError, match=rf"blank bytes in the text at {heap + 16}\)"):
        read_motion(path) if kind == "motion" else read_result(path)


@pytest.mark.parametrize("address", [2**62, 2**63, 2**64 - 2])
def test_a_text_said_to_lie_beyond_all_files_is_refused(tmp_path, address):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    with h5py.File(path) as f:
        at = f["body/node"].id.get_offset()
    data = bytearray(path.read_bytes())
    data[at + 4 : at + 12] = address.to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"is damaged \(no text at"):
        read_motion(path)


def test_a_text_of_gigabytes_that_lies_nowhere_is_refused_before_room_is_made_for_it(tmp_path):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    with h5py.File(path) as f:
        at = f["body/node"].id.get_offset()
    data = bytearray(path.read_bytes())
    data[at : at + 12] = (2**32 - 1).to_bytes(12, "little")
    path.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError, match="is damaged"):
        read_motion(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM


@pytest.mark.parametrize("libver", ["earliest", "latest"])
@pytest.mark.parametrize("where", ["/", "motion", "motion/position"])
def test_an_attribute_of_gigabytes_that_lies_nowhere_is_refused_before_room_is_made(tmp_path, libver, where):
    path, whole, mark = tmp_path / "a.h5", tmp_path / "b.h5", "a text that is easily found"
    write_motion(whole, markers())
    with h5py.File(whole) as old, h5py.File(path, "w", libver=libver) as new:
        for name in ("body", "motion"):
            old.copy(name, new, without_attrs=True)
        new["motion"].attrs["gravity"] = [0.0, 0.0, -9.81]
        new[where].attrs["units"] = mark
        header = h5py.h5o.get_info(new[where].id).addr
    assert mark.encode() in path.read_bytes()
    data = bytearray(path.read_bytes())
    at = data.index(len(mark).to_bytes(4, "little"), data.index(b"units\0", header))
    data[at : at + 12] = (2**32 - 1).to_bytes(12, "little")
    path.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError, match="is damaged"):
        read_motion(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM


def test_a_heap_across_two_blocks_is_found_and_the_hash_is_of_all_bytes(tmp_path, monkeypatch):
    import hashlib

    path = tmp_path / "a.h5"
    write_motion(path, markers())
    data = path.read_bytes()
    at = data.index(b"GCOL\x01")
    found = []
    monkeypatch.setattr(
        "forceid.files.stored.heap.check_heap", lambda file, start, where: found.append(start)
    )
    for block in range(at + 1, at + 5):
        monkeypatch.setattr("forceid.files.stored.heap._BLOCK", block)
        assert fingerprint(path) == hashlib.sha256(data).hexdigest()
    assert found.count(at) == 4


def test_a_file_that_grows_while_it_is_read_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "grows.h5"
    write_motion(path, markers())

    def grow(path):
        with open(path, "ab") as f:
            f.write(b"more")
        return "0" * 64

    monkeypatch.setattr("forceid.files.stored.hdf5.fingerprint", grow)
    with pytest.raises(DataError, match="changed while it was read"):
        read_motion(path)


def test_an_error_of_our_own_is_no_damage_of_the_file(tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    write_motion(path, markers())

    def broken(*_args, **_more):
        raise TypeError("ours")

    monkeypatch.setattr("forceid.files.stored.hdf5.parse_recording", broken)
    with pytest.raises(TypeError, match="ours"):
        read_motion(path)
