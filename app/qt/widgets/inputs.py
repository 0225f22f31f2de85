"""Check box, combo box and line edit. Their marks are drawn: a style sheet takes them only from files."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from PySide6.QtCore import QDir, QEvent, QPointF, Qt, Signal
from PySide6.QtGui import QFontDatabase, QKeyEvent, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QLineEdit,
    QMessageBox,
    QPlainTextEdit,
    QProgressBar,
    QPushButton,
    QStyle,
    QStyleOptionButton,
    QWidget,
)

from app.presenters.base import Progress
from app.qt.theme import set_property
from app.qt.widgets.text import set_tool_tip
from messages.i18n import gettext

_MARK = ((0.22, 0.52), (0.42, 0.72), (0.78, 0.30))  # corners of the mark, in parts of the box


class CheckBox(QCheckBox):
    """A `QCheckBox` with a drawn check mark: colour alone is not accessible."""

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        super().paintEvent(event)
        if not self.isChecked():
            return
        option = QStyleOptionButton()
        self.initStyleOption(option)
        box = self.style().subElementRect(QStyle.SubElement.SE_CheckBoxIndicator, option, self)
        enabled = self.isEnabled()
        group = QPalette.ColorGroup.Active if enabled else QPalette.ColorGroup.Disabled
        role = QPalette.ColorRole.HighlightedText if enabled else QPalette.ColorRole.Text
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(self.palette().color(group, role), 2.0, Qt.PenStyle.SolidLine))
        painter.drawPolyline(
            [QPointF(box.x() + x * box.width(), box.y() + y * box.height()) for x, y in _MARK]
        )
        painter.end()


class ComboBox(QComboBox):
    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        super().paintEvent(event)
        group = QPalette.ColorGroup.Active if self.isEnabled() else QPalette.ColorGroup.Disabled
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(self.palette().color(group, QPalette.ColorRole.Text), 1.5, Qt.PenStyle.SolidLine))
        x, y = self.width() - 16.0, self.height() / 2.0
        painter.drawPolyline([QPointF(x - 4.0, y - 2.0), QPointF(x, y + 2.0), QPointF(x + 4.0, y - 2.0)])
        painter.end()


class ProgressBar(QProgressBar):
    """Bar without text; hidden while nothing goes on."""

    def __init__(self) -> None:
        super().__init__()
        self.setTextVisible(False)

    def show_progress(self, progress: Progress | None) -> None:
        self.setVisible(progress is not None)
        if progress is not None:
            self.setRange(0, 0 if progress.fraction is None else 1000)
            self.setValue(round(1000 * (progress.fraction or 0.0)))


def make_button(
    text: str, act: Callable[[], object], hint: str = "", *, large: bool = False, primary: bool = False
) -> QPushButton:
    button = QPushButton(text)
    set_tool_tip(button, hint)
    if large:
        button.setProperty("scale", "large")
    if primary:
        button.setProperty("primary", "true")
    button.clicked.connect(lambda _checked: act())
    return button


def make_primary_button(text: str) -> QPushButton:
    button = QPushButton(text)
    button.setProperty("primary", "true")
    return button


def make_text_view(name: str) -> QPlainTextEdit:
    """Make a read-only view of unwrapped lines in a fixed font, with an accessible name."""
    view = QPlainTextEdit()
    view.setReadOnly(True)
    view.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
    view.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
    view.setTabChangesFocus(True)
    view.setAccessibleName(name)
    return view


def make_choice(items: Mapping[Any, str]) -> ComboBox:
    """Make a combo box of values (its data) and their titles, which are translated."""
    box = ComboBox()
    for value, title in items.items():
        box.addItem(gettext(title), value)
    return box


def ask_for_folder(parent: QWidget, title: str, start: str, choose: Callable[[str], object]) -> None:
    """Let the operator choose a folder; nothing waits for the dialog."""
    dialog = QFileDialog(parent, title, start)
    dialog.setFileMode(QFileDialog.FileMode.Directory)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    connect_chosen(dialog, choose)
    dialog.open()


def connect_chosen(dialog: QFileDialog, choose: Callable[[str], object]) -> None:
    """Pass on the chosen path as the system writes it: Qt has `/` on Windows too."""
    dialog.fileSelected.connect(lambda path: choose(QDir.toNativeSeparators(path)))


def ask(parent: QWidget, text: str, detail: str, action: str, act: Callable[[], object]) -> None:
    """Ask before `act`, whose button is `action`; Cancel is the default, and nothing waits for the answer."""
    box = QMessageBox(QMessageBox.Icon.Warning, "Slipstand", text, parent=parent)
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setInformativeText(detail)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.addButton(action, QMessageBox.ButtonRole.AcceptRole).clicked.connect(lambda _checked: act())
    cancel = box.addButton(gettext("Cancel"), QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(cancel)
    box.setEscapeButton(cancel)
    box.open()


ESCAPE = frozenset({Qt.Key.Key_Escape})
ESCAPE_AND_ENTER = ESCAPE | {Qt.Key.Key_Return, Qt.Key.Key_Enter}


class ShortcutSafeEdit(QLineEdit):
    """Line edit that some keys leave, even if they are shortcuts of the screen."""

    left = Signal()

    def __init__(self, leaves: Collection[Qt.Key] = ESCAPE) -> None:
        super().__init__()
        self._leaves = leaves

    def event(self, event: QEvent) -> bool:
        leaves = isinstance(event, QKeyEvent) and event.key() in self._leaves
        if leaves and event.type() == QEvent.Type.ShortcutOverride:
            event.accept()
            return True
        if leaves and event.type() == QEvent.Type.KeyPress:
            self.left.emit()
            return True
        return super().event(event)


def show_texts(fields: Mapping[str, QLineEdit], form: object) -> None:
    """Show the texts of a form by the names of its fields; a field with the same text keeps its cursor."""
    for name, field in fields.items():
        if field.text() != getattr(form, name):
            field.setText(getattr(form, name))


def show_default(field: QLineEdit, text: str) -> None:
    """Show in an empty field the value that is used then, in the colour of values: examples are grey."""
    field.setPlaceholderText(text)
    set_property(field, "shows", "default")


def make_fields(texts: Mapping[str, tuple[str, str]], edited: Callable[[], object]) -> dict[str, QLineEdit]:
    """Make line edits by name; the second of each pair of texts stands in the empty field."""
    fields = {name: QLineEdit() for name in texts}
    for name, field in fields.items():
        field.setPlaceholderText(gettext(texts[name][1]))
        field.textEdited.connect(lambda _text: edited())
    return fields
