"""Two cursors on the time axis: values at each of them, and the differences."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.formatting import MINUS, with_unit
from app.presenters import number_text
from app.presenters.identify.state import Cursor, Cursors, Floats, PlottedQuantity
from messages.i18n import ngettext

_FIRST_SHARE, _SECOND_SHARE = 0.25, 0.5  # initial places of the cursors, as shares of the visible span
_PERIOD_TOLERANCE = 0.2
"""A distance that differs from a whole number of periods by less (in periods) is shown as periods."""
_TIME_DECIMALS = 4


def first_cursors(start_s: float, end_s: float) -> Cursors:
    """Cursors in their initial places in a span."""
    reach_s = end_s - start_s
    return Cursors(start_s + _FIRST_SHARE * reach_s, start_s + _SECOND_SHARE * reach_s)


def move_cursor(cursors: Cursors, cursor: Cursor, at_s: float) -> Cursors:
    """Move one cursor, which becomes the active one."""
    if cursor is Cursor.A:
        return replace(cursors, a_s=at_s, active=cursor)
    return replace(cursors, b_s=at_s, active=cursor)


def shift_cursors(cursors: Cursors, by_s: float) -> Cursors:
    """Shift both cursors: the origin of time changed by `-by_s`."""
    return replace(cursors, a_s=cursors.a_s + by_s, b_s=cursors.b_s + by_s)


def step_cursor(cursors: Cursors, time_s: Floats, samples: int) -> Cursors:
    """Move the active cursor by a number of samples of a record at `time_s` (n,)."""
    place = nearest_index(time_s, cursors.at(cursors.active)) + samples
    at_s = float(time_s[min(max(place, 0), len(time_s) - 1)])
    return move_cursor(cursors, cursors.active, at_s)


def read_cursors(
    cursors: Cursors, time_s: Floats, drawn: Sequence[PlottedQuantity], period_s: float | None
) -> Cursors:
    """Snap the cursors to the nearest samples of `time_s` (n,), which rises, and read the values there."""
    a_s, b_s = (float(time_s[nearest_index(time_s, cursors.at(cursor))]) for cursor in Cursor)
    at_a, at_b = ([_value(quantity, at_s) for quantity in drawn] for at_s in (a_s, b_s))
    difference = [later - earlier for earlier, later in zip(at_a, at_b, strict=True)]
    rows = ((Cursor.A.value, a_s, at_a), (Cursor.B.value, b_s, at_b), (f"B {MINUS} A", b_s - a_s, difference))

    def texts(values: Sequence[float]) -> list[str]:
        return [_text(value, one.decimals, one.unit) for value, one in zip(values, drawn, strict=True)]

    return replace(
        cursors,
        a_s=a_s,
        b_s=b_s,
        symbols=tuple(quantity.symbol for quantity in drawn),
        values=(tuple(at_a), tuple(at_b)),
        cells=tuple((name, _text(at_s, _TIME_DECIMALS, "s"), *texts(values)) for name, at_s, values in rows),
        period=_period(abs(b_s - a_s), period_s),
    )


def nearest_index(time_s: Floats, at_s: float) -> int:
    """Index of the sample nearest to a time."""
    after = min(int(np.searchsorted(time_s, at_s)), len(time_s) - 1)
    before = max(after - 1, 0)
    return before if at_s - time_s[before] <= time_s[after] - at_s else after


def _value(quantity: PlottedQuantity, at_s: float) -> float:
    """Linearly interpolated value; NaN beside the line."""
    return float(np.interp(at_s, quantity.time_s, quantity.values, left=np.nan, right=np.nan))


def _text(value: float, decimals: int, unit: str) -> str:
    return with_unit(number_text.format_fixed(value, decimals), unit) if np.isfinite(value) else "–"


def _period(distance_s: float, period_s: float | None) -> str:
    """`10 periods of 319.9 ms each`, or the reciprocal of the distance."""
    if distance_s == 0.0:
        return ""
    count = 0 if period_s is None else round(distance_s / period_s)
    if period_s is not None and count and abs(distance_s / period_s - count) < _PERIOD_TOLERANCE:
        each = with_unit(number_text.format_fixed(distance_s / count * 1e3, 2), "ms")
        return ngettext("{count} period of {each}", "{count} periods of {each} each", count, each=each)
    frequency = with_unit(number_text.format_fixed(1.0 / distance_s, 3), "Hz")
    return f"1/(B {MINUS} A) = {frequency}"
