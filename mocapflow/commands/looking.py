"""Commands that show what there is: plugins, settings, equations, the state of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocapflow.errors import MocapflowError, RecordingError

if TYPE_CHECKING:
    from mocapflow.registry import Registry

PICTURES = Path("runs")


def plugins() -> None:
    """List the installed plugins and what they provide."""
    from mocapflow.registry import PROVIDERS, load_registry

    registry = load_registry()
    for origin in registry.plugins:
        typer.echo(f"{origin.plugin}  ({origin.distribution} {origin.version})")
        for role in PROVIDERS:
            provided = registry.provided(role)
            own = sorted(name for name, found in provided.items() if any(registry.origin(c) == origin for c in found))
            if own:
                typer.echo(f"  {role + ':':<13} {', '.join(own)}")
    for role in PROVIDERS:
        for name, found in registry.provided(role).items():
            if len(found) > 1:
                owners = " and ".join(str(registry.origin(cls)) for cls in found)
                typer.echo(f"note: {owners} provide a {role} '{name}': no pipeline can name it", err=True)
    _tell_failures(registry)


def show(
    role: Annotated[str, typer.Argument(help="draper, garment, matcher, stage, …")],
    name: Annotated[str, typer.Argument(help="Its name, as in a pipeline file.")],
    out: Annotated[
        Path | None, typer.Option(metavar="PNG", help="The picture of a garment.", show_default="runs/NAME.png")
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Whose person and tape measures; a shipped clip if not given.")
    ] = None,
    draper: Annotated[str, typer.Option(help="Lays the garment in the picture.")] = "kinematic",
) -> None:
    """Show what a component does and its settings; draw a garment."""
    from mocapflow.help.describe import describe
    from mocapflow.registry import load_registry

    registry = load_registry()
    cls = registry.get(role, name)
    typer.echo(f"{role} {name}, from {registry.origin(cls)}")
    for line in describe(cls):
        typer.echo(line)
    if role == "garment":
        for line in _drawn(registry, name, recording, draper, out):
            typer.echo(line)
    elif out is not None:
        raise typer.BadParameter("only a garment has a picture", param_hint="--out")


def _drawn(registry: Registry, name: str, recording: Path | None, draper: str, out: Path | None) -> list[str]:
    """Draw a garment and return what to say of it; where nobody has asked for a picture, none is no error."""
    from mocapflow.commands.pictures import draw_garment

    if out is not None:
        return draw_garment(registry, name, recording, draper, out)
    try:
        return draw_garment(registry, name, recording, draper, PICTURES / f"{name}.png")
    except (MocapflowError, OSError) as error:
        return [f"no picture: {error}"]


def settings(
    package: Annotated[str, typer.Argument(metavar="[PACKAGE]", help="Only its.", show_default=False)] = "",
) -> None:
    """Print the settings of every installed component as a Markdown document."""
    from mocapflow.help.manual import manual
    from mocapflow.registry import load_registry

    registry = load_registry()
    typer.echo(manual(registry, package), nl=False)
    _tell_failures(registry)


def equations(
    wanted: Annotated[str, typer.Argument(metavar="[FILTER]", help="A number or a word.", show_default=False)] = "",
) -> None:
    """List the equations of the paper with the functions that implement them."""
    from mocapflow.help.equations import table

    found = [row for row in table() if wanted.lower() in f"{row.number} {row.what} {row.function}".lower()]
    if not found:
        message = f"no equation, title or function has '{wanted}' in it"
        raise MocapflowError(message, hint="without a word all are listed")
    for row in found:
        typer.echo(f"{row.number:<12} {row.what:<50} {row.place()}")


def doctor(
    recording: Annotated[Path, typer.Argument(metavar="DIR", help="A recording folder.")],
    sync: Annotated[bool, typer.Option("--sync", help="Also measure whether cameras are late.")] = False,
    write: Annotated[bool, typer.Option("--write", help="Put what --sync finds into recording.json.")] = False,
) -> None:
    """Check a recording folder and say what to mend."""
    from mocapflow.io.findings import has_errors
    from mocapflow.recordings.doctor import examine, examine_timing

    findings = examine(recording)
    if (sync or write) and not has_errors(findings):
        findings += examine_timing(recording, write)
    for finding in findings:
        place = f"{finding.where}  " if finding.where else ""
        typer.echo("\n       ".join([f"{finding.severity}: {place}{finding.message}", *finding.hint.splitlines()]))
    if has_errors(findings):
        raise typer.Exit(RecordingError.exit_status)
    typer.echo(f"{recording}: {'can be used' if findings else 'nothing to mend'}")


def _tell_failures(registry: Registry) -> None:
    """Say which plugins could not be loaded: what they provide is missing above."""
    for failure in registry.failures:
        typer.echo(f"note: {failure}", err=True)
