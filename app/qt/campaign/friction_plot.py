"""Fig. 2 of the paper on the screen: static and dynamic friction by contact, with intervals and series."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from analysis.arrays import Floats
from analysis.quantities import Quantity
from app.presenters.campaign.state import ContactBars
from app.presenters.curve_table import TableCurve
from app.presenters.number_text import format_fixed
from app.qt.theme import Theme, colour
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plots import PlotStack
from app.qt.widgets.text import set_tool_tip
from messages.i18n import N_, gettext

_WIDTH, _SPREAD = 0.36, 0.22
_HEADROOM = 1.08
_TICKS_HEIGHT, _ROOM = 44, 220
"""Of two lines below the axis, and for the name of a contact, in pixels."""

_STATIC, _DYNAMIC = "▨", "■"
_TITLE = N_("friction by contact &nbsp; {static} static f<sub>s</sub> &nbsp; {dynamic} dynamic f<sub>d</sub>")
_COLUMNS: tuple[tuple[str, Callable[[Quantity], float]], ...] = (
    ("{symbol}", lambda mean: mean.value),
    (N_("{symbol}, lower end of 95 %"), lambda mean: mean.interval_95[0]),
    (N_("{symbol}, upper end of 95 %"), lambda mean: mean.interval_95[1]),
)


class FrictionPlot(QWidget):
    """Draws `ContactBars`: hatched static, plain dynamic; points are series."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._contacts: tuple[ContactBars, ...] = ()
        self._items: list[Any] = []
        set_tool_tip(
            self, gettext("Bars: mean over the series with its 95 % interval; points: series; ▲ at least")
        )
        self._stack = PlotStack(theme, (("", "text"),), format_point=_format_point)
        self._stack.table = self._table
        self._stack.plots[0].bottom.setHeight(_TICKS_HEIGHT)
        self._stack.resized.connect(lambda _: self._name_contacts())
        make_column(self._stack, of=self)
        theme.changed.connect(self._draw)
        self.show_contacts(())

    def show_contacts(self, contacts: tuple[ContactBars, ...]) -> None:
        self._contacts = contacts
        texts = "; ".join(map(_accessible_text, contacts)) or gettext("nothing yet")
        self._stack.setAccessibleName(gettext("Friction by contact: {said}", said=texts))
        self._draw()

    def _table(self) -> list[TableCurve]:
        """Means of both frictions by contact, with the ends of their intervals."""
        if not self._contacts:
            return []
        names = np.array([bars.contact for bars in self._contacts])
        kinds = (
            ("f_s", [bars.static for bars in self._contacts]),
            ("f_d", [bars.dynamic for bars in self._contacts]),
        )
        return [
            TableCurve(
                gettext("contact"),
                gettext(title, symbol=symbol),
                names,
                np.array([read(mean) if mean else math.nan for mean in means]),
            )
            for symbol, means in kinds
            for title, read in _COLUMNS
        ]

    def _draw(self) -> None:
        (plot,) = self._stack.plots
        for item in self._items:
            plot.remove(item)
        self._items = []
        self._stack.restyle()
        self._stack.set_time_title("")
        tokens = self._theme.tokens
        title = gettext(_TITLE, static=_STATIC, dynamic=_DYNAMIC)
        self._stack.set_title(0, title, {_STATIC: "channel_1", _DYNAMIC: "channel_2"})
        tops: list[float] = []
        for x, bars in enumerate(self._contacts):
            static_x, dynamic_x = x - _WIDTH / 2, x + _WIDTH / 2
            self._draw_bar(static_x, bars.static, bars.static_of_series, tokens.channel_1, hatched=True)
            self._draw_bar(dynamic_x, bars.dynamic, bars.dynamic_of_series, tokens.channel_2, hatched=False)
            xs, brush = _spread_out(static_x, len(bars.static_at_least)), pg.mkBrush(tokens.channel_1)
            bounds = list(bars.static_at_least)
            self._add(pg.ScatterPlotItem(x=xs, y=bounds, size=7, symbol="t1", pen=None, brush=brush))
            quantities = (bars.static, bars.dynamic, *bars.static_of_series, *bars.dynamic_of_series)
            tops += [quantity.interval_95[1] for quantity in quantities if quantity] + bounds
        self._name_contacts()
        self._stack.set_time_range(-0.6, max(len(self._contacts), 1) - 0.4)
        plot.set_value_range(0.0, _HEADROOM * max(filter(math.isfinite, tops), default=1.0))

    def _name_contacts(self) -> None:
        has_room = self.width() > _ROOM * max(len(self._contacts), 1)
        ticks = [(x, _tick_text(bars, has_room=has_room)) for x, bars in enumerate(self._contacts)]
        self._stack.plots[0].bottom.setTicks([ticks])

    def _draw_bar(
        self, x: float, mean: Quantity | None, series: tuple[Quantity, ...], token: str, *, hatched: bool
    ) -> None:
        if mean is None:
            return
        brush = pg.mkBrush(colour(token, 0.45 if hatched else 0.30))
        if hatched:
            brush.setStyle(Qt.BrushStyle.BDiagPattern)
        pen, ink = pg.mkPen(token, width=1), self._theme.tokens.text
        self._add(pg.BarGraphItem(x=[x], height=[mean.value], width=_WIDTH * 0.92, brush=brush, pen=pen))
        xs, values = _spread_out(x, len(series)), [quantity.value for quantity in series]
        self._add(_intervals(xs, series, pg.mkPen(colour(ink, 0.5), width=1), 0.0))
        self._add(pg.ScatterPlotItem(x=xs, y=values, size=4, pen=None, brush=pg.mkBrush(ink)))
        self._add(_intervals(np.array([x]), (mean,), pg.mkPen(ink, width=2), 0.08))

    def _add(self, item: Any) -> None:
        (plot,) = self._stack.plots
        self._items.append(plot.add(item))


def _intervals(xs: Floats, quantities: tuple[Quantity, ...], pen: Any, beam: float) -> Any:
    values = np.array([quantity.value for quantity in quantities])
    low, high = np.array([quantity.interval_95 for quantity in quantities]).reshape(-1, 2).T
    return pg.ErrorBarItem(x=xs, y=values, top=high - values, bottom=values - low, beam=beam, pen=pen)


def _spread_out(x: float, count: int) -> Floats:
    """Places of points that would hide one another; none in the middle, where the mean's interval is."""
    even = count + count % 2
    return x + np.linspace(-_SPREAD / 2, _SPREAD / 2, even)[:count]


def _tick_text(bars: ContactBars, *, has_room: bool) -> str:
    """Contact and ratio of its frictions; their names only where the next contact leaves room."""
    if not has_room:
        return f"{bars.contact}\n{bars.ratio}"
    text = f"{bars.contact}: {bars.name}" if bars.name else bars.contact
    return f"{text}\n{gettext('static / dynamic = {ratio}', ratio=bars.ratio)}" if bars.ratio else text


def _accessible_text(bars: ContactBars) -> str:
    values = [f"{name} {bar.value:.3f}" for name, bar in (("f_s", bars.static), ("f_d", bars.dynamic)) if bar]
    return f"{bars.contact} {' '.join(values)}"


def _format_point(_x: float, friction: float) -> str:
    return format_fixed(friction, 4)
