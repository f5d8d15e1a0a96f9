"""What surrounds a command: terminals that lack characters, names that steer them, limits, interrupts."""

import errno
import io

import pytest

from forceid.cli.boundary import endings, terminal
from forceid.cli.boundary.endings import ending
from forceid.cli.boundary.terminal import printable, tell
from forceid.errors import EstimationError


def test_characters_that_an_encoding_lacks_have_a_plain_form():
    terminal.settle()
    assert "0.3 ± 0.1 m² λ".encode("ascii", "forceid") == rb"0.3 +- 0.1 m2 \u03bb"
    assert "m\udcff.h5".encode("latin-1", "forceid") == rb"m\udcff.h5"


@pytest.mark.parametrize("name", ["\x1b[31mred", "a\rb", "a\u202eb", "a\u2028b", "\x9b2J"])
def test_no_name_steers_the_terminal(name):
    shown = printable(f"{name} is missing")
    assert shown.isprintable()
    assert shown.startswith(name[0] if name[0] == "a" else "\\x")


def test_lines_and_letters_of_all_languages_stay():
    text = "verdict  ok\n\tМаркер 標記 ± 1"
    assert printable(text) == text


def test_a_full_device_is_remembered_and_stops_no_work():
    class Full(io.StringIO):
        def write(self, text):
            raise OSError(errno.ENOSPC, "No space left on device")

    tell("a line", Full())
    assert terminal.flushed().errno == errno.ENOSPC
    assert terminal.flushed() is None


@pytest.mark.parametrize(
    ("error", "words", "code"),
    [
        (MemoryError(), "there is not enough memory", 1),
        (OSError(errno.EMFILE, "Too many open files"), "too many files are open", 1),
        (OSError(errno.EACCES, "Permission denied", "a.h5"), "a.h5 cannot be used (Permission denied)", 2),
        (KeyboardInterrupt(), "interrupted", 130),
        (RuntimeError("odd"), "unexpected RuntimeError: odd", 1),
    ],
)
def test_every_end_is_one_line_and_an_exit_code_of_the_contract(error, words, code):
    line, found = ending(error, ["estimate", "b.h5"], False)
    assert words in line
    assert found == code


def test_too_little_address_space_is_told_before_the_libraries_stand_still(monkeypatch):
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (200 << 20, 200 << 20))
    with pytest.raises(EstimationError, match="has 200 MB of address space, expected 500 MB or more"):
        endings.check_room()
