"""Compiled loop that counts what was lost before each reading, from the reading's time or sequence number.

A reading is called a line here, whatever its bytes look like.
"""

import numpy as np

from drivers.arrays import Floats, Record, Records, record_type
from drivers.compiled import compiled, inlined
from drivers.packets import count_packet, is_plausible_gap, state_type
from drivers.samples import SampleStatus

BY_SEQUENCE, BY_TIME, BY_COUNT = range(3)
"""What gives a line its place among the others: its sequence, its time, or only its arrival."""

STATE = state_type("broken", "last_sequence last_time")
"""What the decoder keeps between calls; `broken` counts the lines since the last good one."""

RULES = record_type("place", "period_s unit_s clock_step_s time_wrap sequence_wrap max_gap overload_count")
"""What does not change during a stream: the unit of the time column, 0 without one; the step of the device's
clock; where time and sequence wrap, in their units, 0 where they do not; the gap in samples."""
LINE = record_type("start end good overload", "time sequence table relative")
"""A line: where it is, whether it is good, the overloads that it reports (`SampleStatus`), and its values."""

_NEW_START = -1
_CORRUPT = -2
_TABLE = int(SampleStatus.OVERLOAD_TABLE)
_RELATIVE = int(SampleStatus.OVERLOAD_RELATIVE)


def make_rules(
    place: int,
    rate_hz: float,
    unit_s: float,
    clock_step_s: float,
    wraps: tuple[float, float],
    overload_count: float,
    max_gap_s: float,
) -> Records:
    """(1,) RULES; `place` is one of BY_SEQUENCE, BY_TIME and BY_COUNT, `wraps` those of time and sequence."""
    values = (place, 1 / rate_hz, unit_s, clock_step_s, *wraps, max_gap_s * rate_hz, overload_count)
    return np.array([values], dtype=RULES)


@compiled
def count_lines(
    lines: Records, hold_from: int, state: Records, rules: Records, packets: Records, counts: Floats
) -> tuple[int, int]:
    """Fill packets (lines,) and counts (lines, 2) of good lines; returns numbers of good and used lines.

    A line out of sequence is believed only if the next line confirms it, because a damaged digit in a time
    or sequence would otherwise invent a gap. Where the next line has not come yet, and the line starts at
    `hold_from` or later, it waits: the caller passes it again with the next data. `state` (1,) is updated.
    """
    stream = state[0]
    rule = rules[0]
    found = 0
    for i in range(len(lines)):
        line = lines[i]
        step = _step(stream, rule, line) if line.good else _CORRUPT
        if step == _NEW_START or step > 1 + stream.broken:
            after = i + 1
            while after < len(lines) and not lines[after].good:
                after += 1
            if after < len(lines):
                step = _confirmed_step(stream, rule, line, step, lines[after])
            elif line.start >= hold_from:
                return found, i
        if step == _CORRUPT or step == 0:
            stream.discarded_bytes += line.end - line.start
            stream.repeated += step == 0
            stream.broken += step != 0 and stream.started
            continue
        _fill_packet(stream, rule, line, step, packets[found])
        counts[found, 0] = line.table
        counts[found, 1] = line.relative
        found += 1
    return found, len(lines)


@inlined
def _step(stream: Record, rule: Record, line: Record) -> int:
    """Rows from the last good line to this one; 0 where it is the same line again."""
    if not stream.started:
        return 1
    if rule.place == BY_COUNT:
        return _NEW_START if stream.restarting else 1 + int(stream.broken)
    if rule.place == BY_SEQUENCE:
        ahead = _advance(line.sequence - stream.last_sequence, rule.sequence_wrap)
        step = int(ahead) if 0 <= ahead <= rule.max_gap + 1 else _NEW_START
    else:
        step = _time_step(stream, rule, line)
    return _NEW_START if stream.restarting and not is_plausible_gap(stream, step - 1) else step


@inlined
def _time_step(stream: Record, rule: Record, line: Record) -> int:
    """Rows by time; a line that is late by less than half a period or the clock's step is on time."""
    elapsed_s = _advance(line.time - stream.last_time, rule.time_wrap) * rule.unit_s
    periods = elapsed_s / rule.period_s
    if not 0 <= periods <= rule.max_gap + 1:
        return _NEW_START
    if elapsed_s - rule.period_s <= max(rule.period_s / 2, rule.clock_step_s):
        return 1
    return int(np.rint(periods))


@inlined
def _advance(difference: float, wrap: float) -> float:
    """Difference of two readings of a counter that wraps, within half its range."""
    if wrap == 0:
        return difference
    forward = difference - wrap * np.floor(difference / wrap)
    return float(forward if forward < wrap / 2 else forward - wrap)


@inlined
def _confirmed_step(stream: Record, rule: Record, line: Record, step: int, after: Record) -> int:
    """`step` of `line`, corrected by the good line `after` it."""
    to_after = _step(stream, rule, after)
    if to_after < 1 or to_after > step > 0:
        return step
    if step == _NEW_START or rule.place == BY_SEQUENCE:
        return _CORRUPT
    if _advance(after.time - line.time, rule.time_wrap) < 0:
        return _CORRUPT
    return max(1, to_after - 1)  # the line was only late


@inlined
def _fill_packet(stream: Record, rule: Record, line: Record, step: int, packet: Record) -> None:
    new_start = step == _NEW_START
    gap = int(stream.restart_rows) if new_start else step - 1
    packet.damaged = min(gap, stream.broken)
    packet.missing = gap - packet.damaged
    packet.samples = 1
    packet.status = line.overload
    if abs(line.table) >= rule.overload_count:
        packet.status |= _TABLE
    if abs(line.relative) >= rule.overload_count:
        packet.status |= _RELATIVE
    if new_start:
        stream.row_time_s += (gap + 1) * rule.period_s
    elif stream.started:
        stream.row_time_s += _advance(line.time - stream.last_time, rule.time_wrap) * rule.unit_s
    packet.time_s = stream.row_time_s
    count_packet(stream, packet, new_start or rule.place != BY_SEQUENCE)
    if new_start:
        stream.restarts += 1
        stream.restart_rows = 0  # two restarts in one read share their time
    stream.started = 1
    stream.restarting = 0
    stream.broken = 0
    stream.last_time = line.time
    stream.last_sequence = line.sequence
