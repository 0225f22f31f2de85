"""Pictures and tables of plots: copied, or saved as PNG, SVG or CSV."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QPoint, QRect, QSaveFile, QStandardPaths, Qt
from PySide6.QtGui import QGuiApplication, QPainter
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QFileDialog, QGraphicsItem, QGraphicsView, QMessageBox, QWidget

from app.presenters.curve_table import CurveTableError, TableCurve, csv_text
from messages.i18n import N_, gettext, translate
from messages.message import message

FORMATS = {"png": N_("Pictures (*.png)"), "svg": N_("Drawings (*.svg)"), "csv": N_("Tables (*.csv)")}
_RESOLUTION_DPI = 96
"""Of SVG: its units are then the pixels of the screen."""

_chosen_folders: list[str] = []
"""The folder into which the last plot was saved; none at first."""


def copy_picture(shown: QWidget) -> None:
    QGuiApplication.clipboard().setPixmap(shown.grab())


def ask_for_file(
    parent: QWidget,
    suffix: str,
    name: str,
    content: Callable[[], bytes],
    written: Callable[[Path], object],
) -> None:
    """Let the operator choose a file, write the content into it, and call `written`; a fault is shown.

    The folder chosen last is offered.
    """
    documents = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
    dialog = QFileDialog(parent, gettext("Save"), _chosen_folders[-1] if _chosen_folders else documents)
    dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
    dialog.setNameFilter(gettext(FORMATS[suffix]))
    dialog.setDefaultSuffix(suffix)
    dialog.selectFile(f"{name}.{suffix}")
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.fileSelected.connect(lambda path: _save(parent, Path(path), content, written))
    dialog.open()


def png(shown: QWidget) -> bytes:
    return _written(lambda device: shown.grab().save(device, "PNG"))


def svg(shown: QWidget) -> bytes:
    """Drawing of a widget, with lines as lines and text as text."""
    return _written(lambda device: _draw(shown, device))


def csv(curves: Sequence[TableCurve]) -> bytes:
    """Raise CurveTableError where there is nothing to write, or too much."""
    return csv_text(curves).encode("utf-8-sig")  # spreadsheets take other UTF-8 for an old encoding


def _written(write: Callable[[QIODevice], object]) -> bytes:
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    write(buffer)
    return bytes(buffer.data().data())


def _draw(shown: QWidget, device: QIODevice) -> None:
    drawing = QSvgGenerator()
    drawing.setOutputDevice(device)
    drawing.setResolution(_RESOLUTION_DPI)
    drawing.setSize(shown.size())
    drawing.setViewBox(QRect(0, 0, shown.width(), shown.height()))
    with _without_pictures(shown):
        painter = QPainter(drawing)
        shown.render(painter, QPoint())
        painter.end()


@contextmanager
def _without_pictures(shown: QWidget) -> Iterator[None]:
    """Let the items of plots be drawn themselves, not the pictures of them that Qt keeps."""
    items = [item for view in shown.findChildren(QGraphicsView) for item in view.items()]
    kept = [(item, item.cacheMode()) for item in items]
    for item in items:
        item.setCacheMode(QGraphicsItem.CacheMode.NoCache)
    try:
        yield
    finally:
        for item, mode in kept:
            item.setCacheMode(mode)


def _save(
    parent: QWidget, path: Path, content: Callable[[], bytes], written: Callable[[Path], object]
) -> None:
    try:
        data = content()
    except CurveTableError as error:
        _tell(parent, translate(error.message))
        return
    file = QSaveFile(str(path))
    if file.open(QIODevice.OpenModeFlag.WriteOnly) and file.write(data) == len(data) and file.commit():
        _chosen_folders[:] = [str(path.parent)]
        written(path)
    else:
        fault = message(
            "{path} could not be written: {reason}. Choose another place",
            path=str(path),
            reason=file.errorString(),
        )
        _tell(parent, translate(fault))


def _tell(parent: QWidget, text: str) -> None:
    box = QMessageBox(QMessageBox.Icon.Warning, gettext("Save"), text, parent=parent)
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.open()
