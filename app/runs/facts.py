"""Metadata to and from the groups of a run file."""

import datetime
import uuid
from typing import Any

import h5py
import msgspec

from app.runs import format as names
from app.runs.check_facts import read_checks, write_checks
from app.runs.errors import DamagedRunError
from app.runs.format import get_number, get_text, put_number, put_text
from app.runs.metadata import Conditions, Quantity, RunMetadata, is_fact_name
from app.version import __version__
from config.schema import Device, Gauge, Gauges, Stand
from drivers.samples import DeviceIdentity

_GAUGE_NUMBERS = (
    ("gain_m_per_count", "gain", "{unit}/count"),
    ("zero_count", "zero", "count"),
    ("gain_relative_standard_uncertainty", "gain_relative_standard_uncertainty", "1"),
    ("zero_standard_uncertainty_m", "zero_standard_uncertainty", "{unit}"),
    ("nonlinearity_m", "nonlinearity", "{unit}"),
    ("hysteresis_m", "hysteresis", "{unit}"),
    ("repeatability_m", "repeatability", "{unit}"),
    ("delay_s", "delay", "s"),
    ("delay_standard_uncertainty_s", "delay_standard_uncertainty", "s"),
    ("range_m", "range", "{unit}"),
)
_GAUGE_TEXTS = ("reference", "certificate", "calibrated_by")
_STAND_NUMBERS = (
    ("table_mass_standard_uncertainty_kg", "table_mass_standard_uncertainty", "kg"),
    ("plate_mass_standard_uncertainty_kg", "plate_mass_standard_uncertainty", "kg"),
    ("gravity_m_per_s2", "gravity", "m/s^2"),
    ("gravity_standard_uncertainty_m_per_s2", "gravity_standard_uncertainty", "m/s^2"),
)
_RUN_NUMBERS = (
    ("table_mass_kg", "table_mass", "kg"),
    ("plate_mass_kg", "plate_mass", "kg"),
    ("pullback_m", "pullback", "m"),
)
_RUN_TEXTS = ("series", "source", "excluded")
_CONDITION_TEXTS = ("plate_id", "contact_id", "surface_preparation")
_OTHER_CONDITIONS = f"{names.RUN}/conditions"

EDITABLE = frozenset(
    (
        "title",
        "series",
        "pullback_m",
        "table_mass_kg",
        "plate_mass_kg",
        "operator",
        "note",
        "conditions",
        "gauges",
        "stand",
        "excluded",
    )
)
"""Fields of `RunMetadata` that a later edit may replace; what was measured is not among them."""


class Change(msgspec.Struct, frozen=True):
    """One edit: the new values of some fields of `RunMetadata`, as plain JSON values."""

    date: datetime.datetime
    author: str
    fields: dict[str, Any]
    undoes: int | None = None
    """Number of the edit, from 0, whose old values this one gives back."""


def write_metadata(file: h5py.File, metadata: RunMetadata, identifier: str = "") -> None:
    """Fill the groups of a new run file; without an `identifier` it gets a new one. Raises MetadataError."""
    entry = file[names.ENTRY]
    put_text(entry, "title", metadata.title)
    put_text(entry, "start_time", metadata.start_time.isoformat())
    put_text(entry, "entry_identifier_uuid", identifier or str(uuid.uuid4()))
    put_text(entry, "program_name", "slipstand")
    entry["program_name"].attrs["version"] = __version__
    put_text(file[names.USER], "name", metadata.operator)
    _write_run(file[names.RUN], metadata)
    _write_conditions(file, metadata.conditions)
    _write_stand(file[names.STAND], metadata)
    for path, gauge in zip(names.GAUGES, (metadata.gauges.table, metadata.gauges.relative), strict=True):
        if path in file:
            _write_gauge(file[path], gauge, metadata.unit)
    write_checks(file, metadata.gauge_checks)
    _write_acquisition(file[names.ACQUISITION], metadata)
    if metadata.truth:
        truth = make_group(file, names.TRUTH, "NXcollection")
        truth.attrs.update(metadata.truth)


def read_metadata(file: h5py.File) -> RunMetadata:
    """Read what `write_metadata` wrote, with all later changes applied.

    Raises
    ------
    DamagedRunError
        A fact is missing or of the wrong kind.
    """
    try:
        metadata = read_original(file)
        for change in read_changes(file):
            metadata = apply_change(metadata, change)
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        fault = str(error).replace("\n", " ")
        raise DamagedRunError(
            f"{file.filename}: its facts cannot be read ({fault}). Restore a good copy"
        ) from None
    return metadata


def apply_change(metadata: RunMetadata, change: Change) -> RunMetadata:
    """Metadata with the fields of `change` replaced. Raises ValueError on values that cannot be."""
    unknown = sorted(set(change.fields) - EDITABLE)
    if unknown:
        raise ValueError(f"{unknown[0]!r} cannot be edited: choose from {', '.join(sorted(EDITABLE))}")
    return msgspec.convert(msgspec.to_builtins(metadata) | change.fields, RunMetadata)


def append_change(file: h5py.File, change: Change) -> None:
    """Add one edit to the history. Earlier ones stay."""
    history = file[names.HISTORY]
    note = make_group(history, f"change_{len(history) + 1:03d}", "NXnote")
    put_text(note, "author", change.author)
    put_text(note, "date", change.date.isoformat())
    put_text(note, "type", "application/json")
    put_text(note, "description", msgspec.json.encode(change.fields).decode())
    put_number(note, "undoes", change.undoes)


def read_changes(file: h5py.File) -> list[Change]:
    """All edits, oldest first."""
    history = file[names.HISTORY]
    return [
        Change(
            datetime.datetime.fromisoformat(get_text(note, "date")),
            get_text(note, "author"),
            msgspec.json.decode(get_text(note, "description", "{}"), type=dict[str, Any]),
            None if "undoes" not in note else int(note["undoes"][()]),
        )
        for note in (history[name] for name in sorted(history, key=lambda name: (len(name), name)))
    ]


def make_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """Make a group of a NeXus class."""
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def _write_run(run: h5py.Group, metadata: RunMetadata) -> None:
    for name in _RUN_TEXTS:
        put_text(run, name, getattr(metadata, name) or "")
    if metadata.note:
        note = make_group(run, "notes/note_001", "NXnote")
        put_text(note, "author", metadata.operator)
        put_text(note, "date", metadata.start_time.isoformat())
        put_text(note, "type", "text/plain")
        put_text(note, "description", metadata.note)


def _write_conditions(file: h5py.File, conditions: Conditions) -> None:
    put_number(file[names.SAMPLE], "temperature", conditions.temperature_c, "degC")
    put_number(file[names.SAMPLE], "humidity", conditions.humidity_percent, "%")
    run = file[names.RUN]
    for name in _CONDITION_TEXTS:
        put_text(run, name, getattr(conditions, name))
    put_number(run, "run_in_number", conditions.run_in_number)
    if conditions.other:
        other = make_group(file, _OTHER_CONDITIONS, "NXcollection")
        for name, text in conditions.other.items():
            put_text(other, name, text)


def _write_stand(group: h5py.Group, metadata: RunMetadata) -> None:
    stand = metadata.stand
    put_text(group, "name", stand.name)
    put_text(group, "contact", metadata.contact)
    for field, name, units in _RUN_NUMBERS:
        put_number(group, name, getattr(metadata, field), units)
    for field, name, units in _STAND_NUMBERS:
        put_number(group, name, getattr(stand, field), units)
    put_text(group, "configuration", msgspec.json.encode(stand).decode())
    geometry = make_group(group, "geometry", "NXcollection")
    for name, value in stand.geometry.items():
        if is_fact_name(name):
            put_number(geometry, name, value, "m" if name.endswith("_m") else "")


def _write_gauge(group: h5py.Group, gauge: Gauge, unit: str) -> None:
    put_text(group, "serial_number", gauge.serial_number)
    put_text(group, "calibration_date", gauge.date.isoformat() if gauge.date else "")
    calibration = make_group(group, "calibration", "NXcollection")
    for field, name, units in _GAUGE_NUMBERS:
        put_number(calibration, name, getattr(gauge, field), units.format(unit=unit))
    if gauge.polynomial:
        calibration["polynomial"] = gauge.polynomial
    for name in _GAUGE_TEXTS:
        put_text(calibration, name, getattr(gauge, name))
    put_text(calibration, "valid_until", gauge.valid_until.isoformat() if gauge.valid_until else "")
    put_text(calibration, "measures", gauge.measures)


def _write_acquisition(group: h5py.Group, metadata: RunMetadata) -> None:
    device = metadata.device
    put_text(group, "protocol", device.protocol)
    put_text(group, "device", device.name)
    put_text(group, "firmware", device.firmware)
    put_text(group, "serial_number", device.serial_number)
    put_text(group, "device_settings", msgspec.json.encode(device.settings).decode())
    put_text(group, "configuration", msgspec.json.encode(metadata.gauges.device).decode())
    put_text(group, "port", metadata.port)
    put_text(group, "host", metadata.host)
    put_number(group, "rate_nominal", metadata.rate_hz, "Hz")


def read_original(file: h5py.File) -> RunMetadata:
    """Read what `write_metadata` wrote, without any later change."""
    entry, run, stand = file[names.ENTRY], file[names.RUN], file[names.STAND]
    signal = file[names.MOTION].attrs["signal"]
    dataset = file[f"{names.MOTION}/{signal}"]
    numbers: dict[str, Any] = {field: get_number(stand, name) for field, name, _ in _RUN_NUMBERS}
    return RunMetadata(
        title=get_text(entry, "title"),
        start_time=datetime.datetime.fromisoformat(get_text(entry, "start_time")),
        stand=_read_stand(stand),
        gauges=_read_gauges(file),
        gauge_checks=read_checks(file),
        **numbers,
        series=get_text(run, "series") or None,
        source=get_text(run, "source"),
        excluded=get_text(run, "excluded"),
        operator=get_text(file[names.USER], "name"),
        note=get_text(run, "notes/note_001/description"),
        conditions=_read_conditions(file),
        quantity=msgspec.convert(dataset.attrs["quantity"], Quantity),
        unit=str(dataset.attrs["units"]),
        truth=_read_truth(file),
        **_read_acquisition(file[names.ACQUISITION]),
    )


def _read_acquisition(group: h5py.Group) -> dict[str, Any]:
    device = DeviceIdentity(
        protocol=get_text(group, "protocol"),
        name=get_text(group, "device"),
        firmware=get_text(group, "firmware"),
        serial_number=get_text(group, "serial_number"),
        settings=msgspec.json.decode(get_text(group, "device_settings", "{}"), type=dict[str, str]),
    )
    return {
        "device": device,
        "port": get_text(group, "port"),
        "host": get_text(group, "host"),
        "rate_hz": get_number(group, "rate_nominal"),
    }


def _read_stand(group: h5py.Group) -> Stand:
    stand = msgspec.json.decode(get_text(group, "configuration"), type=Stand)
    return stand.replace(**{field: get_number(group, name) for field, name, _ in _STAND_NUMBERS})


def _read_gauges(file: h5py.File) -> Gauges:
    table = _read_gauge(file[names.GAUGES[0]])
    relative = _read_gauge(file[names.GAUGES[1]]) if names.GAUGES[1] in file else Gauge(1.0, 0.0)
    device = msgspec.json.decode(get_text(file[names.ACQUISITION], "configuration", "{}"), type=Device)
    return Gauges(table=table, relative=relative, device=device)


def _read_gauge(group: h5py.Group) -> Gauge:
    calibration = group["calibration"]
    numbers = {field: get_number(calibration, name) for field, name, _ in _GAUGE_NUMBERS}
    raw = numbers | {
        "measures": get_text(calibration, "measures"),
        "serial_number": get_text(group, "serial_number"),
        **{name: get_text(calibration, name) for name in _GAUGE_TEXTS},
        "polynomial": calibration["polynomial"][()].tolist() if "polynomial" in calibration else (),
        "date": get_text(group, "calibration_date") or None,
        "valid_until": get_text(calibration, "valid_until") or None,
    }
    return msgspec.convert(raw, Gauge)


def _read_conditions(file: h5py.File) -> Conditions:
    sample, run = file[names.SAMPLE], file[names.RUN]
    other = file.get(_OTHER_CONDITIONS, {})
    number = get_number(run, "run_in_number")
    return Conditions(
        temperature_c=get_number(sample, "temperature"),
        humidity_percent=get_number(sample, "humidity"),
        **{name: get_text(run, name) for name in _CONDITION_TEXTS},
        run_in_number=None if number is None else int(number),
        other={name: get_text(other, name) for name in other},
    )


def _read_truth(file: h5py.File) -> dict[str, Any]:
    if names.TRUTH not in file:
        return {}
    attributes = file[names.TRUTH].attrs
    return {name: names.plain(attributes[name]) for name in attributes if name != "NX_class"}
