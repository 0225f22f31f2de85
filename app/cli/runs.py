"""`slipstand runs`: what is in the library."""

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, cast

import msgspec

from analysis.catalogue import Place, definition
from analysis.formatting import format_value
from app.cli import output as out
from app.cli.errors import CommandError, alternatives
from app.cli.recover import print_unfinished_runs
from app.cli.run_file_options import RUN_COLUMNS, ListRunsOptions, TrashOptions
from app.runs.file_operations import list_trash, move_to_trash, restore_from_trash
from app.runs.listing import list_runs
from app.runs.paths import recordings_directory
from app.runs.run_filter import RunFilter
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
    columns = _columns(options.columns)
    with out.progress_bar("looking at new files", total=1.0) as update:
        found = list_runs(options.directory, wanted, progress=lambda done, count: update(done / count))
    found = _sorted(found, options.sort, options.reverse)
    if options.as_json:
        out.print_json([msgspec.to_builtins(run) | {"fault": str(run.fault)} for run in found])
    elif found:
        _print_runs(found, columns)
    elif wanted != RunFilter():
        out.print_line(f"No run in {folder} is of that kind. All runs: slipstand runs")
    else:
        out.print_line(f"No runs in {folder}. Record one, or try: slipstand demo")


def _columns(text: str | None) -> tuple[str, ...]:
    """Names of the columns that were asked for; empty for the usual ones. Raises CommandError."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip())) if text else ()
    for name in names:
        if name not in RUN_COLUMNS:
            raise CommandError(f"--columns {name!r} is not known. Use {alternatives(RUN_COLUMNS)}")
    return names


def _sorted(found: list[RunSummary], column: str | None, reverse: bool) -> list[RunSummary]:
    """Runs in the order of a column, as listed where it is the same; those without a value last."""
    if column is None:
        return found[::-1] if reverse else found
    key = _SORT_KEYS.get(column, _CELLS[column])
    known = [run for run in found if _is_known(key(run))]
    unknown = [run for run in found if not _is_known(key(run))]
    return [*sorted(known, key=lambda run: cast("Any", key(run)), reverse=reverse), *unknown]


def _is_known(value: object) -> bool:
    return value is not None and value != ""


def _print_runs(found: list[RunSummary], columns: tuple[str, ...]) -> None:
    """Write a line a run. Without a choice of columns, those of which all cells are empty are left out."""
    cells = {name: [_CELLS[name](run) for run in found] for name in columns or _USUAL}
    shown = columns or [name for name in _USUAL if name not in _IF_ANY or any(cells[name])]
    out.print_table(tuple(shown), list(zip(*(cells[name] for name in shown), strict=True)))


def _day(option: str, text: str | None) -> datetime.date | None:
    try:
        return datetime.date.fromisoformat(text) if text else None
    except ValueError:
        raise CommandError(f"{option} {text!r} is not a day. Write it like 2026-11-21") from None


def _path_text(run: RunSummary) -> str:
    """Path of a run, relative to the present folder if it is below it: so it can be given to a command."""
    path = Path(run.path)
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else run.path


def _ended_text(run: RunSummary) -> str:
    return "" if run.fault else run.ended or "unfinished: slipstand recover"


def _begun_text(run: RunSummary) -> str:
    return run.start_time.astimezone().strftime("%Y-%m-%d %H:%M:%S") if run.start_time else ""


def _value_text(name: str, value: float | None, uncertainty: float | None) -> str:
    if value is None:
        return ""
    unit = definition(name).unit_at(Place.TERMINAL)
    return str(format_value(value * unit.scale, uncertainty and uncertainty * unit.scale, unit.symbol))


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


_CELLS: Final[dict[str, Callable[[RunSummary], str]]] = {
    "run": _path_text,
    "series": lambda run: run.series or "",
    "begun": _begun_text,
    "seconds": lambda run: "" if run.fault else f"{run.duration_s:.1f}",
    "ended": _ended_text,
    "source": lambda run: run.source or "",
    "f_d": _friction_text,
    "T": lambda run: _value_text("period_s", run.period_s, run.period_uncertainty_s),
    "n1": lambda run: _value_text("damping_n1_per_s", run.damping_n1_per_s, run.damping_n1_uncertainty_per_s),
    "operator": lambda run: run.operator,
    "plate": lambda run: "" if run.plate_mass_kg is None else f"{run.plate_mass_kg:g} kg",
    "note": lambda run: " ".join(run.note.split()),
    "fault": lambda run: str(run.fault),
    "conditions": lambda run: run.conditions.as_text(),
}
"""Text of each column of a run."""

_SORT_KEYS: Final[dict[str, Callable[[RunSummary], object]]] = {
    "begun": lambda run: run.start_time,
    "seconds": lambda run: None if run.fault else run.duration_s,
    "f_d": lambda run: run.friction_dynamic,
    "T": lambda run: run.period_s,
    "n1": lambda run: run.damping_n1_per_s,
    "plate": lambda run: run.plate_mass_kg,
}
"""What a column is sorted by, where not by its text."""

_USUAL: Final = ("run", "series", "begun", "seconds", "ended", "source", "f_d", "conditions", "fault")
_IF_ANY: Final = ("fault", "conditions")


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
