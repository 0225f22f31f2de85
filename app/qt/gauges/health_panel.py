"""How both gauges do: verdicts with remedies, figures, and the spectrum."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PySide6.QtWidgets import QStackedWidget, QWidget

from analysis.formatting import typeset, with_unit
from analysis.health_grade import HealthGrade
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.curve_table import TableCurve
from app.presenters.gauge_health_state import GaugeHealthState
from app.presenters.gauges.state import Floats, GaugesState
from app.qt.theme import TextRole, Theme, set_property
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.plot_marks import pen
from app.qt.widgets.plots import PlotStack
from app.qt.widgets.text import ValueGrid, label, show_chip, stopped_chip
from messages.i18n import N_, gettext

_SYMPTOMS_SHOWN = 3
_TITLE = N_("noise, µm/√Hz &nbsp; — gauge 1 &nbsp; - - gauge 2")
_SWATCHES = {"—": "channel_1", "- -": "channel_2"}
_FREQUENCY = N_("frequency, Hz")
_DASHES = (6.0, 3.0)
_STEPS = (1, 2, 5)
_SHORT, _FEWEST = 1.3, 3
"""Decades that hold three marks at least, and that number."""
_VERDICTS = {HealthGrade.GOOD: N_("Good"), HealthGrade.DOUBTFUL: N_("Doubtful"), HealthGrade.BAD: N_("Bad")}


class HealthPanel(QStackedWidget):
    """Draws the health of both gauges, or how to get it."""

    def __init__(self, theme: Theme, connect_device: Callable[[], None]) -> None:
        super().__init__()
        self._shown: tuple[tuple[GaugeHealthState, ...], str] = ((), "")
        self._words = label(role=TextRole.HEADING, muted=True, wrap=True)
        self._go = make_button(gettext("Connect a device"), connect_device)
        self._go.setProperty("primary", "true")
        self._verdicts = (_Verdict(1), _Verdict(2))
        self._stopped = label(role=TextRole.STRONG, wrap=True)
        self._facts = ValueGrid()
        self._spectrum = Spectrum(theme)
        empty, filled = QWidget(), QWidget()
        go = make_row(self._go, STRETCH)
        make_column(STRETCH, self._words, go, spacing=16, margins=(24, 24), of=empty).addStretch(2)
        verdicts = make_row(*((verdict, 1) for verdict in self._verdicts), spacing=16)
        parts = (self._stopped, verdicts, self._facts, (self._spectrum, 1))
        make_column(*parts, spacing=8, margins=(16, 8), of=filled)
        self.addWidget(empty)
        self.addWidget(filled)

    def show_state(self, state: GaugesState) -> None:
        self._words.setText(state.health_note)
        self._go.setVisible(not state.device)
        self.setCurrentIndex(1 if state.health else 0)
        show_chip(self._stopped, stopped_chip(state.stopped_at))
        shown, self._shown = self._shown, (state.health, state.stopped_at)
        if not state.health or (state.health is shown[0] and state.stopped_at == shown[1]):
            return
        for verdict, card in zip(self._verdicts, state.health, strict=True):
            verdict.show_card(card, is_live=not state.stopped_at)
        self._facts.show_columns(
            (gettext("gauge 1"), gettext("gauge 2")), [card.figures for card in state.health]
        )
        self._spectrum.show_lines([(card.frequency_hz[1:], card.density_um[1:]) for card in state.health])


class _Verdict(QWidget):
    def __init__(self, channel: int) -> None:
        super().__init__()
        self._name = label(role=TextRole.HEADING)
        set_property(self._name, "channel", str(channel))
        self._verdict = label(role=TextRole.STRONG)
        self._symptoms = [(label(wrap=True), label(muted=True, wrap=True)) for _ in range(_SYMPTOMS_SHOWN)]
        symptoms = [part for symptom in self._symptoms for part in symptom]
        make_column(self._name, self._verdict, *symptoms, STRETCH, spacing=4, of=self)

    def show_card(self, card: GaugeHealthState, *, is_live: bool) -> None:
        self._name.setText(gettext(card.name))
        verdict = _chip(card.verdict, gettext(_VERDICTS[card.verdict]))
        show_chip(self._verdict, verdict if is_live else replace(verdict, tone=Tone.STALE))
        for number, (said, remedy) in enumerate(self._symptoms):
            symptom = card.symptoms[number] if number < len(card.symptoms) else None
            show_chip(said, _chip(symptom.grade, symptom.message) if symptom else EMPTY_CHIP)
            remedy.setText(symptom.remedy if symptom else "")
            remedy.setVisible(symptom is not None)
        worst = card.symptoms[0].message if card.symptoms else ""
        self.setAccessibleName(f"{gettext(card.name)}: {gettext(_VERDICTS[card.verdict])}. {worst}")


def _chip(grade: HealthGrade, words: str) -> Chip:
    tones = {HealthGrade.GOOD: Tone.OK, HealthGrade.DOUBTFUL: Tone.WARN, HealthGrade.BAD: Tone.BAD}
    return Chip(words, tones[grade])


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Marks at 1, 2, 5 and their powers of ten, on an axis of logarithms; on a short part of it even ones."""
    decades = range(math.floor(low), math.ceil(high) + 1)
    values = [step * 10.0**decade for decade in decades for step in _STEPS]
    if high - low < _SHORT:
        span = 10.0**high - 10.0**low
        size = 10.0 ** math.floor(math.log10(span / _FEWEST))
        step = max(size * step for step in _STEPS if size * step <= span / _FEWEST)
        values = [step * number for number in range(1, math.ceil(10.0**high / step) + 1)]
    return [(math.log10(value), f"{value:.4g}") for value in values if low <= math.log10(value) <= high]


class Spectrum(PlotStack):
    """Amplitude density of both gauges over the frequency, both axes logarithmic."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, (("", "text"),), format_point=_format_point)
        (plot,) = self.plots
        self._curves = [plot.curve() for _ in range(2)]
        self.table = self._table
        plot.view.sigRangeChanged.connect(lambda *_: self._mark_axes())
        self.setMinimumHeight(180)
        self.setAccessibleName(gettext("Noise of both gauges over the frequency"))
        theme.changed.connect(self._recolour)
        self._recolour()

    def show_lines(self, lines: list[tuple[Floats, Floats]]) -> None:
        """Draw frequency (Hz) and density (um/sqrt(Hz)) of each gauge."""
        drawn = [(np.log10(frequency), np.log10(np.maximum(density, 1e-6))) for frequency, density in lines]
        for curve, (x, y) in zip(self._curves, drawn, strict=True):
            curve.show_points(x, y)
        for number, curve in enumerate(self._curves, start=1):
            curve.title, curve.unit = gettext("gauge {number}, noise", number=number), "µm/√Hz"
        (plot,) = self.plots
        low = min(float(y.min()) for _, y in drawn) - 0.1
        high = max(float(y.max()) for _, y in drawn) + 0.1
        first, last = float(drawn[0][0][0]), float(drawn[0][0][-1])
        plot.set_value_range(low, high)
        self.set_time_range(first, last)
        self._mark_axes()

    def _mark_axes(self) -> None:
        (plot,) = self.plots
        for axis, span in zip((plot.bottom, plot.left), plot.view.viewRange(), strict=True):
            axis.setTicks([_ticks(*span)])

    def _table(self) -> list[TableCurve]:
        """Frequencies and densities themselves, not their logarithms."""
        return [
            TableCurve(curve.x_title, curve.title, 10.0**curve.x, 10.0**curve.y)
            for curve in self.curves_in_view()
        ]

    def _recolour(self) -> None:
        self.restyle()
        self.set_title(0, gettext(_TITLE), _SWATCHES)
        self.set_time_title(gettext(_FREQUENCY))
        tokens = self._theme.tokens
        self._curves[0].setPen(pen(tokens.channel_1))
        self._curves[1].setPen(pen(tokens.channel_2, dashes=_DASHES))


def _format_point(log_frequency: float, log_density: float) -> str:
    """Frequency and density at a point of the axes of logarithms."""
    frequency, density = (typeset(f"{10.0**value:.3g}") for value in (log_frequency, log_density))
    return f"{with_unit(frequency, 'Hz')}   {with_unit(density, 'µm/√Hz')}"
