"""The `forceid` command: finds the command, and turns every error into one line and an exit code."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from keyword import iskeyword
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from forceid import __version__
from forceid.cli.boundary.endings import INTERRUPTED, check_room, ending, fail
from forceid.cli.boundary.status import shown
from forceid.cli.boundary.terminal import flushed, settle
from forceid.errors import ConfigError

HERE = (  # each a module of this folder
    "simulate", "import", "inspect", "estimate", "identify", "coefficients", "live", "batch", "report",
    "open", "export", "settings", "config", "demo", "doctor",
)  # fmt: skip
EVIDENCE = {  # in a distribution of their own, with what their line of the help says
    "chart": "Measure error, claim, time and memory of every method and every peer, on every SCENE.",
    "stress": "Sweep failures from healthy to hopeless: where each method is right, says so, or is wrong.",
}
COMMANDS = (*HERE, *EVIDENCE)
LISTING = "forceid.listing"
EVERYWHERE = {  # accepted before the command and after it
    "debug": {"--debug"}, "quiet": {"--quiet", "-q"}, "verbose": {"--verbose", "-v"}
}  # fmt: skip
ANYWHERE = set().union(*EVERYWHERE.values())
WHOLE = 1000  # characters: no first sentence has as many


class Page(TyperCommand):
    """A command whose help has its headings bold and yellow where the terminal takes that."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help, without rich, which would take as long to load as all the rest."""
        super().format_help(ctx, formatter)
        formatter.buffer = headed(formatter.buffer)


def headed(lines: Sequence[str]) -> list[str]:
    """Lines of a help with headings that stand out; typer takes that away where no terminal is."""
    if os.environ.get("TERM") == "dumb":
        return list(lines)
    color = None if "NO_COLOR" in os.environ else "yellow"
    heads = ("Usage: ", "Arguments:", "Options:", "Commands:")
    return [
        typer.style(word, bold=True, fg=color) + line[len(word) :] if (word := begun(line, heads)) else line
        for line in lines
    ]


def begun(line: str, words: Sequence[str]) -> str:
    """The word that a line begins with, if any."""
    return next((word for word in words if line.startswith(word)), "")


class LazyGroup(TyperGroup):
    """A group that imports the file of a command only when that command is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        """The names of the commands, in the order of the help."""
        return list(COMMANDS)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help, which looks into no other distribution."""
        ctx.meta[LISTING] = True
        super().format_help(ctx, formatter)
        formatter.buffer = headed(formatter.buffer)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The commands with the whole first sentence of each."""
        with formatter.section("Commands"):
            said = [(name, self.get_command(ctx, name).get_short_help_str(WHOLE)) for name in COMMANDS]
            formatter.write_dl(said)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of that name; a ConfigError names the nearest one."""
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        if cmd_name in HERE:
            single.command(cmd_name, cls=Page)(
                import_module(f"forceid.cli.{cmd_name}{'_' * iskeyword(cmd_name)}").run
            )
        elif cmd_name in EVIDENCE and ctx.meta.get(LISTING):
            single.command(cmd_name, cls=Page, help=EVIDENCE[cmd_name])(options)
        elif run := installed(cmd_name):
            single.command(cmd_name, cls=Page)(run)
        elif ctx.resilient_parsing:  # a shell completes: it wants no words
            return None
        elif cmd_name in EVIDENCE:
            raise ConfigError(
                f"the command '{cmd_name}' comes with the package forceid-evidence, which is not installed",
                next_step="run python -m pip install 'forceid[evidence]'",
            )
        else:
            near = get_close_matches(cmd_name, COMMANDS, n=1, cutoff=0.0)[0]
            raise ConfigError(f"unknown command '{cmd_name}'", next_step=f"did you mean '{near}'?")
        return typer.main.get_command(single)


def installed(command: str) -> Any:
    """The function of a command that another distribution brings, None where there is none."""
    from importlib.metadata import entry_points

    return next((found.load() for found in entry_points(group="forceid.commands", name=command)), None)


app = typer.Typer(cls=LazyGroup, rich_markup_mode=None)


def show_version(wanted: bool) -> None:
    """Print the version, the engine that `auto` stands for here and its instructions, and stop."""
    if wanted:
        from forceid.kalman.engines import engine, instructions

        chosen = engine("auto").name
        typer.echo(", ".join([f"forceid {__version__}", f"engine {chosen}", *instructions(chosen)]))
        raise typer.Exit()


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="Show version and engine.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors and --json.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Say every stage, and its time.")] = False,
) -> None:
    """What pushed a body, from how it moved: applied forces and moments with their uncertainty.

    Example: forceid demo -o demo
    """


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    0 all good, 1 an estimate failed or was refused, 2 usage or configuration, 3 input data,
    130 interrupted.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    words = [word for word in given if word not in ANYWHERE]
    debug = "--debug" in given
    quiet, verbose = (not EVERYWHERE[name].isdisjoint(given) for name in ("quiet", "verbose"))
    settle(0 if quiet else 2 if verbose else 1)
    with warnings.catch_warnings():
        if arguments is None and not debug and not sys.warnoptions:
            warnings.simplefilter("ignore")  # a verdict says what is wrong with numbers
        try:
            check_room()
            with shown(next((word for word in words if word in COMMANDS), "")):
                code = typer.main.get_command(app).main(
                    words or ["--help"], prog_name="forceid", standalone_mode=False
                )
            code = code if isinstance(code, int) else 0
            if code == INTERRUPTED:  # as typer tells of one
                raise KeyboardInterrupt
        except BaseException as error:
            if debug:
                traceback.print_exc()
            if isinstance(error, SystemExit | GeneratorExit):
                raise
            code = fail(*ending(error, words, debug))
    if (lost := flushed()) is not None and not code:
        code = fail(f"standard output cannot be written ({lost.strerror}); give it another place", 2)
    return code
