"""Export of the run on Identify: report as PDF or on paper, samples and coefficients, folder."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFileDialog, QMenu, QPushButton, QWidget

from app.presenters.identify.report import ReportPresenter, ReportState
from app.qt.widgets.folder_button import OpenFolderButton
from app.qt.widgets.inputs import connect_chosen
from app.qt.widgets.layouts import STRETCH, make_row
from app.qt.widgets.shortcuts import add_shortcut
from app.qt.widgets.text import label, set_tool_tip, show_chip
from messages.i18n import gettext


class ExportMenu(QPushButton):
    """Button with a menu; `export_run` opens the dialog for samples and coefficients of a run."""

    def __init__(self, presenter: ReportPresenter, export_run: Callable[[str], None]) -> None:
        super().__init__(gettext("Export…"))
        self._presenter = presenter
        self._export_run = export_run
        menu = QMenu(self)
        menu.addAction(gettext("Report as PDF…")).triggered.connect(self._ask_for_target)
        self._print = menu.addAction(gettext("Print report…"))
        self._print.triggered.connect(self._ask_to_print)
        menu.addAction(gettext("Samples and coefficients…")).triggered.connect(self._ask_for_export)
        menu.addAction(gettext("Open folder")).triggered.connect(self._open_folder)
        self.setMenu(menu)

    def add_keys(self, screen: QWidget) -> None:
        words = gettext("Report, samples and coefficients, folder of the run")
        add_shortcut(screen, "Ctrl+E", words, self.click)
        add_shortcut(screen, "Ctrl+P", gettext("Print the report of the run"), self._print.trigger)
        set_tool_tip(self, f"{words} (Ctrl+E)")

    def show_state(self, state: ReportState) -> None:
        self.setEnabled(bool(state.run) and not state.is_busy)
        self._print.setEnabled(self.isEnabled())

    def _ask_for_target(self) -> None:
        target = Path(self._presenter.proposed_target)
        # The folder apart: of the file selected, the dialog of Windows takes the name only.
        dialog = QFileDialog(self, gettext("Report"), str(target.parent), gettext("Reports (*.pdf)"))
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix("pdf")
        dialog.selectFile(target.name)
        connect_chosen(dialog, self._presenter.write)
        dialog.open()

    def _ask_to_print(self) -> None:
        from app.qt.printing import ask_to_print  # its import loads the printers

        name = Path(self._presenter.state.run).stem
        self._presenter.render(lambda pages: ask_to_print(self, name, pages))

    def _ask_for_export(self) -> None:
        self._export_run(self._presenter.state.run)

    def _open_folder(self) -> None:
        folder = Path(self._presenter.state.run).parent
        QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder)))


class ReportLine(QWidget):
    """What is being written or was written; hidden if empty."""

    def __init__(self) -> None:
        super().__init__()
        self._message = label()
        self._open_folder = OpenFolderButton()
        make_row(self._message, self._open_folder, STRETCH, spacing=8, margins=(4, 0), of=self)

    def show_state(self, state: ReportState) -> None:
        self.setVisible(bool(state.message.text))
        show_chip(self._message, state.message)
        self._open_folder.show_folder(state.written_to)
