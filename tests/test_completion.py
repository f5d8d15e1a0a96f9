"""What a shell gets for Tab, as its completion script asks for it."""

import os
import shutil
import subprocess
import sys

import pytest

from forceid.cli.app import main

START = "import sys; from forceid.cli.app import main; sys.exit(main())"


def asked(**environment):
    """Exit code and lines of what the command says to a shell; stderr must stay silent."""
    done = subprocess.run(
        [sys.executable, "-c", START], capture_output=True, text=True, env={**os.environ, **environment}
    )
    assert done.stderr == ""
    return done.returncode, done.stdout.splitlines()


def completed(*words):
    line = " ".join(words)
    found = asked(_FORCEID_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1))
    assert found[0] == 0
    return [word for word in found[1] if word]


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("forceid", "e"), ["estimate", "export"]),
        (("forceid", "estimate", "--met"), ["--method"]),
        (("forceid", "estimate", "--method", "s"), ["savgol", "spline", "smoother"]),
        (("forceid", "batch", "a.h5", "--model", "a"), ["affine", "auto"]),
        (("forceid", "estimate", "--engine", "n"), ["numpy"]),
        (("forceid", "chart", "plate_"), ["plate_16", "plate_64"]),
        (("forceid", "stress", "outlier"), ["outliers", "outlier_size"]),
        (("forceid", "chart", "no such"), []),
        (("forceid", "nonsense", "x"), []),
    ],
)
def test_tab_completes_commands_options_and_names(words, names):
    assert completed(*words) == names


def test_zsh_and_fish_get_the_same_names():
    line = {"_TYPER_COMPLETE_ARGS": "forceid estimate --method s"}
    names = ["savgol", "spline", "smoother"]
    _, zsh = asked(_FORCEID_COMPLETE="complete_zsh", **line)
    assert [word.split('"')[1] for word in zsh] == names
    fish = {"_TYPER_COMPLETE_FISH_ACTION": "get-args", "_TYPER_COMPLETE_WORD_TO_COMPLETE": "s"}
    assert asked(_FORCEID_COMPLETE="complete_fish", **line, **fish)[1] == names


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_every_shell_asks_this_command(shell):
    code, lines = asked(_FORCEID_COMPLETE=f"source_{shell}")
    assert code == 0
    assert "_FORCEID_COMPLETE=complete_" + shell in "\n".join(lines)
    if shutil.which(shell):
        checked = subprocess.run([shell, "-n"], input="\n".join(lines), capture_output=True, text=True)
        assert checked.returncode == 0, checked.stderr


def test_help_offers_to_install_completion(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert "--install-completion" in said
    assert "--show-completion" in said
