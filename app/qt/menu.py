"""The menu of the program, and the dialog About."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QUrl, qVersion
from PySide6.QtGui import QDesktopServices, QGuiApplication
from PySide6.QtWidgets import QDialog, QGridLayout, QMenu, QToolButton, QWidget

from app.log import log_folder
from app.presenters import about
from app.qt.theme import TextRole
from app.qt.widgets.inputs import make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row, make_scroll_area
from app.qt.widgets.text import label
from messages.i18n import gettext

_SIZE = 560, 520


def fill_menu(button: QToolButton, window: QWidget, show_keys: Callable[[], object]) -> None:
    """Give a button the menu of the program, which opens at a click."""
    menu = QMenu(button)
    menu.addAction(gettext("Keys")).triggered.connect(show_keys)
    if address := about.documentation():
        menu.addAction(gettext("Documentation")).triggered.connect(lambda: open_address(address))
    menu.addAction(gettext("Log file")).triggered.connect(open_log)
    menu.addAction(gettext("About Slipstand")).triggered.connect(lambda: AboutDialog(window).show())
    menu.addSeparator()
    menu.addAction(gettext("Quit")).triggered.connect(window.close)
    menu.aboutToHide.connect(lambda: button.setAttribute(Qt.WidgetAttribute.WA_UnderMouse, on=False))
    menu.aboutToHide.connect(button.update)  # Qt would draw the pointer over it until it comes again
    button.setMenu(menu)
    button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)


def open_address(address: str) -> None:
    """Open a file or an address of the web in the system's program for it."""
    QDesktopServices.openUrl(QUrl.fromLocalFile(address) if Path(address).exists() else QUrl(address))


def open_log() -> None:
    """Open the log of the window, or the folder of the logs while nothing was logged."""
    file = about.log_file()
    open_address(str(file if file.exists() else log_folder()))


class AboutDialog(QDialog):
    """Version, licences and libraries. It does not block the window."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        ours, *others = about.components()
        title = label(f"{ours.name} {ours.version}", TextRole.HEADING)
        text = gettext("Measures dry friction on a laboratory shaking stand.")
        licence = gettext("Licence: {licence}. It comes without warranty.", licence=ours.licence)
        qt = gettext("The window is made with Qt {version}, under the LGPL 3.", version=qVersion())
        copy = make_button(gettext("Copy versions"), _copy_versions)
        close = make_button(gettext("Close"), self.close)
        make_column(
            title,
            label(f"{text} {licence}", wrap=True),
            label(qt, wrap=True),
            (make_scroll_area(_table(others), is_column=False, name=gettext("Libraries and licences")), 1),
            make_row(STRETCH, copy, close, spacing=8),
            spacing=12,
            margins=(16, 16),
            of=self,
        )
        self.setWindowTitle(gettext("About Slipstand"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.resize(*_SIZE)
        close.setFocus()


def _table(parts: list[about.Component]) -> QWidget:
    page = QWidget()
    grid = QGridLayout(page)
    grid.setContentsMargins(8, 8, 8, 8)  # clear of the focus ring
    grid.setHorizontalSpacing(16)
    grid.setColumnStretch(2, 1)
    for row, part in enumerate(parts):
        grid.addWidget(label(part.name), row, 0)
        grid.addWidget(label(part.version, muted=True), row, 1)
        grid.addWidget(label(part.licence, muted=True, wrap=True), row, 2)
    return page


def _copy_versions() -> None:
    QGuiApplication.clipboard().setText(about.versions_text())
