"""Tasks of the Runs screen, executed in its worker processes."""

import itertools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from msgspec import convert

from analysis.formatting import with_unit
from analysis.record import AnalysisError
from app.presenters.base import Progress, ReportProgress, batch_progress
from app.presenters.conditions import parse_conditions
from app.presenters.number_text import format_fixed, parse_number
from app.presenters.runs.import_form import GAIN, NUMBER_FIELDS, ImportForm, TextFormat, parse_pairs
from app.presenters.runs.state import Overlay, Trace
from app.presenters.runs.tasks import (
    ANALYSING,
    AnalyseRuns,
    BatchOutcome,
    CopyRuns,
    EditRuns,
    ExportPreview,
    ExportRuns,
    ImportFile,
    ImportPreview,
    ListRuns,
    LoadOverlay,
    PreviewExport,
    PreviewImport,
    RestoreRuns,
    RunAnalysed,
    RunsTask,
    SurveyFile,
    TrashRuns,
    UndoEdits,
)
from app.runs.batch.executors import ExecutorOptions, open_executor
from app.runs.batch.tasks import AnalysisOutcome, AnalysisTask, analyze_runs
from app.runs.blocks import RunBlock
from app.runs.decimation import DecimatedRun, decimate, open_decimated
from app.runs.edits import edit_run, series_fields, undo_edit
from app.runs.errors import RunError
from app.runs.exchange.exporting import ExportRequest, export_runs
from app.runs.exchange.importing import (
    CsvImport,
    ParseOptions,
    even_rate_hz,
    import_csv,
    preview_file,
    read_record,
)
from app.runs.file_operations import copy_run_into, move_to_trash, restore_from_trash
from app.runs.listing import list_runs
from app.runs.reader import open_run
from app.runs.summary import RunSummary
from app.runs.validator import shared_validator
from config.files import load_stand
from config.schema import ConfigError, SeriesError
from messages.i18n import gettext, ngettext, translate

MAX_OVERLAID_RUNS = 8
"""More curves over one another cannot be told apart by eye."""
_DRAWN_SPANS = 1500
"""Extremes are kept for so many intervals of time: at least one a pixel of the preview."""
_BEFORE_RELEASE_S = 1.0
"""Drawn part of the hold before the release."""
_TEXT_SUFFIXES = {".csv", ".json", ".latex", ".uff58"}
_PREVIEW_LINES, _PREVIEW_WIDTH = 12, 160
"""What fits into the preview of the export dialog."""


def execute(task: RunsTask, report: ReportProgress) -> Any:
    """Execute a task. Raises RunError, ConfigError where nothing of it can be done."""
    match task:
        case ListRuns(folder):
            return _list(folder, report)
        case LoadOverlay(paths):
            return load_overlay(paths)
        case EditRuns(paths):
            return _each(paths, lambda path: _edit(path, task), report, gettext("Editing"))
        case UndoEdits(paths, author, field):
            return _each(paths, lambda path: _undo(path, author, field), report, gettext("Undoing"))
        case TrashRuns(paths):
            return _each(paths, move_to_trash, report, gettext("Moving to the trash"))
        case RestoreRuns(paths):
            return _each(paths, restore_from_trash, report, gettext("Bringing back"))
        case CopyRuns(paths, folder):
            return _each(paths, lambda path: copy_run_into(path, Path(folder)), report, gettext("Copying"))
        case ExportRuns():
            return _export_runs(task, report)
        case PreviewExport():
            return _preview_export(task)
        case SurveyFile(path, text_format):
            return preview_file(Path(path), survey_options(text_format))
        case PreviewImport(path, form):
            return _preview_import(Path(path), form)
        case ImportFile():
            return _import_file(task)


def _list(folder: str, report: ReportProgress) -> tuple[RunSummary, ...]:
    path = Path(folder)
    if not path.exists():  # the recordings folder is made by the first run
        return ()
    return tuple(
        list_runs(
            path, progress=lambda done, count: report(Progress(gettext("Looking at new files"), done / count))
        )
    )


def _each(
    paths: tuple[str, ...], act: Callable[[Path], Path], report: ReportProgress, what: str
) -> BatchOutcome:
    """Process every run; one that fails does not stop the rest."""
    done, faults = [], []
    for number, path in enumerate(paths):
        report(Progress(f"{what} {Path(path).name}", number / len(paths)))
        try:
            done.append(str(act(Path(path))))
        except (RunError, AnalysisError, ConfigError, ValueError) as error:
            faults.append(f"{Path(path).name}: {error}")
    return BatchOutcome(tuple(done), tuple(faults))


def _undo(path: Path, author: str, field: str) -> Path:
    undo_edit(path, author, (field,))
    return path


def _edit(path: Path, task: EditRuns) -> Path:
    fields = {task.field: task.value}
    if task.field == "series":
        fields = series_fields(open_run(path).metadata.stand, task.value)
    edit_run(path, task.author, **fields)
    return path


def _export_runs(task: ExportRuns, report: ReportProgress) -> BatchOutcome:
    request = convert(
        {"format": task.format, "content": task.content, "replace": task.replace}, ExportRequest
    )
    outcomes = export_runs(
        [Path(path) for path in task.paths],
        Path(task.output),
        request,
        progress=lambda done, name: report(
            Progress(gettext("Exporting {name}", name=name), done / len(task.paths))
        ),
    )
    return BatchOutcome(
        tuple(file for outcome in outcomes for file in outcome.files),
        tuple(f"{Path(outcome.run).name}: {outcome.error}" for outcome in outcomes if outcome.error),
    )


def _preview_export(task: PreviewExport) -> ExportPreview:
    """Export the run into a temporary folder, and read the first lines of each file."""
    with tempfile.TemporaryDirectory(prefix="slipstand-") as folder:
        output = Path(folder) / Path(task.path).stem
        outcome = _export_runs(
            ExportRuns((task.path,), f"{output}.{task.format}", task.format, task.content, replace=True),
            lambda _progress: None,
        )
        parts = [_first_lines(Path(file)) for file in outcome.done]
    return ExportPreview("\n\n".join([*parts, *outcome.faults]))


def _first_lines(path: Path) -> str:
    size = f"{path.stat().st_size / 1e3:,.0f} kB"
    if path.suffix not in _TEXT_SUFFIXES:
        return f"{path.name}, {size}"
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line.rstrip("\n")[:_PREVIEW_WIDTH] for line in itertools.islice(file, _PREVIEW_LINES)]
    return "\n".join([f"{path.name}, {size}", *lines])


def load_overlay(paths: tuple[str, ...]) -> Overlay:
    """Read and decimate runs, aligned at their releases; say which could not be read."""
    overviews, faults = [], []
    for path in paths[:MAX_OVERLAID_RUNS]:
        try:
            overviews.append(
                open_decimated(
                    path, _DRAWN_SPANS, before_release_s=_BEFORE_RELEASE_S, validator=shared_validator()
                )
            )
        except RunError as error:
            faults.append(str(error))
    if len(paths) > MAX_OVERLAID_RUNS:
        faults.append(
            gettext(
                "The first {shown} of {all} selected runs are drawn", shown=MAX_OVERLAID_RUNS, all=len(paths)
            )
        )
    units = {overview.unit for overview in overviews}
    unit = units.pop() if len(units) == 1 else gettext("mixed units")
    aligned = all(overview.release_s is not None for overview in overviews)
    return Overlay(
        traces=tuple(_run_trace(overview) for overview in overviews),
        time_label=gettext("time from release, s") if aligned else gettext("time, s"),
        unit="mm" if unit == "m" else unit,
        message=". ".join(faults),
    )


def _run_trace(overview: DecimatedRun) -> Trace:
    scale = 1e3 if overview.unit == "m" else 1.0
    table, *others = (scale * readings for readings in overview.readings)
    time_s = overview.time_s - (overview.release_s or 0.0)
    return Trace(overview.path.stem, time_s, table, others[0] if others else None)


def _preview_import(path: Path, form: ImportForm) -> ImportPreview:
    plan = csv_import(form)
    _, _, block = read_record(path, plan)
    rate_hz = even_rate_hz(block.time_s)
    rate = gettext("uneven times") if rate_hz is None else with_unit(f"{rate_hz:.6g}", "Hz")
    length = with_unit(format_fixed(float(block.time_s[-1]), 3), "s")
    summary = ngettext("{count} sample", "{count} samples", len(block)) + f", {length}, {rate}"
    unit, scale = form.unit_name.strip() or "m", 1.0
    if unit == "m" and form.quantity == "displacement":
        unit, scale = "mm", 1e3
    return ImportPreview(
        Overlay((_imported_trace(path, block, plan.measures, scale),), gettext("time, s"), unit), summary
    )


def _imported_trace(path: Path, block: RunBlock, measures: str, scale: float) -> Trace:
    table = scale * block.readings[:, 0]
    columns = [block.time_s, table]
    if block.readings.shape[1] > 1:
        second = scale * block.readings[:, 1]
        columns.append(second - table if measures == "plate" else second)
    time_s, *traces = decimate(tuple(columns), _DRAWN_SPANS)
    return Trace(path.stem, time_s, traces[0], traces[1] if len(traces) > 1 else None)


def _import_file(task: ImportFile) -> str:
    form, path = task.form, Path(task.path)
    target = _free_path(Path(task.folder), form.name.strip().removesuffix(".h5") or path.stem)
    stand = load_stand()
    try:
        return str(import_csv(path, csv_import(form), target, stand, **_run_metadata(form)).path)
    except SeriesError as error:
        raise RunError("{reason}", reason=error, field="series") from None


def _free_path(folder: Path, stem: str) -> Path:
    path, number = folder / f"{stem}.h5", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.h5"
    return path


def survey_options(text_format: TextFormat) -> ParseOptions:
    """Options of `preview_file`; `text_format` is valid."""
    lines = {
        "delimiter": text_format.delimiter or None,
        "decimal": text_format.decimal or None,
        "skip": int(parse_number(text_format.skip) or 0),
        "header": {"yes": True, "no": False}.get(text_format.header),
    }
    return convert(lines, ParseOptions)


def csv_import(form: ImportForm) -> CsvImport:
    """Request for the import, as `slipstand import` makes it; `form` is valid."""
    lines, is_gain = survey_options(form.text_format), form.unit == GAIN
    number = {name: parse_number(getattr(form, name)) for name in NUMBER_FIELDS}
    segment = number["segment"]
    return convert(
        {
            "layout": {
                "time": form.time, "table": form.table, "second": form.second or None,
                "delimiter": lines.delimiter, "decimal": lines.decimal or ".", "skip": lines.skip,
                "header": lines.header is not False,
            },
            "measures": form.measures, "time_unit": form.time_unit, "quantity": form.quantity,
            "unit": None if is_gain else form.unit,
            "gain": (number["gain"] or 1.0) if is_gain else None,
            "offset": (number["offset"] or 0.0) if is_gain else 0.0,
            "unit_name": (form.unit_name.strip() or None) if is_gain else None,
            "gain_uncertainty": number["gain_uncertainty"],
            "from_s": number["from_s"], "until_s": number["until_s"],
            "segment": None if segment is None else int(segment),
        },
        CsvImport,
    )  # fmt: skip


def _run_metadata(form: ImportForm) -> dict[str, Any]:
    """Metadata of the run, as `import_csv` takes them; `form` is valid."""
    return {
        "series": form.series.strip() or None,
        "plate_mass_kg": parse_number(form.plate_mass_kg),
        "table_mass_kg": parse_number(form.table_mass_kg),
        "operator": form.operator.strip(),
        "note": form.note.strip(),
        "conditions": parse_conditions(form, dict(parse_pairs(form.other))),
    }


def analyse_runs(task: AnalyseRuns, report: ReportProgress) -> None:
    """Analyse runs in parallel; report each as `RunAnalysed` when it is done."""
    tell = batch_progress(report, ANALYSING, task.paths)
    tell(0.0, "")
    tasks = [AnalysisTask(path, save=True, force=task.reanalyse) for path in task.paths]
    with open_executor(ExecutorOptions(), len(tasks)) as crew:
        for path, outcome in zip(task.paths, analyze_runs(tasks, crew, tell), strict=True):
            report(RunAnalysed("", None, path, outcome.up_to_date, _analysis_fault(path, outcome)))


def _analysis_fault(path: str, outcome: AnalysisOutcome) -> str:
    if outcome.document is not None:
        return ""
    name = Path(path).name
    said = translate(outcome.error).replace(outcome.run, name)
    return said if name in said else f"{name}: {said}"
