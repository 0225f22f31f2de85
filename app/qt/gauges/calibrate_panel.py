"""Tab Calibrate: live counts, points, residuals, characteristics, and the form to save."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from analysis.formatting import typeset, with_unit
from app.presenters import number_text
from app.presenters.gauges.calibration import CalibrationPresenter
from app.presenters.gauges.state import (
    NAMES,
    CalibrationFit,
    CalibrationForm,
    CalibrationPoint,
    CalibrationState,
)
from app.qt.theme import TextRole, Theme, colour, set_property
from app.qt.widgets.inputs import CheckBox, make_button, make_choice, make_fields, show_texts
from app.qt.widgets.layouts import STRETCH, make_column, make_form_grid, make_row, make_scroll_area
from app.qt.widgets.plot_curves import Points
from app.qt.widgets.plot_marks import pen
from app.qt.widgets.plots import PlotStack
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.tables import serve_table
from app.qt.widgets.text import ValueGrid, label, set_text_or_hide, set_tool_tip, show_chip, stopped_chip
from messages.i18n import N_, gettext

_COLUMN_WIDTH = 256
_FIELD_WIDTH = 100
_DEGREES = {1: N_("line"), 2: N_("polynomial of degree 2"), 3: N_("polynomial of degree 3")}
_HOW = N_(
    "Move the table in even steps up and down, twice or more. At each step type what the dial shows; Enter."
)
_FIELDS = {
    "resolution_mm": (N_("Dial is read to, mm"), "0.01"),
    "uncertainty_mm": (N_("Its uncertainty, mm"), N_("of its certificate")),
    "reference": (N_("Dial gauge"), N_("which one")),
    "certificate": (N_("Certificate"), N_("of the dial gauge")),
    "calibrated_by": (N_("Calibrated by"), N_("your name")),
    "valid_until": (N_("Valid until"), N_("YYYY-MM-DD")),
    "filter_order": (N_("Order of the filter"), "1"),
    "filter_corner_hz": (N_("Its corner (−3 dB), Hz"), ""),
}
_FILTERS = {
    None: N_("as it was"), "none": N_("none"), "rc": "RC", "butterworth": "Butterworth", "bessel": "Bessel",
    "sinc": "sinc",
}  # fmt: skip
_OF_FILTER = ("filter_order", "filter_corner_hz")


class CalibratePanel(QWidget):
    """Draws `CalibrationState`."""

    def __init__(self, theme: Theme, presenter: CalibrationPresenter, reconnect: Callable[[], None]) -> None:
        super().__init__()
        self._presenter = presenter
        self._form = CalibrationForm()
        self._readings = _ReadingColumn(presenter, lambda gauge: self._fill(gauge=gauge))
        self._plot = ResidualPlot(theme)
        self._merits = ValueGrid()
        self._cautions = label(muted=True, wrap=True)
        self._degree = make_choice(_DEGREES)
        self._degree.activated.connect(lambda _: self._fill(degree=self._degree.currentData()))
        self._filter = make_choice(_FILTERS)
        self._filter.activated.connect(lambda _: self._fill(filter_kind=self._filter.currentData()))
        for choice in (self._degree, self._filter):  # not as wide as their longest text
            choice.setMinimumWidth(_FIELD_WIDTH)
        self._fields = make_fields(_FIELDS, self._fill)
        self._use = CheckBox(gettext("Take it for all runs from now on"))
        self._use.clicked.connect(lambda is_used: self._fill(use=is_used))
        self._save = make_button(gettext("Save calibration"), presenter.save)
        hint = gettext("The device is still read by the calibration before")
        self._again = make_button(gettext("Connect again"), reconnect, hint)
        self._shown: CalibrationFit | None = None
        rows: list[tuple[str, QWidget]] = [(gettext("Curve"), self._degree)]
        rows += [(gettext(_FIELDS[name][0]), field) for name, field in self._fields.items()]
        rows.insert(-len(_OF_FILTER), (gettext("Amplifier's filter"), self._filter))
        form = make_form_grid(rows)
        buttons = make_row(self._save, self._again, STRETCH, spacing=8)
        parts = (self._plot, self._merits, self._cautions, form, self._use, buttons, STRETCH)
        inside = QWidget()
        make_row(self._readings, (make_column(*parts, spacing=8), 1), spacing=16, margins=(16, 8), of=inside)
        make_column(make_scroll_area(inside), of=self)

    def show_state(self, state: CalibrationState) -> None:
        self._form = state.form
        self._readings.show_state(state)
        self._degree.setCurrentIndex(self._degree.findData(state.form.degree))
        self._filter.setCurrentIndex(self._filter.findData(state.form.filter_kind))
        for name in _OF_FILTER:
            self._fields[name].setEnabled(state.form.filter_kind not in (None, "none"))
        self._use.setChecked(state.form.use)
        show_texts(self._fields, state.form)
        self._save.setEnabled(state.can_save)
        self._again.setVisible(state.offers_reconnect)
        if state.fit is not self._shown:
            self._shown = state.fit
            self._plot.show_fit(state.fit)
            self._merits.show_values(state.fit.values if state.fit else ())
            set_text_or_hide(self._cautions, "\n".join(state.fit.warnings) if state.fit else "")

    def add_keys(self, screen: QWidget) -> None:
        bind_button(self._save, "Ctrl+S", gettext("Write a new dated file beside the one in use"), screen)
        self._readings.add_keys(screen)

    def _fill(self, **changes: Any) -> None:
        changes |= {name: field.text() for name, field in self._fields.items()}
        self._presenter.set_form(replace(self._form, **changes))


class _ReadingColumn(QWidget):
    def __init__(self, presenter: CalibrationPresenter, choose: Callable[[int], None]) -> None:
        super().__init__()
        self.setFixedWidth(_COLUMN_WIDTH)
        self._presenter = presenter
        self._gauge = make_choice(dict(enumerate(NAMES)))
        self._gauge.setAccessibleName(gettext("Gauge to calibrate"))
        self._gauge.activated.connect(choose)
        self._live = label(role=TextRole.NUMBER)
        self._live.setAccessibleName(gettext("Counts now"))
        self._stopped = label(wrap=True)
        self._spread = label(muted=True, wrap=True)
        self._message = label(wrap=True)
        self._dial = QLineEdit()
        self._dial.setPlaceholderText(gettext("dial reading, mm"))
        self._dial.setAccessibleName(gettext("Dial reading in millimetres"))
        set_tool_tip(self._dial, gettext("Enter averages the counts and takes the reading"))
        self._dial.returnPressed.connect(self._take)
        self._waiting = label(wrap=True)
        self._undo = make_button(gettext("Undo"), presenter.undo)
        hint = gettext("Begin another calibration; the readings stay in their file")
        self._restart = make_button(gettext("Start over"), presenter.restart, hint)
        self._table = _ReadingsTable()
        how = label(gettext(_HOW), muted=True, wrap=True)
        texts = (self._live, self._stopped, self._spread, self._dial, self._waiting, self._message)
        buttons = make_row(self._undo, self._restart, spacing=8)
        make_column(self._gauge, how, *texts, buttons, (self._table, 1), spacing=8, of=self)

    def show_state(self, state: CalibrationState) -> None:
        self._gauge.setCurrentIndex(state.form.gauge)
        self._gauge.setEnabled(not state.points and not state.reading_status)
        self._live.setText(state.live_value or "–")
        set_property(self._live, "tone", "stale" if state.stopped_at else "plain")
        show_chip(self._stopped, stopped_chip(state.stopped_at))
        self._spread.setText(state.live_note)
        show_chip(self._message, state.message)
        set_text_or_hide(self._waiting, state.reading_status)
        self._undo.setEnabled(bool(state.points or state.reading_status))
        self._restart.setEnabled(bool(state.points))
        self._table.show_readings(state.points, state.fit)

    def add_keys(self, screen: QWidget) -> None:
        words = gettext("Take the last reading back, or leave the one being taken")
        bind_button(self._undo, "Alt+U", words, screen)

    def _take(self) -> None:
        self._presenter.take_point(self._dial.text())
        self._dial.selectAll()


class _ReadingsTable(QTableWidget):
    """Dial, counts and what is left, a row a reading; the newest is in sight."""

    def __init__(self) -> None:
        super().__init__(0, 3)
        self._shown: tuple[object, object] = ((), None)
        self.setHorizontalHeaderLabels((gettext("dial, mm"), gettext("counts"), gettext("residual, µm")))
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(24)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        serve_table(self)
        self.setMinimumHeight(140)
        self.setAccessibleName(gettext("Readings taken"))

    def show_readings(self, readings: tuple[CalibrationPoint, ...], fitted: CalibrationFit | None) -> None:
        if (readings, fitted) == self._shown:
            return
        self._shown = readings, fitted
        left = fitted.residual_um if fitted and len(fitted.residual_um) == len(readings) else None
        self.setRowCount(len(readings))
        for row, reading in enumerate(readings):
            residual = "" if left is None else number_text.format_fixed(float(np.asarray(left)[row]), 1)
            counts = typeset(f"{reading.counts:.7g}")
            for column, text in enumerate((typeset(f"{reading.dial_mm:g}"), counts, residual)):
                item = QTableWidgetItem(text)
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                self.setItem(row, column, item)
        self.scrollToBottom()


_TITLE = N_("dial − calibration, µm &nbsp; ▲ up &nbsp; ▼ down")
_SMALLEST_UM = 1.0
_HEIGHT = 240


class ResidualPlot(PlotStack):
    """Marks pointing up on the way up, down on the way down, about a line at zero."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, ((gettext(_TITLE), "text"),), format_point=_format_point)
        (plot,) = self.plots
        self._zero = plot.add(pg.InfiniteLine(pos=0.0, angle=0, movable=False))
        self._marks = [plot.add(Points(symbol=mark, size=10)) for mark in ("t1", "t")]
        for marks, title in zip(self._marks, (N_("residual upwards"), N_("residual downwards")), strict=True):
            marks.title, marks.unit = gettext(title), "µm"
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


def _format_point(dial_mm: float, residual_um: float) -> str:
    dial, residual = number_text.format_fixed(dial_mm, 3), number_text.format_fixed(residual_um, 1)
    return f"{with_unit(dial, 'mm')}   {with_unit(residual, 'µm')}"
