"""Two cursors on the time axis: what is read at each of them, and the differences."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from analysis.formatting import MINUS, with_unit
from app.presenters import number_text
from messages.i18n import ngettext

Floats = NDArray[np.float64]
_FIRST_SHARE, _SECOND_SHARE = 0.25, 0.5
"""Where on the drawn span the cursors stand at first."""
_SURELY = 0.2
"""A distance this near to a whole number of periods (in periods) is told as so many."""
_DECIMALS = {"mm": 3, "µm": 1, "mm/s": 2, "m/s²": 3}


class Cursor(Enum):
    """One of both; the value is its name."""

    A = "A"
    B = "B"


@dataclass(frozen=True, slots=True)
class Cursors:
    """Where the cursors stand (s), which one the keys move, and what is read there, as text.

    Attributes
    ----------
    symbols : tuple of str
        What is read on the tab that is shown, as rich text.
    values : tuple of tuple of float
        Of these, a row each for A and B; NaN where nothing is drawn.
    cells : tuple of tuple of str
        A row each for A, B and B − A: name, time, and the values with their units.
    period : str
        What the distance says of the period.
    """

    a_s: float
    b_s: float
    active: Cursor = Cursor.B
    symbols: tuple[str, ...] = ()
    values: tuple[tuple[float, ...], ...] = ()
    cells: tuple[tuple[str, ...], ...] = ()
    period: str = ""

    def at(self, cursor: Cursor) -> float:
        """Where one stands (s)."""
        return self.a_s if cursor is Cursor.A else self.b_s


@dataclass(frozen=True, eq=False, slots=True)
class PlottedQuantity:
    """A line that cursors read.

    Attributes
    ----------
    symbol, unit : str
        The symbol as rich text.
    time_s, values : (n,) float64
        Times as in `Curves`, rising; values in `unit`, NaN where absent.
    """

    symbol: str
    unit: str
    time_s: Floats
    values: Floats

    def interpolate(self, at_s: float) -> float:
        """Value at a time, between two points on the straight line drawn there; NaN beside the line."""
        return float(np.interp(at_s, self.time_s, self.values, left=np.nan, right=np.nan))

    def format(self, value: float) -> str:
        """A value of it with its unit; a dash where there is none."""
        if not np.isfinite(value):
            return "–"
        return with_unit(number_text.format_fixed(value, _DECIMALS[self.unit]), self.unit)


def first_cursors(start_s: float, end_s: float) -> Cursors:
    """Cursors within the span that is drawn."""
    reach_s = end_s - start_s
    return Cursors(start_s + _FIRST_SHARE * reach_s, start_s + _SECOND_SHARE * reach_s)


def move_cursor(cursors: Cursors, cursor: Cursor, at_s: float) -> Cursors:
    """The same with one of them elsewhere."""
    if cursor is Cursor.A:
        return replace(cursors, a_s=at_s, active=cursor)
    return replace(cursors, b_s=at_s, active=cursor)


def shift_cursors(cursors: Cursors, by_s: float) -> Cursors:
    """The same moments where times are counted from another one."""
    return replace(cursors, a_s=cursors.a_s + by_s, b_s=cursors.b_s + by_s)


def step_cursor(cursors: Cursors, time_s: Floats, readings: int) -> Cursors:
    """The same with the active one moved by so many readings of a record at `time_s` (n,)."""
    place = nearest_index(time_s, cursors.at(cursors.active)) + readings
    at_s = float(time_s[min(max(place, 0), len(time_s) - 1)])
    return move_cursor(cursors, cursors.active, at_s)


def read_cursors(
    cursors: Cursors, time_s: Floats, drawn: Sequence[PlottedQuantity], period_s: float | None
) -> Cursors:
    """The same on the nearest readings of a record at `time_s` (n,), with what is drawn there.

    Parameters
    ----------
    cursors : Cursors
    time_s : (n,) float64
        Rising.
    drawn : sequence of DrawnQuantity
    period_s : float, optional
        As it was found, to count periods by.
    """
    a_s, b_s = (float(time_s[nearest_index(time_s, cursors.at(cursor))]) for cursor in Cursor)
    first, second = ([quantity.interpolate(at_s) for quantity in drawn] for at_s in (a_s, b_s))
    difference = [later - earlier for earlier, later in zip(first, second, strict=True)]
    rows = (
        (Cursor.A.value, a_s, first),
        (Cursor.B.value, b_s, second),
        (f"B {MINUS} A", b_s - a_s, difference),
    )
    return replace(
        cursors,
        a_s=a_s,
        b_s=b_s,
        symbols=tuple(quantity.symbol for quantity in drawn),
        values=(tuple(first), tuple(second)),
        cells=tuple((name, _seconds(at_s), *_written(drawn, values)) for name, at_s, values in rows),
        period=_period(abs(b_s - a_s), period_s),
    )


def nearest_index(time_s: Floats, at_s: float) -> int:
    """Row of the reading next to a time."""
    after = min(int(np.searchsorted(time_s, at_s)), len(time_s) - 1)
    before = max(after - 1, 0)
    return before if at_s - time_s[before] <= time_s[after] - at_s else after


def _seconds(at_s: float) -> str:
    return with_unit(number_text.format_fixed(at_s, 4), "s")


def _written(drawn: Sequence[PlottedQuantity], values: Sequence[float]) -> Iterator[str]:
    return (quantity.format(value) for quantity, value in zip(drawn, values, strict=True))


def _period(distance_s: float, period_s: float | None) -> str:
    """`10 periods of 319.9 ms each`, or the frequency where no period is near."""
    if distance_s == 0.0:
        return ""
    count = 0 if period_s is None else round(distance_s / period_s)
    if period_s is not None and count and abs(distance_s / period_s - count) < _SURELY:
        each = with_unit(number_text.format_fixed(distance_s / count * 1e3, 2), "ms")
        return ngettext("{count} period of {each}", "{count} periods of {each} each", count, each=each)
    frequency = with_unit(number_text.format_fixed(1.0 / distance_s, 3), "Hz")
    return f"1/(B {MINUS} A) = {frequency}"
