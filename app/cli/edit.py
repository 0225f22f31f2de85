"""`slipstand edit`: facts of recorded runs, kept beside the old ones and undone as easily."""

import getpass
from pathlib import Path
from typing import Any

import msgspec

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.option_values import key_values
from app.cli.run_file_options import EditOptions
from app.runs.edits import edit_run, series_fields, undo_edit
from app.runs.metadata import Conditions
from app.runs.metadata_io import Change
from app.runs.reader import Run, open_run
from config.files import load_gauges
from config.schema import Gauges


def edit(options: EditOptions) -> None:
    given: dict[str, Any] = {
        "table_mass_kg": options.table_mass,
        "plate_mass_kg": options.plate_mass,
        "pullback_m": options.pullback,
        "series": options.series,
        "operator": options.operator,
        "title": options.title,
        "note": options.note,
        "gauges": _gauges(options.calibration),
        "excluded": _reason(options.exclude, include=options.include),
    }
    given = {name: value for name, value in given.items() if value is not None}
    if bool(given or options.condition) + options.undo + options.history != 1:
        raise CommandError("give either new values, --undo or --history. See slipstand edit --help")
    who = options.author or getpass.getuser()
    for path in options.runs:
        run = open_run(path.expanduser())
        if options.history:
            _print_history(run)
            continue
        change = (
            undo_edit(run.path, who)
            if options.undo
            else edit_run(run.path, who, **_fields_of_run(run, given, options.condition))
        )
        out.print_line(f"{run.path}: {', '.join(change.fields)} {'undone' if options.undo else 'changed'}")


def _reason(exclude: str | None, *, include: bool) -> str | None:
    """Why the run does not count; "" for one that counts again, None where nothing was said of it."""
    if exclude is None:
        return "" if include else None
    if include:
        raise CommandError("--exclude and --include contradict each other. Give one of them")
    if not exclude.strip():
        raise CommandError("--exclude needs a reason, which stands in table and report. Give one")
    return exclude.strip()


def _gauges(calibration: Path | None) -> Gauges | None:
    return None if calibration is None else load_gauges(calibration.expanduser())


def _fields_of_run(run: Run, given: dict[str, Any], condition: list[str] | None) -> dict[str, Any]:
    """Fields of one run: a series brings the pullback and plate mass of the run's own stand."""
    fields = dict(given)
    if "series" in given:
        fields |= series_fields(run.metadata.stand, given["series"])
        fields |= {name: given[name] for name in ("plate_mass_kg", "pullback_m") if name in given}
    if condition:
        fields["conditions"] = _conditions(run.metadata.conditions, condition)
    return fields


def _conditions(before: Conditions, pairs: list[str]) -> Conditions:
    """Conditions with some given anew; the others stay."""
    given = Conditions.parse(key_values(pairs, "--condition"))
    new = {name: value for name, value in msgspec.structs.asdict(given).items() if value not in (None, "")}
    return before.replace(**new | {"other": before.other | given.other})


def _print_history(run: Run) -> None:
    out.print_line(f"{run.path}: {len(run.changes)} {'edit' if len(run.changes) == 1 else 'edits'}")
    for count, change in enumerate(run.changes, start=1):
        out.print_line(
            f"  {count}  {change.date.astimezone():%Y-%m-%d %H:%M}  {change.author}  {_change_text(change)}"
        )


def _change_text(change: Change) -> str:
    told = ", ".join(
        f"{name} = {msgspec.json.encode(value).decode()}" for name, value in change.fields.items()
    )
    told = told if len(told) <= 200 else f"{told[:200]}..."
    return f"undoes edit {change.undoes + 1}: {told}" if change.undoes is not None else told
