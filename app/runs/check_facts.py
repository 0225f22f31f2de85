"""The last check of each gauge to and from a run file."""

import h5py
import msgspec

from app.runs import format as names
from app.runs.format import read_number, read_text, write_number, write_text
from config.schema import GaugeCheck

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
