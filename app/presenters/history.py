"""Live samples kept for drawing: smallest and largest value of ever longer spans, kept up as samples come."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CHANNELS = 2


@dataclass(frozen=True, eq=False, slots=True)
class Polyline:
    """What is drawn of one channel.

    Attributes
    ----------
    time_s : (n,) float64
    value : (n,) float64
        In the unit that was put in; NaN breaks the line.
    """

    time_s: NDArray[np.float64]
    value: NDArray[np.float64]

    @classmethod
    def empty(cls) -> "Polyline":
        """Nothing to draw."""
        return cls(np.empty(0), np.empty(0))

    @property
    def broken(self) -> bool:
        """Tell whether the line has gaps."""
        return bool(np.isnan(self.value).any())


class _Level:
    """Spans of equally many rows: first time, lowest and highest value of each channel."""

    def __init__(self, capacity: int) -> None:
        self.time_s = np.empty(capacity)
        self.low = np.empty((capacity, CHANNELS), np.float32)
        self.high = np.empty((capacity, CHANNELS), np.float32)
        self.count = 0

    def append(
        self, time_s: NDArray[np.float64], low: NDArray[np.float32], high: NDArray[np.float32]
    ) -> None:
        span = slice(self.count, self.count + len(time_s))
        self.time_s[span], self.low[span], self.high[span] = time_s, low, high
        self.count = span.stop

    def forget(self, oldest: int) -> None:
        kept = self.count - oldest
        for array in (self.time_s, self.low, self.high):
            array[:kept] = array[oldest : self.count].copy()
        self.count = kept


class History:
    """Rows of two channels, from which any time span is drawn with a few points a pixel.

    Appending costs the new rows only, drawing the pixels only, however long the history is. When it is
    full, its older half is forgotten.

    Parameters
    ----------
    capacity : int
        Rows kept at most; a power of two, at least 4096.
    """

    def __init__(self, capacity: int = 1 << 20) -> None:
        self._capacity = capacity
        self._levels = [_Level(capacity >> k) for k in range(capacity.bit_length() - 6)]

    def __len__(self) -> int:
        return self._levels[0].count

    @property
    def end_s(self) -> float:
        """Time of the newest row; NaN when there is none."""
        rows = self._levels[0]
        return float(rows.time_s[rows.count - 1]) if rows.count else float("nan")

    def append(self, time_s: NDArray[np.float64], values: NDArray[np.floating]) -> None:
        """Add rows at the end.

        Parameters
        ----------
        time_s : (n,) float64
            Increasing, later than all rows before.
        values : (n, 2) float
            NaN where absent.
        """
        quarter = self._capacity // 4
        for start in range(0, len(time_s), quarter):
            chunk = slice(start, start + quarter)
            self._make_room(len(time_s[chunk]))
            rows = values[chunk].astype(np.float32)
            self._levels[0].append(time_s[chunk], rows, rows)
            self._condense()

    def lines(self, start_s: float, end_s: float, pixels: int) -> tuple[Polyline, Polyline]:
        """Both channels from `start_s` to `end_s`, drawn exactly at `pixels` pixels of width."""
        first, last = self._rows(start_s, end_s)
        depth = ((last - first) // max(pixels, 1)).bit_length() - 1
        if depth <= 0:
            rows = self._levels[0]
            return _polylines(rows.time_s[first:last].copy(), rows.low[first:last])
        return self._condensed(min(depth, len(self._levels) - 1), first, last)

    def mean(self, start_s: float, end_s: float) -> NDArray[np.float64]:
        """Mean of both channels between two times, absent rows left out; NaN where there are none."""
        first, last = self._rows(start_s, end_s)
        rows = self._levels[0].low[first:last].astype(float)
        present = np.count_nonzero(~np.isnan(rows), axis=0)
        return np.where(present, np.nansum(rows, axis=0) / np.maximum(present, 1), np.nan)

    def clear(self) -> None:
        """Forget everything."""
        for level in self._levels:
            level.count = 0

    def _rows(self, start_s: float, end_s: float) -> tuple[int, int]:
        rows = self._levels[0]
        first, last = np.searchsorted(rows.time_s[: rows.count], (start_s, end_s))
        return int(first), int(last)

    def _make_room(self, new: int) -> None:
        if self._levels[0].count + new > self._capacity:
            for depth, level in enumerate(self._levels):
                level.forget((self._capacity // 2) >> depth)

    def _condense(self) -> None:
        """Bring every level up to the last whole pair of the level below."""
        for below, level in zip(self._levels, self._levels[1:], strict=False):
            pairs = slice(2 * level.count, below.count // 2 * 2)
            if pairs.start == pairs.stop:
                return
            low, high = below.low[pairs], below.high[pairs]
            level.append(
                below.time_s[pairs][::2], np.fmin(low[::2], low[1::2]), np.fmax(high[::2], high[1::2])
            )

    def _condensed(self, depth: int, first: int, last: int) -> tuple[Polyline, Polyline]:
        level = self._levels[depth]
        spans = slice(first >> depth, last >> depth)
        rest = slice(min(level.count, spans.stop) << depth, last)
        low, high, time_s = level.low[spans], level.high[spans], level.time_s[spans]
        if rest.start < rest.stop:
            rows = self._levels[0].low[rest]
            low = np.vstack((low, np.fmin.reduce(rows, axis=0)))
            high = np.vstack((high, np.fmax.reduce(rows, axis=0)))
            time_s = np.append(time_s, self._levels[0].time_s[rest.start])
        both = np.stack((low, high), axis=1).reshape(-1, CHANNELS)
        return _polylines(np.repeat(time_s, 2), both)


def _polylines(time_s: NDArray[np.float64], values: NDArray[np.float32]) -> tuple[Polyline, Polyline]:
    table, relative = np.ascontiguousarray(values.T, dtype=np.float64)
    return Polyline(time_s, table), Polyline(time_s, relative)
