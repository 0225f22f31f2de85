"""`slipstand runs`: what is in the library."""

import datetime

import msgspec

from analysis.formatting import format_value
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.recover import print_unfinished_runs
from app.cli.run_file_options import ListRunsOptions, TrashOptions
from app.runs.file_operations import list_trash, move_to_trash, restore_from_trash
from app.runs.listing import RunFilter, list_runs
from app.runs.paths import recordings_directory
from app.runs.summary import RunSummary
from config.files import load_stand


def runs(options: ListRunsOptions) -> None:
    series = load_stand().series(options.series).code if options.series else None
    folder = options.directory or recordings_directory()
    print_unfinished_runs(folder)
    wanted = RunFilter(
        series,
        _day("--since", options.since),
        _day("--until", options.until),
        options.operator,
        options.text,
        options.stale or None,
    )
    with out.progress_bar("looking at new files", total=1.0) as update:
        found = list_runs(options.directory, wanted, progress=lambda done, count: update(done / count))
    if options.as_json:
        out.print_json([msgspec.to_builtins(run) | {"fault": str(run.fault)} for run in found])
    elif found:
        header = ("run", "series", "begun", "seconds", "ended", "f_d", "conditions")
        out.print_table(header, [_row(run) for run in found])
    elif wanted != RunFilter():
        out.print_line(f"No run in {folder} is of that kind. All runs: slipstand runs")
    else:
        out.print_line(f"No runs in {folder}. Record one, or try: slipstand demo")


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
    damaged = ["a result is damaged"] if run.damaged_analyses else []
    if run.friction_dynamic is None:
        return "".join(damaged)
    marks = damaged + (["stale"] if run.stale else [])
    unfit = "model does not fit, f_d holds" if run.friction_holds else "model does not fit"
    marks += [unfit] if run.adequate is False else []
    marks += ["left out"] if run.excluded else []
    shown = str(format_value(run.friction_dynamic, run.friction_dynamic_uncertainty))
    return f"{shown} ({', '.join(marks)})" if marks else shown


def trash(options: TrashOptions) -> None:
    if options.show and options.bring_back:
        raise CommandError("--list and --restore exclude each other. Give one of them")
    if options.show:
        recordings = recordings_directory()
        folders = options.runs or ([recordings] if recordings.is_dir() else [])
        for folder in folders:
            for path in list_trash(folder.expanduser()):
                out.print_line(str(path))
        return
    if not options.runs:
        raise CommandError("no run is named. Give the run files to move, or --list")
    move = restore_from_trash if options.bring_back else move_to_trash
    for run in options.runs:
        out.print_line(str(move(run.expanduser())))
