"""Readings of two devices laid beside each other, each as it was received."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.rows import MAX_BLOCK_ROWS
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
