"""Every screen by keyboard and screen reader: names on all that can be reached, in the order of reading."""

from itertools import pairwise

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QWidget
from stage import RUN, analysed
from test_identify_screen import with_scan
from window_desk import Desk

from app.presenters.gauges.state import GaugesTab
from app.presenters.identify.state import PlotTab as IdentifySide
from app.presenters.screens import Screen
from app.qt.theme import Theme
from app.qt.widgets.plots import PlotStack
from tests.waiting import PATIENCE_MS


def reached_by_tab(window: QWidget) -> list[QWidget]:
    """What Tab would go through, in its order, the parts of one widget taken as one."""
    found, widget = [], window.nextInFocusChain()
    while widget is not window:
        takes = widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        proxied = isinstance(widget.parentWidget(), QComboBox)
        if (
            takes
            and widget.isVisibleTo(window)
            and widget.isEnabled()
            and not proxied
            and shown(widget, window)
        ):
            found.append(widget)
        widget = widget.nextInFocusChain()
    return found


def shown(widget: QWidget, window: QWidget) -> bool:
    return widget.window() is window and not widget.visibleRegion().isEmpty()


def name_of(widget: QWidget) -> str:
    return widget.accessibleName() or (widget.text() if isinstance(widget, QAbstractButton) else "")


def place(widget: QWidget, window: QWidget) -> QRect:
    return QRect(widget.mapTo(window, QPoint(0, 0)), widget.size())


def goes_back(one: QRect, other: QRect) -> bool:
    """Whether one must look back from the first to the second: up in the same column, or left in a line."""
    is_above = other.bottom() < one.top() and other.left() < one.right()
    in_line = other.top() <= one.center().y() <= other.bottom()
    return is_above or (in_line and other.right() < one.left())


def check(window: QWidget) -> None:
    QApplication.processEvents()
    reached = reached_by_tab(window)
    assert reached
    nameless = [
        f"{type(widget).__name__} in {type(widget.parentWidget()).__name__}"
        for widget in reached
        if not name_of(widget)
    ]
    assert nameless == [], "a screen reader would say nothing"
    plots = [plot for plot in window.findChildren(PlotStack) if plot.isVisible()]
    assert [plot for plot in plots if not described(plot)] == []
    back = [
        f"{name_of(one)} -> {name_of(other)}"
        for one, other in pairwise(reached)
        if goes_back(place(one, window), place(other, window))
    ]
    assert back == [], "Tab jumps back"


def described(plot: QWidget) -> bool:
    """Whether the plot, or what it is the only content of, has a name."""
    parent = plot.parentWidget()
    return bool(plot.accessibleName() or (parent is not None and parent.accessibleName()))


@pytest.mark.parametrize("screen", Screen)
def test_all_that_tab_reaches_has_a_name_and_comes_in_reading_order(desk: Desk, screen: Screen) -> None:
    desk.presenter.show_screen(screen)
    desk.window.resize(1280, 800)
    check(desk.window)


@pytest.mark.parametrize("side", GaugesTab)
def test_each_tab_of_the_gauges_too(desk: Desk, side: GaugesTab) -> None:
    desk.presenter.show_screen(Screen.GAUGES)
    desk.presenter.gauges.set_tab(side)
    check(desk.window)


def test_the_start_page_with_all_settings_unfolded(desk: Desk) -> None:
    desk.click("More settings")
    check(desk.window)


def test_a_recording_that_is_open(desk: Desk) -> None:
    desk.presenter.open_run(RUN)
    desk.worker.calls[-1].done(analysed())
    desk.qtbot.waitUntil(lambda: "Friction laws" in desk.words(), timeout=PATIENCE_MS)
    check(desk.window)


@pytest.mark.parametrize("side", IdentifySide)
def test_each_tab_of_identify_with_cursors_too(desk: Desk, side: IdentifySide) -> None:
    desk.presenter.open_run(RUN)
    desk.worker.calls[-1].done(with_scan())
    desk.qtbot.waitUntil(lambda: "Friction laws" in desk.words(), timeout=PATIENCE_MS)
    desk.presenter.identify.toggle_cursors()
    desk.presenter.identify.set_tab(side)
    check(desk.window)


def test_plots_that_take_keys_show_the_focus(desk: Desk, theme: Theme) -> None:
    desk.presenter.open_run(RUN)
    desk.worker.calls[-1].done(with_scan())
    desk.qtbot.waitUntil(lambda: "Friction laws" in desk.words(), timeout=PATIENCE_MS)
    desk.window.activateWindow()
    for plots in filter(QWidget.isVisible, desk.window.findChildren(PlotStack)):
        desk.button("Cursors").setFocus()
        edge = QPoint(plots.width() // 2, 0)
        assert plots.grab().toImage().pixelColor(edge) != QColor(theme.tokens.accent)
        plots.setFocus()
        QApplication.processEvents()
        assert plots.hasFocus()
        assert plots.grab().toImage().pixelColor(edge) == QColor(theme.tokens.accent)


def test_the_focus_is_seen_in_both_themes(desk: Desk, theme: Theme) -> None:
    field = desk.field("Baud")
    for scheme in (Qt.ColorScheme.Light, Qt.ColorScheme.Dark):
        theme.fix(scheme)
        desk.window.activateWindow()
        for widget in (field, desk.button("Connect my amplifier")):
            desk.button("Open a recording").setFocus()
            plain = widget.grab().toImage()
            widget.setFocus()
            assert widget.grab().toImage() != plain
            ring = QColor(theme.tokens.accent)
            focused = widget.grab().toImage()
            assert focused.pixelColor(focused.width() // 2, 1) == ring
    theme.fix(Qt.ColorScheme.Light)
