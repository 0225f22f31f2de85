"""Record against simulation for both gauges, and what is left over: three plots, one time axis."""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.presenters.identify.state import ChannelCurves, Curves, Floats, ManualFit, PlotLine, ReadingUnit
from app.qt.identify.cursors import CursorLines
from app.qt.theme import Theme, mixed
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plot_curves import Curve
from app.qt.widgets.plot_marks import ShadedSpans, hatching, pen, place_region, shade, shaded_region
from app.qt.widgets.plots import PlotStack, value_at
from app.qt.widgets.text import padded
from messages.i18n import N_, gettext

_NAMES = (
    N_("table displacement u<sub>1</sub>, {unit}"),
    N_("relative displacement u<sub>2</sub> − u<sub>1</sub>, {unit}"),
    N_("residual, {unit}"),
)
_COLOURS = ("channel_1", "channel_2", "text")
_KEY = N_("— record &nbsp; - - simulation")
_SWATCHES = {"- -": "simulation"}
_RECORD_ONLY = N_("— record; no motion was fitted")
_OF_RESIDUAL = N_("table and relative; between the dashes: twice the noise")
_OF_TABLE = N_("table; between the dashes: twice the noise")
_UNUSED = N_("hatched: disturbed, not fitted")
_NO_RESIDUAL = N_("nothing was fitted that could leave any")
_CHANNELS = (N_("table displacement"), N_("relative displacement"))
_RECORD, _SIMULATION = N_("{channel}, record"), N_("{channel}, simulation")
_RESIDUAL = N_("{channel}, residual")
_BEFORE_RELEASE_S = 1.0


class CurvePlots(QWidget):
    """Draws `Curves`.

    A simulation by hand has items of its own: those of the fit are hidden meanwhile, and what does not
    change comes from pictures that Qt keeps, so that a frame costs two short lines a plot.
    """

    span_changed = Signal(float, float, int)  # what of the time axis is drawn (s), and how wide in pixels

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._curves: Curves | None = None
        self._has_grown = False
        self._stack = PlotStack(theme, [("", colour) for colour in _COLOURS], heights=(3, 3, 2))
        table, relative, residual = self._stack.plots
        self._records = [plot.line() for plot in (table, relative)]
        self._simulations = [plot.line(is_smooth=True) for plot in (table, relative)]
        self._residuals = [residual.line() for _ in range(2)]
        # By hand they change with each frame: no smooth edges.
        self._hand_simulations = [plot.curve(antialias=False) for plot in (table, relative)]
        self._hand_residuals = [residual.curve(antialias=False) for _ in range(2)]
        self._slips = [ShadedSpans(plot) for plot in self._stack.plots]
        self._unused = [ShadedSpans(plot) for plot in self._stack.plots]
        self._noise = shaded_region(residual, "horizontal")
        self._noise.setZValue(10)
        self.cursors = CursorLines(self._stack.plots)
        make_column(self._stack, of=self)
        self._stack.hovered.connect(self._show_values)
        self._stack.resized.connect(lambda _: self._report_span())
        self._stack.plots[0].view.sigXRangeChanged.connect(lambda *_: self._report_span())
        theme.changed.connect(self._restyle)
        self._restyle()

    def show_curves(self, curves: Curves) -> None:
        """Show a run. Under another law of the same run the part in view stays."""
        keep = self._curves is not None and np.array_equal(self._curves.time_s, curves.time_s)
        self._curves = curves
        self._stack.set_time_title(curves.time_label)
        for row, channel in enumerate(padded(curves.channels, 2, None)):
            self._records[row].show_line(curves.time_s, channel.record if channel else None)
            self._simulations[row].show_line(curves.time_s, channel.simulation if channel else None)
            self._residuals[row].show_line(curves.time_s, channel.residual if channel else None)
        for plot, lines in zip(self._stack.plots[:2], _lines(curves), strict=False):
            plot.fit_values(*lines, keep=keep)
        self._fit_residuals(keep=keep)
        self.show_manual_fit(None)
        self._set_titles(curves)
        self._name_curves(curves)
        for slip in self._slips:
            slip.show_spans(curves.slips)
        for unused in self._unused:
            unused.show_spans(((curves.fitted[1], math.inf),) if curves.fit_ends_early else ())
        band = 2.0 * (curves.noise or 0.0)
        place_region(self._noise, (-band, band) if band else None)
        first_s, last_s = float(curves.time_s[0]), float(curves.time_s[-1])
        self._stack.set_time_range(max(first_s, -_BEFORE_RELEASE_S), last_s, (first_s, last_s), keep=keep)

    def show_manual_fit(self, hand: ManualFit | None) -> None:
        for fitted in (*self._simulations, *self._residuals):
            fitted.setVisible(hand is None)
        for record in self._records:
            record.keep_picture(kept=hand is not None)
        simulated = () if hand is None else hand.simulations
        left_over = () if hand is None else hand.residuals_um
        for curves, lines in ((self._hand_simulations, simulated), (self._hand_residuals, left_over)):
            for row, curve in enumerate(curves):
                _set_line(curve, lines[row] if row < len(lines) else None)
        if left_over:  # the range only grows, so that it does not jump under a drag
            self._stack.plots[-1].grow_values(*(line.values for line in left_over))
            self._has_grown = True
        elif self._has_grown:
            self._fit_residuals(keep=True)

    def _fit_residuals(self, *, keep: bool) -> None:
        """Show the residuals of what was fitted; a reset shows no more, zooming out all of them."""
        self._has_grown = False
        if self._curves is not None:
            start_s, end_s = self._curves.fitted
            fitted = (self._curves.time_s >= start_s) & (self._curves.time_s <= end_s)
            *_, lines = _lines(self._curves)
            self._stack.plots[-1].fit_values(*lines, shown=fitted, keep=keep)

    def span(self) -> tuple[float, float]:
        """What of the time axis is drawn (s)."""
        return self._stack.time_range()

    def _report_span(self) -> None:
        self.span_changed.emit(*self.span(), max(64, int(self._stack.plots[0].view.width())))

    def _set_titles(self, curves: Curves) -> None:
        table, relative = padded(curves.channels, 2, None)
        is_fitted = any(channel.residual is not None for channel in curves.channels)
        of_residual = gettext(_OF_TABLE if relative is None else _OF_RESIDUAL)
        texts = (
            _key(table),
            curves.no_relative_reason or _key(relative),
            of_residual if is_fitted else gettext(_NO_RESIDUAL),
        )
        if curves.fit_ends_early:
            texts = (f"{texts[0]} &nbsp; {gettext(_UNUSED)}", *texts[1:])
        shown = (True, relative is not None, is_fitted)
        for row, (name, unit, text) in enumerate(zip(_NAMES, _units(curves), texts, strict=True)):
            self._stack.set_title(row, f"{gettext(name, unit=unit.symbol)} &nbsp; {text}", _SWATCHES)
            self._stack.set_plot_visible(row, shown=shown[row])

    def _name_curves(self, curves: Curves) -> None:
        for row, name in enumerate(_CHANNELS):
            named = (
                (self._records[row], _RECORD, curves.unit),
                (self._simulations[row], _SIMULATION, curves.unit),
                (self._hand_simulations[row], _SIMULATION, curves.unit),
                (self._residuals[row], _RESIDUAL, curves.residual_unit),
                (self._hand_residuals[row], _RESIDUAL, curves.residual_unit),
            )
            for curve, of_channel, unit in named:
                curve.title, curve.unit = gettext(of_channel, channel=gettext(name)), unit.symbol

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self._stack.restyle()
        dashed = pen(tokens.simulation, dashes=(5.0, 5.0))
        for row, token in enumerate((tokens.channel_1, tokens.channel_2)):
            self._records[row].setPen(pen(token))
            self._simulations[row].setPen(dashed)
            self._hand_simulations[row].setPen(dashed)
            self._residuals[row].setPen(pen(token, alpha=0.5))
            self._hand_residuals[row].setPen(pen(mixed(token, tokens.surface, 0.5)))
        for slip in self._slips:
            slip.set_brush(shade(tokens.channel_2, tokens.slip_alpha))
        for unused in self._unused:
            unused.set_brush(hatching(tokens.muted))
        self._noise.setBrush(pg.mkBrush(None))
        for line in self._noise.lines:
            line.setPen(pen(tokens.text, dashes=(4.0, 4.0)))
        self.cursors.restyle(tokens)
        if self._curves is not None:
            self._stack.set_time_title(self._curves.time_label)

    def _show_values(self, at_s: float) -> None:
        if self._curves is None:
            return
        for row, (lines, unit) in enumerate(zip(_lines(self._curves), _units(self._curves), strict=True)):
            values = [value_at(self._curves.time_s, line, at_s) for line in lines]
            self._stack.show_values(row, at_s, values, unit.symbol, unit.decimals)


def _units(curves: Curves) -> tuple[ReadingUnit, ...]:
    return curves.unit, curves.unit, curves.residual_unit


def _key(channel: ChannelCurves | None) -> str:
    return gettext(_RECORD_ONLY if channel is None or channel.simulation is None else _KEY)


def _lines(curves: Curves) -> tuple[list[Floats], ...]:
    """Lines of each plot: record and simulation of each gauge, and the residuals."""
    gauges = [(channel.record, channel.simulation) for channel in curves.channels]
    residuals = [channel.residual for channel in curves.channels]
    rows = (*padded(gauges, 2, ()), residuals)
    return tuple([line for line in lines if line is not None] for lines in rows)


def _set_line(curve: Curve, line: PlotLine | None) -> None:
    curve.setVisible(line is not None)
    if line is not None:
        curve.show_points(line.time_s, line.values)
