"""What the cursors read on each tab: the lines that are drawn there, with their symbols and units."""

from app.presenters.identify.cursors import PlottedQuantity
from app.presenters.identify.state import Curves, Floats, Motion, PlotTab
from messages.i18n import gettext

_TABLE, _PLATE = "u<sub>1</sub>", "u<sub>2</sub>"
_RELATIVE = f"{_PLATE} − {_TABLE}"
_RELATIVE_RATE = f"{_PLATE}′ − {_TABLE}′"


def plotted_quantities(side: PlotTab, curves: Curves, motion: Motion | None) -> tuple[PlottedQuantity, ...]:
    """What is drawn on a tab; on the phase plane across and up of the table, then of the plate against it."""
    if side is PlotTab.DISPLACEMENT or motion is None:
        return _measured(curves)
    return tuple(
        PlottedQuantity(symbol, unit, motion.time_s, values)
        for symbol, unit, values in _computed(side, motion)
    )


def _measured(curves: Curves) -> tuple[PlottedQuantity, ...]:
    """Both gauges, then what the simulation leaves of each."""
    both = ((_TABLE, curves.table), (_RELATIVE, curves.relative))
    gauges = [(symbol, channel) for symbol, channel in both if channel is not None]
    records = [PlottedQuantity(symbol, "mm", curves.time_s, channel.record_mm) for symbol, channel in gauges]
    residuals = [
        PlottedQuantity(gettext("residual {symbol}", symbol=symbol), "µm", curves.time_s, channel.residual_um)
        for symbol, channel in gauges
        if channel.residual_um is not None
    ]
    return (*records, *residuals)


def _computed(side: PlotTab, motion: Motion) -> tuple[tuple[str, str, Floats], ...]:
    match side:
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
