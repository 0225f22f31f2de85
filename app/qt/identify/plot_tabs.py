"""Plots of Identify, a page for each tab, with cursors that mouse and keys move on all of them."""

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QStackedWidget, QWidget

from analysis.catalogue import displacement_decimals, displacement_unit
from analysis.formatting import with_unit
from app.presenters.identify.state import Cursor, Cursors, Motion, PlotTab, PlottedQuantity
from app.presenters.number_text import format_fixed
from app.qt.identify.cursors import CursorLines, CursorPoints
from app.qt.identify.curve_plots import CurvePlots
from app.qt.identify.slip_plots import SlipPages
from app.qt.theme import Theme
from app.qt.widgets.layouts import make_column, make_row
from app.qt.widgets.plot_marks import ShadedSpans, pen, shade
from app.qt.widgets.plots import PlotStack, value_at, value_extent
from app.qt.widgets.shortcuts import describe_shortcut
from app.qt.widgets.text import plain_text
from messages.i18n import N_, gettext

_NAMES = {
    PlotTab.DISPLACEMENT: N_("Record against simulation, and residual"),
    PlotTab.VELOCITY: N_("Velocities of the fitted motion"),
    PlotTab.ACCELERATION: N_("Accelerations of the fitted motion"),
    PlotTab.RELATIVE: N_("Relative acceleration of the fitted motion"),
    PlotTab.PHASE: N_("Phase plane of the fitted motion"),
    PlotTab.FRICTION: N_("Friction of each slip, from the plate alone"),
}
_TIME_PLOTS = {
    PlotTab.VELOCITY: (
        (
            N_("velocities, mm/s &nbsp; — table u<sub>1</sub>′ &nbsp; - - plate u<sub>2</sub>′"),
            ("channel_1", "channel_2"),
        ),
        (N_("relative velocity u<sub>2</sub>′ − u<sub>1</sub>′, mm/s"), ("text",)),
    ),
    PlotTab.ACCELERATION: (
        (N_("table acceleration u<sub>1</sub>″, m/s²"), ("channel_1",)),
        (N_("plate acceleration u<sub>2</sub>″, m/s²"), ("channel_2",)),
    ),
    PlotTab.RELATIVE: (
        (N_("relative acceleration u<sub>2</sub>″ − u<sub>1</sub>″, m/s²"), ("text",)),
        (N_("relative displacement u<sub>2</sub> − u<sub>1</sub>, {unit}"), ("channel_2",)),
    ),
}
"""Titles of the plots, and colours of the lines of the tab in the same order."""
_STEP, _LONG_STEP = 1, 10  # samples by which an arrow key moves a cursor, and one with Shift
_DIRECTIONS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}
_CURSOR_KEYS = {Qt.Key.Key_A: Cursor.A, Qt.Key.Key_B: Cursor.B}


class PlotTabs(QStackedWidget):
    """One page for each `PlotTab`."""

    cursor_moved = Signal(Cursor, float)
    cursor_stepped = Signal(int)
    cursor_activated = Signal(Cursor)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.curves = CurvePlots(theme)
        unit = displacement_unit().symbol
        self.motions = {
            tab: TimePlots(theme, [(gettext(title, unit=unit), colours) for title, colours in plots])
            for tab, plots in _TIME_PLOTS.items()
        } | {PlotTab.PHASE: PhasePlots(theme)}
        self.slips = SlipPages(theme)
        for tab in PlotTab:
            page = self._page(tab)
            page.setAccessibleName(gettext(_NAMES[tab]))
            self.addWidget(page)
            if isinstance(page, CurvePlots | TimePlots | SlipPages):
                page.cursors.moved.connect(self.cursor_moved)
        describe_shortcut(
            self, "← → A B", gettext("Move a cursor by a reading, with Shift by ten; choose the cursor")
        )

    def show_motion(self, motion: Motion, slips: tuple[tuple[float, float], ...]) -> None:
        for tab, lines in motion.items():
            self.motions[tab].show_lines(lines, slips)

    def set_run_name(self, name: str) -> None:
        """Name the run in the files of its plots."""
        for tab in PlotTab:
            for stack in self._page(tab).findChildren(PlotStack):
                stack.export_name = f"{name} {gettext(tab.value).lower()}"

    def show_tab(self, tab: PlotTab, cursors: Cursors | None) -> None:
        page = self._page(tab)
        page.cursors.show_cursors(cursors)
        self.setCurrentWidget(page)
        cells = () if cursors is None else (*map(" ".join, cursors.cells), cursors.period)
        stacks = page.findChildren(PlotStack)
        for stack in stacks:
            stack.setAccessibleName(page.accessibleName())
            stack.setAccessibleDescription("; ".join(cells))
            stack.reserved_keys = frozenset() if cursors is None else frozenset(_DIRECTIONS)
        self.setFocusProxy(stacks[0])

    def span(self) -> tuple[float, float] | None:
        """Visible times (s); None on the phase plane."""
        page = self._page(list(PlotTab)[self.currentIndex()])
        return None if isinstance(page, PhasePlots) else page.span()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        key = Qt.Key(event.key())
        if key in _DIRECTIONS:
            is_long = event.modifiers() & Qt.KeyboardModifier.ShiftModifier
            self.cursor_stepped.emit(_DIRECTIONS[key] * (_LONG_STEP if is_long else _STEP))
        elif key in _CURSOR_KEYS:
            self.cursor_activated.emit(_CURSOR_KEYS[key])
        else:
            super().keyPressEvent(event)

    def _page(self, tab: PlotTab) -> "CurvePlots | TimePlots | PhasePlots | SlipPages":
        return self.slips if tab is PlotTab.FRICTION else self.motions.get(tab, self.curves)


class TimePlots(QWidget):
    """Two plots on one time axis, slip shaded: title, and colour tokens of the lines, of each."""

    def __init__(self, theme: Theme, plots: Sequence[tuple[str, Sequence[str]]]) -> None:
        super().__init__()
        self._theme = theme
        self._lines: Sequence[PlottedQuantity] = ()
        heads = [(title, tokens[0] if len(tokens) == 1 else "text") for title, tokens in plots]
        self._stack = PlotStack(theme, heads, heights=(3, 2))
        self._slips = [ShadedSpans(plot) for plot in self._stack.plots]
        self._colours = [token for _, tokens in plots for token in tokens]
        self._rows = [row for row, (_, tokens) in enumerate(plots) for _ in tokens]
        self._curves = [self._stack.plots[row].line() for row in self._rows]
        self.cursors = CursorLines(self._stack.plots)
        self._stack.hovered.connect(self._show_values)
        make_column(self._stack, of=self)
        theme.changed.connect(self._restyle)

    def show_lines(self, lines: Sequence[PlottedQuantity], slips: tuple[tuple[float, float], ...]) -> None:
        keep = bool(self._lines) and np.array_equal(self._lines[0].time_s, lines[0].time_s)
        self._lines = lines
        for curve, line in zip(self._curves, lines, strict=True):
            curve.title, curve.unit = plain_text(line.symbol), line.unit
            curve.show_line(line.time_s, line.values)
        for row, plot in enumerate(self._stack.plots):
            plot.fit_values(*(line.values for line in self._lines_of(row)), keep=keep)
        for slip in self._slips:
            slip.show_spans(slips)
        self._stack.set_time_range(float(lines[0].time_s[0]), float(lines[0].time_s[-1]), keep=keep)
        self._restyle()

    def span(self) -> tuple[float, float]:
        """Drawn part of the time axis (s)."""
        return self._stack.time_range()

    def _lines_of(self, row: int) -> list[PlottedQuantity]:
        return [line for line, its_row in zip(self._lines, self._rows, strict=True) if its_row == row]

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self._stack.restyle()
        self.cursors.restyle(tokens)
        self._stack.set_time_title(gettext("time from release, s"))
        for slip in self._slips:
            slip.set_brush(shade(tokens.channel_2, tokens.slip_alpha))
        for number, (curve, token) in enumerate(zip(self._curves, self._colours, strict=True)):
            is_second = number > 0 and self._rows[number] == self._rows[number - 1]
            curve.setPen(pen(getattr(tokens, token), dashes=(6.0, 3.0) if is_second else ()))

    def _show_values(self, at_s: float) -> None:
        for row in range(len(self._stack.plots) if self._lines else 0):
            lines = self._lines_of(row)
            values = [value_at(line.time_s, line.values, at_s) for line in lines]
            self._stack.show_values(row, at_s, values, lines[0].unit)


class PhasePlots(QWidget):
    """Velocity against displacement: of the table, and of the plate relative to it."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        titles = (
            (gettext("table: velocity, mm/s"), "channel_1"),
            (gettext("plate against table: velocity, mm/s"), "channel_2"),
        )
        self._stacks = [PlotStack(theme, (title,), format_point=_format_phase) for title in titles]
        self._curves = [stack.plots[0].curve() for stack in self._stacks]
        self.cursors = CursorPoints([stack.plots[0] for stack in self._stacks])
        make_row(*((stack, 1) for stack in self._stacks), of=self)
        theme.changed.connect(self._restyle)
        self._restyle()

    def show_lines(self, lines: Sequence[PlottedQuantity], _slips: object) -> None:
        pairs = zip(lines[::2], lines[1::2], strict=True)
        for stack, curve, (displacement, velocity) in zip(self._stacks, self._curves, pairs, strict=True):
            curve.title, curve.unit = plain_text(velocity.symbol), velocity.unit
            curve.show_points(displacement.values, velocity.values)
            stack.set_time_range(*value_extent(displacement.values))
            stack.plots[0].fit_values(velocity.values)

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self.cursors.restyle(tokens)
        for stack, symbol in zip(self._stacks, ("u₁", "u₂ − u₁"), strict=True):
            stack.restyle()
            stack.set_time_title(f"{symbol}, {displacement_unit().symbol}")
        for curve, token in zip(self._curves, (tokens.channel_1, tokens.channel_2), strict=True):
            curve.setPen(pen(token))


def _format_phase(displacement: float, velocity_mm_per_s: float) -> str:
    places = (
        (displacement, displacement_decimals(3), displacement_unit().symbol),
        (velocity_mm_per_s, 2, "mm/s"),
    )
    return "   ".join(with_unit(format_fixed(value, decimals), unit) for value, decimals, unit in places)
