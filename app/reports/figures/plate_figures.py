"""Friction of each slip against sliding velocity, position and time, from the plate alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN, CARETUP
from numpy.typing import NDArray

from analysis.catalogue import MILLIMETRE, MILLIMETRES_PER_SECOND, SECOND, Unit
from analysis.formatting import format_value
from analysis.plate.friction import PlateFriction
from analysis.plate.trends import (
    FrictionTrend,
    trend_with_position,
    trend_with_time,
    trend_with_velocity,
)
from app.reports.figures.run_figures import RUN_FIGURES, RunFigure, RunFigureData
from app.reports.figures.style import DASHED, HEIGHT_IN, PLATE, SIMULATION, new_figure, place_legend_above

Floats = NDArray[np.float64]
_Trend = Callable[[PlateFriction, float], FrictionTrend]


@dataclass(frozen=True, slots=True)
class PlateFigure:
    number: str  # as a run's other figures have one
    caption: str
    label: str
    unit: Unit
    slope_unit: Unit
    """Scale: of what the slope is told for, in the covariate's SI unit."""
    trend: _Trend

    def render(self, run: RunFigureData, title: str = "", height_in: float = HEIGHT_IN) -> Figure | None:
        """Draw the figure within `print_style`; None without friction from the plate alone."""
        if run.plate is None:
            return None
        trend = self.trend(run.plate, run.release_s)
        figure, axes = new_figure(height_in)
        at = trend.grid()
        line, half_width = trend.line(at)
        shown = self.unit.scale * at
        axes.fill_between(shown, line - half_width, line + half_width, color=SIMULATION, alpha=0.12, lw=0)
        axes.plot(shown, line, color=SIMULATION, linewidth=0.8, linestyle=DASHED, label=self._slope(trend))
        limits = trend.value_range()
        _slips(axes, self.unit.scale * trend.at, trend, limits)
        axes.set_xlabel(self.unit.labelled(self.label))
        axes.set_ylabel("dynamic friction $f_d$")
        axes.set_ylim(*limits)
        place_legend_above(axes, ncols=1, handlelength=2.6)
        if title:
            figure.suptitle(title, fontsize=9, x=0.01, ha="left")
        return figure

    def _slope(self, trend: FrictionTrend) -> str:
        scale = self.slope_unit.scale
        slope = format_value(scale * trend.slope, scale * trend.slope_standard_uncertainty).in_print
        verdict = "zero within 95 %" if trend.includes_zero else "zero outside 95 %"
        return f"{slope} per {self.slope_unit.symbol}, {verdict}"


def _slips(axes: Axes, at: Floats, trend: FrictionTrend, limits: tuple[float, float]) -> None:
    """Draw slips with their intervals; an arrow stands at the end of the axes where an interval goes on."""
    low, high = limits
    first, last = trend.friction - trend.half_width_95, trend.friction + trend.half_width_95
    whole = (first >= low) & (last <= high)
    axes.errorbar(
        at[whole], trend.friction[whole], yerr=trend.half_width_95[whole], fmt="o", color=PLATE,
        markersize=2.5, elinewidth=0.8, capsize=1.5, label="slips",
    )  # fmt: skip
    axes.vlines(
        at[~whole], np.clip(first[~whole], low, high), np.clip(last[~whole], low, high),
        colors=PLATE, linewidth=0.8,
    )  # fmt: skip
    inside = ~whole & (trend.friction >= low) & (trend.friction <= high)
    for there, place, mark in (
        (inside, trend.friction[inside], "o"),
        (last > high, high, CARETUP),
        (first < low, low, CARETDOWN),
    ):
        places = np.broadcast_to(place, at[there].shape)
        size = 2.5 if mark == "o" else 4.0
        axes.plot(at[there], places, linestyle="none", marker=mark, markersize=size, color=PLATE)


_ENDS = "Points: slips with their 95 % interval (arrow: it goes on); dashed: fitted line with its 95 % band."
PLATE_FIGURES: Final = (
    PlateFigure(
        "fd-velocity",
        f"Dynamic friction against mean sliding velocity, from the plate alone. {_ENDS}",
        "sliding velocity",
        MILLIMETRES_PER_SECOND,
        Unit("100 mm/s", 0.1),
        lambda plate, _: trend_with_velocity(plate),
    ),
    PlateFigure(
        "fd-position",
        f"Dynamic friction against position on the table, from the plate alone. {_ENDS}",
        "position on the table $u_2 - u_1$",
        MILLIMETRE,
        Unit("mm", 1e-3),
        lambda plate, _: trend_with_position(plate),
    ),
    PlateFigure(
        "fd-time",
        f"Dynamic friction slip by slip, from the plate alone. {_ENDS}",
        "time since release $t$",
        SECOND,
        SECOND,
        trend_with_time,
    ),
)
ALL_FIGURES: Final[tuple[RunFigure | PlateFigure, ...]] = (*RUN_FIGURES, *PLATE_FIGURES)
"""Figures of a run: the paper's, then those of friction by slip."""
