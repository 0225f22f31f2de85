"""Printing of typeset pages."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QImage, QPageLayout, QPainter
from PySide6.QtPrintSupport import QPrintDialog, QPrinter
from PySide6.QtWidgets import QWidget


def ask_to_print(parent: QWidget, name: str, pages: Sequence[bytes]) -> None:
    """Let the operator choose a printer for pages (PNG images); nothing waits for the dialog."""
    printer = QPrinter(QPrinter.PrinterMode.HighResolution)
    printer.setDocName(name)
    dialog = QPrintDialog(printer, parent)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.accepted.connect(lambda: print_pages(printer, pages))
    dialog.setWindowModality(Qt.WindowModality.WindowModal)
    dialog.show()


def print_pages(printer: QPrinter, pages: Sequence[bytes]) -> None:
    """Print pages, each on a sheet of its own that is turned as the page is."""
    printer.setFullPage(True)  # the pages have margins
    painter = QPainter()
    for number, page in enumerate(pages):
        image = QImage.fromData(page)
        is_wide = image.width() > image.height()
        printer.setPageOrientation(
            QPageLayout.Orientation.Landscape if is_wide else QPageLayout.Orientation.Portrait
        )
        if number == 0:
            painter.begin(printer)
        else:
            printer.newPage()
        sheet = painter.viewport()
        size = image.size().scaled(sheet.size(), Qt.AspectRatioMode.KeepAspectRatio)
        sheet.setSize(size)
        painter.drawImage(sheet, image)
    painter.end()
