"""`slipstand import`: records made by other programs become runs."""

import datetime
import glob
from pathlib import Path
from typing import Any

import msgspec
import typer

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.option_values import checked_conditions, print_mass_overrides
from app.cli.run_file_options import FileOptions, ImportOptions, WatchOptions
from app.runs.errors import RunError
from app.runs.exchange.import_run import ImportedRun, free_path, import_foreign_file
from app.runs.exchange.importing import ImportPlan
from config.files import load_gauges, load_stand

_HEADER = ("run", "length", "rate", "gauge 1", "gauge 2", "release")


def import_record(options: ImportOptions) -> None:
    files, plan = _files(options.files), import_plan(options.source)
    metadata = import_metadata(options)
    if len(files) == 1 and not options.output.expanduser().is_dir():
        _import_one(files[0], plan, options, metadata)
    else:
        _import_many(files, plan, options, metadata)


def import_metadata(options: ImportOptions | WatchOptions) -> dict[str, Any]:
    """What is stated of the runs. Raises CommandError."""
    return {
        "series": options.masses.series,
        "plate_mass_kg": options.masses.plate_mass,
        "table_mass_kg": options.masses.table_mass,
        "operator": options.operator,
        "note": options.note,
        "conditions": checked_conditions(options.conditions),
    }


def _import_one(file: Path, plan: ImportPlan, options: ImportOptions, metadata: dict[str, Any]) -> None:
    if options.output.suffix != ".h5":
        raise CommandError(f"-o {options.output.name} does not end in .h5, as run files do. Rename it")
    output = out.output_file(options.output, options.force)
    run = _import(file, plan, output, options.force, metadata)
    print_mass_overrides(options.masses)
    _print_notes(run)
    if options.as_json:
        out.print_json(import_document(run))
    else:
        out.print_line(
            f"{run.run}: {run.samples} samples, {', '.join(filter(None, import_summary(run)[1:]))}"
        )


def _import_many(
    files: list[Path], plan: ImportPlan, options: ImportOptions, metadata: dict[str, Any]
) -> None:
    """Import files into a folder; one that fails does not stop the rest."""
    folder = _folder(options.output)
    print_mass_overrides(options.masses)
    runs: list[ImportedRun] = []
    documents: list[dict[str, Any]] = []
    for file in files:
        try:
            output = folder / f"{file.stem}.h5" if options.force else free_path(folder, file.stem)
            run = _import(file, plan, output, options.force, metadata)
        except RunError as error:
            out.print_status(f"error: {error}")
            documents.append({"file": str(file), "error": str(error)})
        else:
            _print_notes(run)
            runs.append(run)
            documents.append(import_document(run))
    if options.as_json:
        out.print_json(documents)
    elif runs:
        out.print_table(_HEADER, [import_summary(run) for run in runs])
    if len(runs) < len(files):
        raise typer.Exit(1)


def _import(
    file: Path, plan: ImportPlan, output: Path, replace: bool, metadata: dict[str, Any]
) -> ImportedRun:
    with out.progress_bar(f"reading {file.name}", total=1.0) as update:
        return import_foreign_file(
            file, plan, output, load_stand(), gauges=load_gauges(), replace=replace, report=update, **metadata
        )


def _files(given: list[Path]) -> list[Path]:
    """Files of which some may be given as patterns, as Windows hands them on. Raises CommandError."""
    files: list[Path] = []
    for one in given:
        path = one.expanduser()
        found = [] if path.exists() else sorted(glob.glob(str(path)))  # noqa: PTH207 - a pattern with its folder
        if glob.has_magic(str(path)) and not found and not path.exists():
            raise CommandError(f"{path}: there is no such file. Give paths of files")
        files += map(Path, found) if found else [path]
    return list(dict.fromkeys(files))


def _folder(path: Path) -> Path:
    """Folder for the runs of several files, made if it is not there. Raises CommandError."""
    folder = path.expanduser().absolute()
    if folder.suffix == ".h5" or (folder.exists() and not folder.is_dir()):
        raise CommandError(f"-o {path}: several files become several runs. Give a folder")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _print_notes(run: ImportedRun) -> None:
    for note in run.notes:
        out.print_status(f"note: {Path(run.file).name}: {note}")


def import_document(run: ImportedRun) -> dict[str, Any]:
    names = ("table_range", "relative_range")
    return {
        "run": run.run,
        "samples": run.samples,
        "file": run.file,
        "duration_s": run.duration_s,
        "rate_hz": run.rate_hz,
        "start_time": run.start_time and run.start_time.isoformat(),
        **dict(zip(names, map(list, run.ranges), strict=False)),
        "unit": run.unit,
        "release_s": run.release_s,
        "notes": [str(note) for note in run.notes],
    }


def import_summary(run: ImportedRun) -> tuple[str, ...]:
    """Name, length, rate, ranges and release."""
    scale, unit = (1e3, "mm") if run.unit == "m" else (1.0, run.unit)
    ranges = [f"{scale * low:.4g} to {scale * high:.4g} {unit}" for low, high in run.ranges]
    return (
        Path(run.run).name,
        f"{run.duration_s:.4g} s",
        "uneven times" if run.rate_hz is None else f"{run.rate_hz:.6g} Hz",
        *ranges,
        *[""] * (2 - len(ranges)),
        "no release found" if run.release_s is None else f"released at {run.release_s:.3f} s",
    )


def import_plan(source: FileOptions) -> ImportPlan:
    """How a file is read. Raises CommandError for options that do not fit together."""
    if source.relative is not None and source.plate is not None:
        raise CommandError("--relative and --plate are both gauge 2. Give one of them")
    if source.offset is not None and source.gain is None:
        raise CommandError(
            f"--offset {source.offset:g} goes with --gain, in whose unit it is. Give --gain too"
        )
    if source.skip < 0:
        raise CommandError(f"--skip {source.skip} lines cannot be left out. Give 0 or more")
    if source.date is not None and source.time is None:
        raise CommandError("--date goes with --time, the column of times of day. Give --time too")
    layout = {
        "time": source.time or "",
        "table": source.table,
        "second": source.plate if source.relative is None else source.relative,
        "delimiter": source.delimiter,
        "decimal": source.decimal,
        "skip": source.skip,
        "header": not source.no_header,
        "rate_hz": source.rate,
        "date": source.date,
        "date_order": source.date_order,
        "missing": tuple(source.missing or ()),
        "encoding": source.encoding,
    }
    same = ("unit", "gain", "unit_name", "gain_uncertainty", "quantity", "time_unit", "from_s", "until_s",
            "segment", "any_size")  # fmt: skip
    fields = {name: getattr(source, name) for name in same} | {
        "layout": layout,
        "measures": "relative" if source.plate is None else "plate",
        "offset": source.offset or 0.0,
        "begun": _begun(source.begun),
    }
    try:
        return msgspec.convert(fields, ImportPlan)
    except msgspec.ValidationError:
        raise CommandError("the options do not fit together. See slipstand import --help") from None


def _begun(text: str | None) -> datetime.datetime | None:
    if text is None:
        return None
    try:
        begun = datetime.datetime.fromisoformat(text.strip())
    except ValueError:
        raise CommandError(
            f"--begun {text!r} is no time. Give for example 2019-05-04T14:03:00, with +02:00 for a zone"
        ) from None
    return begun if begun.tzinfo else begun.astimezone()
