"""Metadata to and from the groups of a run file."""

import datetime
import uuid
from typing import Any

import h5py
import msgspec

from app.runs import schema as names
from app.runs.errors import DamagedRunError
from app.runs.metadata import Conditions, Quantity, RunMetadata, is_field_name
from app.runs.schema import read_number, read_text, write_number, write_text
from app.version import __version__
from config.schema import Device, Gauge, GaugeCheck, Gauges, Stand
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
    write_text(entry, "title", metadata.title)
    write_text(entry, "start_time", metadata.start_time.isoformat())
    write_text(entry, "entry_identifier_uuid", identifier or str(uuid.uuid4()))
    write_text(entry, "program_name", "slipstand")
    entry["program_name"].attrs["version"] = __version__
    write_text(file[names.USER], "name", metadata.operator)
    _write_run(file[names.RUN], metadata)
    _write_conditions(file, metadata.conditions)
    _write_stand(file[names.STAND], metadata)
    for path, gauge in zip(names.GAUGES, (metadata.gauges.table, metadata.gauges.relative), strict=True):
        if path in file:
            _write_gauge(file[path], gauge, metadata.unit)
    write_gauge_checks(file, metadata.gauge_checks)
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
        metadata = read_recorded_metadata(file)
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
    write_text(note, "author", change.author)
    write_text(note, "date", change.date.isoformat())
    write_text(note, "type", "application/json")
    write_text(note, "description", msgspec.json.encode(change.fields).decode())
    write_number(note, "undoes", change.undoes)


def read_changes(file: h5py.File) -> list[Change]:
    """All edits, oldest first."""
    history = file[names.HISTORY]
    return [
        Change(
            datetime.datetime.fromisoformat(read_text(note, "date")),
            read_text(note, "author"),
            msgspec.json.decode(read_text(note, "description", "{}"), type=dict[str, Any]),
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
        write_text(run, name, getattr(metadata, name) or "")
    if metadata.note:
        note = make_group(run, "notes/note_001", "NXnote")
        write_text(note, "author", metadata.operator)
        write_text(note, "date", metadata.start_time.isoformat())
        write_text(note, "type", "text/plain")
        write_text(note, "description", metadata.note)


def _write_conditions(file: h5py.File, conditions: Conditions) -> None:
    write_number(file[names.SAMPLE], "temperature", conditions.temperature_c, "degC")
    write_number(file[names.SAMPLE], "humidity", conditions.humidity_percent, "%")
    run = file[names.RUN]
    for name in _CONDITION_TEXTS:
        write_text(run, name, getattr(conditions, name))
    write_number(run, "run_in_number", conditions.run_in_number)
    if conditions.other:
        other = make_group(file, _OTHER_CONDITIONS, "NXcollection")
        for name, text in conditions.other.items():
            write_text(other, name, text)


def _write_stand(group: h5py.Group, metadata: RunMetadata) -> None:
    stand = metadata.stand
    write_text(group, "name", stand.name)
    write_text(group, "contact", metadata.contact)
    for field, name, units in _RUN_NUMBERS:
        write_number(group, name, getattr(metadata, field), units)
    for field, name, units in _STAND_NUMBERS:
        write_number(group, name, getattr(stand, field), units)
    write_text(group, "configuration", msgspec.json.encode(stand).decode())
    geometry = make_group(group, "geometry", "NXcollection")
    for name, value in stand.geometry.items():
        if is_field_name(name):
            write_number(geometry, name, value, "m" if name.endswith("_m") else "")


def _write_gauge(group: h5py.Group, gauge: Gauge, unit: str) -> None:
    write_text(group, "serial_number", gauge.serial_number)
    write_text(group, "calibration_date", gauge.date.isoformat() if gauge.date else "")
    calibration = make_group(group, "calibration", "NXcollection")
    for field, name, units in _GAUGE_NUMBERS:
        write_number(calibration, name, getattr(gauge, field), units.format(unit=unit))
    if gauge.polynomial:
        calibration["polynomial"] = gauge.polynomial
    for name in _GAUGE_TEXTS:
        write_text(calibration, name, getattr(gauge, name))
    write_text(calibration, "valid_until", gauge.valid_until.isoformat() if gauge.valid_until else "")
    write_text(calibration, "measures", gauge.measures)


def _write_acquisition(group: h5py.Group, metadata: RunMetadata) -> None:
    device = metadata.device
    write_text(group, "protocol", device.protocol)
    write_text(group, "device", device.name)
    write_text(group, "firmware", device.firmware)
    write_text(group, "serial_number", device.serial_number)
    write_text(group, "device_settings", msgspec.json.encode(device.settings).decode())
    write_text(group, "configuration", msgspec.json.encode(metadata.gauges.device).decode())
    write_text(group, "port", metadata.port)
    write_text(group, "host", metadata.host)
    write_number(group, "rate_nominal", metadata.rate_hz, "Hz")


def read_recorded_metadata(file: h5py.File) -> RunMetadata:
    """Read what `write_metadata` wrote, without any later change."""
    entry, run, stand = file[names.ENTRY], file[names.RUN], file[names.STAND]
    signal = file[names.MOTION].attrs["signal"]
    dataset = file[f"{names.MOTION}/{signal}"]
    numbers: dict[str, Any] = {field: read_number(stand, name) for field, name, _ in _RUN_NUMBERS}
    return RunMetadata(
        title=read_text(entry, "title"),
        start_time=datetime.datetime.fromisoformat(read_text(entry, "start_time")),
        stand=_read_stand(stand),
        gauges=_read_gauges(file),
        gauge_checks=read_gauge_checks(file),
        **numbers,
        series=read_text(run, "series") or None,
        source=read_text(run, "source"),
        excluded=read_text(run, "excluded"),
        operator=read_text(file[names.USER], "name"),
        note=read_text(run, "notes/note_001/description"),
        conditions=_read_conditions(file),
        quantity=msgspec.convert(dataset.attrs["quantity"], Quantity),
        unit=str(dataset.attrs["units"]),
        truth=_read_truth(file),
        **_read_acquisition(file[names.ACQUISITION]),
    )


def _read_acquisition(group: h5py.Group) -> dict[str, Any]:
    device = DeviceIdentity(
        protocol=read_text(group, "protocol"),
        name=read_text(group, "device"),
        firmware=read_text(group, "firmware"),
        serial_number=read_text(group, "serial_number"),
        settings=msgspec.json.decode(read_text(group, "device_settings", "{}"), type=dict[str, str]),
    )
    return {
        "device": device,
        "port": read_text(group, "port"),
        "host": read_text(group, "host"),
        "rate_hz": read_number(group, "rate_nominal"),
    }


def _read_stand(group: h5py.Group) -> Stand:
    stand = msgspec.json.decode(read_text(group, "configuration"), type=Stand)
    return stand.replace(**{field: read_number(group, name) for field, name, _ in _STAND_NUMBERS})


def _read_gauges(file: h5py.File) -> Gauges:
    table = _read_gauge(file[names.GAUGES[0]])
    relative = _read_gauge(file[names.GAUGES[1]]) if names.GAUGES[1] in file else Gauge(1.0, 0.0)
    device = msgspec.json.decode(read_text(file[names.ACQUISITION], "configuration", "{}"), type=Device)
    return Gauges(table=table, relative=relative, device=device)


def _read_gauge(group: h5py.Group) -> Gauge:
    calibration = group["calibration"]
    numbers = {field: read_number(calibration, name) for field, name, _ in _GAUGE_NUMBERS}
    raw = numbers | {
        "measures": read_text(calibration, "measures"),
        "serial_number": read_text(group, "serial_number"),
        **{name: read_text(calibration, name) for name in _GAUGE_TEXTS},
        "polynomial": calibration["polynomial"][()].tolist() if "polynomial" in calibration else (),
        "date": read_text(group, "calibration_date") or None,
        "valid_until": read_text(calibration, "valid_until") or None,
    }
    return msgspec.convert(raw, Gauge)


def _read_conditions(file: h5py.File) -> Conditions:
    sample, run = file[names.SAMPLE], file[names.RUN]
    other = file.get(_OTHER_CONDITIONS, {})
    number = read_number(run, "run_in_number")
    return Conditions(
        temperature_c=read_number(sample, "temperature"),
        humidity_percent=read_number(sample, "humidity"),
        **{name: read_text(run, name) for name in _CONDITION_TEXTS},
        run_in_number=None if number is None else int(number),
        other={name: read_text(other, name) for name in other},
    )


def _read_truth(file: h5py.File) -> dict[str, Any]:
    if names.TRUTH not in file:
        return {}
    attributes = file[names.TRUTH].attrs
    return {name: names.to_python(attributes[name]) for name in attributes if name != "NX_class"}


_PATHS = {
    "table": f"{names.GAUGES[0]}/last_check",
    "relative": f"{names.GAUGES[1]}/last_check",
}
_NUMBERS = (
    ("expected_m", "expected", "m"),
    ("measured_m", "measured", "m"),
    ("tolerance_m", "tolerance", "m"),
    ("gain_m_per_count", "gain", "m/count"),
)
_TEXTS = ("kind", "reference", "checked_by", "device", "serial_number")
_PASSED, _FAILED = "passed", "failed"


def write_gauge_checks(file: h5py.File, checks: tuple[GaugeCheck, ...]) -> None:
    """Put each check beside the calibration of its gauge, where the run has that. Raises MetadataError."""
    for check in checks:
        if _PATHS[check.gauge].rpartition("/")[0] not in file:
            continue
        group = file.create_group(_PATHS[check.gauge])
        group.attrs["NX_class"] = "NXcollection"
        write_text(group, "date", check.at.isoformat())
        write_text(group, "result", _PASSED if check.passed else _FAILED)
        for field, name, units in _NUMBERS:
            write_number(group, name, getattr(check, field), units)
        write_number(group, "deviation", check.deviation_m, "m")
        if check.polynomial:
            group["polynomial"] = check.polynomial
        for name in _TEXTS:
            write_text(group, name, getattr(check, name))


def read_gauge_checks(file: h5py.File) -> tuple[GaugeCheck, ...]:
    """Read what `write_checks` wrote. Raises ValueError on values that cannot be."""
    return tuple(_read(gauge, file[path]) for gauge, path in _PATHS.items() if path in file)


def _read(gauge: str, group: h5py.Group) -> GaugeCheck:
    raw = {field: read_number(group, name) for field, name, _ in _NUMBERS} | {
        "gauge": gauge,
        "at": read_text(group, "date"),
        "passed": read_text(group, "result") == _PASSED,
        "polynomial": group["polynomial"][()].tolist() if "polynomial" in group else (),
        **{name: read_text(group, name) for name in _TEXTS},
    }
    return msgspec.convert(raw, GaugeCheck)
