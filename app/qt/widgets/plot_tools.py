"""Tools of a stack of plots: keys, a bar of buttons that stands in it while the pointer does, and a menu."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, QSize, Qt, QTimer
from PySide6.QtGui import QIcon, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QFrame, QMenu, QToolButton, QWidget

from app.qt.theme import Tokens, set_property
from app.qt.widgets import plot_export
from app.qt.widgets.folder_button import OpenFolderButton
from app.qt.widgets.icons import icon
from app.qt.widgets.layouts import make_row
from app.qt.widgets.plot_view import PAN, STEP, X, Y
from app.qt.widgets.shortcuts import describe_shortcut
from app.qt.widgets.text import label, set_tool_tip
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.qt.widgets.plots import PlotStack

_ZOOM_KEYS = {
    Qt.Key.Key_Plus: STEP,
    Qt.Key.Key_Equal: STEP,  # the same key without Shift
    Qt.Key.Key_Minus: 1.0 / STEP,
    Qt.Key.Key_Underscore: 1.0 / STEP,
}
_PAN_KEYS = {
    Qt.Key.Key_Left: (X, -PAN),
    Qt.Key.Key_Right: (X, PAN),
    Qt.Key.Key_Up: (Y, PAN),
    Qt.Key.Key_Down: (Y, -PAN),
}
_WRITTEN_MS = 10_000  # so long the name of a written file stands in a plot
_GAP = 4  # pixels between the bar and the edges of the first plot


@dataclass(frozen=True, slots=True)
class Tool:
    """An action on plots. `keys` and `gesture` do the same; `icon` is that of its button in the bar."""

    text: str
    act: Callable[[], object]
    keys: str = ""
    gesture: str = ""
    icon: str = ""

    @property
    def hint(self) -> str:
        ways = " · ".join(filter(None, (QKeySequence(self.keys).toString(_NATIVE), self.gesture)))
        return f"{self.text} ({ways})" if ways else self.text


_NATIVE = QKeySequence.SequenceFormat.NativeText


class PlotTools:
    """What can be done with the plots of a stack, by keys, buttons and menu."""

    def __init__(self, stack: "PlotStack") -> None:
        self._stack = stack
        self._bar: _Bar | None = None
        self._written: _Written | None = None
        self.menu: QMenu | None = None
        describe_shortcut(
            stack,
            "+ − ← → ↑ ↓ Y Home",
            gettext("Zoom a plot, with Ctrl in height; move it; fit its height; show all of it"),
        )

    def press(self, event: QKeyEvent) -> bool:
        """Do what a key stands for; False if it stands for nothing."""
        key, is_control = Qt.Key(event.key()), event.modifiers() & Qt.KeyboardModifier.ControlModifier
        if event.matches(QKeySequence.StandardKey.Copy):
            self._copy()
        elif key in _ZOOM_KEYS:
            self._zoom(Y if is_control else X, _ZOOM_KEYS[key])
        elif key in _PAN_KEYS:
            self._pan(*_PAN_KEYS[key])
        elif key == Qt.Key.Key_Home:
            self._stack.reset_view()
        elif key == Qt.Key.Key_Y and not is_control:
            self._stack.autoscale()
        else:
            return False
        return True

    def open_menu(self, at: QPoint) -> None:
        menu = QMenu(self._stack)
        for tools in (self._view_tools(), self._export_tools()):
            for tool in tools:
                action = menu.addAction(tool.text)
                action.setShortcut(QKeySequence(tool.keys))
                action.setShortcutVisibleInContextMenu(True)
                action.triggered.connect(lambda _checked=False, tool=tool: tool.act())
            menu.addSeparator()
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(at)

    def show_bar(self) -> None:
        if self._bar is None:
            self._bar = _Bar(self._stack, self._bar_tools())
            self._bar.restyle(self._stack.tokens)
        self.place_bar()
        self._bar.show()

    def hide_bar(self) -> None:
        if self._bar is not None:
            self._bar.hide()

    def place_bar(self) -> None:
        room = self._stack.first_plot_rect()
        if self._bar is not None:
            self._bar.move(room.right() - self._bar.width() - _GAP, room.top() + _GAP)
        if self._written is not None:
            self._written.adjustSize()
            self._written.move(room.left() + _GAP, room.bottom() - self._written.height() - _GAP)

    def restyle(self, tokens: Tokens) -> None:
        if self._bar is not None:
            self._bar.restyle(tokens)

    def _zoom(self, axis: int, factor: float) -> None:
        pointer = self._stack.pointer
        for view in self._stack.views_meant(axis):
            at = None if pointer is None else (pointer[1].x(), pointer[1].y())[axis]
            view.zoom(axis, factor, at)

    def _pan(self, axis: int, share: float) -> None:
        for view in self._stack.views_meant(axis):
            view.pan(axis, share)

    def _copy(self) -> None:
        with self._hidden() as pictured:
            plot_export.copy_picture(pictured)

    def _picture(self, draw: Callable[[QWidget], bytes]) -> bytes:
        with self._hidden() as pictured:
            return draw(pictured)

    @contextmanager
    def _hidden(self) -> Iterator[QWidget]:
        """What is pictured, without bar, crosshair and frame of the focus."""
        stack = self._stack
        was_shown = self._bar is not None and self._bar.isVisibleTo(stack)
        for part in (self._bar, self._written):
            if part is not None:
                part.hide()
        stack.forget_pointer()
        set_property(stack, "role", "plots-pictured")
        try:
            yield stack.pictured
        finally:
            set_property(stack, "role", "plots")
            if self._bar is not None:
                self._bar.setVisible(was_shown)

    def _save(self, suffix: str, content: Callable[[], bytes]) -> None:
        plot_export.ask_for_file(self._stack, suffix, self._stack.export_name, content, self._show_written)

    def _show_written(self, path: Path) -> None:
        if self._written is None:
            self._written = _Written(self._stack)
        self._written.show_file(path)
        self.place_bar()

    def _bar_tools(self) -> list[Tool]:
        wheel, more = gettext("wheel; with Ctrl in height"), gettext("right click")
        return [
            Tool(gettext("Zoom in"), partial(self._zoom, X, STEP), "+", wheel, "magnifying-glass-plus"),
            Tool(gettext("Zoom out"), partial(self._zoom, X, 1 / STEP), "-", wheel, "magnifying-glass-minus"),
            *self._view_tools(),
            Tool(gettext("More"), self._open_menu_of_bar, "", more, "dots-three"),
        ]

    def _view_tools(self) -> list[Tool]:
        stack, twice = self._stack, gettext("double click")
        return [
            Tool(gettext("Reset view"), stack.reset_view, "Home", twice, "arrows-out"),
            Tool(gettext("Fit height"), stack.autoscale, "Y", "", "arrows-out-line-vertical"),
        ]

    def _export_tools(self) -> list[Tool]:
        stack = self._stack
        return [
            Tool(gettext("Copy image"), self._copy, "Ctrl+C"),
            Tool(
                gettext("Save as PNG…"), partial(self._save, "png", partial(self._picture, plot_export.png))
            ),
            Tool(
                gettext("Save as SVG…"), partial(self._save, "svg", partial(self._picture, plot_export.svg))
            ),
            Tool(
                gettext("Save as CSV…"),
                partial(self._save, "csv", lambda: plot_export.csv(stack.table())),
            ),
        ]

    def _open_menu_of_bar(self) -> None:
        if self._bar is not None:
            self.open_menu(self._bar.mapToGlobal(self._bar.rect().bottomLeft()))


class _Written(QFrame):
    """Says for a while which file was written, and opens its folder."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setProperty("role", "plot-tools")
        self._text, self._open_folder = label(), OpenFolderButton()
        self._open_folder.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        make_row(self._text, self._open_folder, spacing=8, margins=(8, 4), of=self)
        self._timer = QTimer(self, singleShot=True, interval=_WRITTEN_MS)
        self._timer.timeout.connect(self.hide)

    def show_file(self, path: Path) -> None:
        self._text.setText(gettext("Wrote {files}", files=path.name))
        self._open_folder.show_folder(str(path.parent))
        self.show()
        self._timer.start()


class _Bar(QFrame):
    """Buttons without focus: each tool has its key."""

    def __init__(self, parent: QWidget, tools: list[Tool]) -> None:
        super().__init__(parent)
        self.setProperty("role", "plot-tools")
        self._buttons = {tool.icon: _button(tool) for tool in tools}
        make_row(*self._buttons.values(), spacing=0, margins=(2, 2), of=self)
        self.adjustSize()

    def restyle(self, tokens: Tokens) -> None:
        for name, button in self._buttons.items():
            drawn = icon(name, tokens.text).pixmap(button.iconSize(), button.devicePixelRatioF())
            button.setIcon(QIcon(drawn))  # as a picture: it is painted with each frame of the plot below


def _button(tool: Tool) -> QToolButton:
    button = QToolButton()
    button.setProperty("role", "plot-tool")
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    button.setIconSize(QSize(16, 16))
    set_tool_tip(button, tool.hint)
    button.setAccessibleName(tool.text)
    button.clicked.connect(lambda _checked: tool.act())
    return button
