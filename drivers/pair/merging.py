"""Readings of two devices laid beside each other, each as it was received."""

from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.clock import RobustLine, fit_robust_line
from drivers.packets import MAX_BLOCK_ROWS
from drivers.samples import ABSENT, SampleStatus

Counts = NDArray[np.int32] | NDArray[np.float64]

MAX_WAIT_NS = 250_000_000
"""A reading waits for its counterpart, by the times of arrival, so long and no longer."""
_FIRST_MAX_WAIT_NS = 2_000_000_000
"""The first ones: some decoders must see half a second of bytes before they know the rate."""
_KEPT_NS = 10_000_000_000
MAX_WAITING = 4 * MAX_BLOCK_ROWS
"""More readings of a gauge do not wait: so many in seconds are no device's, but claims of gaps in rubbish."""
_REACH = 1.5
"""Periods of a device from one of its readings within which that one is taken."""
_OVERLOAD = int(SampleStatus.OVERLOAD_TABLE)
_OVERLOADS = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)
_ALONE = (SampleStatus.TABLE_MISSING, SampleStatus.RELATIVE_MISSING)


@dataclass(frozen=True, eq=False, slots=True)
class ChannelSamples:
    """Consecutive readings of one device, those that stand for lost ones included.

    Attributes
    ----------
    host_ns : (n,) int64
        When they were taken, by the host's clock (ns); never decreasing.
    counts : (n,) int32 or float64
    status : (n,) uint8
        `SampleStatus` as of a gauge 1.
    """

    host_ns: NDArray[np.int64]
    counts: Counts
    status: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.status)

    def take(self, which: slice | NDArray[np.int64]) -> "ChannelSamples":
        """Some of them."""
        return ChannelSamples(self.host_ns[which], self.counts[which], self.status[which])

    def append(self, more: "ChannelSamples") -> "ChannelSamples":
        """These and those after them, none earlier than the one before it."""
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
    """Rows of both gauges.

    Attributes
    ----------
    counts : (n, 2) int32 or float64
    status : (n,) uint8
        `SampleStatus` flags.
    lag_ns : (n,) int64
        By how much later the reading of gauge 2 was taken than that of gauge 1.
    is_paired : (n,) bool
        Both are there.
    """

    counts: Counts
    status: NDArray[np.uint8]
    lag_ns: NDArray[np.int64]
    is_paired: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.status)


class Merger:
    """Gives each reading of one gauge the nearest one of the other.

    A row is ready as soon as the other gauge has a reading that is not earlier, or has had none for 0.25 s.
    What it becomes depends on the readings and their times of arrival alone, so that the same reads give the
    same rows however they are cut.

    Parameters
    ----------
    base : int
        Whose readings make the rows: 0 for gauge 1, 1 for gauge 2.
    other_period_s : float
        Nominal time between two readings of the other gauge (s).
    """

    def __init__(self, base: int, other_period_s: float) -> None:
        self._base = base
        self._reach_ns = round(_REACH * other_period_s * 1e9)
        self._waiting = [NO_SAMPLES, NO_SAMPLES]
        self._patience_ns = _FIRST_MAX_WAIT_NS

    @property
    def buffered(self) -> int:
        """Readings that are kept: tenths of a second of one gauge, at most 10 s of the other; never many."""
        return sum(map(len, self._waiting))

    def add(self, gauge: int, readings: ChannelSamples) -> None:
        """Take the next readings of a gauge. Of those that nothing is laid beside yet the oldest may go."""
        held = self._waiting[gauge].append(readings)
        if gauge != self._base and len(held):
            self._patience_ns = MAX_WAIT_NS
            first = int(np.searchsorted(held.host_ns, held.host_ns[-1] - _KEPT_NS))
            held = held.take(slice(max(first, len(held) - MAX_WAITING), None))
        self._waiting[gauge] = held

    def is_overdue(self, now_ns: int) -> bool:
        """Tell whether a row has waited long enough, when something came at `now_ns`: `take` it then."""
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
        chosen = other.take(_nearest(rows.host_ns, other.host_ns)) if len(other) else self._nothing(rows)
        both = (chosen, rows) if self._base else (rows, chosen)
        lag_ns = both[1].host_ns - both[0].host_ns
        lacks = [(half.status & int(ABSENT)) != 0 for half in both]
        lacks[1 - self._base] |= np.abs(lag_ns) > self._reach_ns
        status = np.where(lacks[0] & lacks[1], rows.status & int(ABSENT), 0).astype(np.int64)
        for gauge, half in enumerate(both):
            is_clipped = (half.status & _OVERLOAD) != 0
            status |= np.where(lacks[gauge] & ~lacks[1 - gauge], int(_ALONE[gauge]), 0)
            status |= np.where(is_clipped & ~lacks[gauge], int(_OVERLOADS[gauge]), 0)
        return MergedRows(
            np.column_stack([np.where(lack, 0, half.counts) for lack, half in zip(lacks, both, strict=True)]),
            status.astype(np.uint8),
            lag_ns,
            ~(lacks[0] | lacks[1]),
        )

    def _nothing(self, rows: ChannelSamples) -> ChannelSamples:
        """Readings that are too far from `rows` to be taken."""
        return ChannelSamples(rows.host_ns - 2 * self._reach_ns, rows.counts, np.zeros_like(rows.status))


def _nearest(wanted: NDArray[np.int64], offered: NDArray[np.int64]) -> NDArray[np.int64]:
    """Place in `offered` (m,), m >= 1, sorted, of what is nearest to each of `wanted` (n,)."""
    after = np.clip(np.searchsorted(offered, wanted), 1, max(len(offered) - 1, 1))
    after = np.minimum(after, len(offered) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(wanted - offered[before] <= offered[after] - wanted, before, after)


_CELL_NS = 150_000_000
_REACH_NS = 6_000_000_000
_MIN_CELLS = 8
_LEAP_NS = 100_000_000
_LEAP = 0.02
"""A clock is ahead of what is known of it by no more than this, and by this part of the time since."""

_Point: TypeAlias = tuple[float, int]
"""Device's own time (s) of the last reading of a read, and host's time (ns) after that."""


class HostTimeFit:
    """Host's time of a device's readings, by the device's own count or clock.

    A read arrives late by what system and wire add, never early. So of each 0.15 s only the most punctual
    read counts, and a line through those of the last 6 s tells host's time from the device's own. It
    forgets what is older, so that a replay that begins amid a stream soon says the same as was said live.
    """

    def __init__(self) -> None:
        self._points: deque[_Point] = deque()
        self._best: _Point | None = None
        self._line: RobustLine | None = None
        self._origin: _Point = (0.0, 0)

    @property
    def scatter_s(self) -> float:
        """How late the punctual reads were, as root mean square about the line (s); 0 while unknown."""
        return 0.0 if self._line is None else self._line.scatter

    def reset(self) -> None:
        """The link was broken, or the device began anew: its own time may mean another from here on."""
        self._points.clear()
        self._best = self._line = None

    def add(self, device_s: float, arrival_ns: int) -> None:
        """Take the last reading of a read: the device's own time (s), and the host's (ns) after the read."""
        point = (device_s, arrival_ns)
        if self._leaps(point):
            self.reset()
        if self._best is None or _cell(point) > _cell(self._best):
            self._close_cell(arrival_ns)
            self._best = point
        elif _late_ns(point) < _late_ns(self._best):
            self._best = point

    def host_ns(self, device_s: NDArray[np.float64]) -> NDArray[np.int64]:
        """Host's time (ns) of readings (n,) at the device's own times (s), as far as is known by now.

        It includes what the most punctual read took to arrive, which nothing here can tell.
        """
        own_origin_s, origin_ns = self._nearest() if self._line is None else self._origin
        since_s = device_s - own_origin_s
        if self._line is not None:
            since_s = since_s + self._line.at(since_s)
        return origin_ns + np.rint(since_s * 1e9).astype(np.int64)

    def _leaps(self, point: _Point) -> bool:
        """Tell whether a reading would have been taken after it came: the device's clock leapt ahead."""
        if self._best is None:
            return False
        own_s, arrival_ns = point
        early_ns = int(self.host_ns(np.array([own_s]))[0]) - arrival_ns
        return early_ns > _LEAP_NS + _LEAP * (arrival_ns - self._best[1])

    def _nearest(self) -> _Point:
        """What to go by while there are too few cells for a line: the latest one that is whole."""
        return self._points[-1] if self._points else self._best or (0.0, 0)

    def _close_cell(self, now_ns: int) -> None:
        if self._best is not None:
            self._points.append(self._best)
        while self._points and self._points[0][1] < now_ns - _REACH_NS:
            self._points.popleft()
        self._line = None
        if len(self._points) >= _MIN_CELLS:
            self._refit()

    def _refit(self) -> None:
        self._origin = own_s, origin_ns = self._points[-1]
        since_s = np.array([cell_s - own_s for cell_s, _ in self._points])
        late_s = np.array([(arrival_ns - origin_ns) * 1e-9 for _, arrival_ns in self._points]) - since_s
        self._line = fit_robust_line(since_s, late_s)


def _cell(point: _Point) -> int:
    return point[1] // _CELL_NS


def _late_ns(point: _Point) -> float:
    return point[1] - point[0] * 1e9
