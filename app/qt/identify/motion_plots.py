"""Velocities, accelerations and phase plane of the fitted motion."""

import math
from collections.abc import Sequence

import numpy as np
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.presenters import numbers
from app.presenters.identify.state import Floats, Motion
from app.qt.theme import Theme
from app.qt.widgets.plots import PlotStack, nearest, pen

Line = tuple[Floats, str]
"""Values, and the colour token that they are drawn in."""


class RatesPlots(QWidget):
    """Two plots on one time axis: both masses above, plate against table below.

    Parameters
    ----------
    theme : Theme
    titles : (str, str)
        Rich text.
    unit : str
    """

    def __init__(self, theme: Theme, titles: tuple[str, str], unit: str) -> None:
        super().__init__()
        self._theme = theme
        self._unit = unit
        self._time_s: Floats = np.empty(0)
        self._lines: tuple[tuple[Line, ...], ...] = ((), ())
        self._stack = PlotStack(
            theme, [(title, "text") for title in titles], interactive=True, heights=(3, 2)
        )
        above, below = self._stack.plots
        self._curves = ((above.curve(), above.curve()), (below.curve(),))
        self._stack.hovered.connect(self._read_out)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._stack)
        theme.changed.connect(self._restyle)

    def show_lines(self, time_s: Floats, table: Floats, plate: Floats, relative: Floats) -> None:
        """Draw a motion."""
        self._time_s = time_s
        self._lines = (((table, "channel_1"), (plate, "channel_2")), ((relative, "text"),))
        for plot, curves, lines in zip(self._stack.plots, self._curves, self._lines, strict=True):
            for curve, (values, _) in zip(curves, lines, strict=True):
                curve.setData(time_s, values)
            plot.set_height(*_extent([values for values, _ in lines]))
        self._stack.set_span(float(time_s[0]), float(time_s[-1]))
        self._restyle()

    def _restyle(self) -> None:
        self._stack.restyle()
        self._stack.set_time_title("time from release, s")
        for curves, lines in zip(self._curves, self._lines, strict=True):
            for number, (curve, (_, token)) in enumerate(zip(curves, lines, strict=False)):
                dashes = (6.0, 3.0) if number else ()
                curve.setPen(pen(getattr(self._theme.tokens, token), dashes=dashes))

    def _read_out(self, at_s: float) -> None:
        for row, lines in enumerate(self._lines):
            values = [nearest(self._time_s, values, at_s) for values, _ in lines]
            shown = " | ".join(numbers.rounded(value, 3) for value in values if math.isfinite(value))
            at = "" if math.isnan(at_s) else numbers.with_unit(numbers.rounded(at_s, 3), "s")
            self._stack.set_readout(row, f"{at}   {numbers.with_unit(shown, self._unit)}" if shown else "")


class PhasePlots(QWidget):
    """Velocity against displacement: the table at the left, the plate against it at the right."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        titles = (
            ("table: velocity, mm/s, against displacement", "channel_1", "u₁, mm"),
            ("plate against table: velocity, mm/s, against displacement", "channel_2", "u₂ − u₁, mm"),
        )
        self._stacks = [PlotStack(theme, ((title, token),), interactive=False) for title, token, _ in titles]
        self._axes = [axis for _, _, axis in titles]
        self._curves = [stack.plots[0].curve() for stack in self._stacks]
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        for stack in self._stacks:
            layout.addWidget(stack, 1)
        theme.changed.connect(self._restyle)
        self._restyle()

    def show_motion(self, motion: Motion) -> None:
        """Draw a motion."""
        both = ((motion.table_mm, motion.table_mm_per_s), (motion.relative_mm, motion.relative_mm_per_s))
        for stack, curve, (across, up) in zip(self._stacks, self._curves, both, strict=True):
            curve.setData(across, up)
            stack.set_span(*_extent([across]))
            stack.plots[0].set_height(*_extent([up]))

    def _restyle(self) -> None:
        tokens = self._theme.tokens
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
