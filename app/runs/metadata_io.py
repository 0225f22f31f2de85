"""Metadata of a run to and from the groups of its file, and the history of edits."""

import datetime
import functools
import uuid
from typing import Any

import h5py
import msgspec

from app.runs import fields, schema
from app.runs.errors import DamagedRunError, MetadataError, one_line
from app.runs.metadata import EndMetadata, RunMetadata, is_field_name
from app.version import __version__
from config.schema import GaugeCheck
from messages.i18n import N_

EDITABLE = frozenset((
    "title", "series", "pullback_m", "table_mass_kg", "plate_mass_kg", "operator", "note", "conditions",
    "gauges", "stand", "excluded",
))  # fmt: skip
"""Fields of `RunMetadata` that an edit may replace. What was measured is not among them."""
_GAUGE_NAMES = ("table", "relative")


class Change(msgspec.Struct, frozen=True):
    """One edit: the new values of some fields of `RunMetadata`, as plain JSON values."""

    date: datetime.datetime
    author: str
    fields: dict[str, Any]
    undoes: int | None = None
    """Number of the edit, from 0, whose old values this one restores."""


def write_metadata(file: h5py.File, metadata: RunMetadata, identifier: str = "") -> None:
    """Fill the groups of a new run file; without an `identifier` it gets a new one. Raises MetadataError."""
    fields.write_fields(file, schema.RUN_FIELDS, metadata)
    fields.write_text(file, schema.IDENTIFIER, identifier or str(uuid.uuid4()))
    fields.write_text(file, schema.PROGRAM, "slipstand")
    file[schema.PROGRAM].attrs["version"] = __version__
    fields.write_text(file, schema.CONTACT, metadata.contact)
    if metadata.note:
        file[schema.NOTE].attrs["NX_class"] = "NXnote"
        fields.write_text(file, f"{schema.NOTE}/author", metadata.operator)
        if metadata.start_time is not None:
            fields.write_text(file, f"{schema.NOTE}/date", metadata.start_time.isoformat())
        fields.write_text(file, f"{schema.NOTE}/type", "text/plain")
    _write_open_groups(file, metadata)
    _write_gauges(file, metadata)


def read_metadata(file: h5py.File) -> RunMetadata:
    """Read the metadata of a run with all edits applied. Raises DamagedRunError."""
    try:
        return functools.reduce(apply_change, read_changes(file), read_recorded_metadata(file))
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        template = N_("{file}: its metadata cannot be read ({fault}). Restore a good copy")
        raise DamagedRunError(template, file=file.filename, fault=one_line(error)) from None


def read_recorded_metadata(file: h5py.File) -> RunMetadata:
    """Read the metadata as recorded, without edits. Raises DamagedRunError, KeyError, ValueError."""
    raw = fields.read_fields(file, schema.RUN_FIELDS)
    signal = file[f"{schema.MOTION}/{file[schema.MOTION].attrs['signal']}"]
    raw |= {"quantity": signal.attrs["quantity"], "unit": str(signal.attrs["units"]), "gauge_checks": []}
    others = file.get(schema.OTHER_CONDITIONS, {})
    raw["conditions"]["other"] = {name: fields.read_text(others, name) for name in others}
    if schema.TRUTH in file:
        truth = file[schema.TRUTH].attrs
        raw["truth"] = {name: fields.to_python(truth[name]) for name in truth if name != "NX_class"}
    raw["gauges"] |= {name: {"gain_m_per_count": 1.0, "zero_count": 0.0} for name in _GAUGE_NAMES}
    for name, path in zip(_GAUGE_NAMES, schema.GAUGES, strict=True):
        if path in file:
            raw["gauges"][name] = fields.read_fields(file[path], schema.GAUGE_FIELDS)
        if (check := f"{path}/{schema.LAST_CHECK}") in file:
            raw["gauge_checks"].append(
                {"gauge": name, **fields.read_fields(file[check], schema.CHECK_FIELDS)}
            )
    return msgspec.convert(raw, RunMetadata)


def read_end_metadata(file: h5py.File) -> EndMetadata | None:
    """Read what was known when the run ended; None for a run that was never closed."""
    if not fields.read_text(file, schema.ENDED):
        return None
    return msgspec.convert(fields.read_fields(file, schema.END_FIELDS), EndMetadata)


def read_identifier(file: h5py.File) -> str:
    """UUID that the run was given when it was recorded."""
    return fields.read_text(file, schema.IDENTIFIER)


def apply_change(metadata: RunMetadata, change: Change) -> RunMetadata:
    """Metadata with the fields of `change` replaced. Raises ValueError for values that are not valid."""
    unknown = sorted(set(change.fields) - EDITABLE)
    if unknown:
        raise MetadataError(
            "{field!r} cannot be edited: choose from {editable}", field=unknown[0], editable=sorted(EDITABLE)
        )
    return msgspec.convert(msgspec.to_builtins(metadata) | change.fields, RunMetadata)


def append_change(file: h5py.File, change: Change) -> None:
    """Add one edit to the history. Earlier ones stay."""
    history = file[schema.HISTORY]
    note = fields.make_group(history, f"change_{len(history) + 1:03d}", "NXnote")
    fields.write_text(note, "author", change.author)
    fields.write_text(note, "date", change.date.isoformat())
    fields.write_text(note, "type", "application/json")
    fields.write_text(note, "description", msgspec.json.encode(change.fields).decode())
    fields.write_number(note, "undoes", change.undoes)


def read_changes(file: h5py.File) -> list[Change]:
    """All edits, oldest first."""
    history = file[schema.HISTORY]
    return [
        Change(
            datetime.datetime.fromisoformat(fields.read_text(note, "date")),
            fields.read_text(note, "author"),
            msgspec.json.decode(fields.read_text(note, "description", "{}"), type=dict[str, Any]),
            None if "undoes" not in note else int(note["undoes"][()]),
        )
        for note in (history[name] for name in sorted(history, key=lambda name: (len(name), name)))
    ]


def _write_open_groups(file: h5py.File, metadata: RunMetadata) -> None:
    if metadata.conditions.other:
        others = fields.make_group(file, schema.OTHER_CONDITIONS, "NXcollection")
        for name, text in metadata.conditions.other.items():
            fields.write_text(others, name, text)
    geometry = fields.make_group(file[schema.STAND], "geometry", "NXcollection")
    for name, value in metadata.stand.geometry.items():
        if is_field_name(name):
            fields.write_number(geometry, name, value, "m" if name.endswith("_m") else "")
    if metadata.truth:
        fields.make_group(file, schema.TRUTH, "NXcollection").attrs.update(metadata.truth)


def _write_gauges(file: h5py.File, metadata: RunMetadata) -> None:
    checks: dict[str, GaugeCheck] = {check.gauge: check for check in metadata.gauge_checks}
    for name, path in zip(_GAUGE_NAMES, schema.GAUGES, strict=True):
        if path not in file:
            continue
        fields.make_group(file[path], "calibration", "NXcollection")
        fields.write_fields(file[path], schema.GAUGE_FIELDS, getattr(metadata.gauges, name), metadata.unit)
        if check := checks.get(name):
            group = fields.make_group(file[path], schema.LAST_CHECK, "NXcollection")
            fields.write_fields(group, schema.CHECK_FIELDS, check)
            fields.write_number(group, schema.DEVIATION, check.deviation_m, "m")
