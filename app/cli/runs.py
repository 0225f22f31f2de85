"""`slipstand runs`: what is in the library."""

import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from analysis.formatting import format_value
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import Json, SeriesCode
from app.cli.recover import print_unfinished_runs
from app.runs.file_operations import list_trash, move_to_trash, restore_from_trash
from app.runs.listing import RunFilter, list_runs
from app.runs.paths import recordings_directory
from app.runs.summary import RunSummary
from config.files import load_stand


def runs(
    directory: Annotated[
        Path | None, typer.Argument(help="Folder of runs; the recordings folder if absent.", metavar="[DIR]")
    ] = None,
    series: SeriesCode = None,
    since: Annotated[str | None, typer.Option(help="Only runs of this day or later: 2026-11-21.")] = None,
    until: Annotated[str | None, typer.Option(help="Only runs of this day or earlier.")] = None,
    operator: Annotated[str | None, typer.Option(help="Only runs of this operator.")] = None,
    text: Annotated[
        str | None, typer.Option(help="Only runs with this in name, title, note, operator or source.")
    ] = None,
    stale: Annotated[
        bool, typer.Option("--stale", help="Only runs changed since their newest analysis.")
    ] = False,
    as_json: Json = False,
) -> None:
    """List recorded runs, oldest first.

    Files that cannot be read stand last with their fault.
    """
    series = load_stand().series(series).code if series else None
    print_unfinished_runs(directory or recordings_directory())
    wanted = RunFilter(series, _day("--since", since), _day("--until", until), operator, text, stale or None)
    with out.progress_bar("looking at new files", total=1.0) as update:
        found = list_runs(directory, wanted, progress=lambda done, count: update(done / count))
    if as_json:
        out.print_json([msgspec.to_builtins(run) | {"fault": str(run.fault)} for run in found])
    elif found:
        header = ("run", "series", "begun", "seconds", "ended", "f_d", "conditions")
        out.print_table(header, [_row(run) for run in found])
    elif wanted != RunFilter():
        out.print_line(
            f"No run in {directory or recordings_directory()} is of that kind. All runs: slipstand runs"
        )
    else:
        out.print_line(
            f"No runs in {directory or recordings_directory()}. Record one, or try: slipstand demo"
        )


def _day(option: str, text: str | None) -> datetime.date | None:
    try:
        return datetime.date.fromisoformat(text) if text else None
    except ValueError:
        raise CommandError(f"{option} {text!r} is not a day. Write it like 2026-11-21") from None


def _row(run: RunSummary) -> tuple[str, ...]:
    if run.fault:
        return (run.path, "", "", "", "", str(run.fault), "")
    begun = run.start_time.astimezone().strftime("%Y-%m-%d %H:%M:%S") if run.start_time else ""
    ended = run.ended or "unfinished: slipstand recover"
    seconds = f"{run.duration_s:.1f}"
    return (run.path, run.series or "", begun, seconds, ended, _friction_text(run), run.conditions.as_text())


def _friction_text(run: RunSummary) -> str:
    """Newest f_d, with what is to be known of it in a word."""
    if run.friction_dynamic is None:
        return ""
    marks = ["stale"] if run.stale else []
    marks += ["model does not fit"] if run.adequate is False else []
    marks += ["left out"] if run.excluded else []
    shown = str(format_value(run.friction_dynamic, run.friction_dynamic_uncertainty))
    return f"{shown} ({', '.join(marks)})" if marks else shown


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
    if show and bring_back:
        raise CommandError("--list and --restore exclude each other. Give one of them")
    if show:
        recordings = recordings_directory()
        folders = [run.expanduser() for run in runs or [recordings] if runs or recordings.is_dir()]
        for path in (path for folder in folders for path in list_trash(folder)):
            out.print_line(str(path))
        return
    if not runs:
        raise CommandError("no run is named. Give the run files to move, or --list")
    for run in runs:
        moved = restore_from_trash(run.expanduser()) if bring_back else move_to_trash(run.expanduser())
        out.print_line(str(moved))
