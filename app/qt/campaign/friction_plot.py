"""Fig. 2 of the paper on the screen: static and dynamic friction by contact, with intervals and series."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.presenters.campaign.state import Bar, ContactBars
from app.qt.theme import Theme, colour
from app.qt.widgets.layouts import make_column
from app.qt.widgets.plots import PlotStack
from messages.i18n import gettext

_WIDTH, _SPREAD = 0.36, 0.22
_HEADROOM = 1.08
_TICKS_HEIGHT, _ROOM = 44, 220
"""Of two lines below the axis, and for the name of a contact, in pixels."""


class FrictionPlot(QWidget):
    """Draws `ContactBars`: hatched static, plain dynamic; points are series."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._contacts: tuple[ContactBars, ...] = ()
        self._items: list[Any] = []
        title = gettext("friction by contact &nbsp; ▨ static f<sub>s</sub> &nbsp; ■ dynamic f<sub>d</sub>")
        self.setToolTip(
            gettext("Bars: mean over the series with its 95 % interval; points: series; ▲ at least")
        )
        self._stack = PlotStack(theme, ((title, "text"),), interactive=False)
        self._stack.plots[0].bottom.setHeight(_TICKS_HEIGHT)
        self._stack.resized.connect(lambda _: self._name())
        make_column(self._stack, of=self)
        theme.changed.connect(self._draw)
        self.show_contacts(())

    def show_contacts(self, contacts: tuple[ContactBars, ...]) -> None:
        self._contacts = contacts
        said = "; ".join(_spoken(one) for one in contacts)
        self.setAccessibleName(gettext("Friction by contact: {said}", said=said or gettext("nothing yet")))
        self._draw()

    def _draw(self) -> None:
        (plot,) = self._stack.plots
        for item in self._items:
            plot.view.removeItem(item)
        self._items = []
        self._stack.restyle()
        self._stack.set_time_title("")
        tokens = self._theme.tokens
        for place, one in enumerate(self._contacts):
            self._bar(place - _WIDTH / 2, one.static, one.static_of_series, tokens.channel_1, hatched=True)
            self._bar(place + _WIDTH / 2, one.dynamic, one.dynamic_of_series, tokens.channel_2, hatched=False)
            self._least(place - _WIDTH / 2, one.static_at_least)
        self._name()
        self._stack.set_time_range(-0.6, max(len(self._contacts), 1) - 0.4)
        plot.set_value_range(0.0, _HEADROOM * max(_tops(self._contacts), default=1.0))

    def _name(self) -> None:
        has_room = self.width() > _ROOM * max(len(self._contacts), 1)
        ticks = [(place, _named(one, has_room=has_room)) for place, one in enumerate(self._contacts)]
        self._stack.plots[0].bottom.setTicks([ticks])

    def _bar(
        self, place: float, mean: Bar | None, series: tuple[Bar, ...], token: str, *, hatched: bool
    ) -> None:
        if mean is None:
            return
        brush = pg.mkBrush(colour(token, 0.45 if hatched else 0.30))
        if hatched:
            brush.setStyle(Qt.BrushStyle.BDiagPattern)
        pen = pg.mkPen(token, width=1)
        self._add(pg.BarGraphItem(x=[place], height=[mean.value], width=_WIDTH * 0.92, brush=brush, pen=pen))
        ink = self._theme.tokens.text
        self._intervals(_beside(place, len(series)), series, pg.mkPen(colour(ink, 0.5), width=1), 0.0)
        values = [one.value for one in series]
        self._add(
            pg.ScatterPlotItem(
                x=_beside(place, len(series)), y=values, size=4, pen=None, brush=pg.mkBrush(ink)
            )
        )
        self._intervals([place], (mean,), pg.mkPen(ink, width=2), 0.08)

    def _intervals(self, places: Iterable[float], bars: tuple[Bar, ...], pen: Any, beam: float) -> None:
        values = np.array([one.value for one in bars])
        above = np.array([one.high for one in bars]) - values
        below = values - np.array([one.low for one in bars])
        self._add(
            pg.ErrorBarItem(x=np.array(list(places)), y=values, top=above, bottom=below, beam=beam, pen=pen)
        )

    def _least(self, place: float, least: tuple[float, ...]) -> None:
        brush = pg.mkBrush(self._theme.tokens.channel_1)
        places = _beside(place, len(least))
        self._add(pg.ScatterPlotItem(x=places, y=list(least), size=7, symbol="t1", pen=None, brush=brush))

    def _add(self, item: Any) -> None:
        (plot,) = self._stack.plots
        self._items.append(plot.add(item))


def _beside(place: float, count: int) -> list[float]:
    """Places of points that would hide one another; none in the middle, where the mean's interval is."""
    even = count + count % 2
    return [float(x) for x in place + np.linspace(-_SPREAD / 2, _SPREAD / 2, even)[:count]]


def _tops(contacts: tuple[ContactBars, ...]) -> list[float]:
    found = [
        bar.high
        for one in contacts
        for bar in (one.static, one.dynamic, *one.static_of_series, *one.dynamic_of_series)
        if bar is not None and np.isfinite(bar.high)
    ]
    return [*found, *(low for one in contacts for low in one.static_at_least)]


def _named(one: ContactBars, *, has_room: bool) -> str:
    words = f"{one.contact}: {one.name}" if one.name and has_room else one.contact
    return f"{words}\nf_s/f_d = {one.ratio}" if one.ratio else words


def _spoken(one: ContactBars) -> str:
    said = [f"{name} {bar.value:.3f}" for name, bar in (("f_s", one.static), ("f_d", one.dynamic)) if bar]
    return f"{one.contact} {' '.join(said)}"
