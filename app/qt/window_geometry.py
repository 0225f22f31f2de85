"""Geometry of the window: saved when it closes, restored when it opens as far as it still fits."""

from collections.abc import Iterator

from PySide6.QtCore import QPoint, QRect, QSize, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QHeaderView, QMainWindow, QSplitter, QWidget

from app.qt.widgets.tables import show_columns, shown_columns
from config.schema import WindowLayout

_NAME = "remembered"
_USUAL = QSize(1280, 800)
_LEAST = QSize(940, 500)
"""Texts are cut in a smaller window."""
_GRIP = QSize(160, 40)
"""Part of the title bar that must be on a screen, so that the mouse can move the window."""
_FRAME = QSize(16, 40)
"""Room for title bar and borders, which are known only when a window is shown. Windows 11 takes 16 x 39."""


def persist_layout(part: QHeaderView | QSplitter, name: str) -> None:
    """Store the widths in a table or splitter, and columns and sort order of a table, under a name."""
    part.setProperty(_NAME, name)


class WindowGeometry:
    def __init__(self, place: WindowLayout) -> None:
        self._place = place

    @property
    def screen(self) -> str:
        return self._place.screen

    def restore_window(self, window: QMainWindow) -> None:
        """Restore size and place; a place that is on no screen any more becomes the middle of the first.

        A window that is too large for its screen with title bar and borders is maximized, unless that would
        cut its texts: the mouse can move one that is larger than the screen.
        """
        place = self._place
        wanted = QRect(place.x, place.y, place.width or _USUAL.width(), place.height or _USUAL.height())
        room = _room_for(wanted) if place.width else None
        free = room or QGuiApplication.primaryScreen().availableGeometry()
        inside = free.size() - _FRAME
        window.resize(wanted.size().boundedTo(inside))
        if place.width:
            window.move(wanted.topLeft() if room else free.center() - window.rect().center())
        is_too_large = wanted.size().boundedTo(inside) != wanted.size()
        can_fill = _LEAST.boundedTo(free.size()) == _LEAST
        if place.maximized or (is_too_large and can_fill):
            window.setWindowState(Qt.WindowState.WindowMaximized)

    def within_screen(self, smallest: QSize) -> QSize:
        """Limit a size to the screen without a frame: a scale of 200 % leaves 960 x 540 of 1920 x 1080."""
        free = QGuiApplication.primaryScreen().availableSize()
        return smallest.boundedTo(free - _FRAME).expandedTo(_LEAST)

    def restore_parts(self, screen: QWidget) -> None:
        for name, part in _parts(screen):
            if isinstance(part, QHeaderView):
                show_columns(part, self._place.columns.get(name, ()))
            widths = self._place.widths.get(name, ())
            if len(widths) == part.count():
                _set_widths(part, widths)
            if isinstance(part, QHeaderView) and name in self._place.sorted_by:
                column, descending = self._place.sorted_by[name]
                if 0 <= column < part.count():
                    orders = Qt.SortOrder.DescendingOrder, Qt.SortOrder.AscendingOrder
                    part.setSortIndicator(column, orders[0 if descending else 1])

    def capture(self, window: QMainWindow, screen: str) -> WindowLayout:
        shape = window.normalGeometry() if window.isMaximized() else window.geometry()
        parts = dict(_parts(window))
        widths = {name: found for name, part in parts.items() if any(found := _widths(part))}
        return WindowLayout(
            x=window.pos().x() if not window.isMaximized() else shape.x(),
            y=window.pos().y() if not window.isMaximized() else shape.y(),
            width=shape.width(),
            height=shape.height(),
            maximized=window.isMaximized(),
            screen=screen,
            widths={**self._place.widths, **widths},
            sorted_by={**self._place.sorted_by, **_orders(parts)},
            columns={**self._place.columns, **_columns(parts)},
        )


def _parts(within: QWidget) -> Iterator[tuple[str, QHeaderView | QSplitter]]:
    parts: list[QHeaderView | QSplitter] = [*within.findChildren(QHeaderView)]
    parts += within.findChildren(QSplitter)
    for part in parts:
        if name := part.property(_NAME):
            yield name, part


def _set_widths(part: QHeaderView | QSplitter, widths: tuple[int, ...]) -> None:
    if isinstance(part, QSplitter):
        part.setSizes(list(widths))
        return
    for number, width in enumerate(widths):
        if width:  # of a hidden column nothing is known
            part.resizeSection(number, max(width, part.minimumSectionSize()))


def _orders(parts: dict[str, QHeaderView | QSplitter]) -> dict[str, tuple[int, bool]]:
    return {
        name: (part.sortIndicatorSection(), part.sortIndicatorOrder() is Qt.SortOrder.DescendingOrder)
        for name, part in parts.items()
        if isinstance(part, QHeaderView) and part.isSortIndicatorShown()
    }


def _columns(parts: dict[str, QHeaderView | QSplitter]) -> dict[str, tuple[str, ...]]:
    columns = {name: shown_columns(part) for name, part in parts.items() if isinstance(part, QHeaderView)}
    return {name: shown for name, shown in columns.items() if shown}


def _widths(part: QHeaderView | QSplitter) -> tuple[int, ...]:
    """Widths of a part; zeros of a splitter that was not shown yet."""
    if isinstance(part, QSplitter):
        return tuple(part.sizes())
    return tuple(part.sectionSize(number) for number in range(part.count()))


def _room_for(wanted: QRect) -> QRect | None:
    """Free part of the screen that the title bar of a window would be on."""
    grip = QRect(wanted.topLeft() + QPoint((wanted.width() - _GRIP.width()) // 2, 0), _GRIP)
    for screen in QGuiApplication.screens():
        if screen.availableGeometry().contains(grip):
            return screen.availableGeometry()
    return None
