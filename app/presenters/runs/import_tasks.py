"""Work for the import dialog, done in the worker's process by the code of `slipstand import`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters import number_text
from app.presenters.runs.import_form import ImportForm, TextFormat, csv_import, run_metadata, survey_options
from app.presenters.runs.state import Overlay, Trace
from messages.i18n import gettext, ngettext

if TYPE_CHECKING:
    import numpy as np

    from app.runs.blocks import RunBlock

_DRAWN_SPANS = 1500


@dataclass(frozen=True, slots=True)
class SurveyFile:
    """Tell which columns there are."""

    path: str
    text_format: TextFormat = field(default_factory=TextFormat)


@dataclass(frozen=True, slots=True)
class PreviewImport:
    """Read the file as it would be imported."""

    path: str
    form: ImportForm


@dataclass(frozen=True, slots=True)
class ImportFile:
    """Make a run of the file, under a free name in the folder; the answer is its path."""

    path: str
    form: ImportForm
    folder: str


@dataclass(frozen=True, eq=False, slots=True)
class ImportPreview:
    """How the record would look: drawn, and in a line."""

    overlay: Overlay
    summary: str


ImportTask = SurveyFile | PreviewImport | ImportFile


def execute(task: ImportTask) -> Any:
    """Do a task. Raises RunError, ConfigError."""
    match task:
        case SurveyFile(path, reading):
            from app.runs.exchange.preview import preview_file

            return preview_file(Path(path), survey_options(reading))
        case PreviewImport(path, form):
            return _preview(Path(path), form)
        case ImportFile():
            return _import(task)


def _preview(path: Path, form: ImportForm) -> ImportPreview:
    from app.runs.exchange.importing import even_rate_hz, read_record

    plan = csv_import(form)
    _, _, block = read_record(path, plan)
    rate_hz = even_rate_hz(block.time_s)
    rate = gettext("uneven times") if rate_hz is None else number_text.with_unit(f"{rate_hz:.6g}", "Hz")
    length = number_text.with_unit(number_text.format_fixed(float(block.time_s[-1]), 3), "s")
    words = ngettext("{count} sample", "{count} samples", len(block)) + f", {length}, {rate}"
    unit, scale = form.unit_name.strip() or "m", 1.0
    if unit == "m" and form.quantity == "displacement":
        unit, scale = "mm", 1e3
    return ImportPreview(
        Overlay((_trace(path, block, plan.measures, scale),), gettext("time, s"), unit), words
    )


def _trace(path: Path, block: "RunBlock", measures: str, scale: float) -> Trace:
    from app.runs.decimation import decimate

    table: np.ndarray = scale * block.readings[:, 0]
    columns = [block.time_s, table]
    if block.readings.shape[1] > 1:
        second = scale * block.readings[:, 1]
        columns.append(second - table if measures == "plate" else second)
    time_s, *drawn = decimate(tuple(columns), _DRAWN_SPANS)
    return Trace(path.stem, time_s, drawn[0], drawn[1] if len(drawn) > 1 else None)


def _import(task: ImportFile) -> str:
    from app.runs.exchange.importing import import_csv
    from config.files import load_stand

    form, path = task.form, Path(task.path)
    place = _free_path(Path(task.folder), form.name.strip().removesuffix(".h5") or path.stem)
    return str(import_csv(path, csv_import(form), place, load_stand(), **run_metadata(form)).path)


def _free_path(folder: Path, stem: str) -> Path:
    path, number = folder / f"{stem}.h5", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.h5"
    return path
