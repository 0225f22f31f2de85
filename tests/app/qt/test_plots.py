"""Gestures, keys, menu and files that all plots have, by events of mouse, wheel and keyboard."""

import csv
from pathlib import Path

import numpy as np
import pytest
from looking import visible_words
from pointing import Hand
from PySide6.QtCore import QDir, QEvent, QPointF, Qt, QUrl
from PySide6.QtGui import QColor, QDesktopServices, QEnterEvent, QGuiApplication, QImage
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu, QMessageBox, QPushButton, QToolButton
from pytestqt.qtbot import QtBot

from app.qt.theme import Theme
from app.qt.widgets.plot_marks import pen
from app.qt.widgets.plots import PlotStack

CONTROL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
TIME_S = np.linspace(-2.0, 8.0, 10_001)
RECORD_ENDS = (-2.0, 8.0)
SHOWN = (-1.0, 8.0)


@pytest.fixture
def stack(theme: Theme, qtbot: QtBot) -> PlotStack:
    """Two plots with one time axis: a decaying swing above, a small one below."""
    made = PlotStack(theme, (("table, mm", "channel_1"), ("relative, mm", "channel_2")))
    for plot, size, name in zip(made.plots, (10.0, 1.0), ("table", "relative"), strict=True):
        line = plot.line()
        line.title, line.unit = name, "mm"
        line.setPen(pen(theme.tokens.channel_1))
        values = size * np.exp(-0.5 * np.maximum(TIME_S, 0.0)) * np.cos(20.0 * TIME_S)
        line.show_line(TIME_S, values)
        plot.fit_values(values)
    made.restyle()
    made.set_time_title("time from release, s")
    made.set_time_range(*SHOWN, RECORD_ENDS)
    qtbot.addWidget(made)
    made.resize(900, 600)
    made.show()
    qtbot.waitExposed(made)
    QApplication.processEvents()
    return made


@pytest.fixture
def hand(stack: PlotStack) -> Hand:
    return Hand(stack)


def x_range(stack: PlotStack, row: int = 0) -> tuple[float, float]:
    return tuple(stack.plots[row].view.viewRange()[0])


def y_range(stack: PlotStack, row: int = 0) -> tuple[float, float]:
    return tuple(stack.plots[row].view.viewRange()[1])


def test_the_wheel_zooms_in_time_at_the_pointer_in_all_linked_plots(stack: PlotStack, hand: Hand) -> None:
    at, height = hand.place(0.3, 0.5), y_range(stack)
    before = hand.value(at)
    hand.wheel(3, at)
    start, end = x_range(stack)
    assert end - start == pytest.approx(0.8**3 * 9.0)
    assert hand.value(at).x() == pytest.approx(before.x())
    assert y_range(stack) == height
    assert x_range(stack, 1) == pytest.approx((start, end))


def test_with_control_it_zooms_the_height_of_the_plot_under_the_pointer(stack: PlotStack, hand: Hand) -> None:
    at, times, other = hand.place(0.5, 0.25), x_range(stack), y_range(stack, 1)
    before, (low, high) = hand.value(at), y_range(stack)
    hand.wheel(2, at, CONTROL)
    low_after, high_after = y_range(stack)
    assert high_after - low_after == pytest.approx(0.64 * (high - low))
    assert hand.value(at).y() == pytest.approx(before.y())
    assert (x_range(stack), y_range(stack, 1)) == (times, other)


@pytest.mark.parametrize(("steps", "keys", "sideways"), [(-1, SHIFT, 0), (0, Qt.KeyboardModifier(0), -1)])
def test_with_shift_or_sideways_it_moves(
    stack: PlotStack, hand: Hand, steps: int, keys: Qt.KeyboardModifier, sideways: int
) -> None:
    at = hand.place(0.5, 0.5)
    hand.wheel(5, at)
    start, end = x_range(stack)
    hand.wheel(steps, at, keys, sideways=sideways)
    assert x_range(stack) == pytest.approx((start + 0.1 * (end - start), end + 0.1 * (end - start)))


def test_nothing_shows_more_than_the_record(stack: PlotStack, hand: Hand) -> None:
    at, height = hand.place(0.5, 0.5), y_range(stack)
    for _ in range(12):
        hand.wheel(-1, at)
        hand.wheel(-1, at, CONTROL)
    assert x_range(stack) == pytest.approx(RECORD_ENDS)
    assert y_range(stack) == pytest.approx(height)
    hand.wheel(4, at)
    for _ in range(40):
        hand.wheel(1, at, SHIFT)
    start, end = x_range(stack)
    assert (start, end - start) == pytest.approx((RECORD_ENDS[0], 0.8**4 * 10.0))
    for _ in range(100):
        hand.wheel(1, at)
    start, end = x_range(stack)
    assert end - start >= 1e-6 * 10.0


def test_a_box_zooms_both_axes(stack: PlotStack, hand: Hand) -> None:
    first, last = hand.place(0.2, 0.2), hand.place(0.4, 0.6)
    left_top, right_bottom = hand.value(first), hand.value(last)
    hand.drag(first, last)
    assert x_range(stack) == pytest.approx((left_top.x(), right_bottom.x()), abs=0.02)
    assert y_range(stack) == pytest.approx((right_bottom.y(), left_top.y()), abs=0.1)
    assert x_range(stack, 1) == pytest.approx(x_range(stack))


@pytest.mark.parametrize(
    ("end", "zoomed"),
    [((0.6, 0.51), (True, False)), ((0.205, 0.9), (False, True)), ((0.203, 0.51), (False,) * 2)],
)
def test_a_flat_box_zooms_one_axis_and_a_tiny_one_none(
    stack: PlotStack, hand: Hand, end: tuple[float, float], zoomed: tuple[bool, bool]
) -> None:
    before = x_range(stack), y_range(stack)
    hand.drag(hand.place(0.2, 0.5), hand.place(*end))
    assert (x_range(stack) != before[0], y_range(stack) != before[1]) == zoomed


@pytest.mark.parametrize(
    ("button", "keys"),
    [(Qt.MouseButton.MiddleButton, Qt.KeyboardModifier(0)), (Qt.MouseButton.LeftButton, SHIFT)],
)
def test_the_middle_button_or_shift_moves_what_is_under_the_pointer(
    stack: PlotStack, hand: Hand, button: Qt.MouseButton, keys: Qt.KeyboardModifier
) -> None:
    for _ in range(4):
        hand.wheel(1, hand.place(0.5, 0.5))
        hand.wheel(1, hand.place(0.5, 0.5), CONTROL)
    start, end = hand.place(0.5, 0.5), hand.place(0.4, 0.6)
    grasped = hand.value(start)
    hand.drag(start, end, button, keys)
    left = hand.value(end)
    assert (left.x(), left.y()) == pytest.approx((grasped.x(), grasped.y()), abs=0.05)


def test_over_an_axis_the_wheel_zooms_that_axis(stack: PlotStack, hand: Hand) -> None:
    times, height = x_range(stack), y_range(stack)
    left_of_plot = hand.place(0.0, 0.5) - QPointF(20.0, 0.0)
    hand.wheel(1, left_of_plot)
    assert x_range(stack) == times
    assert y_range(stack) != height


def test_a_double_click_and_home_show_all_again(stack: PlotStack, hand: Hand, qtbot: QtBot) -> None:
    height = y_range(stack)
    for reset in (
        lambda: hand.double_click(hand.place(0.5, 0.5)),
        lambda: qtbot.keyClick(stack, Qt.Key.Key_Home),
    ):
        hand.drag(hand.place(0.2, 0.2), hand.place(0.4, 0.6))
        assert (x_range(stack), y_range(stack)) != (SHOWN, height)
        reset()
        assert x_range(stack) == pytest.approx(SHOWN)
        assert y_range(stack) == pytest.approx(height)


def test_keys_zoom_and_move(stack: PlotStack, qtbot: QtBot) -> None:
    qtbot.keyClick(stack, Qt.Key.Key_Plus)
    start, end = x_range(stack)
    assert (start + end, end - start) == pytest.approx((7.0, 0.8 * 9.0))
    qtbot.keyClick(stack, Qt.Key.Key_Left)
    assert x_range(stack)[0] == pytest.approx(start - 0.1 * (end - start))
    qtbot.keyClick(stack, Qt.Key.Key_Minus)
    assert x_range(stack)[1] - x_range(stack)[0] == pytest.approx(9.0)
    heights = [y_range(stack, row) for row in range(2)]
    qtbot.keyClick(stack, Qt.Key.Key_Plus, CONTROL)
    qtbot.keyClick(stack, Qt.Key.Key_Up)
    for row, (low, high) in enumerate(heights):
        assert y_range(stack, row) == pytest.approx((low + 0.18 * (high - low), high - 0.02 * (high - low)))


def test_a_key_that_the_widget_around_wants_is_left_to_it(stack: PlotStack, qtbot: QtBot) -> None:
    stack.reserved_keys = frozenset({Qt.Key.Key_Left})
    hand_in = x_range(stack)
    qtbot.keyClick(stack, Qt.Key.Key_Plus)
    zoomed = x_range(stack)
    qtbot.keyClick(stack, Qt.Key.Key_Left)
    assert x_range(stack) == zoomed != hand_in


def test_the_height_fits_what_is_in_view(stack: PlotStack, hand: Hand, qtbot: QtBot) -> None:
    hand.drag(hand.place(0.8, 0.5), hand.place(0.95, 0.5))
    start, end = x_range(stack)
    qtbot.keyClick(stack, Qt.Key.Key_Y)
    seen = (start <= TIME_S) & (end >= TIME_S)
    largest = np.abs(10.0 * np.exp(-0.5 * TIME_S) * np.cos(20.0 * TIME_S))[seen].max()
    low, high = y_range(stack)
    assert largest < high < 1.3 * largest
    assert y_range(stack, 1) == pytest.approx((0.1 * low, 0.1 * high), rel=0.05)
    assert x_range(stack) == (start, end)


def test_a_zoomed_line_has_every_reading_where_there_is_room(stack: PlotStack, hand: Hand) -> None:
    line = stack.plots[0]._items[0]
    assert len(line.getData()[0]) < 4 * 900
    for _ in range(20):
        hand.wheel(1, hand.place(0.5, 0.5))
    start, end = x_range(stack)
    drawn_s, _ = line.getData()
    expected = TIME_S[(start <= TIME_S) & (end >= TIME_S)]
    assert np.isin(expected, drawn_s).all()
    assert drawn_s[0] <= start
    assert drawn_s[-1] >= end


def test_a_crosshair_stands_at_the_pointer_in_all_plots(stack: PlotStack, hand: Hand) -> None:
    at = hand.place(0.25, 0.3, row=1)
    hovered: list[float] = []
    stack.hovered.connect(hovered.append)
    hand.move(at)
    pointed = hand.value(at, row=1)
    verticals, horizontals = stack._crosshair._verticals, stack._crosshair._horizontals
    assert [line.isVisible() for line in verticals] == [True, True]
    assert [line.value() for line in verticals] == pytest.approx([pointed.x()] * 2)
    assert [line.isVisible() for line in horizontals] == [False, True]
    assert horizontals[1].value() == pytest.approx(pointed.y())
    assert hovered == pytest.approx([pointed.x()])
    QApplication.sendEvent(stack, QEvent(QEvent.Type.Leave))
    assert not any(line.isVisible() for line in (*verticals, *horizontals))
    assert np.isnan(hovered[-1])


def test_a_plot_of_no_time_reads_the_place_of_the_pointer(theme: Theme, qtbot: QtBot) -> None:
    stack = PlotStack(theme, (("", "text"),), format_point=lambda x, y: f"{x:.0f} against {y:.0f}")
    qtbot.addWidget(stack)
    stack.set_time_range(0.0, 100.0)
    stack.plots[0].set_value_range(0.0, 10.0)
    stack.resize(600, 300)
    stack.show()
    qtbot.waitExposed(stack)
    QApplication.processEvents()
    hand = Hand(stack)
    hand.move(hand.place(0.5, 0.0) + QPointF(0.0, 1.0))
    assert "50 against 10" in stack.plots[0].readout.text
    QApplication.sendEvent(stack, QEvent(QEvent.Type.Leave))
    assert "against" not in stack.plots[0].readout.text


def open_menu(stack: PlotStack, hand: Hand) -> QMenu:
    hand.click(hand.place(0.5, 0.5), Qt.MouseButton.RightButton)
    (menu,) = [menu for menu in stack.findChildren(QMenu) if menu.isVisible()]
    return menu


def trigger(stack: PlotStack, hand: Hand, text: str) -> None:
    menu = open_menu(stack, hand)
    (action,) = [action for action in menu.actions() if action.text() == text]
    menu.close()
    action.trigger()


def test_a_right_click_offers_what_can_be_done(stack: PlotStack, hand: Hand) -> None:
    menu = open_menu(stack, hand)
    offered = [(action.text(), action.shortcut().toString()) for action in menu.actions() if action.text()]
    assert offered == [
        ("Reset view", "Home"),
        ("Fit height", "Y"),
        ("Copy image", "Ctrl+C"),
        ("Save as PNG…", ""),
        ("Save as SVG…", ""),
        ("Save as CSV…", ""),
    ]
    menu.close()
    zoomed = hand.place(0.4, 0.6)
    hand.drag(hand.place(0.2, 0.2), zoomed)
    assert x_range(stack) != pytest.approx(SHOWN), "the menu leaves nothing behind in pyqtgraph"
    trigger(stack, hand, "Reset view")
    assert x_range(stack) == pytest.approx(SHOWN)


def test_an_image_without_crosshair_and_focus_is_copied(
    stack: PlotStack, hand: Hand, qtbot: QtBot, theme: Theme
) -> None:
    stack.activateWindow()
    stack.setFocus()
    hand.move(hand.place(0.5, 0.9))
    QGuiApplication.clipboard().clear()
    qtbot.keyClick(stack, Qt.Key.Key_C, CONTROL)
    image = QGuiApplication.clipboard().image()
    assert image.size() == stack.size()
    assert image.pixelColor(image.width() // 2, 0) != QColor(theme.tokens.accent)
    assert stack.property("role") == "plots"
    trigger(stack, hand, "Copy image")
    assert QGuiApplication.clipboard().image() == image


def save(stack: PlotStack, hand: Hand, text: str, path: Path) -> None:
    trigger(stack, hand, text)
    (dialog,) = stack.findChildren(QFileDialog)
    dialog.fileSelected.emit(str(path))
    dialog.close()
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def test_plots_are_saved_as_pictures(stack: PlotStack, hand: Hand, tmp_path: Path) -> None:
    save(stack, hand, "Save as PNG…", tmp_path / "a.png")
    assert QImage(str(tmp_path / "a.png")).size() == stack.size()
    save(stack, hand, "Save as SVG…", tmp_path / "a.svg")
    drawing = (tmp_path / "a.svg").read_text("utf-8")
    assert "time from release, s" in drawing
    assert drawing.count("<polyline") + drawing.count("<path") > 10
    assert "data:image" not in drawing


def test_curves_in_view_are_saved_as_a_table_with_units(stack: PlotStack, hand: Hand, tmp_path: Path) -> None:
    hand.drag(hand.place(0.2, 0.5), hand.place(0.4, 0.5))
    start, end = x_range(stack)
    save(stack, hand, "Save as CSV…", tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="utf-8-sig", newline="") as file:
        titles, *rows = csv.reader(file)
    assert titles == ["time from release, s", "table, mm", "relative, mm"]
    seen = (start <= TIME_S) & (end >= TIME_S)
    np.testing.assert_array_equal([float(row[0]) for row in rows], TIME_S[seen])
    np.testing.assert_allclose(
        [float(row[1]) for row in rows], 10.0 * np.array([float(row[2]) for row in rows])
    )


def test_a_saved_plot_is_named_and_its_folder_opens_and_is_offered_again(
    stack: PlotStack, hand: Hand, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[QUrl] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", opened.append)
    save(stack, hand, "Save as CSV…", tmp_path / "a.csv")
    assert "Wrote a.csv" in visible_words(stack)
    (folder,) = [b for b in stack.findChildren(QPushButton) if b.isVisible()]
    qtbot.mouseClick(folder, Qt.MouseButton.LeftButton)
    assert opened == [QUrl.fromLocalFile(str(tmp_path))]
    trigger(stack, hand, "Save as PNG…")
    (dialog,) = stack.findChildren(QFileDialog)
    assert dialog.directory() == QDir(str(tmp_path))
    dialog.fileSelected.emit(str(tmp_path / "b.png"))
    dialog.close()
    stack._tools._written._timer.stop()
    assert "Wrote b.png" in visible_words(stack)


def test_the_file_has_a_name_and_its_suffix(stack: PlotStack, hand: Hand) -> None:
    stack.export_name = "20260112_1FFM0_001"
    trigger(stack, hand, "Save as CSV…")
    (dialog,) = stack.findChildren(QFileDialog)
    assert dialog.defaultSuffix() == "csv"
    assert [Path(file).name for file in dialog.selectedFiles()] == ["20260112_1FFM0_001.csv"]
    dialog.close()


@pytest.mark.parametrize("text", ["Save as PNG…", "Save as CSV…"])
def test_what_cannot_be_saved_is_said_in_a_line(
    stack: PlotStack, hand: Hand, tmp_path: Path, text: str
) -> None:
    save(stack, hand, text, tmp_path / "nowhere" / "a.file")
    (said,) = stack.findChildren(QMessageBox)
    assert "a.file could not be written: " in said.text()
    assert said.text().endswith(". Choose another place")
    said.close()


def test_an_empty_plot_says_that_there_is_nothing_to_save(
    stack: PlotStack, hand: Hand, tmp_path: Path
) -> None:
    for plot in stack.plots:
        plot._items[0].show_line(None, None)
    save(stack, hand, "Save as CSV…", tmp_path / "a.csv")
    (said,) = stack.findChildren(QMessageBox)
    assert said.text() == "there is no curve in view to save: reset the view, or open a run"
    assert not (tmp_path / "a.csv").exists()
    said.close()


def test_buttons_stand_in_the_plot_while_the_pointer_does(stack: PlotStack, qtbot: QtBot) -> None:
    point = QPointF(5.0, 5.0)
    QApplication.sendEvent(stack, QEnterEvent(point, point, stack.mapToGlobal(point)))
    buttons = {b.accessibleName(): b for b in stack.findChildren(QToolButton) if b.isVisible()}
    assert list(buttons) == ["Zoom in", "Zoom out", "Reset view", "Fit height", "More"]
    assert buttons["Zoom in"].toolTip() == "Zoom in (+ · wheel; with Ctrl in height)"
    assert buttons["Reset view"].toolTip() == "Reset view (Home · double click)"
    qtbot.mouseClick(buttons["Zoom in"], Qt.MouseButton.LeftButton)
    assert x_range(stack)[1] - x_range(stack)[0] == pytest.approx(0.8 * 9.0)
    qtbot.mouseClick(buttons["More"], Qt.MouseButton.LeftButton)
    (menu,) = [menu for menu in stack.findChildren(QMenu) if menu.isVisible()]
    menu.close()
    QApplication.sendEvent(stack, QEvent(QEvent.Type.Leave))
    assert not buttons["Zoom in"].isVisible()


def test_a_curve_is_drawn_wherever_the_view_goes(theme: Theme, qtbot: QtBot) -> None:
    stack = PlotStack(theme, [("one", "text")])
    qtbot.addWidget(stack)
    stack.resize(400, 300)
    (plot,) = stack.plots
    curve = plot.curve(antialias=False)
    curve.setPen(pen("#ff0000"))
    stack.show()
    for start in (0.0, 100.0, -3000.0):
        x = np.linspace(start, start + 10.0, 50)
        curve.show_points(x, x)
        plot.set_value_range(start, start + 10.0)
        stack.set_time_range(start, start + 10.0)
        QApplication.processEvents()
        image = stack.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
        inks = np.frombuffer(image.constBits(), np.uint32) & 0xFFFFFF
        assert np.count_nonzero(inks == 0xFF0000) > 100
