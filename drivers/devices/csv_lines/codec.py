"""Lines of values, encoded and decoded."""

import math
from functools import reduce
from operator import xor

import numpy as np

from drivers.arrays import Counts, Floats, Records, UInt8s
from drivers.clock import rate_from_steps
from drivers.crc import crc16
from drivers.devices.csv_lines.columns import TIME_UNIT_S, Column, LineFormat
from drivers.devices.csv_lines.line_parser import LineParser
from drivers.line_counting import BY_COUNT, BY_SEQUENCE, BY_TIME, STATE, count_lines, make_rules
from drivers.packets import MAX_GAP_S, PACKET, LossEstimator, PacketDecoder
from drivers.samples import SampleStatus

_BOTH_OVERLOADED = int(SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE)
MAX_LINE_BYTES = 1024  # a longer line is garbage
_MAX_HELD_BYTES = 2 * MAX_LINE_BYTES
_LINES_EXAMINED = 200


def encode_line(
    layout: LineFormat,
    time_s: float,
    table: float,
    relative: float,
    sequence: int = 0,
    *,
    is_overloaded: bool = False,
) -> bytes:
    """One line with its end.

    `time_s` is the device's time; us and ms columns are whole numbers that wrap, as `sequence` does. Whole
    readings have no decimal point; a `value` column has that of `table`. `ignore` columns become 0, units
    "kg" where none is given, words "S".
    """
    fields = []
    for column in layout.columns:
        match column:
            case Column.TIME_US | Column.TIME_MS:
                fields.append(str(_wrapped(round(time_s / TIME_UNIT_S[column]), layout.time_wrap)))
            case Column.TIME_S:
                fields.append(_number(round(time_s, 6), layout.decimal))
            case Column.TABLE | Column.VALUE:
                fields.append(_number(table, layout.decimal))
            case Column.RELATIVE:
                fields.append(_number(relative, layout.decimal))
            case Column.SEQUENCE:
                fields.append(str(_wrapped(sequence, layout.sequence_wrap)))
            case Column.XOR:
                fields.append(f"{reduce(xor, layout.separator.join(fields).encode('ascii'), 0):02X}")
            case Column.CRC:
                fields.append(f"{crc16(layout.separator.join(fields).encode('ascii')):04X}")
            case Column.STATUS:
                is_told = is_overloaded and layout.overload_status
                fields.append(layout.overload_status[0] if is_told else layout.good_status)
            case _:
                texts = {Column.UNIT: layout.unit or "kg", Column.EMPTY: "", Column.WORD: "S"}
                fields.append(texts.get(column, "0"))
    return (layout.separator.join(fields) + layout.line_end).encode("ascii")


def encode_lines(
    layout: LineFormat,
    times_s: Floats,
    counts: Counts,
    first_sequence: int = 0,
    status: UInt8s | None = None,
) -> list[bytes]:
    """A line for each row of `counts` (n, 2), at device times `times_s` (n,); see `encode_line`.

    `status` (n,) are flags of `SampleStatus`; None: no reading is overloaded.
    """
    shown = (SampleStatus.OVERLOAD_TABLE, _BOTH_OVERLOADED)[layout.channels - 1]
    overloads = [False] * len(counts) if status is None else (status & shown != 0).tolist()
    rows = zip(times_s.tolist(), counts.tolist(), overloads, strict=True)
    return [
        encode_line(layout, time_s, table, relative, first_sequence + row, is_overloaded=is_overloaded)
        for row, (time_s, (table, relative), is_overloaded) in enumerate(rows)
    ]


def _wrapped(value: int, wrap: int) -> int:
    return value % wrap if wrap else value


def _number(value: float, decimal: str) -> str:
    text = str(int(value)) if value == int(value) else repr(value)
    return text.replace(".", decimal)


class LineDecoder(PacketDecoder):
    """Bytes to sample blocks; sequence or time columns show lost samples.

    - A sequence proves missing samples.
    - A time alone: a line that comes k periods after the one before shows k - 1 lost ones
      (`missing_estimated`). Losses shorter than the step of the device's clock do not show.
    - Neither: a row stands for each broken line; other losses are estimated from the host's clock, in
      `losses` alone.

    As many of the lost rows as lines came broken are damaged, the others missing. A time or sequence that
    goes back or leaps by more than `max_gap_s` is a restart of the device: the rows until it are estimated
    from the host's clock.

    The first line is left out, because it may be cut; lines before the first good one are a banner. Without a
    checksum a damaged digit in a value is not noticed. `rate_hz` is, with a time column, that of its times;
    `clock_step_s` the step of the device's clock. Readings of `overload_count` and more are marked.
    """

    def __init__(
        self,
        layout: LineFormat,
        rate_hz: float,
        clock_step_s: float = 0.0,
        overload_count: float = math.inf,
        max_gap_s: float = MAX_GAP_S,
    ) -> None:
        super().__init__(STATE, rate_hz, max_gap_s)
        self._parser = LineParser(layout)
        time = layout.time_column
        place = BY_SEQUENCE if Column.SEQUENCE in layout.columns else BY_TIME if time else BY_COUNT
        unit_s = TIME_UNIT_S[time] if time else 0.0
        wraps = layout.time_wrap, layout.sequence_wrap
        self._rules = make_rules(place, rate_hz, unit_s, clock_step_s, wraps, overload_count, max_gap_s)
        self._has_time = time is not None
        self._loss_estimator = LossEstimator(rate_hz) if place == BY_COUNT else None
        self._skipping = True
        """Until the end of the line that is under way."""

    def expect_restart(self) -> None:
        self._state["broken"] += self._state["started"] * bool(self._unfinished)
        self._skipping = True
        super().expect_restart()

    def _whole_lines(self, data: bytes) -> bytes:
        if self._skipping:
            start = first_line_start(data)
            self._state["discarded_bytes"] += start - 1 if start else len(data)
            data = data[start:] if start else b""
            self._skipping = not start
        end = whole_lines_end(data)
        self._unfinished = data[end:]
        if len(self._unfinished) > MAX_LINE_BYTES + _MAX_HELD_BYTES:
            self._state["broken"] += self._state["started"]
            self._state["discarded_bytes"] += len(self._unfinished)
            self._unfinished = b""
            self._skipping = True
        return data[:end]

    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        data = self._whole_lines(data)
        lines = self._parser.read(data)
        packets = np.empty(len(lines), dtype=PACKET)
        counts = np.empty((len(lines), 2))
        self._state["restart_rows"] = self._rows_since(arrival_ns, len(lines))
        hold_from = len(data) if self._skipping else len(data) - _MAX_HELD_BYTES
        found, done = count_lines(lines, hold_from, self._state, self._rules, packets, counts)
        if done < len(lines):
            self._unfinished = data[int(lines[done]["start"]) :] + self._unfinished
        return packets[:found], counts[:found]


def rate_from_lines(layout: LineFormat, data: bytes) -> float | None:
    """Samples a second by the device's own times; None while there are too few lines."""
    time = layout.time_column
    if time is None:
        return None
    lines = LineParser(layout).read(whole_lines(data))
    steps = np.diff(lines["time"][lines["good"] != 0])
    if layout.time_wrap:
        steps = (steps + layout.time_wrap / 2) % layout.time_wrap - layout.time_wrap / 2
    return rate_from_steps(steps * TIME_UNIT_S[time], clock_step_from_lines(layout, data))


def clock_step_from_lines(layout: LineFormat, data: bytes) -> float:
    """Step (s) of the device's clock: the unit of whole numbers, or the last decimal of seconds."""
    if layout.time_column is None:
        return 0.0
    if layout.time_column is not Column.TIME_S:
        return TIME_UNIT_S[layout.time_column]
    place = layout.columns.index(Column.TIME_S)
    separator, decimal = layout.separator.encode("ascii"), layout.decimal.encode("ascii")
    lines = whole_lines(data).splitlines()[:_LINES_EXAMINED]
    fields = [line.split(separator) for line in lines if line.count(separator) == len(layout.columns) - 1]
    decimals = [row[place].strip().partition(decimal)[2] for row in fields]
    return 10.0 ** -max((len(digits) for digits in decimals if digits.isdigit()), default=0)


def first_line_start(data: bytes) -> int:
    """Position after the first terminator; 0 if there is none."""
    return min((at + 1 for at in (data.find(b"\n"), data.find(b"\r")) if at >= 0), default=0)


def whole_lines_end(data: bytes) -> int:
    """Position after the last terminator; 0 if there is none."""
    return max(data.rfind(b"\n"), data.rfind(b"\r")) + 1


def whole_lines(data: bytes) -> bytes:
    """Lines of `data` without the first, which may be cut, and the unfinished last one."""
    return data[first_line_start(data) : whole_lines_end(data)]


def has_good_line(layout: LineFormat, data: bytes) -> bool:
    """Whether one line of `data` after the first is good."""
    return bool(LineParser(layout).read(whole_lines(data))["good"].any())
