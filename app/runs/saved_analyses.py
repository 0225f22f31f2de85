"""Results of analyses: as the JSON that the outside relies on, and kept in the run beside earlier ones."""

import datetime
import hashlib
import math
import re
import zlib
from dataclasses import dataclass, fields
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
    write_fields,
    write_number,
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
    for field in (field for field in fields(record) if field.name not in ("release", "decay_end_s")):
        value = getattr(record, field.name)
        digest.update(field.name.encode())
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
    return tuple(
        msgspec.convert(read_fields(group, schema.ANALYSIS_FIELDS), SavedAnalysis)
        for group in (_group(file, number) for number in _numbers(file))
        if not _is_damaged(group)
    )


def damaged_analyses(file: h5py.File) -> tuple[int, ...]:
    """Numbers of the analyses in an open run that are not what was kept, by their checksum."""
    return tuple(number for number in _numbers(file) if _is_damaged(_group(file, number)))


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


def _is_damaged(group: h5py.Group) -> bool:
    """Tell whether an analysis is not what was kept. Earlier versions kept no checksum."""
    stored = read_number(group, schema.ANALYSIS_CHECKSUM)
    return stored is not None and stored != _checksum(group)


def _write(group: h5py.Group, kept: SavedAnalysis) -> None:
    document = kept.document
    write_fields(group, schema.ANALYSIS_FIELDS, kept)
    write_text(group, "program", "slipstand")
    group[schema.ANALYSIS_CHECKSUM] = np.uint32(_checksum(group))
    _write_results(make_group(group, "results", "NXcollection"), document["results"])
    model = document["model"] or {}
    _write_values(make_group(group, "model", "NXcollection"), model)
    _write_table(make_group(group, "tried", "NXcollection"), model.get("tried", []))
    _write_table(make_group(group, "budget", "NXcollection"), document["budget"])
    _write_values(make_group(group, "events", "NXcollection"), document["events"])
    _write_table(
        make_group(group, "warnings", "NXcollection"),
        [{name: warning[name] for name in ("code", "message")} for warning in document["warnings"]],
    )


def _write_results(group: h5py.Group, results: dict[str, Any]) -> None:
    for name, result in results.items():
        if not isinstance(result, dict):
            _write_values(group, {name: result})
            continue
        write_number(group, name, result["value"], result["unit"])
        for fact in ("standard_uncertainty", "interval_95"):
            if result[fact] is not None:
                group[name].attrs[fact] = result[fact]


def _write_values(group: h5py.Group, values: dict[str, Any]) -> None:
    """Texts, truths and numbers; anything else is in `document` alone."""
    for name, value in values.items():
        if isinstance(value, str):
            write_text(group, name, value)
        elif isinstance(value, bool | int | float):
            write_number(group, name, value)


def _write_table(group: h5py.Group, rows: list[dict[str, Any]]) -> None:
    """One column a key; numbers that are absent are NaN, words of a list stand in one text."""
    for name in rows[0] if rows else ():
        column = [", ".join(x) if isinstance(x := row[name], list) else x for row in rows]
        if isinstance(column[0], str):
            data = [text.encode() for text in column]
            kind = text_type(b"".join(data), max(1, *map(len, data)))
            group.create_dataset(name, data=np.array(data, dtype=kind))
        else:
            group.create_dataset(name, data=np.array([math.nan if x is None else x for x in column], float))


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
