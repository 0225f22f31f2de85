"""`slipstand runs`: what is in the library."""

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.errors import CommandError
from app.cli.options import Json, SeriesCode

if TYPE_CHECKING:
    from app.runs.summary import RunSummary


def runs(
    directory: Annotated[
        Path | None, typer.Argument(help="Folder of runs; the recordings folder if absent.", metavar="[DIR]")
    ] = None,
    series: SeriesCode = None,
    since: Annotated[str | None, typer.Option(help="Only runs of this day or later: 2026-11-21.")] = None,
    as_json: Json = False,
) -> None:
    """List recorded runs, oldest first; files that cannot be read stand last with their fault."""
    import msgspec

    from app.cli import output as out
    from app.runs.library import list_runs
    from app.runs.places import recordings_directory

    found = list_runs(directory, series=series, since=_day(since))
    if as_json:
        out.emit_json(msgspec.to_builtins(found))
    elif found:
        out.table(("run", "series", "begun", "seconds", "ended", "f_d"), [_row(run) for run in found])
    else:
        out.say(f"No runs in {directory or recordings_directory()}. Record one, or try: slipstand demo")


def _day(text: str | None) -> datetime.date | None:
    try:
        return datetime.date.fromisoformat(text) if text else None
    except ValueError:
        raise CommandError(f"--since {text!r} is not a day. Write it like 2026-11-21") from None


def _row(run: "RunSummary") -> tuple[str, ...]:
    from app.cli import output as out

    if run.fault:
        return (run.path, "", "", "", "", run.fault)
    begun = run.start_time.astimezone().strftime("%Y-%m-%d %H:%M:%S") if run.start_time else ""
    friction = ""
    if run.friction_dynamic is not None:
        friction = out.rounded(run.friction_dynamic, run.friction_dynamic_uncertainty or 0.0)
    return (run.path, run.series or "", begun, f"{run.duration_s:.1f}", run.ended or "unfinished", friction)
