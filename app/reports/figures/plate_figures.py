"""Friction of each slip against sliding velocity, position and time, from the plate alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from matplotlib.figure import Figure

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
from app.reports.figures.style import DASHED, PLATE, SIMULATION, new_figure, place_legend_above

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

    def render(self, run: RunFigureData, title: str = "") -> Figure | None:
        """Draw the figure within `print_style`; None without friction from the plate alone."""
        if run.plate is None:
            return None
        trend = self.trend(run.plate, run.release_s)
        figure, axes = new_figure()
        at = trend.grid()
        line, half_width = trend.line(at)
        shown = self.unit.scale * at
        axes.fill_between(shown, line - half_width, line + half_width, color=SIMULATION, alpha=0.12, lw=0)
        axes.plot(shown, line, color=SIMULATION, linewidth=0.8, linestyle=DASHED, label=self._slope(trend))
        axes.errorbar(
            self.unit.scale * trend.at, trend.friction, yerr=trend.half_width_95, fmt="o", color=PLATE,
            markersize=2.5, elinewidth=0.8, capsize=1.5, label="slips",
        )  # fmt: skip
        axes.set_xlabel(self.unit.labelled(self.label))
        axes.set_ylabel("dynamic friction")
        axes.set_ylim(*trend.value_range())
        place_legend_above(axes, ncols=1, handlelength=2.6)
        if title:
            figure.suptitle(title, fontsize=9, x=0.01, ha="left")
        return figure

    def _slope(self, trend: FrictionTrend) -> str:
        scale = self.slope_unit.scale
        slope = format_value(scale * trend.slope, scale * trend.slope_standard_uncertainty).in_print
        verdict = "zero within 95 %" if trend.includes_zero else "zero outside 95 %"
        return f"{slope} per {self.slope_unit.symbol}, {verdict}"


_ENDS = "Points: slips with their 95 % interval; dashed: fitted line with its 95 % band."
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
