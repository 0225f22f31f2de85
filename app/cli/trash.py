"""`slipstand trash`: put runs aside, and bring them back. Nothing is ever deleted."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli.errors import CommandError


def trash(
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run files; with --list, a folder.", metavar="[RUN...]")
    ] = None,
    bring_back: Annotated[bool, typer.Option("--restore", help="Bring runs back from the trash.")] = False,
    show: Annotated[bool, typer.Option("--list", help="Show what is in the trash.")] = False,
) -> None:
    """Move runs to the trash, and bring them back.

    The trash is the folder .trash beside them.
    """
    from app.cli import output as out
    from app.runs.places import recordings_directory
    from app.runs.trash import move_to_trash, restore, trashed

    if show and bring_back:
        raise CommandError("--list and --restore exclude each other. Give one of them")
    if show:
        recordings = recordings_directory()
        folders = [run.expanduser() for run in runs or [recordings] if runs or recordings.is_dir()]
        for path in (path for folder in folders for path in trashed(folder)):
            out.say(str(path))
        return
    if not runs:
        raise CommandError("no run is named. Give the run files to move, or --list")
    for run in runs:
        moved = restore(run.expanduser()) if bring_back else move_to_trash(run.expanduser())
        out.say(str(moved))
