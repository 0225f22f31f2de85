"""The Gauges screen: cards and tabs follow the state; keys and clicks reach the presenter."""

import datetime
import math
from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from looking import clipped_words, visible_words
from pointing import Hand
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton, QScrollArea
from pytestqt.qtbot import QtBot
from stage import FakeWorker

from analysis.health_grade import HealthGrade
from app.acquisition.messages import Connected
from app.presenters.base import Chip, LabelledValue, Tone
from app.presenters.gauge_health_state import GaugeHealthState, SymptomText
from app.presenters.gauges.presenter import GaugesPresenter
from app.presenters.gauges.state import (
    ActiveCalibrations,
    CalibrationFit,
    CalibrationPoint,
    CheckState,
    GaugesTab,
    PortCard,
)
from app.presenters.navigator import ConnectForm
from app.qt.gauges.health_panel import _ticks
from app.qt.gauges.screen import GaugesScreen
from app.qt.theme import Theme
from app.qt.widgets.plots import PlotStack
from config.files import load_gauges
from config.schema import GaugeChecks, Gauges

NOW = datetime.datetime(2026, 2, 1, 12, 0, tzinfo=datetime.UTC)
GAUGES = load_gauges()
READINGS = tuple(CalibrationPoint(5e5 * dial, dial) for dial in (0.0, 5.0, 10.0, 5.0, 0.0))
FITTED = CalibrationFit(
    np.array([0.0, 5.0, 10.0, 5.0, 0.0]),
    np.array([-1.0, -2.0, 0.5, 2.0, 1.0]),
    np.array([True, True, True, False, False]),
    (LabelledValue("gain", "0.002\u202fµm/count"), LabelledValue("hysteresis", "7.1\u202fµm")),
    ("the dial gauge's own uncertainty is not stated and not counted.",),
)
PORTS = (
    PortCard(
        "/dev/ttyUSB0",
        "FTDI FT232R adapter, USB 0403:6001 A9001",
        Chip("Lines of numbers at 115200 baud 8N1", Tone.OK),
        ("2 gauges, 1000 Hz; not verified on hardware", "its latency timer is 16 ms. Set it to 1 ms"),
        ConnectForm("/dev/ttyUSB0", "csv"),
    ),
    PortCard("/dev/ttyACM0", "", Chip("silent")),
)


def health(name: str, verdict: HealthGrade) -> GaugeHealthState:
    frequency = np.arange(500.0)
    symptoms = (SymptomText("noise", verdict, "noise of 45 µm rms", "Check shield and plugs"),)
    facts = (LabelledValue("noise, rms", "45\u202fµm"), LabelledValue("drift", "3 ± 2\u202fµm/min"))
    return GaugeHealthState(name, verdict, symptoms, facts, frequency, 1.0 / (1.0 + frequency))


class Stage:
    """Screen and presenter, shown, with workers whose work the test does."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.worker, self.prober = FakeWorker(), FakeWorker()
        self.went: list[Any] = []
        self.presenter = GaugesPresenter(self.worker, self.prober, GAUGES, self, lambda: NOW)  # type: ignore[arg-type]
        self.screen = GaugesScreen(theme, self.presenter)
        qtbot.addWidget(self.screen)
        self.screen.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)

    def show_start(self) -> None:
        self.went.append("start")

    def fill_connection(self, form: ConnectForm) -> None:
        self.went.append(form)

    def fill_second_port(self, url: str) -> None:
        self.went.append(url)

    def reconnect(self) -> None:
        self.went.append("again")

    def set_gauges(self, gauges: Gauges) -> None:
        self.went.append(gauges)

    def words(self) -> str:
        return visible_words(self.screen)

    def connect(self) -> None:
        self.presenter.on_connecting("COM7")
        self.presenter.on_connected(Connected("GSV-8", "1.0", 1000.0, "/nowhere"))

    def click(self, text: str) -> None:
        (found,) = [b for b in self.screen.findChildren(QPushButton) if b.text() == text and b.isVisible()]
        self.qtbot.mouseClick(found, Qt.MouseButton.LeftButton)

    def field(self, name: str) -> QLineEdit:
        (found,) = [f for f in self.screen.findChildren(QLineEdit) if f.accessibleName() == name]
        return found

    def fill(self) -> None:
        """Put something into every part."""
        expired = GAUGES.table.replace(valid_until=datetime.date(2026, 1, 1), certificate="DAkkS 1234-5678")
        in_use = ActiveCalibrations(
            GAUGES.replace(table=expired), GaugeChecks(), "/home/lab/config/gauges.toml"
        )
        self.presenter.enter()
        self.worker.calls[-1].done(in_use)
        self.connect()
        self.presenter._update(
            health=(health("Gauge 1", HealthGrade.DOUBTFUL), health("Gauge 2", HealthGrade.BAD))
        )
        self.presenter.ports._update(ports=PORTS)
        self.presenter.calibration._update(points=READINGS, fit=FITTED, live_value="1000123", can_save=True)


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


def test_cards_tell_what_is_in_use_and_what_has_expired(stage: Stage) -> None:
    stage.fill()
    words = stage.words()
    assert "EXPIRED on 2026-01-01" in words
    assert "DAkkS 1234-5678" in words
    assert "Not checked yet" in words


def test_health_says_how_to_get_it_then_shows_it(stage: Stage) -> None:
    assert "Connect the device" in stage.words()
    stage.click("Connect a device")
    assert stage.went == ["start"]
    stage.fill()
    assert "noise of 45 µm rms" in stage.words()
    assert "Check shield and plugs" in stage.words()
    drawn = stage.screen._health._spectrum._curves[0].getData()
    assert len(drawn[0]) == 499


def test_the_spectrum_is_zoomed_with_numbers_at_its_axes_and_saved_in_its_units(stage: Stage) -> None:
    stage.fill()
    QApplication.processEvents()
    spectrum = stage.screen._health._spectrum
    hand = Hand(spectrum)
    for _ in range(12):
        hand.wheel(1, hand.place(0.5, 0.5))
    (plot,) = spectrum.plots
    low, high = plot.view.viewRange()[0]
    marks = [value for value, _ in plot.bottom._tickLevels[0]]
    assert len(marks) >= 2
    assert all(low <= mark <= high for mark in marks)
    hand.move(hand.place(0.5, 0.5))
    assert "Hz" in plot.readout.text
    (one, _) = spectrum.table()
    assert (one.x_title, one.title) == ("frequency, Hz", "gauge 1, noise, µm/√Hz")
    assert 10.0**low <= one.x[0] < one.x[-1] <= 10.0**high


@pytest.mark.parametrize(("low", "high"), [(0.42, 1.24), (0.9, 21.0), (0.031, 0.044), (3.0, 800.0)])
def test_an_axis_of_logarithms_has_round_numbers(low: float, high: float) -> None:
    marks = _ticks(math.log10(low), math.log10(high))
    assert len(marks) >= 3
    for place, text in marks:
        assert len(text.replace("0", "").replace(".", "")) <= 2, text
        assert low <= 10.0**place <= high * (1.0 + 1e-9)
        assert float(text) == pytest.approx(10.0**place)


def test_keys_reach_every_tab_and_the_ports(stage: Stage) -> None:
    for key, side in (
        (Qt.Key.Key_P, GaugesTab.PORTS),
        (Qt.Key.Key_C, GaugesTab.CALIBRATE),
        (Qt.Key.Key_K, GaugesTab.CHECK),
        (Qt.Key.Key_H, GaugesTab.HEALTH),
    ):
        stage.qtbot.keyClick(stage.screen, key, Qt.KeyboardModifier.AltModifier)
        assert stage.presenter.state.tab is side
    stage.qtbot.keyClick(stage.screen, Qt.Key.Key_F5)
    assert stage.prober.calls[-1].arguments == (False, "")


def test_fields_of_a_calibration_are_whole_on_a_small_screen(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.CALIBRATE)
    stage.screen.resize(866, 540)  # of a window of 960, as on 1920 x 1080 at 200 %
    QApplication.processEvents()
    (area,) = stage.screen._calibrate.findChildren(QScrollArea)
    assert area.widget().minimumSizeHint().width() <= area.viewport().width()


def test_one_click_takes_what_a_port_suggests(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.PORTS)
    stage.presenter.ports.probe()
    assert "No serial port is plugged" not in stage.words(), "nobody has looked yet"
    stage.prober.calls[-1].done(())
    assert "No serial port is plugged" in stage.words()
    stage.fill()
    assert "not verified on hardware" in stage.words()
    stage.click("Use this port")
    assert PORTS[0].suggested_form in stage.went
    stage.screen._ports._query_silent.click()
    stage.click("Look at the ports")
    assert stage.prober.calls[-1].arguments == (True, "COM7")
    stage.click("Stop looking")
    assert stage.prober.cancelled == 1


def test_a_port_that_nobody_has_listened_to_says_so(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.PORTS)
    stage.presenter.ports._update(ports=(PortCard("COM3", "FTDI adapter"),))
    assert "Not looked at yet" in stage.words()
    stage.fill()
    assert "Not looked at yet" not in stage.words()


def test_the_tabs_are_the_first_that_keys_meet(stage: Stage) -> None:
    stage.screen.activateWindow()
    stage.qtbot.waitUntil(stage.screen._tabs.hasFocus)
    stage.qtbot.keyClick(stage.screen._tabs, Qt.Key.Key_Right)
    assert stage.presenter.state.tab is list(GaugesTab)[1]


@pytest.mark.parametrize("part", ["_ports._list", "_check", "_cards"])
def test_what_scrolls_takes_the_keyboard_and_has_a_name(stage: Stage, part: str) -> None:
    found = attrgetter(part)(stage.screen)
    area = found if isinstance(found, QScrollArea) else found.findChild(QScrollArea)
    assert area.accessibleName()
    assert area.focusPolicy() & Qt.FocusPolicy.TabFocus


def test_enter_takes_a_reading_and_the_fit_is_drawn(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.CALIBRATE)
    dial = stage.field("Dial reading in millimetres")
    stage.qtbot.keyClicks(dial, "1.5")
    stage.qtbot.keyClick(dial, Qt.Key.Key_Return)
    assert "connect the device first" in stage.words()
    stage.fill()
    assert "7.1" in stage.words()
    assert stage.screen._calibrate._readings._table.rowCount() == 5
    up, down = stage.screen._calibrate._plot._marks
    assert (len(up.points()), len(down.points())) == (3, 2)


def test_calibration_without_a_device_speaks_the_language_of_the_window(
    theme: Theme, qtbot: QtBot, use_language: Callable[[str], None]
) -> None:
    """Note and plot title once stayed English."""
    use_language("ru")
    stage = Stage(theme, qtbot)
    stage.presenter.set_tab(GaugesTab.CALIBRATE)
    assert "Нет отсчётов: сначала подключите прибор" in stage.words()
    titles = [
        stack.plots[0].title.text for stack in stage.screen.findChildren(PlotStack) if stack.isVisible()
    ]
    assert any("индикатор − калибровка" in title for title in titles)


def test_what_is_filled_in_reaches_the_presenter(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.CALIBRATE)
    stage.qtbot.keyClicks(stage.field("Calibrated by"), "A. Berger")
    stage.field("Its uncertainty, mm").setFocus()
    stage.qtbot.keyClicks(stage.field("Its uncertainty, mm"), "0.002")
    form = stage.presenter.calibration.state.form
    assert (form.calibrated_by, form.uncertainty_mm) == ("A. Berger", "0.002")
    corner = stage.field("Its corner (−3 dB), Hz")
    assert not corner.isEnabled(), "no filter is stated yet"
    choice = stage.screen._calibrate._filter
    choice.setCurrentIndex(choice.findData("rc"))
    choice.activated.emit(choice.currentIndex())
    assert corner.isEnabled()
    assert stage.presenter.calibration.state.form.filter_kind == "rc"
    assert "fit_calibration" not in [call.name for call in stage.worker.calls]


@pytest.mark.parametrize("side", GaugesTab)
@pytest.mark.parametrize("size", [(932, 640), (1188, 800), (1828, 1080)], ids=lambda size: f"{size[0]}")
def test_no_word_is_cut_off(stage: Stage, size: tuple[int, int], side: GaugesTab) -> None:
    stage.screen.resize(*size)
    stage.presenter.set_tab(side)
    assert clipped_words(stage.screen) == []
    stage.fill()
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []


def test_a_check_is_led_through(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.CHECK)
    stage.connect()
    stage.click("Begin the check")
    assert "Say how far the gauge is moved" in stage.words()
    stage.qtbot.keyClicks(stage.field("Known"), "10")
    stage.qtbot.keyClick(stage.field("Known"), Qt.Key.Key_Return)
    assert "Let the gauge rest" in stage.words()
    assert not stage.field("Known").isEnabled()
    stage.click("Break off")
    assert "nothing is kept" in stage.words()
    stage.presenter.check._set_state(
        CheckState(
            outcome=Chip("Gauge 1 FAILED", Tone.BAD),
            values=(LabelledValue("known", "10 mm"),),
            warnings=("a",),
        )
    )
    assert "Gauge 1 FAILED" in stage.words()


def test_one_of_two_devices_can_be_that_of_gauge_2(stage: Stage) -> None:
    stage.presenter.set_tab(GaugesTab.PORTS)
    other = replace(PORTS[0], url="/dev/ttyUSB1")
    stage.presenter.ports.probe()
    stage.prober.calls[-1].done(PORTS)
    assert "Use for gauge 2" not in stage.words(), "there is only one"
    stage.presenter.ports.probe()
    stage.prober.calls[-1].done((*PORTS, other))
    (_, second) = [b for b in stage.screen.findChildren(QPushButton) if b.text() == "Use for gauge 2"]
    second.click()
    assert stage.went == ["/dev/ttyUSB1"]
