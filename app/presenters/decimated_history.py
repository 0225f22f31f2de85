"""History of live samples for drawing: lowest and highest value of spans of doubling length."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

CHANNELS = 2
_LEVELS = 24
"""The longest spans hold 2^23 rows: a screen full of them lasts days at any rate."""


@dataclass(frozen=True, eq=False, slots=True)
class Polyline:
    """Line to draw of one channel; NaN breaks it."""

    time_s: NDArray[np.float64]
    value: NDArray[np.float64]

    @classmethod
    def empty(cls) -> "Polyline":
        return cls(np.empty(0), np.empty(0))

    @property
    def has_gaps(self) -> bool:
        return bool(np.isnan(self.value).any())

    @property
    def is_min_max(self) -> bool:
        """Tell whether two points follow at each time: the lowest and the highest of a span."""
        return len(self.time_s) % 2 == 0 and np.array_equal(self.time_s[::2], self.time_s[1::2])

    def strokes(self, height: float) -> float:
        """Length of the line in heights of the plot."""
        strokes = np.abs(np.diff(self.value))
        length = strokes.sum()
        return float(np.nansum(strokes) if np.isnan(length) else length) / height


_Spans = tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float32]]
"""Beginnings (n,), lowest and highest values (n, 2)."""


class _Level:
    """Newest spans of one length: first time, lowest and highest value of each channel."""

    def __init__(self, capacity: int) -> None:
        self._time_s = np.empty(capacity)
        self._low = np.empty((capacity, CHANNELS), np.float32)
        self._high = np.empty((capacity, CHANNELS), np.float32)
        self.first = 0
        """Number of the oldest span held, counted from the first ever."""
        self.end = 0  # number of the next span

    @property
    def time_s(self) -> NDArray[np.float64]:
        return self._time_s[: self.end - self.first]

    def append(
        self, time_s: NDArray[np.float64], low: NDArray[np.float32], high: NDArray[np.float32]
    ) -> None:
        """Add spans, at most half as many as there is room for; a full level forgets its older half."""
        if self.end - self.first + len(time_s) > len(self._time_s):
            self._drop(len(self._time_s) // 2)
        at = self.end - self.first
        new = slice(at, at + len(time_s))
        self._time_s[new], self._low[new], self._high[new] = time_s, low, high
        self.end += len(time_s)

    def spans(self, first: int, end: int) -> _Spans:
        kept = slice(max(first - self.first, 0), max(end - self.first, 0))
        return self._time_s[kept], self._low[kept], self._high[kept]

    def index_at(self, at_s: float) -> int:
        """Number of the first span that begins at `at_s` or later."""
        return self.first + int(np.searchsorted(self.time_s, at_s))

    def _drop(self, oldest: int) -> None:
        kept = self.end - self.first - oldest
        for array in (self._time_s, self._low, self._high):
            array[:kept] = array[oldest : oldest + kept].copy()
        self.first += oldest


class DecimatedHistory:
    """Rows of two channels, from which any time span is drawn with a few points a pixel.

    Appending costs the new rows only, drawing the pixels only. The newest `capacity` spans of each length are
    kept: the last rows one by one, a day as finely as a screen can show it. `capacity` is at least 4096, four
    times the pixels of the widest screen.
    """

    def __init__(self, capacity: int = 1 << 16) -> None:
        self._capacity = capacity
        self._levels = [_Level(capacity) for _ in range(_LEVELS)]

    def __len__(self) -> int:
        return len(self._levels[0].time_s)

    @property
    def end_s(self) -> float:
        """Time of the newest row; NaN when there is none."""
        time_s = self._levels[0].time_s
        return float(time_s[-1]) if len(time_s) else float("nan")

    def append(self, time_s: NDArray[np.float64], values: NDArray[np.floating]) -> None:
        """Add later rows: times (n,), increasing, and values (n, 2), NaN where absent."""
        quarter = self._capacity // 4
        for start in range(0, len(time_s), quarter):
            chunk = slice(start, start + quarter)
            rows = values[chunk].astype(np.float32)
            self._levels[0].append(time_s[chunk], rows, rows)
            self._decimate()

    def lines(self, start_s: float, end_s: float, pixels: int) -> tuple[Polyline, Polyline]:
        """Both channels from `start_s` to `end_s`, drawn exactly at `pixels` pixels of width."""
        depth = self._depth(start_s, end_s, pixels)
        if depth == 0:
            rows = self._levels[0]
            time_s, values, _ = rows.spans(rows.index_at(start_s), rows.index_at(end_s))
            return _polylines(time_s.copy(), values)
        time_s, low, high = self._decimated(depth, start_s, end_s)
        return _polylines(np.repeat(time_s, 2), np.stack((low, high), axis=1).reshape(-1, CHANNELS))

    def mean(self, start_s: float, end_s: float) -> NDArray[np.float64]:
        """Mean of both channels between two late times, absent rows left out; NaN where there are none."""
        newest = self._levels[0]
        _, values, _ = newest.spans(newest.index_at(start_s), newest.index_at(end_s))
        rows = values.astype(float)
        present = np.count_nonzero(~np.isnan(rows), axis=0)
        return np.where(present, np.nansum(rows, axis=0) / np.maximum(present, 1), np.nan)

    def clear(self) -> None:
        self._levels = [_Level(self._capacity) for _ in range(_LEVELS)]

    def _decimate(self) -> None:
        """Bring every level up to the last whole pair of the level below."""
        for below, level in pairwise(self._levels):
            time_s, low, high = below.spans(2 * level.end, below.end // 2 * 2)
            if not len(time_s):
                return
            level.append(time_s[::2], np.fmin(low[::2], low[1::2]), np.fmax(high[::2], high[1::2]))

    def _depth(self, start_s: float, end_s: float, pixels: int) -> int:
        """Level whose spans are about as long as a pixel is wide, of those that reach back to `start_s`."""
        reaching = (
            k for k, level in enumerate(self._levels) if not level.first or level.time_s[0] <= start_s
        )
        depth = next(reaching, _LEVELS - 1)
        level = self._levels[depth]
        shown = level.index_at(end_s) - level.index_at(start_s)
        return min(depth + max((shown // max(pixels, 1)).bit_length() - 1, 0), _LEVELS - 1)

    def _decimated(self, depth: int, start_s: float, end_s: float) -> _Spans:
        """Spans of `depth` and, where the last of them would reach beyond the end, ever shorter ones."""
        first = max(self._levels[depth].index_at(start_s) - 1, 0)
        parts = []
        for level in self._levels[depth::-1]:
            begun = level.index_at(end_s)
            end = begun if level is self._levels[0] else max(begun - 1, first)
            parts.append(level.spans(first, end))
            first = 2 * end
        time_s, low, high = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        return time_s, low, high


def _polylines(time_s: NDArray[np.float64], values: NDArray[np.float32]) -> tuple[Polyline, Polyline]:
    table, relative = np.ascontiguousarray(values.T, dtype=np.float64)
    return Polyline(time_s, table), Polyline(time_s, relative)
