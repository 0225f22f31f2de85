"""The export dialog: format, content and target, with a preview. It does not block the window."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QFileDialog, QGridLayout, QLineEdit, QWidget

from app.presenters.base import Chip
from app.presenters.runs.export_presenter import CONTENTS, FORMATS, ExportPresenter, ExportState
from app.qt.theme import TextRole
from app.qt.widgets import inputs
from app.qt.widgets.folder_button import OpenFolderButton
from app.qt.widgets.layouts import make_column, make_form_grid, make_row
from app.qt.widgets.text import label, set_text_or_hide, set_tool_tip, show_chip
from messages.i18n import gettext, ngettext


class ExportDialog(QDialog):
    """Draws `ExportState`."""

    def __init__(self, presenter: ExportPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._shown = ExportState()
        self._title = label(role=TextRole.HEADING)
        self._format = inputs.make_choice(FORMATS)
        self._content = inputs.ComboBox()
        self._output = QLineEdit()
        self._browse = inputs.make_button(gettext("Browse…"), self._choose_output)
        self._replace = inputs.CheckBox(gettext("Replace existing files"))
        self._preview = inputs.make_text_view(gettext("Preview"))
        self._bar = inputs.ProgressBar()
        self._message = label(wrap=True)
        self._details = label(muted=True, wrap=True)
        self._open_folder = OpenFolderButton()
        self._export = inputs.make_primary_button(gettext("Export"))
        self._export.setDefault(True)
        self._lay_out()
        self._connect()

    def show_state(self, state: ExportState) -> None:
        old, self._shown = self._shown, state
        count = len(state.runs)
        what = Path(state.runs[0]).stem if count == 1 else ngettext("{count} run", "{count} runs", count)
        self._title.setText(gettext("Export {what}", what=what) if count else "")
        self._format.setCurrentIndex(self._format.findData(state.format))
        if state.contents != old.contents or not self._content.count():
            self._content.clear()
            for name in state.contents:
                self._content.addItem(gettext(CONTENTS[name]), name)
        self._content.setCurrentIndex(self._content.findData(state.content))
        if self._output.text() != state.output:
            self._output.setText(state.output)
        set_tool_tip(
            self._output,
            gettext("A folder, made if it is not there") if state.is_folder else gettext("The file to write"),
        )
        self._replace.setChecked(state.replace)
        self._preview.setPlainText(state.preview or gettext("Making a preview"))
        self._show_work(state)

    def _show_work(self, state: ExportState) -> None:
        self._bar.show_progress(state.progress)
        show_chip(self._message, Chip(state.progress.text) if state.progress is not None else state.message)
        set_text_or_hide(self._details, "\n".join(state.details))
        self._open_folder.show_folder(state.written_to)
        self._export.setEnabled(state.progress is None)

    def _choose_output(self) -> None:
        if self._shown.is_folder:
            inputs.ask_for_folder(self, gettext("Export to"), self._shown.output, self._presenter.set_output)
            return
        dialog = QFileDialog(self, gettext("Export to"), self._shown.output)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setOption(QFileDialog.Option.DontConfirmOverwrite)  # the box below says whether
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        inputs.connect_chosen(dialog, self._presenter.set_output)
        dialog.open()

    def _connect(self) -> None:
        self._format.activated.connect(lambda _: self._presenter.set_format(self._format.currentData()))
        self._content.activated.connect(lambda _: self._presenter.set_content(self._content.currentData()))
        self._output.textEdited.connect(self._presenter.set_output)
        self._replace.toggled.connect(self._presenter.set_replace)
        self._export.clicked.connect(lambda _checked: self._presenter.export())

    def _lay_out(self) -> None:
        self.setWindowTitle(gettext("Export"))
        self.resize(720, 560)
        close = inputs.make_button(gettext("Close"), self.close)
        buttons = make_row((self._bar, 1), self._export, close, spacing=8)
        buttons.insertStretch(1, 0)
        make_column(
            self._title,
            self._form(),
            label(gettext("Preview of the first run"), TextRole.LABEL, muted=True),
            (self._preview, 1),
            make_row((self._message, 1), self._open_folder, spacing=8),
            self._details,
            buttons,
            spacing=12,
            margins=(16, 16),
            of=self,
        )

    def _form(self) -> QGridLayout:
        place = QWidget()
        make_row((self._output, 1), self._browse, spacing=8, of=place)
        place.setFocusProxy(self._output)
        fields = ((gettext("Format"), self._format), (gettext("Content"), self._content))
        form = make_form_grid((*fields, (gettext("To"), place)))
        self._output.setAccessibleName(gettext("To"))
        form.addWidget(self._replace, form.rowCount(), 1)
        return form
