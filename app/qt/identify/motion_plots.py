"""Velocities, accelerations and phase plane of the fitted motion."""

from collections.abc import Sequence

from PySide6.QtWidgets import QWidget

from app.presenters.identify.state import PlottedQuantity
from app.qt.identify.cursors import CursorLines, CursorPoints
from app.qt.theme import Theme
from app.qt.widgets.layouts import make_column, make_row
from app.qt.widgets.plots import PlotStack, ShadedSpans, pen, shade, value_at, value_extent
from messages.i18n import gettext


class TimePlots(QWidget):
    """Two plots on one time axis, slip shaded: title, and colour tokens of the lines, of each."""

    def __init__(self, theme: Theme, plots: Sequence[tuple[str, Sequence[str]]]) -> None:
        super().__init__()
        self._theme = theme
        self._lines: Sequence[PlottedQuantity] = ()
        heads = [(title, tokens[0] if len(tokens) == 1 else "text") for title, tokens in plots]
        self._stack = PlotStack(theme, heads, interactive=True, heights=(3, 2))
        self._slips = [ShadedSpans(plot) for plot in self._stack.plots]
        self._colours = [token for _, tokens in plots for token in tokens]
        self._rows = [row for row, (_, tokens) in enumerate(plots) for _ in tokens]
        self._curves = [self._stack.plots[row].curve() for row in self._rows]
        self.cursors = CursorLines(self._stack.plots)
        self._stack.hovered.connect(self._show_values)
        make_column(self._stack, of=self)
        theme.changed.connect(self._restyle)

    def show_lines(self, lines: Sequence[PlottedQuantity], slips: tuple[tuple[float, float], ...]) -> None:
        self._lines = lines
        for curve, line in zip(self._curves, lines, strict=True):
            curve.setData(line.time_s, line.values)
        for row, plot in enumerate(self._stack.plots):
            plot.fit_values(*(line.values for line in self._lines_of(row)))
        for slip in self._slips:
            slip.show_spans(slips)
        self._stack.set_time_range(float(lines[0].time_s[0]), float(lines[0].time_s[-1]))
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
        self._stacks = [PlotStack(theme, (title,), interactive=False) for title in titles]
        self._curves = [stack.plots[0].curve() for stack in self._stacks]
        self.cursors = CursorPoints([stack.plots[0] for stack in self._stacks])
        make_row(*((stack, 1) for stack in self._stacks), of=self)
        theme.changed.connect(self._restyle)
        self._restyle()

    def show_lines(self, lines: Sequence[PlottedQuantity], _slips: object) -> None:
        pairs = zip(lines[::2], lines[1::2], strict=True)
        for stack, curve, (displacement, velocity) in zip(self._stacks, self._curves, pairs, strict=True):
            curve.setData(displacement.values, velocity.values)
            stack.set_time_range(*value_extent(displacement.values))
            stack.plots[0].fit_values(velocity.values)

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self.cursors.restyle(tokens)
        for stack, axis in zip(self._stacks, ("u₁, mm", "u₂ − u₁, mm"), strict=True):
            stack.restyle()
            stack.set_time_title(axis)
        for curve, token in zip(self._curves, (tokens.channel_1, tokens.channel_2), strict=True):
            curve.setPen(pen(token))
