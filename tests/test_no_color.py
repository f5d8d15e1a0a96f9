"""NO_COLOR (no-color.org) on a terminal: letters may be bold, and nothing has a color."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pseudo_terminal import watched_on_terminal

ROOT = Path(__file__).parents[1]
START = "import sys; from forceid.cli.app import main; sys.exit(main())"
COLOR = re.compile(r"\x1b\[(?:[\d;]*;)?(?:3[0-9]|4[0-9]|9[0-7]|10[0-7])(?:;[\d;]*)?m")


def on_terminal(words, cwd, **environment):
    """Exit code of a command, and all that it writes to a terminal."""
    ours = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR", "PY_COLORS")}
    process, written = watched_on_terminal(
        lambda end: subprocess.Popen(
            [sys.executable, "-c", START, *words], stdin=end, stdout=end, stderr=end, cwd=cwd,
            env={**ours, "TERM": "xterm-256color", "PYTHONPATH": str(ROOT), **environment},
        )
    )  # fmt: skip
    return process.wait(), written


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("terminal")
    shutil.copy(ROOT / "data" / "synthetic" / "top.h5", folder)
    return folder


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--help"], 0),
        (["estimate", "--help"], 0),
        (["import", "--help"], 0),
        (["estimat"], 2),
        (["estimate"], 2),
        (["inspect", "missing.h5"], 3),
        (["inspect", "top.h5"], 0),
        (["batch", "top.h5", "-o", "out", "-j", "1", "--method", "difference"], 0),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else "",
)
def test_nothing_on_a_terminal_has_a_color_under_no_color(words, code, folder):
    found, written = on_terminal(words, folder, NO_COLOR="1")
    assert found == code
    assert written.strip()
    assert not COLOR.findall(written)


def test_without_no_color_a_terminal_has_colors_and_a_dumb_one_no_codes(folder):
    assert COLOR.search(on_terminal(["--help"], folder)[1])
    assert "\x1b[" not in on_terminal(["--help"], folder, TERM="dumb")[1]
