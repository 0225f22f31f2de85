"""A finished line for drawing: any part of it at a few points a pixel, however long it is."""

import numpy as np
from numpy.typing import NDArray

from app.presenters.decimated_history import Polyline

Floats = NDArray[np.float64]

_GROUP = 16
"""Rows, and spans of each level, that make a span of the next level."""


class DecimatedLine:
    """Line over times that do not fall; NaN breaks it.

    Spans of rows begin at the same rows wherever a part begins: a drawing that is moved does not flicker.
    """

    def __init__(self, time_s: Floats, values: Floats) -> None:
        self.time_s = time_s
        self.values = values
        self._levels = [(values, values)]  # lowest and highest values of spans of `_GROUP` ** index rows

    def part(self, start_s: float, end_s: float, pixels: int) -> Polyline:
        """Rows from `start_s` to `end_s` and one beyond each end, for a drawing `pixels` wide.

        More rows than fit come as the lowest and the highest value of spans about as long as a pixel is wide.
        """
        first, end, per_span = self._rows(start_s, end_s, pixels)
        if per_span <= 2:  # two extremes are as many points as two rows
            return Polyline(self.time_s[first:end], self.values[first:end])
        low, high = self._extremes(first, end, per_span)
        return Polyline(np.repeat(self.time_s[first:end:per_span], 2), np.column_stack((low, high)).ravel())

    def thinned(self, start_s: float, end_s: float, pixels: int) -> Polyline:
        """The same part by every n-th row, of a line that is smooth."""
        first, end, per_span = self._rows(start_s, end_s, pixels)
        return Polyline(self.time_s[first:end:per_span], self.values[first:end:per_span])

    def _rows(self, start_s: float, end_s: float, pixels: int) -> tuple[int, int, int]:
        """First row and end of a part of whole spans, and rows of a span."""
        first = max(int(np.searchsorted(self.time_s, start_s)) - 1, 0)
        end = min(int(np.searchsorted(self.time_s, end_s, side="right")) + 1, len(self.time_s))
        per_span = _power_of_two((end - first) // max(pixels, 1))
        return first - first % per_span, min(-(-end // per_span) * per_span, len(self.time_s)), per_span

    def _extremes(self, first: int, end: int, per_span: int) -> tuple[Floats, Floats]:
        """Lowest and highest values of spans of rows."""
        depth, size = 0, 1
        while size * _GROUP <= per_span:
            depth, size = depth + 1, size * _GROUP
        low, high = (values[first // size : -(-end // size)] for values in self._level(depth))
        while size < per_span:  # by halves: a loop over each span takes several times as long
            low, high, size = _halved(np.fmin, low), _halved(np.fmax, high), 2 * size
        return low, high

    def _level(self, depth: int) -> tuple[Floats, Floats]:
        while len(self._levels) <= depth:
            low, high = self._levels[-1]
            starts = np.arange(0, len(low), _GROUP)
            self._levels.append((np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)))
        return self._levels[depth]


def _halved(extreme: np.ufunc, values: Floats) -> Floats:
    """Extreme of each two values that follow each other, and an odd last one."""
    pairs = extreme(values[:-1:2], values[1::2])
    return np.append(pairs, values[-1]) if len(values) % 2 else pairs


def _power_of_two(number: int) -> int:
    """Largest power of two that is not larger; 1 for 0."""
    return 1 << max(number.bit_length() - 1, 0)
