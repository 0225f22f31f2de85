"""Plots below one another with one time axis, with the gestures, keys and menu that all plots have."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRect, Qt, Signal
from PySide6.QtGui import (
    QContextMenuEvent,
    QEnterEvent,
    QFocusEvent,
    QKeyEvent,
    QPixmapCache,
    QResizeEvent,
)
from PySide6.QtWidgets import QFrame, QGraphicsItem, QGraphicsView, QWidget

from analysis.formatting import typeset, with_unit
from app.presenters.curve_table import TableCurve
from app.presenters.number_text import format_fixed
from app.qt.theme import TextRole, Theme, Tokens, font
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plot_curves import Curve, Line, Points
from app.qt.widgets.plot_marks import Crosshair, Grid
from app.qt.widgets.plot_tools import PlotTools
from app.qt.widgets.plot_view import PlotView, X, Y
from app.qt.widgets.text import markup, plain_text

Floats = NDArray[np.float64]
AXIS_WIDTH = 52
_SMALLEST_HEIGHT = 96
_ENDLESS = 16_777_215.0
"""Qt's own largest height."""
_CACHE_KB = 128 * 1024
"""Room for the pictures of axes and grids of a large screen; Qt's own 10 MB hold those of a small one."""


class Plot:
    """One plot in a row of a `PlotStack`: title and readout above, axes at the left and below.

    It is built of pyqtgraph's view and axes: a `PlotItem` would create seven menus for each plot.
    """

    def __init__(self, canvas: Any, row: int) -> None:
        self.view = PlotView()
        self._items: list[Curve | Points] = []
        self.left = self._axis("left")
        self.bottom = self._axis("bottom")
        self.left.setWidth(AXIS_WIDTH)
        self.title = canvas.addLabel("", row=3 * row, col=0, colspan=2, justify="left")
        self.readout = canvas.addLabel("", row=3 * row, col=2, justify="right")
        canvas.addItem(self.left, row=3 * row + 1, col=0)
        canvas.addItem(self.view, row=3 * row + 1, col=1, colspan=2)
        canvas.addItem(self.bottom, row=3 * row + 2, col=1, colspan=2)
        self._grid = Grid(self)

    def curve(self, *, antialias: bool = True) -> Curve:
        """Add a curve of few points, or of such as come decimated."""
        curve = Curve(antialias=antialias)
        self.add(curve)
        return curve

    def line(self, *, is_smooth: bool = False) -> Line:
        """Add a line over rising times that may be long."""
        line = Line(is_smooth=is_smooth)
        self.add(line)
        return line

    def add(self, item: Any) -> Any:
        self.view.addItem(item, ignoreBounds=True)
        if isinstance(item, Curve | Points):
            self._items.append(item)
        if isinstance(item, Line):
            self.view.sigRangeChanged.connect(item.refresh)
            self.view.sigResized.connect(item.refresh)
        return item

    def remove(self, item: Any) -> None:
        self.view.removeItem(item)
        if item in self._items:
            self._items.remove(item)

    def set_value_range(self, low: float, high: float, *, keep: bool = False) -> None:
        """Set the range of values that a reset shows; none beyond it can be shown."""
        self.view.set_home(Y, (low, high), keep=keep)

    def fit_values(self, *lines: Floats, shown: NDArray[np.bool_] | None = None, keep: bool = False) -> None:
        """Show all values of lines, with a margin; with `shown` (n,) those, and the others on demand."""
        limits = value_extent(*lines)
        home = limits if shown is None else value_extent(*(line[shown] for line in lines))
        self.view.set_home(Y, home, limits, keep=keep)

    def grow_values(self, *lines: Floats) -> None:
        """Make the range that a reset shows so large that lines fit into it."""
        self.view.grow_home(Y, value_extent(*lines))

    def autoscale(self) -> None:
        """Fit the height to what is in view."""
        values = [curve.y for curve in self.curves_in_view("")]
        if any(len(part) for part in values):
            self.view.show_ranges({Y: value_extent(*values)})

    def curves_in_view(self, x_title: str) -> list[TableCurve]:
        """Points in view of the curves that are shown, with their titles."""
        span = self.view.viewRange()[X]
        shown = [(item, *item.samples()) for item in self._items if item.isVisible()]
        return [
            TableCurve(x_title, ", ".join(filter(None, (item.title, item.unit))), x, y).between(*span)
            for item, x, y in shown
            if len(x)
        ]

    def restyle(self, tokens: Tokens) -> None:
        self.view.restyle(tokens)
        for axis in (self.left, self.bottom):
            axis.setPen(pg.mkPen(tokens.line, width=1))
            axis.setTickPen(pg.mkPen(tokens.muted, width=1))
            axis.setTextPen(pg.mkPen(tokens.muted))
        self._grid.restyle(tokens)

    def _axis(self, side: str) -> Any:
        axis = _Axis(side, self.view)
        axis.enableAutoSIPrefix(False)  # "(x0.001)" is no unit
        axis.setStyle(tickFont=font(TextRole.LABEL), tickLength=0, maxTickLevel=1)
        # An axis seldom changes, but would be drawn with each frame.
        axis.setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)
        return axis


class PlotStack(QFrame):
    """Several plots, linked in time, each with a title at its top left and a readout at its top right.

    `titles` are rich text and colour token of each plot, from the top. `heights` are relative. `format_point`
    writes x and y of the pointer, where no view reads the curves there itself.
    """

    hovered = Signal(float)  # time under the pointer (s); NaN when it has left
    resized = Signal(int)  # width of the plots in pixels

    def __init__(
        self,
        theme: Theme,
        titles: Sequence[tuple[str, str]],
        *,
        heights: Sequence[int] = (),
        format_point: Callable[[float, float], str] | None = None,
    ) -> None:
        super().__init__()
        QPixmapCache.setCacheLimit(_CACHE_KB)
        self._theme = theme
        self._titles = [_Title(text, token) for text, token in titles]
        self._time_title = ""
        self._format_point = format_point
        self.pointer: tuple[int, QPointF] | None = None
        """Row of the plot under the pointer, and the place there in its units."""
        self.reserved_keys: frozenset[Qt.Key] = frozenset()
        """Keys that the widget around handles."""
        self.export_name = "plot"
        self.pictured: QWidget = self
        """What is copied and saved as a picture."""
        self.table: Callable[[], list[TableCurve]] = self.curves_in_view
        """What is saved as a table."""
        self._canvas = pg.GraphicsLayoutWidget()
        # A background of one colour is filled faster than its picture is copied.
        self._canvas.setCacheMode(QGraphicsView.CacheModeFlag.CacheNone)
        for part in (self._canvas, self._canvas.viewport()):
            part.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # keys are for the whole plot
        self.plots = [Plot(self._canvas, row) for row in range(len(titles))]
        self._crosshair = Crosshair(self.plots)
        self._tools = PlotTools(self)
        self._arrange(heights or [1] * len(titles))
        make_column(self._canvas, of=self)
        self._canvas.scene().sigMouseMoved.connect(self._on_mouse)
        self._canvas.scene().sigMouseClicked.connect(self._on_click)
        self.setProperty("role", "plots")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMinimumHeight(_SMALLEST_HEIGHT * len(titles))

    def restyle(self) -> None:
        tokens = self._theme.tokens
        self._canvas.setBackground(tokens.surface)
        self._crosshair.restyle(tokens)
        self._tools.restyle(tokens)
        for plot, title in zip(self.plots, self._titles, strict=True):
            title.write(plot.title, tokens)
            plot.restyle(tokens)
        self.set_time_title(self._time_title)

    def set_title(self, row: int, text: str, swatches: Mapping[str, str] | None = None) -> None:
        """Write a title; each of `swatches`, characters in it, has the colour token given for it."""
        self._titles[row] = replace(self._titles[row], text=text, swatches=swatches or {})
        self._titles[row].write(self.plots[row].title, self._theme.tokens)

    def set_plot_visible(self, row: int, *, shown: bool) -> None:
        """Show a plot, or only its title (and the time axis, of the last)."""
        for item in (self.plots[row].view, self.plots[row].left):
            item.setVisible(shown)
        self._canvas.ci.layout.setRowMaximumHeight(3 * row + 1, _ENDLESS if shown else 0.0)

    def set_time_title(self, text: str) -> None:
        self._time_title = text
        self.plots[-1].bottom.setLabel(
            markup(text), **{"color": self._theme.tokens.muted, "font-size": "11px"}
        )

    def set_time_range(
        self, start_s: float, end_s: float, limits: tuple[float, float] | None = None, *, keep: bool = False
    ) -> None:
        """Set the times that a reset shows, and show them; `limits` are the ends of the record, if others.

        With `keep` a part that the user has zoomed into stays.
        """
        for plot in self.plots:
            plot.view.set_home(X, (start_s, end_s), limits, keep=keep)

    def time_range(self) -> tuple[float, float]:
        (start_s, end_s), _ = self.plots[0].view.viewRange()
        return float(start_s), float(end_s)

    def reset_view(self) -> None:
        for plot in self.plots:
            plot.view.show_home(Y)
            plot.view.show_home(X)

    def autoscale(self) -> None:
        """Fit the height of each plot to what is in view."""
        for plot in self.plots:
            if plot.view.isVisible():
                plot.autoscale()

    def set_readout(self, row: int, text: str) -> None:
        _write(self.plots[row].readout, text, self._theme.tokens.text)

    def show_values(
        self, row: int, at_s: float, values: Sequence[float], unit: str, decimals: int = 3
    ) -> None:
        """Show a time (nothing if NaN) and the values of a plot there (a dash if NaN) as its readout."""
        texts = [format_fixed(value, decimals) if math.isfinite(value) else "–" for value in values]
        at = "" if math.isnan(at_s) else with_unit(format_fixed(at_s, 3), "s")
        self.set_readout(row, f"{at}   {with_unit(' | '.join(texts), unit)}" if at and texts else at)

    def curves_in_view(self) -> list[TableCurve]:
        x_title = plain_text(self.plots[-1].bottom.labelText)
        return [curve for plot in self.plots for curve in plot.curves_in_view(x_title)]

    def views_meant(self, axis: int) -> list[PlotView]:
        """Views that a key means: of the plot under the pointer, else of all; time is common to them."""
        rows = [self.pointer[0]] if self.pointer else range(1 if axis == X else len(self.plots))
        return [self.plots[row].view for row in rows]

    def first_plot_rect(self) -> QRect:
        """Place of the first plot in pixels of the stack."""
        inside: QRect = self._canvas.mapFromScene(self.plots[0].view.sceneBoundingRect()).boundingRect()
        return inside.translated(self._canvas.pos())

    @property
    def tokens(self) -> Tokens:
        return self._theme.tokens

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        if Qt.Key(event.key()) in self.reserved_keys or not self._tools.press(event):
            event.ignore()

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:  # noqa: N802
        if event.reason() is QContextMenuEvent.Reason.Keyboard:  # of a click pyqtgraph wants to see the end
            self._tools.open_menu(self.mapToGlobal(self.rect().center()))
        event.accept()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._tools.place_bar()
        self.resized.emit(max(64, self.width() - AXIS_WIDTH - 20))

    def enterEvent(self, event: QEnterEvent) -> None:  # noqa: N802
        super().enterEvent(event)
        self._tools.show_bar()

    def focusInEvent(self, event: QFocusEvent) -> None:  # noqa: N802
        super().focusInEvent(event)
        if event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason):
            self._tools.show_bar()

    def leaveEvent(self, event: QEvent) -> None:  # noqa: N802
        super().leaveEvent(event)
        self.forget_pointer()
        self._tools.hide_bar()

    def focusOutEvent(self, event: QFocusEvent) -> None:  # noqa: N802
        super().focusOutEvent(event)
        if not self.underMouse():
            self._tools.hide_bar()

    def _arrange(self, heights: Sequence[int]) -> None:
        grid = self._canvas.ci.layout
        grid.setContentsMargins(8, 4, 12, 4)
        grid.setSpacing(0)
        for row, height in enumerate(heights):
            grid.setRowStretchFactor(3 * row + 1, height)
            grid.setRowPreferredHeight(3 * row + 1, 1000.0)
        for plot in self.plots[:-1]:
            plot.bottom.setStyle(showValues=False)
            plot.bottom.setHeight(4)
        for plot in self.plots[1:]:
            plot.view.setXLink(self.plots[0].view)

    def _on_mouse(self, position: QPointF) -> None:
        for row, plot in enumerate(self.plots):
            if plot.view.isVisible() and plot.view.sceneBoundingRect().contains(position):
                self._point(row, plot.view.mapSceneToView(position))
                return
        self.forget_pointer()

    def _point(self, row: int, at: QPointF) -> None:
        if self.pointer is not None and self.pointer[0] != row:
            self.forget_pointer()
        self.pointer = row, at
        self._crosshair.show_at(row, at)
        if self._format_point is not None:
            self.set_readout(row, self._format_point(at.x(), at.y()))
        self.hovered.emit(float(at.x()))

    def forget_pointer(self) -> None:
        if self.pointer is None:
            return
        row, _ = self.pointer
        self.pointer = None
        self._crosshair.hide()
        if self._format_point is not None:
            self.set_readout(row, "")
        self.hovered.emit(math.nan)

    def _on_click(self, event: Any) -> None:
        if event.button() == Qt.MouseButton.RightButton:
            self._tools.open_menu(event.screenPos().toPoint())
        elif event.button() == Qt.MouseButton.LeftButton and event.double():
            self.reset_view()


class _Axis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    def __init__(self, side: str, view: PlotView) -> None:
        super().__init__(side, linkView=view)
        self._known: tuple[tuple[float, ...], Any] = ((), None)

    def ticks_in_view(self, level: int) -> list[float]:
        """Ticks of a level: those with a number, then those between them."""
        if self._tickLevels is not None:
            return [value for value, _ in self._tickLevels[level]] if level < len(self._tickLevels) else []
        view = self.linkedView()
        length = view.height() if self.orientation == "left" else view.width()
        levels: Any = self.tickValues(self.range[0], self.range[1], length) if length else []
        return levels[level][1] if level < len(levels) else []

    def generateDrawSpecs(self, painter: Any) -> Any:  # noqa: N802
        """As pyqtgraph, without ticks, which have no length; of an axis without numbers only its line."""
        if not self.style["showValues"]:
            bounds = self.mapRectFromParent(self.geometry())
            return (self.pen(), bounds.topLeft(), bounds.topRight()), [], []
        specs = super().generateDrawSpecs(painter)
        return None if specs is None else (specs[0], [], specs[2])

    def tickValues(self, minVal: float, maxVal: float, size: float) -> Any:  # noqa: N802
        """Interval and ticks of each level, without those of the levels before, as pyqtgraph counts them.

        Its own arithmetic with arrays takes ten times as long for so few; it asks several times for the same.
        """
        asked = (minVal, maxVal, size, self.scale)
        if asked != self._known[0]:
            low, high = sorted((minVal * self.scale, maxVal * self.scale))
            levels: list[tuple[float, list[float]]] = []
            for spacing, _ in self.tickSpacing(low, high, size):
                ticks = [n * spacing for n in range(math.ceil(low / spacing), math.floor(high / spacing) + 1)]
                coarser = [interval for interval, _ in levels]
                levels.append((spacing, [tick for tick in ticks if not _is_multiple(tick, spacing, coarser)]))
            self._known = (
                asked,
                [(spacing / self.scale, [tick / self.scale for tick in ticks]) for spacing, ticks in levels],
            )
        return self._known[1]

    def tickStrings(self, values: Any, scale: float, spacing: float) -> list[str]:  # noqa: N802
        return [typeset(text) for text in super().tickStrings(values, scale, spacing)]


def _is_multiple(tick: float, spacing: float, intervals: Sequence[float]) -> bool:
    """Whether a tick is at a multiple of one of the intervals, to a hundredth of its spacing."""
    return any(abs(math.remainder(tick, interval)) <= 0.01 * spacing for interval in intervals)


def value_at(time_s: Floats, values: Floats, at_s: float) -> float:
    """Value of a drawn line at a time; NaN outside it."""
    if not len(time_s) or not time_s[0] <= at_s <= time_s[-1]:
        return math.nan
    return float(values[min(int(np.searchsorted(time_s, at_s)), len(values) - 1)])


def value_extent(*lines: Floats) -> tuple[float, float]:
    """Lowest and highest value of lines, with a margin; -1 and 1 without any."""
    values = [line[np.isfinite(line)] for line in lines]
    low = min((float(line.min()) for line in values if len(line)), default=-1.0)
    high = max((float(line.max()) for line in values if len(line)), default=1.0)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


@dataclass(frozen=True)
class _Title:
    """Rich text, its colour token, and the tokens of characters in it that have another colour."""

    text: str
    token: str
    swatches: Mapping[str, str] = field(default_factory=dict)

    def write(self, item: Any, tokens: Tokens) -> None:
        inks = {swatch: getattr(tokens, token) for swatch, token in self.swatches.items()}
        _write(item, self.text, getattr(tokens, self.token), inks)


def _write(item: Any, text: str, text_colour: str, inks: Mapping[str, str] | None = None) -> None:
    """Set the text of a label; a wide one is cut instead of moving the plot. `inks` colour characters."""
    inked = markup(text)
    for swatch, ink in (inks or {}).items():
        inked = inked.replace(swatch, f'<span style="color: {ink}">{swatch}</span>')
    styled = f'<span style="color: {text_colour}; font-size: 12px">{inked}</span>'
    if styled != item.text:  # to lay a text out takes as long as to draw a curve
        item.setText(styled)
        item.setMinimumWidth(0.0)
