"""forceid live: frames as lines in, wrenches as lines and as a growing file out."""

import io
import subprocess
import sys

import h5py
import numpy as np
import pytest

import forceid
from forceid.cli.app import main
from forceid.files import frames_from_lines, growing_file, growing_lines, write_motion
from forceid.records import Body, LiveWrench, Motion, Recording

TIPS = np.array([[0.1, 0.0, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, 0.0, 0.1]])
EXIT = "import sys; from forceid.cli.app import main; sys.exit(main())"


@pytest.fixture(scope="module")
def shelf(tmp_path_factory):
    """The file of a body that hangs still, and its frames as lines."""
    folder = tmp_path_factory.mktemp("shelf")
    t = np.arange(300) / 100
    x = TIPS + 2e-4 * np.random.default_rng(0).standard_normal((300, 4, 3))
    motion = Motion(t, x, noise_std={"position": 2e-4}, gravity=np.array([0.0, 0.0, -9.81]))
    write_motion(folder / "body.h5", Recording(Body(("a", "b", "c", "d"), TIPS, np.full(4, 0.02)), motion))
    rows = [f"{time:.3f}," + ",".join(f"{v:.6f}" for v in p.ravel()) for time, p in zip(t, x, strict=True)]
    (folder / "frames.csv").write_text("time,x,y,z\n" + "\n".join(rows) + "\n")
    return folder


def lines(text):
    return [line.split(",") for line in text.splitlines()]


def test_every_line_in_is_a_line_out(shelf, capsys):
    given = [str(shelf / "body.h5"), str(shelf / "frames.csv"), "-o", str(shelf / "live.h5"), "--lag", "0.1"]
    assert main(["live", *given]) == 0
    streams = capsys.readouterr()
    head, *rows = lines(streams.out)
    assert head[:4] == ["time", "fx", "fy", "fz"]
    assert len(rows) == 300
    assert float(rows[200][3]) == pytest.approx(0.08 * 9.81, abs=4 * float(rows[200][9]))
    assert {row[13] for row in rows} == {"ok"}
    assert "tuned on 256 frames" in streams.err
    with h5py.File(shelf / "live.h5") as f:
        live = f["live"]
        np.testing.assert_allclose(live["force"][:, 2], [float(row[3]) for row in rows], rtol=1e-5)
        assert live.attrs["lag"] == 0.1
        assert live["force"].attrs["units"] == "N"
        assert b"tuned on 256 frames" in live["note"][0]


def test_standard_input_is_read_as_it_comes(shelf):
    command = [sys.executable, "-c", EXIT, "live", str(shelf / "body.h5"), "--tuned-on-body"]
    text = (shelf / "frames.csv").read_text()
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert len(done.stdout.splitlines()) == 301


def test_a_file_is_followed_up_to_its_last_word(shelf, tmp_path, capsys):
    path = tmp_path / "growing.csv"
    path.write_text((shelf / "frames.csv").read_text() + "end\n0.1,2\n")
    assert main(["live", str(shelf / "body.h5"), str(path), "--follow", "--tuned-on-body"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 301


def test_a_line_that_is_written_in_two_goes_is_read_as_one(tmp_path):
    path = tmp_path / "growing.csv"
    path.write_text("0.1,1")
    with path.open() as file, path.open("a") as more:
        read = growing_lines(file)
        more.write(",2\n0.2")
        more.flush()
        assert next(read) == "0.1,1,2\n"


def test_bad_lines_in_mid_stream_are_said_and_left_out(shelf, tmp_path, capsys):
    rows = (shelf / "frames.csv").read_text().splitlines()
    rows[50], rows[60], rows[70] = "0.5,1,2", rows[60].replace(",", ",oops,", 1)[:-9], "nan" + rows[70][5:]
    path = tmp_path / "bad.csv"
    path.write_text("\n".join(rows))
    assert main(["live", str(shelf / "body.h5"), str(path), "--tuned-on-body"]) == 0
    streams = capsys.readouterr()
    assert len(streams.out.splitlines()) == 298
    assert "line 51 has 3 fields, expected 13: time, then x, y, z of 4 nodes (a, b, c, d)" in streams.err
    assert "line 61 has 'oops' in field 2, expected a number or nothing" in streams.err
    assert "line 71 has the time 'nan'" in streams.err
    assert "Traceback" not in streams.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no frame, expected 13"),
        ("0.1,2,3\n", "line 1 has 3 fields, expected 13"),
        ("time;x;y;z\n0;1;2;3\n", "line 2 has 1 fields, expected 13"),
    ],
)
def test_input_that_holds_no_frames_is_one_line_and_exit_3(shelf, tmp_path, capsys, text, said):
    path = tmp_path / "none.csv"
    path.write_text(text)
    assert main(["live", str(shelf / "body.h5"), str(path)]) == 3
    streams = capsys.readouterr()
    assert said in streams.err
    assert streams.err.count("\n") == 1


def test_an_earlier_file_is_kept_until_there_is_a_wrench_and_nothing_is_left_beside_it(shelf, tmp_path):
    path, earlier = tmp_path / "none.csv", tmp_path / "live.h5"
    path.write_text("0.1,2,3\n")
    earlier.write_text("of yesterday")
    assert main(["live", str(shelf / "body.h5"), str(path), "-o", str(earlier), "--force"]) == 3
    assert earlier.read_text() == "of yesterday"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["live.h5", "none.csv"]


def test_wrong_usage_is_said_with_its_exit_code(shelf, tmp_path, capsys):
    body, csv = str(shelf / "body.h5"), str(shelf / "frames.csv")
    assert main(["live", body, str(tmp_path / "missing.csv")]) == 3
    assert main(["live", str(tmp_path / "missing.h5"), csv]) == 3
    assert main(["live", body, csv, "--lag", "0"]) == 2
    assert main(["live", body, csv, "-o", body]) == 2
    assert main(["live", body, csv, "-o", str(tmp_path / "no" / "folder.h5")]) == 2
    assert main(["live", body, "--follow"]) == 2
    assert capsys.readouterr().err.count("forceid: error:") == 6


def test_another_program_reads_the_file_while_it_grows(tmp_path):
    path, one = tmp_path / "live.h5", np.ones(3)
    reader = (
        "import h5py, sys; f = h5py.File(sys.argv[1], 'r', libver='latest', swmr=True)['live'];"
        "print(len(f['time']), len(f['force']), f['degraded'][-1], f['reasons'][-1].decode())"
    )
    with growing_file(path, {"method": "live"}) as growing:
        for k in range(5):
            growing.add(
                LiveWrench(float(k), one, one, one, one, ("1 of 4 markers missing",) if k == 4 else ())
            )
        growing.write()
        done = subprocess.run(
            [sys.executable, "-c", reader, str(path)], capture_output=True, text=True, check=True
        )
    assert done.stdout.split(maxsplit=3) == ["5", "5", "1", "1 of 4 markers missing\n"]


def test_what_waits_to_be_written_is_bounded(tmp_path, monkeypatch):
    from forceid.files.stored import growing as module

    monkeypatch.setattr(module, "EVERY", 1e9)
    one = np.ones(3)
    with growing_file(tmp_path / "live.h5", {}) as growing:
        growing.write()
        growing.written = module.monotonic()
        for k in range(3 * module.AT_ONCE + 7):
            growing.add(LiveWrench(float(k), one, one, one, one))
            assert len(growing.waiting) < module.AT_ONCE
    with h5py.File(tmp_path / "live.h5") as f:
        assert f["live/time"][:].tolist() == list(range(3 * module.AT_ONCE + 7))


def test_empty_fields_are_markers_that_were_not_seen():
    frames = list(frames_from_lines(io.StringIO("0.0,,,\n0.1,1, ,nan\n"), ("a",), "x", print))
    assert np.isnan(frames[0].position).all()
    assert np.isnan(frames[1].position[0]).tolist() == [False, True, True]


def test_live_is_a_public_name(shelf):
    tree = forceid.open_motion(shelf / "body.h5")
    motion = tree["motion"]
    frames = zip(motion.time.values, motion.position.values, strict=True)
    found = list(forceid.live(frames, tree, lag=0.1, tuned_on_file=True))
    assert len(found) == 300
    assert found[150].flag == "ok"
