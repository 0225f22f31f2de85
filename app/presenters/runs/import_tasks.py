"""Work for the import dialog, done in the worker's process by the code of `slipstand import`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters import numbers
from app.presenters.runs.state import Overlay, Trace
from app.presenters.words import tr, trn

if TYPE_CHECKING:
    import numpy as np

    from app.runs.importers import CsvImport
    from app.runs.layout import RunBlock

_DRAWN_SPANS = 1500
GAIN = "gain"
"""Unit of who gives a gain instead."""


@dataclass(frozen=True, slots=True)
class Reading:
    """How the lines of a text are read, as typed; empty finds it out."""

    delimiter: str = ""
    decimal: str = ""
    skip: str = ""
    header: str = ""
    """`yes` or `no`."""


@dataclass(frozen=True, slots=True)
class ImportForm:
    """What the operator has filled in, as typed. Columns as `Survey.columns` calls them."""

    reading: Reading = Reading()
    time: str = ""
    table: str = ""
    second: str = ""
    measures: str = "relative"
    time_unit: str = "s"
    unit: str = "m"
    gain: str = ""
    offset: str = ""
    unit_name: str = ""
    quantity: str = "displacement"
    from_s: str = ""
    until_s: str = ""
    segment: str = ""
    series: str = ""
    plate_mass_kg: str = ""
    table_mass_kg: str = ""
    operator: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class LookAtFile:
    """Tell which columns there are."""

    path: str
    reading: Reading = Reading()


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
    words: str


ImportTask = LookAtFile | PreviewImport | ImportFile


def do(task: ImportTask) -> Any:
    """Do a task. Raises RunError, ConfigError."""
    match task:
        case LookAtFile(path, reading):
            from app.runs.foreign_survey import survey

            return survey(Path(path), _told(reading))
        case PreviewImport(path, form):
            return _preview(Path(path), form)
        case ImportFile():
            return _import(task)


def _told(reading: Reading) -> Any:
    import msgspec

    from app.runs.foreign_survey import Told

    return msgspec.convert(
        {
            "delimiter": reading.delimiter or None,
            "decimal": reading.decimal or None,
            "skip": int(_number(reading.skip, tr("Lines skipped"), whole=True) or 0),
            "header": {"yes": True, "no": False}.get(reading.header),
        },
        Told,
    )


def _plan(form: ImportForm) -> "CsvImport":
    """What was filled in, as `slipstand import` takes it. Raises ImportFileError."""
    import msgspec

    from app.runs.importers import CsvImport

    told, is_gain = _told(form.reading), form.unit == GAIN
    layout = {
        "time": form.time, "table": form.table, "second": form.second or None, "delimiter": told.delimiter,
        "decimal": told.decimal or ".", "skip": told.skip, "header": told.header is not False,
    }  # fmt: skip
    segment = _number(form.segment, tr("Stretch"), whole=True)
    wanted = {
        "layout": layout, "measures": form.measures, "time_unit": form.time_unit, "quantity": form.quantity,
        "unit": None if is_gain else form.unit,
        "gain": (_number(form.gain, tr("Gain")) or 1.0) if is_gain else None,
        "offset": (_number(form.offset, tr("Offset")) or 0.0) if is_gain else 0.0,
        "unit_name": (form.unit_name.strip() or None) if is_gain else None,
        "from_s": _number(form.from_s, tr("From")), "until_s": _number(form.until_s, tr("Until")),
        "segment": None if segment is None else int(segment),
    }  # fmt: skip
    return msgspec.convert(wanted, CsvImport)


def _number(text: str, name: str, *, whole: bool = False) -> float | None:
    """Read a number as typed; None where nothing was. Raises ImportFileError."""
    from app.runs.errors import ImportFileError

    if not text.strip():
        return None
    try:
        value = float(text.strip().replace(",", ".").replace(numbers.MINUS, "-"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or (whole and (value < 0 or value != int(value))):
        kind = "whole number, 0 or above" if whole else "number"
        raise ImportFileError(f"{name} {text.strip()!r} is no {kind}. Write one, or leave it empty")
    return value


def _preview(path: Path, form: ImportForm) -> ImportPreview:
    from app.runs.importers import even_rate_hz, read_record

    plan = _plan(form)
    _, _, block = read_record(path, plan)
    rate_hz = even_rate_hz(block.time_s)
    rate = tr("uneven times") if rate_hz is None else numbers.with_unit(f"{rate_hz:.6g}", "Hz")
    length = numbers.with_unit(numbers.rounded(float(block.time_s[-1]), 3), "s")
    words = trn("{count} sample", "{count} samples", len(block)) + f", {length}, {rate}"
    unit, scale = form.unit_name.strip() or "m", 1.0
    if unit == "m" and form.quantity == "displacement":
        unit, scale = "mm", 1e3
    return ImportPreview(Overlay((_trace(path, block, plan.measures, scale),), tr("time, s"), unit), words)


def _trace(path: Path, block: "RunBlock", measures: str, scale: float) -> Trace:
    from app.runs.overview import condense

    table: np.ndarray = scale * block.readings[:, 0]
    columns = [block.time_s, table]
    if block.readings.shape[1] > 1:
        second = scale * block.readings[:, 1]
        columns.append(second - table if measures == "plate" else second)
    time_s, *drawn = condense(tuple(columns), _DRAWN_SPANS)
    return Trace(path.stem, time_s, drawn[0], drawn[1] if len(drawn) > 1 else None)


def _import(task: ImportFile) -> str:
    from app.runs.importers import import_csv
    from config.files import load_stand

    form, path = task.form, Path(task.path)
    stored = import_csv(
        path, _plan(form), _free_path(Path(task.folder), path.stem), load_stand(),
        series=form.series or None,
        plate_mass_kg=_positive(form.plate_mass_kg, tr("Plate mass")),
        table_mass_kg=_positive(form.table_mass_kg, tr("Table mass")),
        operator=form.operator.strip(), note=form.note.strip(),
    )  # fmt: skip
    return str(stored.path)


def _positive(text: str, name: str) -> float | None:
    from app.runs.errors import ImportFileError

    value = _number(text, name)
    if value is not None and value <= 0.0:
        raise ImportFileError(f"{name} {text.strip()!r} is not above 0. Write it in kg, or leave it empty")
    return value


def _free_path(folder: Path, stem: str) -> Path:
    path, number = folder / f"{stem}.h5", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.h5"
    return path
