"""Two cursors on the time axis: what is read at each of them, and the differences."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from app.presenters import numbers

Floats = NDArray[np.float64]
_FIRST_SHARE, _SECOND_SHARE = 0.25, 0.5
"""Where on the drawn span the cursors stand at first."""
_SURELY = 0.2
"""A distance this near to a whole number of periods (in periods) is told as so many."""


class Cursor(Enum):
    """One of both; the value is its name."""

    A = "A"
    B = "B"


@dataclass(frozen=True, slots=True)
class Cursors:
    """Where the cursors stand (s), which one the keys move, and what is read there, as text.

    Attributes
    ----------
    cells : tuple of tuple of str
        A row each for A, B and B − A: name, time, table, relative displacement.
    period : str
        What the distance says of the period.
    """

    a_s: float
    b_s: float
    active: Cursor = Cursor.B
    cells: tuple[tuple[str, ...], ...] = ()
    period: str = ""

    def at(self, cursor: Cursor) -> float:
        """Where one stands (s)."""
        return self.a_s if cursor is Cursor.A else self.b_s


def first_cursors(start_s: float, end_s: float) -> Cursors:
    """Cursors within the span that is drawn."""
    reach_s = end_s - start_s
    return Cursors(start_s + _FIRST_SHARE * reach_s, start_s + _SECOND_SHARE * reach_s)


def moved(cursors: Cursors, cursor: Cursor, at_s: float) -> Cursors:
    """The same with one of them elsewhere."""
    if cursor is Cursor.A:
        return replace(cursors, a_s=at_s, active=cursor)
    return replace(cursors, b_s=at_s, active=cursor)


def stepped(cursors: Cursors, time_s: Floats, readings: int) -> Cursors:
    """The same with the active one moved by so many readings of a record at `time_s` (n,)."""
    place = nearest(time_s, cursors.at(cursors.active)) + readings
    at_s = float(time_s[min(max(place, 0), len(time_s) - 1)])
    return moved(cursors, cursors.active, at_s)


def read(
    cursors: Cursors, time_s: Floats, channels_mm: tuple[Floats | None, ...], period_s: float | None
) -> Cursors:
    """The same on the nearest readings, with what they say.

    Parameters
    ----------
    cursors : Cursors
    time_s : (n,) float64
        Rising.
    channels_mm : tuple of (n,) float64 or None
        Readings; NaN where absent.
    period_s : float, optional
        As it was found, to count periods by.
    """
    places = [nearest(time_s, cursors.at(cursor)) for cursor in Cursor]
    a_s, b_s = (float(time_s[place]) for place in places)
    rows = [[float(time_s[place]), *(_at(line, place) for line in channels_mm)] for place in places]
    rows.append([second - first for first, second in zip(*rows, strict=True)])
    names = (Cursor.A.value, Cursor.B.value, f"B {numbers.MINUS} A")
    cells = tuple((name, *_cells(row)) for name, row in zip(names, rows, strict=True))
    return replace(cursors, a_s=a_s, b_s=b_s, cells=cells, period=_period(abs(b_s - a_s), period_s))


def nearest(time_s: Floats, at_s: float) -> int:
    """Row of the reading next to a time."""
    after = min(int(np.searchsorted(time_s, at_s)), len(time_s) - 1)
    before = max(after - 1, 0)
    return before if at_s - time_s[before] <= time_s[after] - at_s else after


def _at(line: Floats | None, place: int) -> float:
    return float("nan") if line is None else float(line[place])


def _cells(row: list[float]) -> tuple[str, ...]:
    time_s, *channels_mm = row
    return (
        numbers.with_unit(numbers.rounded(time_s, 4), "s"),
        *(_millimetres(value) for value in channels_mm),
    )


def _millimetres(value_mm: float) -> str:
    return numbers.with_unit(numbers.rounded(value_mm, 3), "mm") if np.isfinite(value_mm) else "–"


def _period(distance_s: float, period_s: float | None) -> str:
    """`10 periods of 319.9 ms each`, or the frequency where no period is near."""
    if distance_s == 0.0:
        return ""
    count = 0 if period_s is None else round(distance_s / period_s)
    if period_s is not None and count and abs(distance_s / period_s - count) < _SURELY:
        each = numbers.with_unit(numbers.rounded(distance_s / count * 1e3, 2), "ms")
        return f"1 period of {each}" if count == 1 else f"{count} periods of {each} each"
    frequency = numbers.with_unit(numbers.rounded(1.0 / distance_s, 3), "Hz")
    return f"1/(B {numbers.MINUS} A) = {frequency}"
