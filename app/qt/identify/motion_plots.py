"""Velocities, accelerations and phase plane of the fitted motion."""

import math
from collections.abc import Sequence

import numpy as np
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from analysis.formatting import with_unit
from app.presenters import number_text
from app.presenters.identify.state import Floats, Motion
from app.qt.identify.cursors import CursorLines, CursorPoints
from app.qt.theme import Theme
from app.qt.widgets.plots import PlotStack, ShadedSpans, pen, shade, value_at
from messages.i18n import gettext

_COLOURS = (("channel_1", "channel_2"), ("text",))
"""Of the lines of the plot above, and of the one below."""


class TimePlots(QWidget):
    """Plots on one time axis, slip shaded; `titles` have text and unit, `colours` the tokens of the lines."""

    def __init__(
        self, theme: Theme, titles: Sequence[tuple[str, str]], colours: Sequence[Sequence[str]] = _COLOURS
    ) -> None:
        super().__init__()
        self._theme = theme
        self._units = [unit for _, unit in titles]
        self._colours = colours
        self._time_s: Floats = np.empty(0)
        self._lines: Sequence[Sequence[Floats]] = ((),) * len(titles)
        heads = [
            (title, tokens[0] if len(tokens) == 1 else "text")
            for (title, _), tokens in zip(titles, colours, strict=True)
        ]
        self._stack = PlotStack(theme, heads, interactive=True, heights=(3, 2))
        self._slips = [ShadedSpans(plot) for plot in self._stack.plots]
        self._curves = [
            [plot.curve() for _ in tokens] for plot, tokens in zip(self._stack.plots, colours, strict=True)
        ]
        self.cursors = CursorLines(self._stack.plots)
        self._stack.hovered.connect(self._read_out)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._stack)
        theme.changed.connect(self._restyle)

    def show_lines(
        self, time_s: Floats, lines: Sequence[Sequence[Floats]], slips: tuple[tuple[float, float], ...]
    ) -> None:
        """Draw a motion: for each plot its lines, (n,) each at `time_s` (n,)."""
        self._time_s, self._lines = time_s, lines
        for plot, curves, drawn in zip(self._stack.plots, self._curves, lines, strict=True):
            for curve, values in zip(curves, drawn, strict=True):
                curve.setData(time_s, values)
            plot.set_value_range(*_extent(drawn))
        for slip in self._slips:
            slip.show_spans(slips)
        self._stack.set_time_range(float(time_s[0]), float(time_s[-1]))
        self._restyle()

    def span(self) -> tuple[float, float]:
        """What of the time axis is drawn (s)."""
        return self._stack.time_range()

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self._stack.restyle()
        self.cursors.restyle(tokens)
        self._stack.set_time_title(gettext("time from release, s"))
        for slip in self._slips:
            slip.set_brush(shade(tokens.channel_2, tokens.slip_alpha))
        for curves, names in zip(self._curves, self._colours, strict=True):
            for number, (curve, name) in enumerate(zip(curves, names, strict=True)):
                curve.setPen(pen(getattr(tokens, name), dashes=(6.0, 3.0) if number else ()))

    def _read_out(self, at_s: float) -> None:
        for row, (lines, unit) in enumerate(zip(self._lines, self._units, strict=True)):
            values = [value_at(self._time_s, values, at_s) for values in lines]
            shown = " | ".join(number_text.format_fixed(value, 3) for value in values if math.isfinite(value))
            at = "" if math.isnan(at_s) else with_unit(number_text.format_fixed(at_s, 3), "s")
            self._stack.set_readout(row, f"{at}   {with_unit(shown, unit)}" if shown else "")


class MotionTabs:
    """The plots behind all tabs but the first, in the order of the tabs."""

    def __init__(self, theme: Theme) -> None:
        velocities = gettext("velocities, mm/s &nbsp; — table u<sub>1</sub>′ &nbsp; - - plate u<sub>2</sub>′")
        relative = gettext("relative velocity u<sub>2</sub>′ − u<sub>1</sub>′, mm/s")
        self.velocities = TimePlots(theme, ((velocities, "mm/s"), (relative, "mm/s")))
        self.accelerations = TimePlots(
            theme,
            (
                (gettext("table acceleration u<sub>1</sub>″, m/s²"), "m/s²"),
                (gettext("plate acceleration u<sub>2</sub>″, m/s²"), "m/s²"),
            ),
            (("channel_1",), ("channel_2",)),
        )
        self.relative = TimePlots(
            theme,
            (
                (gettext("relative acceleration u<sub>2</sub>″ − u<sub>1</sub>″, m/s²"), "m/s²"),
                (gettext("relative displacement u<sub>2</sub> − u<sub>1</sub>, mm"), "mm"),
            ),
            (("text",), ("channel_2",)),
        )
        self.phase = PhasePlots(theme)

    @property
    def widgets(self) -> tuple["TimePlots | PhasePlots", ...]:
        return self.velocities, self.accelerations, self.relative, self.phase

    def show_motion(self, motion: Motion, slips: tuple[tuple[float, float], ...]) -> None:
        self.velocities.show_lines(
            motion.time_s,
            ((motion.table_mm_per_s, motion.plate_mm_per_s), (motion.relative_mm_per_s,)),
            slips,
        )
        self.accelerations.show_lines(
            motion.time_s, ((motion.table_m_per_s2,), (motion.plate_m_per_s2,)), slips
        )
        self.relative.show_lines(motion.time_s, ((motion.relative_m_per_s2,), (motion.relative_mm,)), slips)
        self.phase.show_motion(motion)


class PhasePlots(QWidget):
    """Velocity against displacement: the table at the left, the plate against it at the right."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        titles = (
            (gettext("table: velocity, mm/s"), "channel_1", "u₁, mm"),
            (gettext("plate against table: velocity, mm/s"), "channel_2", "u₂ − u₁, mm"),
        )
        self._stacks = [PlotStack(theme, ((title, token),), interactive=False) for title, token, _ in titles]
        self._axes = [axis for _, _, axis in titles]
        self._curves = [stack.plots[0].curve() for stack in self._stacks]
        self.cursors = CursorPoints([stack.plots[0] for stack in self._stacks])
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        for stack in self._stacks:
            layout.addWidget(stack, 1)
        theme.changed.connect(self._restyle)
        self._restyle()

    def show_motion(self, motion: Motion) -> None:
        both = ((motion.table_mm, motion.table_mm_per_s), (motion.relative_mm, motion.relative_mm_per_s))
        for stack, curve, (across, up) in zip(self._stacks, self._curves, both, strict=True):
            curve.setData(across, up)
            stack.set_time_range(*_extent([across]))
            stack.plots[0].set_value_range(*_extent([up]))

    def _restyle(self) -> None:
        tokens = self._theme.tokens
        self.cursors.restyle(tokens)
        for stack, curve, axis, token in zip(
            self._stacks, self._curves, self._axes, (tokens.channel_1, tokens.channel_2), strict=True
        ):
            stack.restyle()
            stack.set_time_title(axis)
            curve.setPen(pen(token))


def _extent(lines: Sequence[Floats]) -> tuple[float, float]:
    low = min(float(np.nanmin(line)) for line in lines)
    high = max(float(np.nanmax(line)) for line in lines)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin
