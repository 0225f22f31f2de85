"""Results of analyses: as the JSON that the outside relies on, and kept in the run beside earlier ones."""

import datetime
import hashlib
import math
import re
import zlib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from analysis.identification import Identification
from analysis.record import Record
from app.runs import schema
from app.runs.analysis_json import (
    budget_documents,
    json_values,
    plate_document,
    quantity_document,
    warning_documents,
)
from app.runs.analysis_request import AnalysisRequest
from app.runs.fields import (
    make_group,
    read_fields,
    read_number,
    read_text,
    text_type,
    to_python,
    write_fields,
    write_text,
)
from app.runs.metadata import RunMetadata
from app.runs.metadata_io import read_metadata
from app.runs.origin import analysis_origin, software_text
from app.runs.rewrite import rewrite
from app.version import __version__
from config.schema import Gauge
from drivers.samples import Losses

SCHEMA = "slipstand-analysis/1"
Document = dict[str, Any]


@dataclass(frozen=True, slots=True)
class SavedAnalysis:
    """One analysis as kept in a run: `document` is what `analyze --json` said."""

    number: int
    date: datetime.datetime
    version: str
    inputs_hash: str
    """Hash of the record that was analysed, see `inputs_hash`."""
    settings: dict[str, Any]
    document: Document
    metadata_hash: str = ""
    """Hash of what was known beside the samples, see `app.runs.saved_analyses`."""
    commit: str = ""
    request_hash: str = ""
    reproduce: str = ""
    """Command that gives the same digits; these three are empty in analyses of versions that kept none."""

    @property
    def program_text(self) -> str:
        """Program that made it, with version and commit."""
        return software_text({"program": "slipstand", "version": self.version, "commit": self.commit})

    def document_of(
        self, path: Path, metadata: RunMetadata, identifier: str, *, has_gauge_2: bool
    ) -> Document:
        """The document for a run that may have been moved; its origin is that of the run where none was kept.

        For an analysis that still stands, so that masses and calibration are those of the run.
        """
        document = self.document | {"run": str(path.absolute())}
        request = AnalysisRequest.of_settings(self.settings)
        if request is None:
            return document
        inputs = self.inputs_hash
        origin = document.get("origin")
        if origin is None:
            origin = analysis_origin(path, metadata, identifier, request, inputs, has_gauge_2=has_gauge_2)
            origin |= {"version": self.version, "commit": None, "date": self.date.isoformat()}
        return document | {"origin": origin | {"reproduce": request.command(path.absolute())}}


def analysis_document(
    path: Path | None, series: str | None, losses: Losses, result: Identification
) -> Document:
    """JSON object of one identification, schema `slipstand-analysis/1`; `run` is null without a path."""
    quantities = {
        name: quantity_document(value) for name, value in result.results.items() if math.isfinite(value.value)
    }
    return {
        "schema": SCHEMA,
        "run": None if path is None else str(path.absolute()),
        "series": series,
        "kind": result.kind,
        "results": quantities | result.labels,
        "model": json_values(result.model),
        "plate": plate_document(result.plate),
        "budget": budget_documents(result.budget),
        "events": json_values(result.events),
        "warnings": warning_documents(result.warnings, with_templates=True),
        "quality": {name: getattr(losses, name) for name in ("samples", "missing", "damaged", "overloaded")}
        | {"missing_estimated": losses.missing_estimated},
    }


def inputs_hash(record: Record) -> str:
    """Hash of all that an analysis takes: readings, masses, calibration uncertainties, clock.

    Which release of the record is analysed belongs to the request, and the end of its free decay is found.
    """
    digest = hashlib.blake2b(digest_size=16)
    for name in (part.name for part in fields(record) if part.name not in ("release", "decay_end_s")):
        value = getattr(record, name)
        digest.update(name.encode())
        digest.update(value.tobytes() if isinstance(value, np.ndarray) else msgspec.json.encode(value))
    return digest.hexdigest()


def latest_valid(analyses: tuple[SavedAnalysis, ...], record: Record) -> SavedAnalysis | None:
    """Latest saved analysis of exactly this record; None where calibration or masses changed since."""
    inputs = inputs_hash(record)
    return next((saved for saved in reversed(analyses) if saved.inputs_hash == inputs), None)


def save_analysis(path: Path, document: Document, inputs: str, settings: dict[str, Any] | None = None) -> int:
    """Keep an analysis in its run. Returns the NNN of `/entry/analysis_NNN`. Raises RunError.

    `inputs` is the `inputs_hash` of the analysed record; `settings` say how it was analysed.
    """
    origin = document.get("origin", {})
    settings, number = settings or {}, 0
    masses = {name: settings.get(name) for name in ("table_mass_kg", "plate_mass_kg")}

    def add(file: h5py.File) -> None:
        nonlocal number
        number = max(_numbers(file), default=0) + 1
        kept = SavedAnalysis(
            number=number,
            date=datetime.datetime.now().astimezone().replace(microsecond=0),
            version=__version__,
            inputs_hash=inputs,
            settings=settings,
            document=document,
            metadata_hash=metadata_hash(file, **masses),
            **{name: origin.get(name) or "" for name in ("commit", "request_hash", "reproduce")},
        )
        _write(_group(file, number), kept)

    rewrite(path, add)
    return number


def read_analyses(file: h5py.File) -> tuple[SavedAnalysis, ...]:
    """All analyses kept in an open run, oldest first; those that are damaged are left out."""
    return read_all_analyses(file)[0]


def read_all_analyses(file: h5py.File) -> tuple[tuple[SavedAnalysis, ...], tuple[int, ...]]:
    """Analyses kept in an open run, oldest first, and the numbers of those that are not what was kept."""
    numbers = _numbers(file)
    kept = {number: _read(_group(file, number)) for number in numbers}
    undamaged = tuple(analysis for analysis in kept.values() if analysis is not None)
    return undamaged, tuple(number for number in numbers if kept[number] is None)


def _numbers(file: h5py.File) -> list[int]:
    found = (re.fullmatch(rf"{schema.ANALYSIS_PREFIX}(\d+)", name) for name in file[schema.ENTRY])
    return sorted(int(match[1]) for match in found if match)


def _group(file: h5py.File, number: int) -> h5py.Group:
    name = f"{schema.ANALYSIS_PREFIX}{number:03d}"
    return file[schema.ENTRY].get(name) or make_group(file[schema.ENTRY], name, "NXprocess")


def _checksum(group: h5py.Group) -> int:
    """CRC-32 of all texts of an analysis, whichever version wrote them."""
    texts = [
        f"{name}={read_text(group, name)}"
        for name, item in sorted(group.items())
        if isinstance(item, h5py.Dataset) and h5py.check_string_dtype(item.dtype)
    ]
    return zlib.crc32("\0".join(texts).encode())


def _read(group: h5py.Group) -> SavedAnalysis | None:
    """Analysis of a group; None if it is not what was kept. Earlier versions kept no checksum."""
    stored = read_number(group, schema.ANALYSIS_CHECKSUM)
    if stored is not None and stored != _checksum(group):
        return None
    analysis = msgspec.convert(read_fields(group, schema.ANALYSIS_FIELDS), SavedAnalysis)
    copies = _copies(analysis.document)
    return analysis if all(_agrees(group.get(name), copies[name]) for name in copies) else None


def _write(group: h5py.Group, kept: SavedAnalysis) -> None:
    write_fields(group, schema.ANALYSIS_FIELDS, kept)
    write_text(group, "program", "slipstand")
    group[schema.ANALYSIS_CHECKSUM] = np.uint32(_checksum(group))
    for name, copies in _copies(kept.document).items():
        part = make_group(group, name, "NXcollection")
        for key, copy in copies.items():
            copy.write(part, key)


@dataclass(frozen=True, slots=True)
class _Copy:
    """Part of a document as a dataset: one value, or a column with a value a row."""

    value: str | float | list[str] | list[float]
    attributes: dict[str, Any] = field(default_factory=dict)

    def write(self, group: h5py.Group, name: str) -> None:
        """Make the dataset. An empty text is left out."""
        if isinstance(self.value, str):
            write_text(group, name, self.value)
        elif isinstance(self.value, list) and isinstance(self.value[0], str):
            data = [str(text).encode() for text in self.value]
            kind = text_type(b"".join(data), max(1, *map(len, data)))
            group.create_dataset(name, data=np.array(data, dtype=kind))
        else:
            group.create_dataset(name, data=self.value)
        for key, value in self.attributes.items():
            group[name].attrs[key] = value

    def equals(self, dataset: h5py.Dataset) -> bool:
        """Tell whether a dataset and its attributes hold exactly this."""
        attributes = dict(dataset.attrs)
        return (
            _is_same(dataset[()], self.value)
            and attributes.keys() == self.attributes.keys()
            and all(_is_same(attributes[key], value) for key, value in self.attributes.items())
        )


def _is_same(stored: Any, value: Any) -> bool:
    """Tell whether what h5py reads is this text, number or list; NaN is NaN."""
    expected, found = np.asarray(value), np.asarray(_plain(stored))
    if expected.dtype.kind == "U" or found.dtype.kind == "U":
        return bool(np.array_equal(expected, found))
    return bool(np.array_equal(expected, found, equal_nan=True))


def _plain(stored: Any) -> Any:
    plain = to_python(stored)
    return [to_python(item) for item in plain] if isinstance(plain, list) else plain


def _agrees(group: h5py.Group | None, copies: dict[str, _Copy]) -> bool:
    """Tell whether all datasets of a group are copies of the document."""
    return group is None or all(
        name in copies and copies[name].equals(dataset) for name, dataset in group.items()
    )


def _copies(document: Document) -> dict[str, dict[str, _Copy]]:
    """Parts of a document that other programs find as datasets, by group and name."""
    model = document["model"] or {}
    warnings = [{name: warning[name] for name in ("code", "message")} for warning in document["warnings"]]
    return {
        "results": _result_copies(document["results"]),
        "model": _value_copies(model),
        "tried": _column_copies(model.get("tried", [])),
        "budget": _column_copies(document["budget"]),
        "events": _value_copies(document["events"]),
        "warnings": _column_copies(warnings),
    }


def _result_copies(results: dict[str, Any]) -> dict[str, _Copy]:
    quantities = {name: result for name, result in results.items() if isinstance(result, dict)}
    labels = {name: label for name, label in results.items() if name not in quantities}
    return _value_copies(labels) | {
        name: _Copy(result["value"], _quantity_attributes(result)) for name, result in quantities.items()
    }


def _quantity_attributes(result: dict[str, Any]) -> dict[str, Any]:
    attributes = {"units": result["unit"]} if result["unit"] else {}
    facts = ("standard_uncertainty", "interval_95")
    return attributes | {fact: result[fact] for fact in facts if result[fact] is not None}


def _value_copies(values: dict[str, Any]) -> dict[str, _Copy]:
    """Texts, truths and numbers; anything else is in `document` alone."""
    return {
        name: _Copy(value) for name, value in values.items() if isinstance(value, str | bool | int | float)
    }


def _column_copies(rows: list[dict[str, Any]]) -> dict[str, _Copy]:
    """One column a key; numbers that are absent are NaN, words of a list stand in one text."""
    return {name: _Copy([_cell(row[name]) for row in rows]) for name in (rows[0] if rows else ())}


def _cell(value: Any) -> Any:
    if isinstance(value, list):
        return ", ".join(value)
    return value if isinstance(value, str) else math.nan if value is None else float(value)


def is_stale(file: h5py.File, metadata: RunMetadata, saved: SavedAnalysis) -> bool:
    """Tell whether masses, pullback, calibration or clock of the run changed since.

    Raises DamagedRunError.
    """
    masses = {name: saved.settings.get(name) for name in ("table_mass_kg", "plate_mass_kg")}
    return saved.metadata_hash != metadata_hash(file, metadata, **masses)


def metadata_hash(file: h5py.File, metadata: RunMetadata | None = None, **masses_kg: float | None) -> str:
    """Hash of all that an analysis takes of a run beside its samples. Raises DamagedRunError.

    `masses_kg` are `table_mass_kg` and `plate_mass_kg` that replaced those of the run in the analysis.
    """
    metadata = metadata or read_metadata(file)
    given = {name: mass for name, mass in masses_kg.items() if mass is not None}
    clock = [read_number(file, path) for path in (schema.CLOCK_SCALE, schema.CLOCK_SCALE_UNCERTAINTY)]
    facts = [*_facts(metadata.replace(**given) if given else metadata), *clock]
    return hashlib.blake2b(msgspec.json.encode(facts), digest_size=16).hexdigest()


def _facts(metadata: RunMetadata) -> list[object]:
    stand = metadata.stand
    return [
        metadata.table_mass_kg,
        metadata.plate_mass_kg,
        metadata.pullback_m,
        stand.table_mass_standard_uncertainty_kg,
        stand.plate_mass_standard_uncertainty_kg,
        stand.gravity_m_per_s2,
        stand.gravity_standard_uncertainty_m_per_s2,
        *_calibration(metadata.gauges.table),
        *_calibration(metadata.gauges.relative),
    ]


_ABOUT = (
    "serial_number", "reference", "date", "valid_until", "certificate", "calibrated_by", "hysteresis_m",
    "repeatability_m",
)  # fmt: skip


def _calibration(gauge: Gauge) -> list[object]:
    """What a gauge says of readings; who calibrated it, and until when it holds, changes no number."""
    absent = [name for name in ("polynomial", "filter") if not getattr(gauge, name)]
    return [getattr(gauge, name) for name in gauge.__struct_fields__ if name not in (*_ABOUT, *absent)]
