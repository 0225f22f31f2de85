"""Tasks of the Runs screen, executed in its worker processes."""

import contextlib
import itertools
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import convert

from analysis.catalogue import displacement_unit, reading_units_on_screen
from analysis.formatting import with_unit
from analysis.record import AnalysisError
from app.presenters.base import Progress, ReportProgress, batch_progress
from app.presenters.conditions import parse_conditions
from app.presenters.number_text import format_fixed
from app.presenters.results import sentence
from app.presenters.runs.import_form import (
    FIELDS,
    GAIN,
    OPTION_LABELS,
    PER_FILE_FIELDS,
    Form,
    parse_pairs,
    parse_time,
)
from app.presenters.runs.state import (
    ANALYSING,
    BatchOutcome,
    ImportOutcome,
    ImportPreview,
    Overlay,
    RunAnalysed,
    SizeQuestion,
    Span,
    Trace,
)
from app.runs.batch.executors import ExecutorOptions, open_executor
from app.runs.batch.tasks import AnalysisOutcome, AnalysisTask, analyze_runs
from app.runs.decimation import DecimatedRun, decimate, open_decimated
from app.runs.edits import edit_run, series_fields
from app.runs.errors import ImportFileError, RunError
from app.runs.exchange import import_run, importing, recognition, sizes, storing
from app.runs.exchange.exporting import ExportRequest, export_runs
from app.runs.exchange.reading_process import shared_reading_process
from app.runs.listing import list_runs
from app.runs.lock import is_being_recorded
from app.runs.reader import open_run
from app.runs.summary import RunSummary
from app.runs.validator import shared_validator
from config.files import load_gauges, load_stand
from config.schema import ConfigError, SeriesError
from messages.i18n import N_, gettext, ngettext, translate
from messages.message import Message, MessageError, message, replace_options

MAX_OVERLAID_RUNS = 8  # more curves over one another cannot be told apart by eye
_DRAWN_SPANS = 1500  # extremes are kept for so many intervals of time: at least one a pixel of the preview
_BEFORE_RELEASE_S = 1.0  # drawn part of the hold before the release
_TEXT_SUFFIXES = {".csv", ".json", ".latex", ".uff58"}
_SYMBOLS = {"um": "µm"}
_PREVIEW_LINES, _PREVIEW_WIDTH = 12, 160
"""What fits into the preview of the export dialog."""


def list_folder(folder: str, in_trash: bool, report: ReportProgress) -> tuple[RunSummary, ...]:
    """Runs of a folder, or with `in_trash` those in its trash; without what is being recorded."""
    path = Path(folder)
    if not path.exists():  # the recordings folder is made by the first run
        return ()
    text = gettext("Looking at new files")

    def on_progress(done: int, count: int) -> None:
        report(Progress(text, done / count))

    runs = list_runs(path, progress=on_progress, in_trash=in_trash)
    return tuple(run for run in runs if not (run.fault and is_being_recorded(Path(run.path))))


def change_runs(
    paths: tuple[str, ...],
    change: Callable[..., object],
    arguments: tuple[Any, ...],
    what: str,
    report: ReportProgress,
) -> BatchOutcome:
    """Call `change(path, *arguments)` for every run; one that fails does not stop the rest.

    `change` returns where a moved run is now. `what` is shown with the name of each run.
    """
    done, faults = [], []
    for number, path in enumerate(map(Path, paths)):
        report(Progress(f"{what} {path.name}", number / len(paths)))
        try:
            moved = change(path, *arguments)
        except (RunError, AnalysisError, ConfigError, ValueError) as error:
            reason = error.message if isinstance(error, MessageError) else str(error)
            faults.append(f"{path.name}: {translate(reason)}")
        else:
            done.append(str(moved if isinstance(moved, Path) else path))
    return BatchOutcome(tuple(done), tuple(faults))


def edit(path: Path, field: str, value: Any, author: str) -> None:
    """Set a field of `RunMetadata`; a series also sets its pullback and plate mass."""
    fields = {field: value}
    if field == "series":
        fields = series_fields(open_run(path).metadata.stand, value)
    edit_run(path, author, **fields)


def export_files(
    paths: tuple[str, ...], output: str, choice: dict[str, Any], report: ReportProgress
) -> BatchOutcome:
    """Export runs; `choice` has the fields of `ExportRequest`."""
    outcomes = export_runs(
        [Path(path) for path in paths],
        Path(output),
        convert(choice, ExportRequest),
        progress=lambda done, name: report(
            Progress(gettext("Exporting {name}", name=name), done / len(paths))
        ),
    )
    failed = [outcome for outcome in outcomes if outcome.error]
    return BatchOutcome(
        tuple(file for outcome in outcomes for file in outcome.files),
        tuple(f"{Path(outcome.run).name}: {translate(outcome.error)}" for outcome in failed),
    )


def preview_export(path: str, choice: dict[str, Any]) -> str:
    """Export a run into a temporary folder; names and sizes of the files, and first lines of text files."""
    with tempfile.TemporaryDirectory(prefix="slipstand-") as folder:
        output = f"{Path(folder) / Path(path).stem}.{choice['format']}"
        outcome = export_files((path,), output, choice, lambda _progress: None)
        parts = [_first_lines(Path(file)) for file in outcome.done]
    return "\n\n".join([*parts, *outcome.faults])


def _first_lines(path: Path) -> str:
    size = with_unit(f"{path.stat().st_size / 1e3:.0f}", "kB")
    if path.suffix not in _TEXT_SUFFIXES:
        return f"{path.name}, {size}"
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line.rstrip("\n")[:_PREVIEW_WIDTH] for line in itertools.islice(file, _PREVIEW_LINES)]
    return "\n".join([f"{path.name}, {size}", *lines])


def load_overlay(paths: tuple[str, ...]) -> Overlay:
    """Read and decimate runs, aligned at their releases; say which could not be read."""
    overviews, faults = [], []
    options: dict[str, Any] = {"between_s": (-_BEFORE_RELEASE_S, math.inf), "validator": shared_validator()}
    for path in paths[:MAX_OVERLAID_RUNS]:
        try:
            overviews.append(open_decimated(path, _DRAWN_SPANS, **options))
        except RunError as error:
            faults.append(translate(error.message))
    if len(paths) > MAX_OVERLAID_RUNS:
        template = N_("The first {shown} of {all} selected runs are drawn")
        faults.append(gettext(template, shown=MAX_OVERLAID_RUNS, all=len(paths)))
    units = {overview.unit for overview in overviews}
    unit = units.pop() if len(units) == 1 else gettext("mixed units")
    aligned = all(overview.release_s is not None for overview in overviews)
    return Overlay(
        traces=tuple(_run_trace(overview) for overview in overviews),
        time_label=gettext("time from release, s") if aligned else gettext("time, s"),
        unit=reading_units_on_screen(unit)[0].symbol,
        message=". ".join(faults),
    )


def load_part(paths: tuple[str, ...], span: Span, pixels: int) -> tuple[Trace, ...]:
    """Read the part of runs that is in view, as finely as it is drawn; unreadable ones are absent."""
    traces = []
    for path in paths[:MAX_OVERLAID_RUNS]:
        with contextlib.suppress(RunError):
            run = open_decimated(path, 2 * pixels, between_s=span, validator=shared_validator())
            traces.append(_run_trace(run))
    return tuple(traces)


def _run_trace(overview: DecimatedRun) -> Trace:
    scale = reading_units_on_screen(overview.unit)[0].scale
    table, *others = (scale * readings for readings in overview.readings)
    time_s = overview.time_s - (overview.release_s or 0.0)
    return Trace(overview.path.stem, time_s, table, others[0] if others else None, str(overview.path))


def preview_import(path: str, form: Form, report: ReportProgress) -> ImportPreview:
    """Read a file as it would be imported; `form` is valid, also below."""
    plan = import_plan(form)
    unit, scale = form["unit_name"].strip() or "m", 1.0
    if unit == "m" and form["quantity"] == "displacement":
        unit, scale = displacement_unit().symbol, displacement_unit().scale
    with shared_reading_process().read(Path(path), plan, _reading(path, report)) as record:
        storing.check_length(Path(path), record)
        trace = _imported_trace(Path(path).stem, record, plan.measures, scale)
        told = [_record_summary(record), *map(_in_window, record.facts.notes)]
        unlikely = None if plan.any_size else sizes.unlikely_size(record, plan, load_gauges())
    question = None if unlikely is None else _size_question(unlikely)
    return ImportPreview(Overlay((trace,), gettext("time, s"), unit), ". ".join(told), question)


def _size_question(unlikely: sizes.UnlikelySize) -> SizeQuestion:
    if unlikely.unit is None:
        template, unit = N_("{fault}. Is that right?"), ""
    else:
        template, unit = N_("{fault}. Is the file in {unit}?"), _SYMBOLS.get(unlikely.unit, unlikely.unit)
    asked = message(template, fault=unlikely.fault, unit=unit)
    return SizeQuestion(sentence(asked), unlikely.unit or "", unit)


def _reading(path: str, report: ReportProgress) -> Callable[[float], object]:
    """What reports the share of a file that is read."""
    text = gettext("Reading {name}", name=Path(path).name)
    return lambda share: report(Progress(text, share))


def _record_summary(record: importing.ForeignRecord) -> str:
    rate_hz, start = record.facts.rate_hz, record.facts.start
    rate = gettext("uneven times") if rate_hz is None else with_unit(f"{rate_hz:.6g}", "Hz")
    length = with_unit(format_fixed(float(record.time_s[-1]), 3), "s")
    begun = gettext("begun {start}", start=f"{start.astimezone():%Y-%m-%d %H:%M:%S}") if start else ""
    count = ngettext("{count} sample", "{count} samples", len(record))
    return ", ".join(filter(None, (count, length, rate, begun or gettext("date not known"))))


def _imported_trace(name: str, record: importing.ForeignRecord, measures: str, scale: float) -> Trace:
    readings = [
        scale * gauge.gain_m_per_count * (cells - gauge.zero_count)
        for gauge, cells in zip(record.facts.gauges, record.cells, strict=True)
    ]
    if len(readings) > 1 and measures == "plate":
        readings[1] = readings[1] - readings[0]
    time_s, *traces = decimate((np.array(record.time_s), *readings), _DRAWN_SPANS)
    return Trace(name, time_s, traces[0], traces[1] if len(traces) > 1 else None)


def import_file(path: str, form: Form, folder: str, report: ReportProgress) -> str:
    """Import a file as a run, under a free name in the folder; its path."""
    return _import(path, form, folder, report).run


def _import(path: str, form: Form, folder: str, report: ReportProgress) -> import_run.ImportedRun:
    stem = form["name"].strip().removesuffix(".h5") or Path(path).stem
    target = import_run.free_path(Path(folder), stem)
    text = gettext("Importing {name}", name=Path(path).name)
    metadata: dict[str, Any] = {
        "series": form["series"].strip() or None,
        "plate_mass_kg": FIELDS["plate_mass_kg"].parse(form),
        "table_mass_kg": FIELDS["table_mass_kg"].parse(form),
        "operator": form["operator"].strip(),
        "note": form["note"].strip(),
        "conditions": parse_conditions(form, dict(parse_pairs(form["other"]))),
    }
    try:
        return import_run.import_foreign_file(
            Path(path), import_plan(form), target, load_stand(), gauges=load_gauges(),
            report=lambda share: report(Progress(text, share)), **metadata,
        )  # fmt: skip
    except SeriesError as error:
        raise RunError("{reason}", reason=error, field="series") from None


def import_files(paths: tuple[str, ...], form: Form, folder: str, report: ReportProgress) -> ImportOutcome:
    """Import files alike; what is stated of one test holds for the first. A fault stops no other file."""
    layout = _survey(paths[0], form, lambda _: None).preview
    runs: list[import_run.ImportedRun] = []
    faults: list[str] = []
    for number, path in enumerate(paths):

        def on_progress(progress: Progress, done: int = number) -> None:
            report(Progress(progress.text, (done + (progress.fraction or 0.0)) / len(paths)))

        try:
            if number:
                _check_layout(path, form, layout, paths[0])
            runs.append(_import(path, form, folder, on_progress))
        except (RunError, ConfigError) as error:
            faults.append(f"{Path(path).name}: {_in_window(error.message)}")
        form = {**form, **dict.fromkeys(PER_FILE_FIELDS, ""), "header": form["header"]}
    return ImportOutcome(tuple(run.run for run in runs), tuple(map(_result_row, runs)), tuple(faults))


def _check_layout(path: str, form: Form, layout: recognition.FilePreview | None, first: str) -> None:
    """Refuse a file with other columns or units than the first. Raises ImportFileError."""
    found = _survey(path, form, lambda _: None).preview
    if layout is not None and found is not None and not found.has_layout_of(layout):
        raise ImportFileError(
            "its columns or units are not those of {name}. Import it by itself", name=Path(first).name
        )


def _in_window(text: Message) -> str:
    return sentence(replace_options(text, OPTION_LABELS))


def _result_row(run: import_run.ImportedRun) -> str:
    """Name, length, rate, range of each gauge, and release of an imported run."""
    unit, _ = reading_units_on_screen(run.unit)
    ends = ((unit.scale * low, unit.scale * high) for low, high in run.ranges)
    ranges = (with_unit(f"{low:.4g} … {high:.4g}", unit.symbol) for low, high in ends)
    release = gettext("no release found")
    if run.release_s is not None:
        release = gettext("released at {time}", time=with_unit(format_fixed(run.release_s, 3), "s"))
    rate = gettext("uneven times") if run.rate_hz is None else with_unit(f"{run.rate_hz:.6g}", "Hz")
    length = with_unit(format_fixed(run.duration_s, 3), "s")
    return "   ".join((Path(run.run).stem, length, rate, *ranges, release))


def survey_file(path: str, form: Form, report: ReportProgress) -> recognition.FileSurvey:
    """Read the columns and first lines of a file."""
    return _survey(path, form, _reading(path, report))


def _survey(path: str, form: Form, report: Callable[[float], object]) -> recognition.FileSurvey:
    options = {name: form[name] or None for name in ("delimiter", "decimal", "encoding")}
    request = convert(options | _lines(form), recognition.ParseOptions)
    return shared_reading_process().survey(Path(path), request, report)


def import_plan(form: Form) -> importing.ImportPlan:
    """Request for the import, as `slipstand import` makes it."""
    number = {name: field.parse(form) for name, field in FIELDS.items() if field.rule}
    unit: dict[str, Any] = {"unit": form["unit"] or None}
    if form["unit"] == GAIN:
        unit = {
            "gain": number["gain"] or 1.0,
            "offset": number["offset"] or 0.0,
            "unit_name": form["unit_name"].strip() or None,
        }
    lines = _lines(form)
    layout = {
        "time": form["time"],
        "table": form["table"],
        "second": form["second"] or None,
        "delimiter": form["delimiter"] or None,
        "decimal": form["decimal"] or None,
        "skip": lines["skip"],
        "header": lines["header"] is not False,
        "rate_hz": number["rate"],
        "date": (form["time"] and form["date"]) or None,
        "date_order": form["date_order"] or None,
        "encoding": form["encoding"] or None,
        "missing": tuple(filter(None, map(str.strip, form["missing"].split(";")))),
    }
    request = {
        "layout": layout,
        **unit,
        **{name: form[name] for name in ("measures", "quantity")},
        "time_unit": form["time_unit"] or None,
        "begun": parse_time(form["begun"]),
        "any_size": bool(form["any_size"]),
        **{name: number[name] for name in ("gain_uncertainty", "from_s", "until_s", "segment")},
    }
    return convert(request, importing.ImportPlan)


def _lines(form: Form) -> dict[str, Any]:
    return {"skip": FIELDS["skip"].parse(form) or 0, "header": {"yes": True, "no": False}.get(form["header"])}


def analyse_runs(paths: tuple[str, ...], reanalyse: bool, report: Callable[[Any], None]) -> None:
    """Analyse runs in parallel and save the results; report each as `RunAnalysed` when it is done.

    With `reanalyse` also those that are up to date.
    """
    on_progress = batch_progress(report, ANALYSING, paths)
    on_progress(0.0, "")
    tasks = [AnalysisTask(path, save=True, force=reanalyse) for path in paths]
    with open_executor(ExecutorOptions(), len(tasks)) as executor:
        for path, outcome in zip(paths, analyze_runs(tasks, executor, on_progress), strict=True):
            report(RunAnalysed(path, outcome.up_to_date, _analysis_fault(path, outcome)))


def _analysis_fault(path: str, outcome: AnalysisOutcome) -> str:
    if outcome.document is not None:
        return ""
    name = Path(path).name
    said = translate(outcome.error).replace(outcome.run, name)
    return said if name in said else f"{name}: {said}"
