"""The readings of a record that can be analysed: checked, on true time, gaps and overloads left out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays import Floats
from analysis.formatting import format_number
from analysis.quantities import ResultWarning
from analysis.record import Record, RecordError, StandMasses
from messages.message import message

DELAY_MAX_S = 0.5
"""A gauge later than this is not read in the same test."""
SAMPLES_MIN = 50
"""With fewer readings a decay cannot be distinguished from noise or drift."""


@dataclass(frozen=True, eq=False, slots=True)
class Channel:
    """Valid readings of one gauge: `time_s` (n,) from the record's first sample, and `value_m` (n,)."""

    time_s: Floats
    value_m: Floats

    def __len__(self) -> int:
        return len(self.time_s)

    def between(self, start_s: float, end_s: float) -> "Channel":
        """Readings with start_s <= time < end_s."""
        first, last = np.searchsorted(self.time_s, (start_s, end_s))
        return Channel(self.time_s[first:last], self.value_m[first:last])

    def scaled(self, factor: float) -> "Channel":
        """Readings times `factor`."""
        return Channel(self.time_s, self.value_m * factor)


@dataclass(frozen=True, eq=False, slots=True)
class Channels:
    """Both gauges on true time.

    Attributes
    ----------
    table : Channel
        Gauge 1.
    relative : Channel or None
        Gauge 2 as it reads (against the table, or against the base where `Record` says so).
    origin_s, clock_scale : float
        Record time of the first sample; true seconds per second of the record.
    interval_s : float
        Median time between rows.
    quantisation_m : (float, float)
        Smallest step of each gauge's readings.
    """

    table: Channel
    relative: Channel | None
    origin_s: float
    clock_scale: float
    interval_s: float
    quantisation_m: tuple[float, float]

    def to_record_time(self, time_s: float) -> float:
        """Time in the base of `Record.time_s`."""
        return self.origin_s + time_s / self.clock_scale

    def from_record_time(self, time_s: Floats) -> Floats:
        """True seconds since the first sample, of times in the base of `Record.time_s`."""
        return (time_s - self.origin_s) * self.clock_scale


def read_channels(record: Record) -> tuple[Channels, list[ResultWarning]]:
    """Check `record` and take its valid readings.

    Returns
    -------
    Channels
    list of ResultWarning
        What was left out, and why.

    Raises
    ------
    RecordError
        Times that go back, columns of unequal length, masses or clock that cannot be, no valid reading.
    """
    check_masses(record.masses)
    check_gauges(record)
    _check_columns(record)
    time_s = (record.time_s - record.time_s[0]).astype(np.float64) * record.clock_scale
    warnings: list[ResultWarning] = []
    table_valid = _valid(
        record.table_displacement_m, record.table_overload, record.table_gauge.range_m, gauge=1
    )
    table = Channel(
        time_s[table_valid] - record.table_gauge.delay_s,
        record.table_displacement_m[table_valid].astype(np.float64),
    )
    relative = None
    if record.relative_displacement_m is not None:
        relative = _relative(record, record.relative_displacement_m, time_s, warnings)
    steps = (quantisation_m(table.value_m), 0.0 if relative is None else quantisation_m(relative.value_m))
    channels = Channels(
        table, relative, float(record.time_s[0]), record.clock_scale, float(np.median(np.diff(time_s))), steps
    )
    return channels, warnings


def check_masses(masses: StandMasses) -> None:
    """Raise RecordError unless masses and gravity are positive and finite."""
    for name in ("table_mass_kg", "plate_mass_kg", "gravity_m_per_s2"):
        value = getattr(masses, name)
        if not (np.isfinite(value) and value > 0.0):
            raise RecordError(
                "{name} = {value!r} is not a positive number. Give the stand's true value.",
                name=name,
                value=value,
            )
        stated = name.replace("_kg", "_uncertainty_kg").replace("gravity_", "gravity_uncertainty_")
        _check_not_negative(stated, getattr(masses, stated))


def check_gauges(record: Record) -> None:
    """Raise RecordError unless what is stated of gauges, clock and pullback can be."""
    _check_not_negative("clock_scale_uncertainty", record.clock_scale_uncertainty)
    for gauge, known in (("table_gauge", record.table_gauge), ("relative_gauge", record.relative_gauge)):
        _check_not_negative(f"{gauge}.gain_relative", known.gain_relative or 0.0)
        _check_not_negative(f"{gauge}.nonlinearity_m", known.nonlinearity_m)
        _check_not_negative(f"{gauge}.delay_s_uncertainty", known.delay_s_uncertainty)
        if not abs(known.delay_s) <= DELAY_MAX_S:
            raise RecordError(
                "{gauge}.delay_s = {delay_s!r} is not within {delay_max_s:g} s. Measure it anew.",
                gauge=gauge,
                delay_s=known.delay_s,
                delay_max_s=DELAY_MAX_S,
            )
        if known.range_m is not None and not known.range_m > 0.0:
            raise RecordError(
                "{gauge}.range_m = {range_m!r} is not positive. Give the range, or none.",
                gauge=gauge,
                range_m=known.range_m,
            )
    if record.pullback_m is not None and not np.isfinite(record.pullback_m):
        raise RecordError(
            "pullback_m = {pullback_m!r} is not a number. Give the pullback, or none.",
            pullback_m=record.pullback_m,
        )


def quantisation_m(value_m: Floats) -> float:
    """Smallest step between different readings (m): their resolution, where they are quantised."""
    steps = np.diff(np.unique(value_m))
    return float(steps.min()) if len(steps) else 0.0


def _check_not_negative(name: str, value: float) -> None:
    if not (np.isfinite(value) and value >= 0.0):
        raise RecordError(
            "{name} = {value!r} is not zero or a positive number. State it, or leave it out.",
            name=name,
            value=value,
        )


def _check_columns(record: Record) -> None:
    time_s = record.time_s
    if len(time_s) < SAMPLES_MIN:
        raise RecordError(
            "the record has {count} samples, too short for a decay. Record from the hold to rest.",
            count=len(time_s),
        )
    for name in ("table_displacement_m", "relative_displacement_m", "table_overload", "relative_overload"):
        column = getattr(record, name)
        if column is not None and len(column) != len(time_s):
            raise RecordError(
                "{name} has {count} values for {times} times. Give one for each time.",
                name=name,
                count=len(column),
                times=len(time_s),
            )
    if not (np.isfinite(record.clock_scale) and 0.5 < record.clock_scale < 2.0):
        raise RecordError(
            "clock_scale = {clock_scale!r} is not near 1. Check the clock fit of the run.",
            clock_scale=record.clock_scale,
        )
    _check_times(time_s)


def _check_times(time_s: Floats) -> None:
    if not np.isfinite(time_s).all():
        row = int(np.flatnonzero(~np.isfinite(time_s))[0])
        raise RecordError(
            "time_s[{row}] is {time_s}. Leave out rows without a time.", row=row, time_s=time_s[row]
        )
    steps = np.diff(time_s)
    if (steps <= 0.0).any():
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        raise RecordError(
            "time goes back at row {row}: {before_s} s, then {after_s} s. Sort the rows, or"
            " take one stretch of them.",
            row=row,
            before_s=format_number(time_s[row - 1], 15),
            after_s=format_number(time_s[row], 15),
        )


def _valid(
    value_m: Floats, overload: NDArray[np.bool_] | None, range_m: float | None, gauge: int
) -> NDArray[np.bool_]:
    present = np.isfinite(value_m)
    if not present.any():
        raise RecordError(
            "gauge {gauge} holds no reading (all are NaN). Check its cable and the import column.",
            gauge=gauge,
        )
    valid = present.copy()
    if overload is not None:
        valid &= ~overload
    if range_m is not None:
        valid[present] &= np.abs(value_m[present]) < range_m
    if int(valid.sum()) < SAMPLES_MIN:
        raise RecordError(
            "gauge {gauge} has {count} valid readings of {total}, the rest missing or clipped."
            " Re-centre the gauge or choose a wider range, and record again.",
            gauge=gauge,
            count=int(valid.sum()),
            total=len(value_m),
        )
    return valid


def _relative(
    record: Record, value_m: Floats, time_s: Floats, warnings: list[ResultWarning]
) -> Channel | None:
    gauge = record.relative_gauge
    try:
        valid = _valid(value_m, record.relative_overload, gauge.range_m, gauge=2)
    except RecordError as error:
        warnings.append(
            ResultWarning(
                "gauge-2-absent",
                message("{error} The friction comes from the table channel alone.", error=error),
            )
        )
        return None
    return Channel(time_s[valid] - gauge.delay_s, value_m[valid].astype(np.float64))
