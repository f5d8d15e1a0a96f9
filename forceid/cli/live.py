"""forceid live: force and moment while the motion goes on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from forceid.cli.boundary.terminal import give_up, printable, tell
from forceid.cli.estimate import Config, Force, naming
from forceid.errors import ConfigError, DataError

if TYPE_CHECKING:
    from forceid.records import LiveWrench

HEADER = "time,fx,fy,fz,mx,my,mz,fx_std,fy_std,fz_std,mx_std,my_std,mz_std,flag,reasons"


def run(
    body: Annotated[Path, typer.Argument(metavar="BODY.h5", help="Motion file of the body.")],
    frames: Annotated[
        str, typer.Argument(metavar="FRAMES.csv|-", help="Frames as lines; - is standard input.")
    ] = "-",
    config: Config = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="OUT.h5", help="HDF5 that grows, beside stdout.")
    ] = None,
    lag: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds from a frame to its wrench; 0.05 if not given.")
    ] = None,
    first: Annotated[
        float | None,
        typer.Option(metavar="S", help="Seconds tuned on at the start, 256 frames at least; 0.5."),
    ] = None,
    retune: Annotated[
        float | None, typer.Option(metavar="S", help="Most seconds between tunings; 60. inf: never again.")
    ] = None,
    tuned_on_body: Annotated[
        bool, typer.Option("--tuned-on-body", help="Tune on the motion in BODY, not on the first frames.")
    ] = False,
    follow: Annotated[
        bool, typer.Option("--follow", help="Wait for more of FRAMES.csv, up to a line `end`.")
    ] = False,
    force: Force = False,
) -> None:
    """Estimate force and moment while the motion goes on: a frame in, the wrench of a lag before out.

    A line a frame: time (s), then x, y, z (m) of every node in the order of /body/node of BODY, with commas
    between, empty or nan where a marker is not seen; one header line may stand before. Results go to stdout
    as lines, to OUT.h5 as HDF5 that others may read while it grows, and what is to be said to stderr. A line
    that is no frame is said and left out; frames after a gap are flagged.

    Example: forceid live body.h5 frames.csv -o live.h5 --lag 0.05
    """
    from forceid.config import load_settings
    from forceid.estimation import followed_live, live_pace, read_recording
    from forceid.files import check_output, frames_from_lines, growing_file

    settings = load_settings(config)
    if output is not None:
        check_output(output, "live", [body, frames, *([config] if config else [])], force)
    with naming(body):
        recording = read_recording(body, settings)[0]
    pace = live_pace(lag, first, retune)
    stopped: list[bool] = []
    with ExitStack() as held:
        tell: Callable[[str], None] = say
        kept = None
        if output is not None:
            about: dict[str, str | float] = {
                "method": "live",
                "lag": pace.lag,
                "moment_about": "mass_center",
                "body": str(body),
            }
            kept = held.enter_context(growing_file(output, about))
            tell = beside(kept.note)
        lines = interrupted(held.enter_context(source(frames, follow)), stopped)
        shown = "standard input" if frames == "-" else frames
        read = frames_from_lines(lines, recording.body.node, shown, tell)
        found = followed_live(read, recording, settings, pace, tuned_on_body, tell)
        printed(found, kept.add if kept is not None else None)
    if stopped:
        raise KeyboardInterrupt


def printed(found: Iterator[LiveWrench], keep: Callable[[LiveWrench], None] | None) -> None:
    """Print wrenches as lines, each at once, and keep them; only that when nobody reads any more."""
    listening = print_line(HEADER)
    for wrench in found:
        if keep is not None:
            keep(wrench)
        if listening:
            parts = (wrench.force, wrench.moment, wrench.force_std, wrench.moment_std)
            numbers = [f"{v:.6g}" if v == v else "" for part in parts for v in part.tolist()]
            said = "; ".join(wrench.reasons).replace(",", "")
            listening = print_line(",".join([f"{wrench.time:.9g}", *numbers, wrench.flag, said]))
        elif keep is None:
            return


def print_line(text: str) -> bool:
    """Print a line at once; False where nobody reads it any more."""
    try:
        print(printable(text), flush=True)
    except OSError as error:
        give_up(sys.stdout, error)
        return False
    return True


def say(text: str) -> None:
    """Say something beside the results."""
    tell(f"forceid live: {' '.join(text.split())}", sys.stderr)


def beside(keep: Callable[[str], None]) -> Callable[[str], None]:
    """Say something, and keep it in the result file."""

    def tell(text: str) -> None:
        say(text)
        keep(text)

    return tell


@contextmanager
def source(frames: str, follow: bool) -> Iterator[Iterator[str]]:
    """The lines of standard input or of a file, growing if it is followed."""
    from forceid.files import growing_lines

    if frames == "-":
        if follow:
            raise ConfigError("is for a file", "--follow", "leave it out: standard input is followed anyway")
        yield iter(sys.stdin)
        return
    try:
        file: TextIO = open(frames, encoding="utf-8", errors="replace")  # noqa: SIM115  (closed below)
    except OSError as e:
        raise DataError(f"cannot be read ({e.strerror})", frames, "give a file of frames, or -") from e
    with file:
        yield growing_lines(file) if follow else iter(file)


def interrupted(lines: Iterator[str], stopped: list[bool]) -> Iterator[str]:
    """The lines up to an interruption while they are waited for: what came before is still told."""
    while True:
        try:
            line = next(lines, None)
        except KeyboardInterrupt:
            stopped.append(True)
            return
        if line is None:
            return
        yield line
