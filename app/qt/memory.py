"""How the window was left: restored when it opens, as far as it still fits, and told when it closes."""

from collections.abc import Iterator

from PySide6.QtCore import QPoint, QRect, QSize, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QHeaderView, QMainWindow, QSplitter, QWidget

from config.schema import WindowPlace

_NAME = "remembered"
_USUAL = QSize(1280, 800)
_LEAST = QSize(940, 500)
"""Below this words are cut."""
_GRIP = QSize(160, 40)
"""So much of the title bar must be on a screen for the mouse to take hold of."""


def remember(part: QHeaderView | QSplitter, name: str) -> None:
    """Let the widths in a table or splitter be kept under a name."""
    part.setProperty(_NAME, name)


class Memory:
    """What is known of how the window was left.

    Parameters
    ----------
    place : WindowPlace
    """

    def __init__(self, place: WindowPlace) -> None:
        self._place = place

    @property
    def screen(self) -> str:
        """The screen that was shown last."""
        return self._place.screen

    def restore_window(self, window: QMainWindow) -> None:
        """Put the window where it was; where that is no screen any more, into the middle of the first."""
        place = self._place
        wanted = QRect(place.x, place.y, place.width or _USUAL.width(), place.height or _USUAL.height())
        room = _room_for(wanted) if place.width else None
        free = room or QGuiApplication.primaryScreen().availableGeometry()
        window.resize(wanted.size().boundedTo(free.size()))
        if place.width:
            window.move(wanted.topLeft() if room else free.center() - window.rect().center())
        if place.maximized:
            window.setWindowState(Qt.WindowState.WindowMaximized)

    def within_screen(self, smallest: QSize) -> QSize:
        """No more than the screen has: a scale of 200 % leaves 960 x 540 of 1920 x 1080."""
        free = QGuiApplication.primaryScreen().availableSize()
        return smallest.boundedTo(free).expandedTo(_LEAST)

    def restore_parts(self, screen: QWidget) -> None:
        """Give the tables and splitters of a screen the widths that they had."""
        for name, part in _parts(screen):
            widths = self._place.widths.get(name, ())
            if isinstance(part, QSplitter):
                if len(widths) == part.count():
                    part.setSizes(list(widths))
            elif len(widths) == part.count():
                for number, width in enumerate(widths):
                    part.resizeSection(number, max(width, part.minimumSectionSize()))

    def of(self, window: QMainWindow, screen: str) -> WindowPlace:
        """How the window is left now; parts that were not seen this time keep their widths."""
        shape = window.normalGeometry() if window.isMaximized() else window.geometry()
        widths = {name: _widths(part) for name, part in _parts(window)}
        return WindowPlace(
            x=window.pos().x() if not window.isMaximized() else shape.x(),
            y=window.pos().y() if not window.isMaximized() else shape.y(),
            width=shape.width(),
            height=shape.height(),
            maximized=window.isMaximized(),
            screen=screen,
            widths={**self._place.widths, **widths},
        )


def _parts(within: QWidget) -> Iterator[tuple[str, QHeaderView | QSplitter]]:
    parts: list[QHeaderView | QSplitter] = [
        *within.findChildren(QHeaderView),
        *within.findChildren(QSplitter),
    ]
    for part in parts:
        if name := part.property(_NAME):
            yield name, part


def _widths(part: QHeaderView | QSplitter) -> tuple[int, ...]:
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
