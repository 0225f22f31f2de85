"""Merging of two devices: their times by the host's clock, and rows of nearest readings."""

from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from drivers.arrays import Counts, Flags, Floats, Ints, UInt8s
from drivers.clock import RobustLine, fit_robust_line
from drivers.packets import MAX_BLOCK_ROWS
from drivers.samples import ABSENT, SampleStatus

MAX_WAIT_NS = 250_000_000
"""How long a reading waits for its counterpart, by times of arrival; a balance of delay on the screen against
readings of a busy computer that come late."""
_FIRST_MAX_WAIT_NS = 2_000_000_000
"""The same for the first readings: some decoders need half a second of bytes to know the rate."""
_KEPT_NS = 10_000_000_000
MAX_WAITING = 4 * MAX_BLOCK_ROWS
"""Readings of a gauge that may wait. No device sends more in seconds; garbage can claim gaps of so many."""
_REACH = 0.75
"""A row takes a reading that is no further than so many periods of its device: the nearest is within half a
period, and one that is a period away is that of another row."""
_JITTER_REACH, _JITTER_NS = 1.5, 2_000_000
"""The same where a period is as short as the errors of times by the host's clock, which are no longer."""
_OVERLOAD = int(SampleStatus.OVERLOAD_TABLE)
_OVERLOADS = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)
_ALONE = (SampleStatus.TABLE_MISSING, SampleStatus.RELATIVE_MISSING)


@dataclass(frozen=True, eq=False, slots=True)
class ChannelSamples:
    """Consecutive readings of one device, lost ones included."""

    host_ns: Ints  # (n,) int64: host's time of each reading (ns), never decreasing
    counts: Counts  # (n,) int32 or float64
    status: UInt8s  # (n,) uint8: `SampleStatus`, flags as of gauge 1

    def __len__(self) -> int:
        return len(self.status)

    def take(self, which: slice | Ints) -> "ChannelSamples":
        return ChannelSamples(self.host_ns[which], self.counts[which], self.status[which])

    def append(self, more: "ChannelSamples") -> "ChannelSamples":
        """These followed by `more`, whose times are raised where they would decrease."""
        host_ns = np.maximum.accumulate(more.host_ns)
        if len(self):
            host_ns = np.maximum(host_ns, self.host_ns[-1])
        return ChannelSamples(
            np.concatenate([self.host_ns, host_ns]),
            np.concatenate([self.counts, more.counts]),
            np.concatenate([self.status, more.status]),
        )


NO_SAMPLES = ChannelSamples(np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, np.uint8))


@dataclass(frozen=True, eq=False, slots=True)
class MergedRows:
    """Rows of both gauges."""

    counts: Counts  # (n, 2) int32 or float64
    status: UInt8s  # (n,) uint8: `SampleStatus` flags
    lag_ns: Ints  # (n,) int64: time of gauge 2 minus time of gauge 1
    is_paired: Flags  # (n,) bool: whether both readings exist

    def __len__(self) -> int:
        return len(self.status)


class Merger:
    """Pairs each reading of one gauge with the nearest one of the other.

    A row is ready as soon as the other gauge has a reading that is not earlier, or has had none for 0.25 s.
    Rows depend on readings and times of arrival alone, so the same reads give the same rows in any cut. Rows
    are the readings of gauge `base` (0 or 1); `other_period_s` is the nominal time between two readings of
    the other gauge.
    """

    def __init__(self, base: int, other_period_s: float) -> None:
        self._base = base
        period_ns = other_period_s * 1e9
        self._reach_ns = round(max(_REACH * period_ns, min(_JITTER_REACH * period_ns, _JITTER_NS)))
        self._waiting = [NO_SAMPLES, NO_SAMPLES]
        self._patience_ns = _FIRST_MAX_WAIT_NS

    @property
    def buffered(self) -> int:
        return sum(map(len, self._waiting))

    def add(self, gauge: int, readings: ChannelSamples) -> None:
        """Add the next readings of a gauge. The oldest of those that wait may be dropped."""
        held = self._waiting[gauge].append(readings)
        if gauge != self._base and len(held):
            self._patience_ns = MAX_WAIT_NS
            first = int(np.searchsorted(held.host_ns, held.host_ns[-1] - _KEPT_NS))
            held = held.take(slice(max(first, len(held) - MAX_WAITING), None))
        self._waiting[gauge] = held

    def is_overdue(self, now_ns: int) -> bool:
        waiting = self._waiting[self._base]
        return bool(len(waiting)) and bool(waiting.host_ns[0] < now_ns - self._patience_ns)

    def take(self, now_ns: int) -> MergedRows | None:
        """Rows that are ready at the arrival `now_ns`, at most `MAX_BLOCK_ROWS`; None without any."""
        waiting, other = self._waiting[self._base], self._waiting[1 - self._base]
        ready = int(np.searchsorted(waiting.host_ns, now_ns - self._patience_ns))
        if len(other):
            ready = max(ready, int(np.searchsorted(waiting.host_ns, other.host_ns[-1], side="right")))
        ready = min(ready or len(waiting) - MAX_WAITING, MAX_BLOCK_ROWS)
        if ready <= 0:
            return None
        rows = waiting.take(slice(ready))
        self._waiting[self._base] = waiting.take(slice(ready, None))
        merged = self._merged(rows, other)
        before = int(np.searchsorted(other.host_ns, rows.host_ns[-1], side="right")) - 1
        self._waiting[1 - self._base] = other.take(slice(max(before, 0), None))
        return merged

    def _merged(self, rows: ChannelSamples, other: ChannelSamples) -> MergedRows:
        if len(other):
            chosen = other.take(_nearest(rows.host_ns, other.host_ns))
        else:  # readings too far from `rows` to be paired with them
            host_ns = rows.host_ns - 2 * self._reach_ns
            chosen = ChannelSamples(host_ns, rows.counts, np.zeros_like(rows.status))
        both = (chosen, rows) if self._base else (rows, chosen)
        lag_ns = both[1].host_ns - both[0].host_ns
        lacks = [(half.status & int(ABSENT)) != 0 for half in both]
        lacks[1 - self._base] |= np.abs(lag_ns) > self._reach_ns
        status = np.where(lacks[0] & lacks[1], rows.status & int(ABSENT), 0).astype(np.int64)
        for gauge, half in enumerate(both):
            is_clipped = (half.status & _OVERLOAD) != 0
            status |= np.where(lacks[gauge] & ~lacks[1 - gauge], int(_ALONE[gauge]), 0)
            status |= np.where(is_clipped & ~lacks[gauge], int(_OVERLOADS[gauge]), 0)
        counts = [np.where(lack, 0, half.counts) for lack, half in zip(lacks, both, strict=True)]
        is_paired = ~(lacks[0] | lacks[1])
        return MergedRows(np.column_stack(counts), status.astype(np.uint8), lag_ns, is_paired)


def _nearest(wanted: Ints, offered: Ints) -> Ints:
    """Index in `offered` (m,), m >= 1, sorted, of the nearest to each of `wanted` (n,)."""
    after = np.clip(np.searchsorted(offered, wanted), 1, max(len(offered) - 1, 1))
    after = np.minimum(after, len(offered) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(wanted - offered[before] <= offered[after] - wanted, before, after)


_WINDOW_NS = 150_000_000
_SPAN_NS = 6_000_000_000
"""The fit takes the earliest arrival of each window of the last 6 s: long enough for 0.1 ms, and so short
that a replay from the middle of a stream soon agrees with the live decoder."""
_MIN_WINDOWS = 8
_LEAP_NS = 100_000_000
_LEAP = 0.02
"""A clock that is ahead of its fit by more than this, plus this share of the time since, has leapt."""

_Point: TypeAlias = tuple[float, int]
"""Device's own time (s) of the last reading of a read, and host's time (ns) after the read."""


class HostTimeFit:
    """Converts a device's own times to the host's clock.

    A read arrives late by what system and wire add, never early. So only the earliest arrival of each 0.15 s
    counts, and a line through those of the last 6 s gives the host's time.
    """

    def __init__(self) -> None:
        self._points: deque[_Point] = deque()
        self._best: _Point | None = None
        self._line: RobustLine | None = None
        self._origin: _Point = (0.0, 0)

    @property
    def scatter_s(self) -> float:
        """Root mean square of the residuals of the line (s); 0 while unknown."""
        return 0.0 if self._line is None else self._line.scatter

    def reset(self) -> None:
        """Forget all times: the connection broke or the device restarted, and its time may have changed."""
        self._points.clear()
        self._best = self._line = None

    def add(self, device_s: float, arrival_ns: int) -> None:
        """Add the last reading of a read: the device's own time (s), and the host's (ns) after the read."""
        point = (device_s, arrival_ns)
        if self._best is not None:  # of a clock that leapt ahead, a reading would be taken after it came
            early_ns = int(self.host_ns(np.array([device_s]))[0]) - arrival_ns
            if early_ns > _LEAP_NS + _LEAP * (arrival_ns - self._best[1]):
                self.reset()
        best_s, best_ns = self._best or point
        if self._best is None or arrival_ns // _WINDOW_NS > best_ns // _WINDOW_NS:
            self._close_window(arrival_ns)
            self._best = point
        elif arrival_ns - device_s * 1e9 < best_ns - best_s * 1e9:
            self._best = point

    def host_ns(self, device_s: Floats) -> Ints:
        """Host's time (ns) of readings (n,) at the device's own times (s), the least delay included."""
        own_origin_s, origin_ns = self._origin
        if self._line is None:  # too few windows for a line: the last complete one
            own_origin_s, origin_ns = self._points[-1] if self._points else self._best or (0.0, 0)
        since_s = device_s - own_origin_s
        if self._line is not None:
            since_s = since_s + self._line.at(since_s)
        return origin_ns + np.rint(since_s * 1e9).astype(np.int64)

    def _close_window(self, now_ns: int) -> None:
        if self._best is not None:
            self._points.append(self._best)
        while self._points and self._points[0][1] < now_ns - _SPAN_NS:
            self._points.popleft()
        self._line = None
        if len(self._points) >= _MIN_WINDOWS:
            self._origin = own_s, origin_ns = self._points[-1]
            since_s = np.array([point_s - own_s for point_s, _ in self._points])
            late_s = np.array([(arrival_ns - origin_ns) * 1e-9 for _, arrival_ns in self._points]) - since_s
            self._line = fit_robust_line(since_s, late_s)
