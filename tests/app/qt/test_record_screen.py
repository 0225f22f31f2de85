"""The Record screen draws what its state says and tells what the operator does."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from looking import clipped_words, visible_words
from pointing import Hand
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot
from stage import (
    END_S,
    RELEASED_S,
    FakeRecorder,
    FakeWorker,
    analysed,
    bench,
    ended,
    health,
    motion_m,
    rows_between,
    script,
)

from analysis.quantities import Quantity
from app.acquisition.messages import Connected, LiveResult, PullbackState, StateChanged
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import Action, AnalysisFailed, Connecting
from app.qt.record.screen import RecordScreen
from app.qt.theme import Theme
from app.qt.widgets.text import ValueLabel

LIVE = LiveResult(
    9.0,
    friction_dynamic=Quantity.normal(0.1003, 0.0009, "1"),
    period=Quantity.normal(0.31994, 3.1e-4, "s"),
    damping_n1=Quantity.normal(0.121, 0.0042, "1/s"),
    narrowing=("damping_n1_per_s",),
    may_stop=True,
)
SIZES = [(932, 700), (1188, 800), (1828, 1080)]


class Stage:
    """Screen, presenter and recorder, shown."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.recorder = FakeRecorder()
        self.files = FakeWorker()
        self.presenter = RecordPresenter(self.recorder, bench(), self.files, "me")  # type: ignore[arg-type]
        self.screen = RecordScreen(theme, self.presenter)
        qtbot.addWidget(self.screen)
        self.screen.resize(*SIZES[1])
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)

    def connect(self) -> None:
        self.presenter.dispatch(Connecting("COM7"))
        self.presenter.dispatch(Connected("GSV-8 S/N 1234", "1", 1000.0, "/ring"))
        self.presenter.dispatch(StateChanged(PullbackState.IDLE, 0.0))
        self.presenter.dispatch(health())

    def play(self, start_s: float, end_s: float) -> None:
        for at_s, event in script(str(analysed().path)):
            if start_s <= at_s < end_s:
                self.presenter.dispatch(event)
        self.recorder.rows = rows_between(start_s, end_s)
        self.presenter.tick()

    def words(self) -> str:
        return visible_words(self.screen)


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


def offline(stage: Stage) -> None:
    pass


def idle(stage: Stage) -> None:
    stage.connect()
    stage.play(0.0, 0.4)


def pulling(stage: Stage) -> None:
    stage.connect()
    stage.play(0.0, 2.1)
    stage.play(2.1, 3.5)


def tail(stage: Stage) -> None:
    pulling(stage)
    stage.play(3.5, 10.0)


def live(stage: Stage) -> None:
    tail(stage)
    stage.presenter.dispatch(LIVE)


def result(stage: Stage) -> None:
    tail(stage)
    stage.play(10.0, END_S + 0.1)
    stage.presenter.dispatch(analysed())


def failure(stage: Stage) -> None:
    tail(stage)
    stage.presenter.dispatch(ended())
    message = "the decay lasts 0.213 s, under two periods. Record until rest"
    stage.presenter.dispatch(AnalysisFailed(str(analysed().path), message))


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}")
@pytest.mark.parametrize("play", [offline, idle, pulling, tail, live, result, failure])
def test_no_word_is_cut_off(stage: Stage, play: Callable[[Stage], None], size: tuple[int, int]) -> None:
    stage.screen.resize(*size)
    play(stage)
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []


def test_the_header_and_the_sentence_are_read_off_the_state(stage: Stage) -> None:
    pulling(stage)
    words = stage.words()
    for expected in (
        "GSV-8 S/N 1234",
        "1000.02\u202fHz",
        "✓ Lost 0",
        "✓ Gauge 1 ok",
        "✓ Gauge 2 ok",
        "✓ Disk 210\u202fGB free",
        "Pull the table back to 12.0\u202fmm",
        "✓Zero",
    ):
        assert expected in words
    assert "Connect" not in words.splitlines()


def test_running_values_are_read_off_the_state(stage: Stage) -> None:
    tail(stage)
    assert "± 0.00090" not in stage.words()
    live(stage)
    words = stage.words()
    for expected in ("319.94", "± 0.31\u202fms", "0.1210", "0.10030", "± 0.00090", "you may stop"):
        assert expected in words


def test_the_result_is_read_off_the_state(stage: Stage) -> None:
    result(stage)
    words = stage.words()
    for expected in (
        "0.10030",
        "± 0.00064",
        "✓ Model fits",
        "319.942",
        "coulomb+tilt explains the record; residual 21\u202fµm, noise 20\u202fµm",
        "▲ The tail does not decay exponentially.",
        "✓ Ended: more samples would not sharpen the result",
    ):
        assert expected in words
    assert "Pull the table back" not in words
    stage.presenter.dispatch(Action.NEXT)
    assert "Model fits" not in stage.words()


def test_single_keys_arm_stop_and_go_on(stage: Stage, qtbot: QtBot) -> None:
    stage.connect()
    qtbot.keyClick(stage.screen, Qt.Key.Key_Escape)
    assert stage.recorder.stopped == 0, "nothing is being recorded"
    qtbot.keyClick(stage.screen, Qt.Key.Key_A)
    assert len(stage.recorder.armed) == 1
    stage.presenter.dispatch(StateChanged(PullbackState.ZERO, 0.5))
    qtbot.keyClick(stage.screen, Qt.Key.Key_Escape)
    assert stage.recorder.stopped == 1
    stage.presenter.dispatch(ended())
    stage.presenter.dispatch(StateChanged(PullbackState.IDLE, 2.0))
    stage.presenter.dispatch(analysed())
    qtbot.keyClick(stage.screen, Qt.Key.Key_Return)
    assert stage.presenter.state.result is None


def test_letters_typed_into_a_field_arm_nothing(stage: Stage, qtbot: QtBot) -> None:
    stage.connect()
    qtbot.keyClick(stage.screen, Qt.Key.Key_F2)
    note = next(field for field in stage.screen.findChildren(QLineEdit) if field.accessibleName() == "Note")
    note.setFocus()
    qtbot.keyClicks(note, "a plain pad")
    assert stage.presenter.state.choices.form.note == "a plain pad"
    assert stage.recorder.armed == []


def test_buttons_are_large_and_only_the_possible_ones_can_be_pressed(stage: Stage) -> None:
    stage.connect()
    buttons = [
        b for b in stage.screen.findChildren(QPushButton) if b.isVisible() and b.property("scale") == "large"
    ]
    assert [(b.text(), b.isEnabled()) for b in buttons] == [
        ("Tare   T", True),
        ("Arm   A", True),
        ("Stop   Esc", False),
        ("Next   Enter", False),
    ]
    assert {button.height() for button in buttons} == {56}


def test_everything_that_takes_the_keyboard_has_a_name(stage: Stage) -> None:
    for kind in (QLineEdit, QPushButton):
        for widget in stage.screen.findChildren(kind):
            assert widget.accessibleName() or getattr(widget, "text", str)(), widget


def test_without_a_device_the_way_to_one_is_offered(stage: Stage, qtbot: QtBot) -> None:
    (connect,) = [
        b for b in stage.screen.findChildren(QPushButton) if b.text() == "Connect" and b.isVisible()
    ]
    assert connect.height() == 56
    stage.connect()
    assert not connect.isVisible()


def test_the_curves_are_the_traces(stage: Stage) -> None:
    tail(stage)
    traces = stage.presenter.state.traces
    drawn = [curve.samples() for curve in stage.screen._plots._curves]
    for (time_s, value), line in zip(drawn, (traces.table, traces.relative), strict=True):
        np.testing.assert_array_equal(time_s, line.time_s)
        np.testing.assert_array_equal(value, line.value)
    ranges = [plot.view.viewRange() for plot in stage.screen._plots._stack.plots]
    assert ranges[0][0] == ranges[1][0] == list(traces.span)
    assert ranges[0][1] == [-traces.table_limit_mm, traces.table_limit_mm]


def test_what_is_drawn_differs_from_an_empty_plot(stage: Stage) -> None:
    idle(stage)
    empty = stage.screen._plots.grab().toImage()
    tail_again = stage.screen._plots
    tail(stage)
    assert tail_again.grab().toImage() != empty


def test_the_pointer_reads_time_and_value(stage: Stage) -> None:
    tail(stage)
    stage.screen._plots._hover(1.0)
    readouts = [plot.readout.text for plot in stage.screen._plots._stack.plots]
    assert "1.000\u202fs" in readouts[0]
    assert "mm" in readouts[0]
    stage.screen._plots._hover(float("nan"))
    assert all("mm" not in plot.readout.text for plot in stage.screen._plots._stack.plots)


def test_the_plots_tell_their_width_so_that_as_much_is_drawn(stage: Stage, qtbot: QtBot) -> None:
    stage.connect()
    stage.screen.resize(1828, 1080)
    QApplication.processEvents()
    wide = stage.presenter._model.live.width_px
    stage.screen.resize(932, 700)
    QApplication.processEvents()
    assert 64 < stage.presenter._model.live.width_px < wide < 1828


def test_the_theme_can_change_at_any_time(stage: Stage, theme: Theme) -> None:
    tail(stage)
    light = stage.screen.grab().toImage()
    try:
        theme.fix(Qt.ColorScheme.Dark)
        QApplication.processEvents()
        dark = stage.screen.grab().toImage()
        assert dark.pixelColor(5, 5).lightness() < 60 < light.pixelColor(5, 5).lightness()
        card = stage.screen._plots.mapTo(stage.screen, stage.screen._plots.rect().center())
        assert dark.pixelColor(card.x() + 3, card.y()).lightness() < 128
    finally:
        theme.fix(Qt.ColorScheme.Light)


def pointing(stage: Stage) -> Hand:
    QApplication.processEvents()
    return Hand(stage.screen._plots._stack)


def shown_span(stage: Stage) -> tuple[float, float]:
    return stage.screen._plots._stack.time_range()


def test_files_of_the_plots_have_the_name_of_the_run_that_is_shown(stage: Stage) -> None:
    tail(stage)
    stack = stage.screen._plots._stack
    assert stack.export_name == "live traces"
    stage.play(10.0, END_S + 0.1)
    stage.presenter.dispatch(analysed())
    assert stack.export_name == "20260112_1FFM0_001"
    titles = [curve.title for curve in stack.curves_in_view()]
    assert titles == ["table displacement, mm", "relative displacement, mm"]


def test_a_zoomed_part_is_drawn_finely_and_stays_while_samples_come(stage: Stage) -> None:
    tail(stage)
    coarse = stage.presenter.state.traces.table
    hand = pointing(stage)
    for _ in range(12):
        hand.wheel(1, hand.place(0.3, 0.5))
    QApplication.processEvents()
    start_s, end_s = zoomed = shown_span(stage)
    line = stage.presenter.state.traces.table
    assert np.count_nonzero((coarse.time_s >= start_s) & (coarse.time_s <= end_s)) < len(line.time_s)
    assert np.diff(line.time_s) == pytest.approx(1e-3)
    assert line.time_s[0] == pytest.approx(start_s, abs=2e-3)
    assert line.time_s[-1] == pytest.approx(end_s, abs=2e-3)
    limits = [plot.view.viewRange()[1] for plot in stage.screen._plots._stack.plots]
    stage.play(10.0, 14.5)
    QApplication.processEvents()
    assert shown_span(stage) == zoomed
    assert [plot.view.viewRange()[1] for plot in stage.screen._plots._stack.plots] == limits
    np.testing.assert_array_equal(stage.presenter.state.traces.table.time_s, line.time_s)
    hand.double_click(hand.place(0.5, 0.5))
    QApplication.processEvents()
    assert shown_span(stage) == stage.presenter.state.traces.span
    assert stage.presenter.state.traces.table.time_s[-1] > 9.0


def test_a_new_time_axis_is_shown_whole(stage: Stage) -> None:
    pulling(stage)
    hand = pointing(stage)
    hand.wheel(3, hand.place(0.8, 0.5))
    assert shown_span(stage) != stage.presenter.state.traces.span
    stage.play(3.5, 10.0)
    QApplication.processEvents()
    assert shown_span(stage) == stage.presenter.state.traces.span == (-1.0, 8.0)


def test_the_result_is_zoomed_into_long_after_the_run(stage: Stage) -> None:
    result(stage)
    stage.recorder.rows = rows_between(END_S + 0.1, END_S + 3.0)
    stage.presenter.tick()
    hand = pointing(stage)
    for _ in range(10):
        hand.wheel(1, hand.place(0.2, 0.5))
    QApplication.processEvents()
    line = stage.presenter.state.traces.table
    assert np.diff(line.time_s) == pytest.approx(1e-3)
    table_m, _ = motion_m(RELEASED_S + line.time_s).T
    assert line.value == pytest.approx(1e3 * table_m - 0.2, abs=0.06), "from the zero of the run"
    hand.drag(hand.place(0.5, 0.5), hand.place(0.4, 0.5), Qt.MouseButton.MiddleButton)
    QApplication.processEvents()
    assert stage.presenter.state.traces.table.time_s[-1] > line.time_s[-1]


def test_the_main_result_is_whole_in_a_window_that_is_made_smaller(stage: Stage) -> None:
    stage.screen.resize(1190, 760)
    tail(stage)
    stage.play(10.0, END_S + 0.1)
    stage.presenter.dispatch(analysed())
    QApplication.processEvents()
    stage.screen.resize(934, 640)
    for _ in range(3):
        QApplication.processEvents()
    shown = [value for value in stage.screen.findChildren(ValueLabel) if value.isVisible()]
    assert shown
    assert all(value.height() >= value.minimumHeight() > 20 for value in shown)
    assert clipped_words(stage.screen) == []


@pytest.mark.parametrize("language", ["en", "ru"])
@pytest.mark.parametrize(
    "friction", [Quantity.normal(0.1003, 6.4e-9, "1"), Quantity.normal(-0.1003, 6.4e-13, "1"), None]
)
def test_the_main_result_fits_its_card_in_a_window_of_1280(
    theme: Theme,
    qtbot: QtBot,
    friction: Quantity | None,
    language: str,
    use_language: Callable[[str], None],
) -> None:
    use_language(language)
    stage = Stage(theme, qtbot)
    stage.screen.resize(1190, 760)
    tail(stage)
    stage.play(10.0, END_S + 0.1)
    found = analysed().results
    others = {name: quantity for name, quantity in found.items() if not name.startswith("friction")}
    precise = {name: replace(quantity, standard_uncertainty=1e-12) for name, quantity in others.items()}
    stage.presenter.dispatch(analysed(results=precise | ({"friction_dynamic": friction} if friction else {})))
    for _ in range(3):
        QApplication.processEvents()
    assert clipped_words(stage.screen) == []
