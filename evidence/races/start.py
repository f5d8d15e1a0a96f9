"""How long `forceid --help` takes to appear, beside the import of numpy that nobody can avoid."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from evidence.races.paired import Goal, Race, Racer

HELP, NUMPY = "forceid --help", 'python -c "import numpy"'


def races(quick: bool) -> Iterator[Race]:
    python = sys.executable
    commands = {
        HELP: [str(Path(python).with_name("forceid")), "--help"],
        NUMPY: [python, "-c", "import numpy"],
        'python -c "from forceid import kalman"': [python, "-c", "from forceid import kalman"],
        "python -c pass": [python, "-c", "pass"],
    }
    if not quick:
        commands['python -c "import filterpy.kalman"'] = [python, "-c", "import filterpy.kalman"]
    repeats = 2 if quick else 3
    contestants = [starter(name, command, repeats) for name, command in commands.items()]
    goals = [Goal(HELP, NUMPY, 0.5)]
    yield Race("Start of the command", contestants, NUMPY, 1, 1, goals, repeats, "start", "ms")


def starter(name: str, command: list[str], repeats: int) -> Racer:
    def job() -> None:
        for _ in range(repeats):
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    return Racer(name, lambda size: job, lambda found: {}, judged=False)
