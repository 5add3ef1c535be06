"""The command line: parse, call, print. Heavy modules are imported by the command that needs them."""

from __future__ import annotations

import logging
import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable
from io import TextIOWrapper
from itertools import pairwise
from typing import Annotated, Any

import typer
import typer.core

from mocapflow.commands import cache, comparing, looking, new, prior, results, running
from mocapflow.errors import MocapflowError, uncompilable, unwritable
from mocapflow.interrupts import Interrupts, interrupted

INTERRUPTED = 130  # the exit status
NO_VALUE = re.compile("--[a-z-]+=")  # an option with an empty value
QUIET = {"OPENCV_LOG_LEVEL": "ERROR", "OPENCV_FFMPEG_LOGLEVEL": "-8"}  # what can't be decoded is told by mocapflow


class Commands(typer.core.TyperGroup):
    """Prints a problem the user can mend without a traceback; anything else is a bug and shows its own."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return the words that are left; none may be empty, for an empty path is the working directory."""
        for before, word in pairwise(["mocapflow", *args]):
            if not word or NO_VALUE.fullmatch(word):
                ctx.fail(f"nothing stands behind {word or before}; is a shell variable not set?")
        words: list[str] = super().parse_args(ctx, args)
        return words

    def invoke(self, ctx: Any) -> Any:
        """Run the command and turn errors into exit status 1 or 2, an interrupt or SIGTERM into 130."""
        try:
            return super().invoke(ctx)
        except (Exception, KeyboardInterrupt, SystemExit) as error:
            if interrupted(error):
                typer.echo(f"\ninterrupted{_to_go_on(ctx.invoked_subcommand)}", err=True)
                raise typer.Exit(INTERRUPTED) from None
            if isinstance(error, SystemExit):  # no command of ours ends so, and 0 would say that it is done
                raise RuntimeError("a plugin or a library left the program") from error
            said = unwritable(error) if isinstance(error, OSError) else uncompilable(error) or error
            if not isinstance(said, MocapflowError):
                raise
            typer.echo(f"error: {said}", err=True)
            raise typer.Exit(said.exit_status) from None


def _to_go_on(command: str | None) -> str:
    """Return how to resume a command that was interrupted; "" where it saves nothing."""
    if command not in ("run", "demo", "compare"):
        return ""
    words = [word for word in sys.argv[1:] if word != "--fresh"]  # it would remove what is saved
    return f"; what is finished is saved. To go on: {shlex.join(['mocapflow', *words])}"


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def tell_version(asked: bool) -> None:
    """Print the version and end, if asked."""
    if asked:
        from importlib import metadata

        typer.echo(f"mocapflow {metadata.version('mocapflow')}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=tell_version, help="Print the version.")
    ] = False,
) -> None:
    """Markerless motion capture of people in their own loose clothes."""


COMMANDS: tuple[Callable[..., None], ...] = (
    running.run,
    running.plan,
    running.status,
    running.demo,
    comparing.compare,
    results.evaluate,
    results.export,
    results.view,
    looking.plugins,
    looking.show,
    looking.settings,
    looking.equations,
    looking.doctor,
)
for command in COMMANDS:
    app.command()(command)
app.add_typer(cache.app, name="cache")
app.add_typer(prior.app, name="prior")
app.add_typer(new.app, name="new")


def main() -> None:
    """Run the command line; warnings and what stages found go to stderr, one line each."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # what a terminal's encoding lacks, or no encoding has, is escaped
            stream.reconfigure(errors="backslashreplace")
    for variable, level in QUIET.items():
        os.environ.setdefault(variable, level)
    warnings.showwarning = _show_warning
    _tell_on_stderr()
    Interrupts().install()
    try:
        app(prog_name="mocapflow")
    except SystemExit as end:
        if end.code == INTERRUPTED:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(INTERRUPTED)  # libraries that were cut off in the middle may crash on their way out
        raise


def _tell_on_stderr() -> None:
    """Print warnings of all libraries, and what our stages found, one line each."""
    warned = logging.StreamHandler(sys.stderr)
    warned.setLevel(logging.WARNING)  # of the handler: libraries lower that of their own loggers
    logging.basicConfig(format="warning: %(message)s", handlers=[warned])
    told = logging.StreamHandler(sys.stderr)
    told.addFilter(lambda record: record.levelno < logging.WARNING)
    ours = logging.getLogger("mocapflow")
    ours.addHandler(told)
    ours.setLevel(logging.INFO)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    logging.getLogger("py.warnings").warning("%s", message)  # where progress makes way for it
