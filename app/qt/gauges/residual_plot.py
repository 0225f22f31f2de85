"""What a calibration leaves of its readings, against the dial."""

import numpy as np
import pyqtgraph as pg

from app.presenters.gauges.state import CalibrationFit
from app.qt.theme import Theme, colour
from app.qt.widgets.plots import PlotStack, pen
from messages.i18n import N_, gettext

_TITLE = N_("dial − calibration, µm &nbsp; ▲ up &nbsp; ▼ down")
_SMALLEST_UM = 1.0
_HEIGHT = 240


class ResidualPlot(PlotStack):
    """Marks pointing up on the way up, down on the way down, about a line at zero."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, ((_TITLE, "text"),), interactive=False)
        (plot,) = self.plots
        self._zero = plot.add(pg.InfiniteLine(pos=0.0, angle=0, movable=False))
        self._marks = [plot.add(pg.ScatterPlotItem(symbol=mark, size=10)) for mark in ("t1", "t")]
        self.setFixedHeight(_HEIGHT)
        self.setAccessibleName(gettext("Residuals of the calibration"))
        theme.changed.connect(self._recolour)
        self._recolour()
        self.show_fit(None)

    def show_fit(self, fitted: CalibrationFit | None) -> None:
        (plot,) = self.plots
        if fitted is None:
            for marks in self._marks:
                marks.setData([], [])
            plot.set_value_range(-10.0, 10.0)
            self.set_time_range(-10.0, 10.0)
            return
        for marks, shown in zip(self._marks, (fitted.upward, ~fitted.upward), strict=True):
            marks.setData(fitted.dial_mm[shown], fitted.residual_um[shown])
        limit = 1.25 * max(float(np.abs(fitted.residual_um).max()), _SMALLEST_UM)
        plot.set_value_range(-limit, limit)
        low, high = float(fitted.dial_mm.min()), float(fitted.dial_mm.max())
        margin = 0.05 * (high - low) or 1.0
        self.set_time_range(low - margin, high + margin)

    def _recolour(self) -> None:
        self.restyle()
        self.set_time_title(gettext("dial gauge, mm"))
        tokens = self._theme.tokens
        self._zero.setPen(pen(tokens.muted, dashes=(4.0, 4.0)))
        for marks, token in zip(self._marks, (tokens.channel_1, tokens.channel_2), strict=True):
            marks.setBrush(pg.mkBrush(colour(token)))
            marks.setPen(pg.mkPen(None))
