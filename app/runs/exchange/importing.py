"""Foreign files as records: which columns are what, in which unit, since when."""

import datetime
import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs.blocks import RunBlock
from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ForeignColumns, ReportShare, part_of
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.foreign_files import has_own_time, is_csv, read_foreign, unpacked
from app.runs.exchange.recognition import ParseOptions, preview_file
from app.runs.exchange.rounded_times import even_times
from app.runs.exchange.units import parse_unit
from app.runs.metadata import QUANTITY_UNITS, Quantity, SourceFile
from config.schema import Gauge
from drivers.samples import SampleStatus
from messages.i18n import N_
from messages.message import Message, message, option

Floats = NDArray[np.float64]
LengthUnit = Literal["m", "mm", "um"]
_TIME_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
LENGTH_UNITS_M: dict[LengthUnit, float] = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_EVEN = 0.01
"""Relative spread of the time steps up to which a record has a rate."""

_LONGEST_S = 1e9
_EPOCHS = tuple(datetime.datetime(year, 1, 1, tzinfo=datetime.UTC) for year in (1970, 1904))
"""From which Unix and LabVIEW count seconds."""
_SINCE, _SPAN = datetime.datetime(2001, 1, 1, tzinfo=datetime.UTC), _EPOCHS[0] - _EPOCHS[1]
"""Times are taken to count from an epoch if they lie in the 66 years from 2001 on: no clock that starts with
a record gets there, and no times lie there from both epochs."""
_BLOCK_ROWS = 1 << 17
_HASHED_BYTES = 1 << 22
_UNPACKED_SHARE, _SURVEYED_SHARE, _READ_SHARE = 0.05, 0.1, 0.95
"""What of the time of reading is over when a file is unpacked, when its columns are found, and are read."""


class ImportPlan(msgspec.Struct, frozen=True):
    """Which columns of a foreign file are what, and in which unit. A reading is `gain * cell + offset`."""

    layout: FileLayout
    measures: Literal["relative", "plate"] = "relative"
    """What the second column is: plate against table, or plate against base."""
    time_unit: Literal["s", "ms", "us"] | None = None
    """None takes what the file names, else s."""
    unit: LengthUnit | None = None
    """Of the cells: this length, or this length per s or s^2; None takes what the file names, else m."""
    gain: float | None = None
    offset: float = 0.0
    unit_name: str | None = None
    """Unit after the gain, where it is not metres (per s, per s^2): rad, V, ..."""
    gain_uncertainty: float | None = None  # relative standard uncertainty; None is "not stated"
    quantity: Quantity = "displacement"
    from_s: float | None = None
    until_s: float | None = None
    """Kept stretch, on the file's own time axis in seconds, ends included; from the first stamp on."""
    segment: int | None = None  # which of the stretches between times that go back, counted from 0
    begun: datetime.datetime | None = None
    """Time of the file's first row; None takes what the file tells."""
    any_size: bool = False
    """Whether displacements are taken that are beyond the gauge's range, or far below a pullback."""


class RecordFacts(msgspec.Struct, frozen=True):
    """What a foreign file tells besides its numbers."""

    gauges: tuple[Gauge, ...]
    """Calibrations that turn the cells of each column into readings."""
    first_s: float
    """The file's time of the first row that is kept."""
    start: datetime.datetime | None
    """When the first row that is kept was recorded; None where neither file nor user says it."""
    rate_hz: float | None
    source: SourceFile
    interval_uncertainty: float = 0.0
    """Relative standard uncertainty of the rate of stamps that the logger rounded."""
    notes: tuple[Message, ...] = ()
    """What was concluded or left out."""


@dataclass(frozen=True, eq=False, slots=True)
class ForeignRecord:
    """A foreign file as it would be imported."""

    facts: RecordFacts
    time_s: Floats
    """(n,) float64: since the first row."""
    cells: tuple[Floats, ...]
    """One or two of (n,) float64: as written, NaN where absent."""

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def block(self) -> RunBlock:
        """The whole record."""
        return self._block(slice(None))

    def blocks(self) -> Iterator[RunBlock]:
        """The record in parts, so that its memory stays bounded."""
        for first in range(0, len(self), _BLOCK_ROWS):
            yield self._block(slice(first, first + _BLOCK_ROWS))

    def _block(self, rows: slice) -> RunBlock:
        cells = np.column_stack([column[rows] for column in self.cells])
        gains = np.array([gauge.gain_m_per_count for gauge in self.facts.gauges])
        zeros = np.array([gauge.zero_count for gauge in self.facts.gauges])
        with np.errstate(over="ignore"):  # what is too large is refused
            readings = gains * (cells - zeros)
        absent = np.isnan(cells).all(axis=1)
        status = np.where(absent, SampleStatus.MISSING, SampleStatus.GOOD).astype(np.uint8)
        return RunBlock(np.asarray(self.time_s[rows]), readings, status, cells)


def read_record(
    path: Path,
    plan: ImportPlan,
    report: ReportShare = lambda _: None,
    keep: Callable[[Floats], Floats] = lambda cells: cells,
) -> ForeignRecord:
    """Read a foreign file as it would be imported. Raises RunError.

    `report` is called with the share that is done. `keep` takes the cells of each gauge when they are
    complete, and returns them from where they are kept, so that no more than one column needs memory.
    `app.runs.exchange.reading_process` does it in a process with limits.
    """
    check_plan(plan)
    with unpacked(path, part_of(report, 0.0, _UNPACKED_SHARE)) as plain:
        plan = _with_time(plain, plan, part_of(report, _UNPACKED_SHARE, _SURVEYED_SHARE))
        columns = read_foreign(plain, plan.layout, part_of(report, _SURVEYED_SHARE, _READ_SHARE))
        return _record(path, plan, columns, part_of(report, _READ_SHARE, 1.0), keep)


def _record(
    path: Path,
    plan: ImportPlan,
    columns: ForeignColumns,
    report: ReportShare,
    keep: Callable[[Floats], Floats],
) -> ForeignRecord:
    if not len(columns):
        raise ImportFileError("{path} holds no rows. Give a file with numbers", path=path)
    unit_s = _time_unit_s(path, plan, columns)
    columns.time *= unit_s
    start = _start(plan, columns)
    _even_out(columns, plan)
    kept = _kept(columns, plan)
    time_s = columns.time[kept]
    _check_span(path, plan, time_s)
    first_s = float(time_s[0])
    if start is not None:
        start += datetime.timedelta(seconds=first_s - float(columns.time[0]))
    time_s -= first_s
    gauges = tuple(_gauge(path, plan, columns, number) for number in range(len(columns.cells)))
    cells = tuple(keep(_checked_size(path, plan, gauge, columns.cells.pop(0)[kept])) for gauge in gauges)
    uncertainty = columns.interval_uncertainty
    rate_hz = plan.layout.rate_hz or even_rate_hz(time_s)
    facts = RecordFacts(
        gauges, first_s, start, rate_hz, _source(path, report), uncertainty, tuple(columns.notes)
    )
    return ForeignRecord(facts, time_s, cells)


def even_rate_hz(time_s: Floats) -> float | None:
    """Samples a second of an even record, None of an uneven one."""
    steps = np.diff(time_s)
    if not len(steps):
        return None
    lowest, highest = float(steps.min()), float(steps.max())
    middling = float(np.median(steps, overwrite_input=True))
    is_even = max(highest - middling, middling - lowest) <= _EVEN * middling
    return 1.0 / middling if is_even else None


def _source(path: Path, report: ReportShare) -> SourceFile:
    digest, size_bytes = hashlib.sha256(), max(path.stat().st_size, 1)
    with path.open("rb") as file:
        while data := file.read(_HASHED_BYTES):
            digest.update(data)
            report(min(file.tell() / size_bytes, 1.0))
        return SourceFile(name=path.name, sha256=digest.hexdigest(), size_bytes=file.tell())


def _with_time(path: Path, plan: ImportPlan, report: ReportShare) -> ImportPlan:
    """Plan with the time column that the names tell, where none is given. Raises ImportFileError."""
    layout = plan.layout
    if layout.rate_hz is not None or layout.time or has_own_time(path):
        return plan
    lines = ParseOptions(layout.delimiter, layout.decimal, layout.skip, layout.header, layout.encoding)
    found = preview_file(path, lines, report)
    if not found.time and not is_csv(path):
        return plan
    numbers = dict(zip(found.columns, found.numbers, strict=True))
    if not found.time or {found.time, str(numbers[found.time])} & {layout.table, layout.second}:
        raise ImportFileError(
            "{path}: no column of times is found. Choose it by {time_option}, or set {rate_option}",
            path=path,
            time_option=option("--time"),
            rate_option=option("--rate"),
        )
    layout = msgspec.structs.replace(layout, time=found.time, date=layout.date or found.date or None)
    return msgspec.structs.replace(plan, layout=layout)


def _time_unit_s(path: Path, plan: ImportPlan, columns: ForeignColumns) -> float:
    if columns.is_stamped or columns.is_even:
        return 1.0
    if plan.time_unit is not None:
        return _TIME_UNITS_S[plan.time_unit]
    named = columns.units[0]
    unit = parse_unit(named) if named else None
    if unit is not None and not unit.is_time:
        raise ImportFileError(
            "{path}, column {name}: {unit} is no unit of time. Check {time_option}, or add {option} s, ms"
            " or us",
            path=path,
            name=columns.names[0],
            unit=named,
            time_option=option("--time"),
            option=option("--time-unit"),
        )
    if unit is not None and unit.scale != 1.0:
        columns.notes.append(
            message("times are in {unit}, as {name} says", unit=named, name=columns.names[0])
        )
    return 1.0 if unit is None else unit.scale


def _start(plan: ImportPlan, columns: ForeignColumns) -> datetime.datetime | None:
    """Time of the file's first row."""
    if plan.begun is not None:
        return plan.begun if plan.begun.tzinfo else plan.begun.astimezone()
    if columns.start is not None:
        return columns.start + datetime.timedelta(seconds=float(columns.time[0]))
    if columns.is_even:
        return None
    first_s = float(columns.time[0])
    starts_s = {epoch: first_s - (_SINCE - epoch).total_seconds() for epoch in _EPOCHS}
    epochs = [epoch for epoch, since_s in starts_s.items() if 0.0 <= since_s < _SPAN.total_seconds()]
    return epochs[0] + datetime.timedelta(seconds=first_s) if epochs else None


def _even_out(columns: ForeignColumns, plan: ImportPlan) -> None:
    """Replace stamps that a logger has rounded, so that some repeat, by even ones."""
    if columns.is_even or plan.segment is not None:
        return
    if min((float(steps.min()) for _, steps in _steps(columns.time)), default=1.0) != 0.0:
        return
    even = even_times(columns.time)
    if even is None:
        return
    columns.time = even.time - even.time[0] + columns.time[0]
    columns.interval_uncertainty = even.interval_relative_uncertainty
    note = N_("times repeat, rounded to {resolution:g} s: rows are taken as even, {rate:.6g} Hz")
    columns.notes.append(message(note, resolution=even.resolution, rate=1.0 / even.interval))


def check_plan(plan: ImportPlan) -> None:
    """Refuse options that do not fit together, and numbers that cannot be. Raises ImportFileError."""
    _check_exclusions(plan)
    gain = 1.0 if plan.gain is None else plan.gain
    if not math.isfinite(gain) or gain == 0.0:
        template = N_(
            "{option} {value:g} cannot be. Give a finite number other than 0; a negative one turns the gauge"
        )
        raise ImportFileError(template, option=option("--gain"), value=gain)
    if not math.isfinite(plan.offset / gain):
        template = N_("{option} {value:g} cannot be. Give a finite number")
        raise ImportFileError(template, option=option("--offset"), value=plan.offset)
    share, rate_hz = plan.gain_uncertainty, plan.layout.rate_hz
    if share is not None and not (math.isfinite(share) and share >= 0.0):
        template = N_("{option} {value} cannot be. Give a finite share of the gain, 0 or above")
        raise ImportFileError(template, option=option("--gain-uncertainty"), value=share)
    if rate_hz is not None and not (math.isfinite(rate_hz) and rate_hz > 0.0):
        template = N_("{option} {value:g} cannot be. Give samples a second, above 0")
        raise ImportFileError(template, option=option("--rate"), value=rate_hz)


def _check_exclusions(plan: ImportPlan) -> None:
    if plan.gain is not None and plan.unit is not None:
        template = N_(
            "{unit_option} and {gain_option} exclude each other: a gain says the unit. Give one of them"
        )
        raise ImportFileError(template, unit_option=option("--unit"), gain_option=option("--gain"))
    if plan.unit_name and plan.gain is None:
        raise ImportFileError(
            "{name_option} {unit_name!r} needs {gain_option}, the {unit_name} of one cell unit",
            name_option=option("--unit-name"),
            gain_option=option("--gain"),
            unit_name=plan.unit_name,
        )
    if plan.layout.rate_hz is not None and plan.layout.time:
        template = N_("{time_option} and {rate_option} exclude each other. Give one of them")
        raise ImportFileError(template, time_option=option("--time"), rate_option=option("--rate"))


def _gauge(path: Path, plan: ImportPlan, columns: ForeignColumns, number: int) -> Gauge:
    """Calibration that turns cells of a column into readings. Raises ImportFileError."""
    gain = plan.gain
    if gain is None:
        gain = LENGTH_UNITS_M[plan.unit] if plan.unit else _named_gain(path, plan, columns, number)
    return Gauge(
        gain_m_per_count=gain,
        zero_count=-plan.offset / gain if plan.offset else 0.0,
        gain_relative_standard_uncertainty=plan.gain_uncertainty,
    )


def _named_gain(path: Path, plan: ImportPlan, columns: ForeignColumns, number: int) -> float:
    """Gain by the unit that the file names. Raises ImportFileError for one of something else."""
    name, named = columns.names[1 + number], columns.units[1 + number]
    unit = parse_unit(named) if named else None
    if unit is None:
        note = N_("{name} names no unit: it is taken as {unit}. {option} states another")
        named = QUANTITY_UNITS[plan.quantity]
        columns.notes.append(message(note, name=name, unit=named, option=option("--unit")))
        return 1.0
    if unit.quantity is None:
        raise ImportFileError(
            "{path}, column {name}: what one {unit} means is not known. Add {gain_option}, metres of one"
            " {unit}, or {unit_option}",
            path=path,
            name=name,
            unit=named,
            gain_option=option("--gain"),
            unit_option=option("--unit"),
        )
    # A length is taken for the quantity that is stated: names leave out "per second" often enough.
    if unit.quantity not in ("displacement", plan.quantity):
        raise ImportFileError(
            "{path}, column {name}: {unit} is a unit of {quantity}. Add {option} {quantity}, or choose"
            " another column",
            path=path,
            name=name,
            unit=named,
            quantity=unit.quantity,
            option=option("--quantity"),
        )
    columns.notes.append(message("{name} is in {unit}, as the file says", name=name, unit=named))
    return unit.scale


def _check_span(path: Path, plan: ImportPlan, time_s: Floats) -> None:
    with np.errstate(over="ignore"):
        is_too_long = not float(time_s[-1]) - float(time_s[0]) <= _LONGEST_S
    if is_too_long:
        raise ImportFileError(
            "{path}: its times go from {time_s:g} s to {time_s_2:g} s, too long for a record."
            " Check {time_option} {time} and {unit_option} {time_unit}",
            time_option=option("--time"),
            unit_option=option("--time-unit"),
            path=path,
            time_s=time_s[0],
            time_s_2=time_s[-1],
            time=plan.layout.time,
            time_unit=plan.time_unit or "s",
        )


def _checked_size(path: Path, plan: ImportPlan, gauge: Gauge, cells: Floats) -> Floats:
    """Cells whose readings are finite. Raises ImportFileError."""
    low, high = float(np.fmin.reduce(cells)), float(np.fmax.reduce(cells))
    if any(math.isinf(gauge.gain_m_per_count * (cell - gauge.zero_count)) for cell in (low, high)):
        template = N_("{path}: with {option} {value:g} its readings are too large. Check both")
        raise ImportFileError(template, path=path, option=option("--gain"), value=plan.gain or 1.0)
    return cells


def _kept(columns: ForeignColumns, plan: ImportPlan) -> slice:
    """Rows of the segment and stretch that were asked for, their times rising. Raises ImportFileError."""
    time = columns.time
    segment = _segment(columns, plan.segment)
    _check_rising(columns, segment)
    first = -math.inf if plan.from_s is None else plan.from_s
    last = math.inf if plan.until_s is None else plan.until_s
    start = segment.start + int(np.searchsorted(time[segment], first))
    end = segment.start + int(np.searchsorted(time[segment], last, "right"))
    if start >= end:
        low, high = time[segment][0], time[segment][-1]
        raise ImportFileError(
            "{path}: no row lies between {first:g} s and {last:g} s. Its times go from {low:g}"
            " s to {high:g} s: change {from_option} and {until_option}",
            from_option=option("--from"),
            until_option=option("--until"),
            path=columns.path,
            first=first,
            last=last,
            low=low,
            high=high,
        )
    return slice(start, end)


def _segment(columns: ForeignColumns, number: int | None) -> slice:
    time = columns.time
    if number is None:
        return slice(0, len(time))
    bounds = [0, *(np.flatnonzero(np.diff(time) < 0.0) + 1).tolist(), len(time)]
    count = len(bounds) - 1
    if not 0 <= number < count:
        template = N_(
            "{path}: there is no segment {number}. Its times rise in {count} stretches: give 0 to {count_2}"
        )
        raise ImportFileError(template, path=columns.path, number=number, count=count, count_2=count - 1)
    return slice(bounds[number], bounds[number + 1])


def _steps(time: Floats) -> Iterator[tuple[int, Floats]]:
    """Differences of times in parts, each with the row that its first one begins at."""
    for first in range(0, len(time) - 1, _BLOCK_ROWS):
        yield first, np.diff(time[first : first + _BLOCK_ROWS + 1])


def _check_rising(columns: ForeignColumns, rows: slice) -> None:
    for first, steps in _steps(columns.time[rows]):
        is_wrong = steps <= 0.0
        if is_wrong.any():
            raise _not_rising(columns, rows.start + first + int(np.flatnonzero(is_wrong)[0]) + 1)


def _not_rising(columns: ForeignColumns, row: int) -> ImportFileError:
    before, now = columns.time[row - 1 : row + 1]
    if now < before:
        fault = message(
            "time goes back from {before} to {now}. Pick one stretch with {option} N, from 0",
            before=str(before),
            now=str(now),
            option=option("--segment"),
        )
    else:
        fault = message(
            "time {now} comes twice, and the rows are not even. Export the times with more digits, delete the"
            " line, or give {option} HZ",
            now=str(now),
            option=option("--rate"),
        )
    return columns.fault(row, 0, fault)
