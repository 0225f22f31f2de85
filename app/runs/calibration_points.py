"""Readings of a calibration as CSV, and the calibration that comes of them as settings of a gauge."""

import csv
import datetime
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from analysis.calibration.calibrate import Calibration
from analysis.calibration.points import CalibrationPoints
from app.runs.errors import RunError
from config.schema import Filter, Gauge
from messages.i18n import N_

_COLUMNS = ("counts", "dial_mm")
_WAYS = {"up": 1, "down": -1, "+1": 1, "1": 1, "-1": -1, "+": 1, "-": -1}
_SIMULATED = "SIM-"  # begins the serial numbers of the gauges in the shipped calibration
_RANGE_OF_FILE = f"The columns are {', '.join(_COLUMNS)}, and perhaps direction (up, down) and round"


class PointsError(RunError, ValueError):
    """A file of readings that cannot be used."""


@dataclass(frozen=True, slots=True)
class CalibrationDetails:
    """What belongs to a calibration beside its numbers."""

    date: datetime.date
    valid_until: datetime.date | None = None
    reference: str = ""
    certificate: str = ""
    calibrated_by: str = ""
    serial_number: str | None = None
    """None keeps that of the gauge as it was, unless it is one of the simulated stand."""
    range_m: float | None = None
    filter: Filter | None = None
    """None keeps that of the gauge as it was."""


def calibrated_gauge(before: Gauge, found: Calibration, about: CalibrationDetails) -> Gauge:
    """The gauge with its new calibration; delay and what it measures stay as they were."""
    kept = {name for name in ("serial_number", "range_m", "filter") if getattr(about, name) is None}
    if before.serial_number.startswith(_SIMULATED):
        before = before.replace(serial_number="")
    return before.replace(
        gain_m_per_count=found.gain_m_per_count.value,
        zero_count=found.zero_count.value,
        polynomial=found.polynomial,
        # An analysis takes it for normal, whatever the few degrees of freedom behind it.
        gain_relative_standard_uncertainty=found.gain_relative_normal_uncertainty,
        zero_standard_uncertainty_m=found.zero_standard_uncertainty_m,
        nonlinearity_m=found.characteristics.nonlinearity_m,
        hysteresis_m=found.characteristics.hysteresis_m,
        repeatability_m=found.characteristics.repeatability_m,
        **{name: value for name, value in asdict(about).items() if name not in kept},
    )


def read_points(path: Path) -> CalibrationPoints:
    """Read a CSV file with the columns counts and dial_mm, in the order in which they were taken.

    Columns direction and round are taken too, else seen from the dial. Raises PointsError, CalibrationError.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise PointsError(
            "{path}: cannot be read ({error}). Give a readable CSV file", path=path, error=error
        ) from None
    header = lines[0] if lines else ""
    separator = next((mark for mark in ";\t" if mark in header), ",")
    table = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator)]
    names = [name.lower() for name in table[0]] if table else []
    for column in _COLUMNS:
        if column not in names:
            raise PointsError(
                "{path}: there is no column {column} in {header!r}. {range_of_file}",
                path=path,
                column=column,
                header=header[:60],
                range_of_file=_RANGE_OF_FILE,
            )
    rows = [(line, dict(zip(names, row, strict=False))) for line, row in enumerate(table[1:], 2) if any(row)]
    counts, dial_mm = (_numbers(path, rows, name, separator) for name in _COLUMNS)
    taken: list[list[int]] = []
    if {"direction", "round"} <= set(names):
        ways = [_way(path, line, row.get("direction", "")) for line, row in rows]
        taken = [ways, [int(n) for n in _numbers(path, rows, "round", separator)]]
    return CalibrationPoints.from_readings(counts, np.array(dial_mm) * 1e-3, *taken)


def write_points(path: Path, counts: Sequence[float], dial_m: Sequence[float]) -> None:
    """Write readings as `read_points` reads them. Raises OSError."""
    lines = [f"{count!r},{place * 1e3:.6g}\n" for count, place in zip(counts, dial_m, strict=True)]
    path.write_text("counts,dial_mm\n" + "".join(lines), encoding="utf-8")


def _numbers(path: Path, rows: list[tuple[int, dict[str, str]]], name: str, separator: str) -> list[float]:
    values = []
    for line, row in rows:
        text = row.get(name, "")
        try:
            values.append(float(text if separator == "," else text.replace(",", ".")))
        except ValueError:
            template = N_("{path}: line {line}: {name} {text!r} is not a number. Correct it")
            raise PointsError(template, path=path, line=line, name=name, text=text) from None
    return values


def _way(path: Path, line: int, text: str) -> int:
    try:
        return _WAYS[text.lower()]
    except KeyError:
        template = N_("{path}: line {line}: direction {text!r} is not known. Use up or down")
        raise PointsError(template, path=path, line=line, text=text) from None
