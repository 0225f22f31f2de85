"""Two cursors on the time axis: values at each of them, and the differences."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.formatting import MINUS, with_unit
from app.presenters import number_text
from app.presenters.identify.state import Cursor, Cursors, Curves, Floats, Motion, PlotTab
from messages.i18n import gettext, ngettext

_FIRST_SHARE, _SECOND_SHARE = 0.25, 0.5
"""Initial places of the cursors, as shares of the visible span."""
_PERIOD_TOLERANCE = 0.2
"""A distance that differs from a whole number of periods by less (in periods) is shown as periods."""
_DECIMALS = {"mm": 3, "µm": 1, "mm/s": 2, "m/s²": 3}
_TABLE, _PLATE = "u<sub>1</sub>", "u<sub>2</sub>"
_RELATIVE = f"{_PLATE} − {_TABLE}"
_RELATIVE_RATE = f"{_PLATE}′ − {_TABLE}′"


@dataclass(frozen=True, eq=False, slots=True)
class PlottedQuantity:
    """A plotted line that cursors read."""

    symbol: str
    """The symbol as rich text."""
    unit: str
    time_s: Floats
    """(n,) float64: rising times as in `Curves`; values in `unit`, NaN where missing."""
    values: Floats

    def interpolate(self, at_s: float) -> float:
        """Linearly interpolated value at a time; NaN beside the line."""
        return float(np.interp(at_s, self.time_s, self.values, left=np.nan, right=np.nan))

    def format(self, value: float) -> str:
        """Format a value with its unit; a dash for NaN."""
        if not np.isfinite(value):
            return "–"
        return with_unit(number_text.format_fixed(value, _DECIMALS[self.unit]), self.unit)


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
    """Index of the sample nearest to a time."""
    after = min(int(np.searchsorted(time_s, at_s)), len(time_s) - 1)
    before = max(after - 1, 0)
    return before if at_s - time_s[before] <= time_s[after] - at_s else after


def _seconds(at_s: float) -> str:
    return with_unit(number_text.format_fixed(at_s, 4), "s")


def _written(drawn: Sequence[PlottedQuantity], values: Sequence[float]) -> Iterator[str]:
    return (quantity.format(value) for quantity, value in zip(drawn, values, strict=True))


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


def plotted_quantities(tab: PlotTab, curves: Curves, motion: Motion | None) -> tuple[PlottedQuantity, ...]:
    """Lines of a tab. Phase plane: displacement and velocity of the table, then relative ones."""
    if tab is PlotTab.DISPLACEMENT or motion is None:
        return _measured(curves)
    return tuple(
        PlottedQuantity(symbol, unit, motion.time_s, values)
        for symbol, unit, values in _computed(tab, motion)
    )


def _measured(curves: Curves) -> tuple[PlottedQuantity, ...]:
    """Records of the gauges, then the residuals."""
    both = ((_TABLE, curves.table), (_RELATIVE, curves.relative))
    gauges = [(symbol, channel) for symbol, channel in both if channel is not None]
    records = [PlottedQuantity(symbol, "mm", curves.time_s, channel.record_mm) for symbol, channel in gauges]
    residuals = [
        PlottedQuantity(gettext("residual {symbol}", symbol=symbol), "µm", curves.time_s, channel.residual_um)
        for symbol, channel in gauges
        if channel.residual_um is not None
    ]
    return (*records, *residuals)


def _computed(tab: PlotTab, motion: Motion) -> tuple[tuple[str, str, Floats], ...]:
    match tab:
        case PlotTab.VELOCITY:
            return (
                (f"{_TABLE}′", "mm/s", motion.table_mm_per_s),
                (f"{_PLATE}′", "mm/s", motion.plate_mm_per_s),
                (_RELATIVE_RATE, "mm/s", motion.relative_mm_per_s),
            )
        case PlotTab.ACCELERATION:
            return (
                (f"{_TABLE}″", "m/s²", motion.table_m_per_s2),
                (f"{_PLATE}″", "m/s²", motion.plate_m_per_s2),
            )
        case PlotTab.RELATIVE:
            return (
                (f"{_PLATE}″ − {_TABLE}″", "m/s²", motion.relative_m_per_s2),
                (_RELATIVE, "mm", motion.relative_mm),
            )
        case _:
            return (
                (_TABLE, "mm", motion.table_mm),
                (f"{_TABLE}′", "mm/s", motion.table_mm_per_s),
                (_RELATIVE, "mm", motion.relative_mm),
                (_RELATIVE_RATE, "mm/s", motion.relative_mm_per_s),
            )
