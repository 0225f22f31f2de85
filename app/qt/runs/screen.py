"""The Runs screen: search above, table at the left, preview and facts at the right, actions below."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QDir, Qt
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QFileDialog, QLineEdit, QStackedWidget, QWidget

from app.presenters.runs.presenter import RUN_SUFFIX, RunsPresenter
from app.presenters.runs.state import RunFilter, RunsState, StatusFilter
from app.qt.runs.preview import RunsPreview
from app.qt.runs.selected_runs import ActionBar, MetadataEditor
from app.qt.runs.table import RunsTable
from app.qt.theme import TextRole, Theme
from app.qt.widgets.folder_button import FolderButton
from app.qt.widgets.inputs import ComboBox, ask, make_button, make_choice
from app.qt.widgets.layouts import make_column, make_frame, make_row
from app.qt.widgets.shortcuts import add_shortcut, bind_button
from app.qt.widgets.text import label, set_tool_tip
from app.runs.exchange.formats import SUFFIXES
from messages.i18n import N_, gettext, ngettext

if TYPE_CHECKING:
    from app.qt.window import MainWindow

_COLUMN_SHARE = 0.28
_COLUMN_WIDTHS = (344, 620)
_ALL_SERIES = N_("All series")


class RunsScreen(QWidget):
    """Draws `RunsState`; `dialogs` opens those for export and import."""

    def __init__(self, theme: Theme, presenter: RunsPresenter, dialogs: "MainWindow") -> None:
        super().__init__()
        self._presenter = presenter
        self._dialogs = dialogs
        self._shown: RunsState | None = None
        self._text = QLineEdit()
        self._series = ComboBox()
        self._status = make_choice({status: status.value for status in StatusFilter})
        self._count = label(muted=True)
        self._import = make_button(gettext("Import…"), self._choose_files)
        title = gettext("Show the runs of a folder")
        self._folder = FolderButton(title, lambda: presenter.recent_folders, presenter.choose_folder)
        self._trash = make_button("", self._toggle_trash)
        self._table = RunsTable(theme)
        self._empty = label(role=TextRole.HEADING, muted=True, wrap=True)
        self._middle = QStackedWidget()
        self._preview = RunsPreview(theme)
        self._metadata = MetadataEditor()
        side = QWidget()
        make_column((self._preview, 1), self._metadata, spacing=6, of=side)
        self._side = make_frame(side)
        self._actions = ActionBar(presenter, dialogs.ask_for_export, self._ask_to_empty)
        self._lay_out()
        self._connect()
        self.setAcceptDrops(True)

    def show_state(self, state: RunsState) -> None:
        old, self._shown = self._shown, state
        if old is None or state.all_series != old.all_series:
            self._series.clear()
            self._series.addItems([gettext(_ALL_SERIES), *state.all_series])
            self._show_wanted(state.filter)
        if old is not None and state.filter != old.filter:
            self._show_wanted(state.filter)
        if old is None or state.rows is not old.rows or state.selected != old.selected:
            self._table.show_rows(state.rows, state.selected)
        self._table.show_order(state.sorted_by, descending=state.descending)
        self._trash.setText(gettext("Show runs") if state.in_trash else gettext("Show trash"))
        self._import.setEnabled(not state.in_trash)
        self._show_middle(state)
        if old is None or state.overlay is not old.overlay:
            self._preview.show_overlay(state.overlay)
        if old is None or state.metadata != old.metadata:
            self._metadata.show_metadata(state.metadata)
        self._actions.show_state(state)

    def _show_wanted(self, wanted: RunFilter) -> None:
        self._series.setCurrentText(wanted.series or gettext(_ALL_SERIES))
        self._status.setCurrentText(gettext(wanted.status.value))
        if self._text.text() != wanted.text:
            self._text.setText(wanted.text)

    def focus_search(self) -> None:
        self._text.setFocus()
        self._text.selectAll()

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        super().showEvent(event)
        self.take_focus()

    def take_focus(self) -> None:
        (self._table if self._table.isVisible() else self).setFocus()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        narrowest, widest = _COLUMN_WIDTHS
        self._side.setFixedWidth(min(max(round(self.width() * _COLUMN_SHARE), narrowest), widest))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: N802
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: N802
        paths = tuple(url.toLocalFile() for url in event.mimeData().urls() if url.isLocalFile())
        if paths:
            self._take_files(paths)

    def _take_files(self, paths: Sequence[str]) -> None:
        if self._presenter.add_files(tuple(map(QDir.toNativeSeparators, paths))):
            self._dialogs.show_import()

    def _choose_files(self) -> None:
        dialog = QFileDialog(
            self, gettext("Import records of other programs"), self._presenter.recent.import_folder
        )
        endings = " ".join(f"*{suffix}" for suffix in (*SUFFIXES, RUN_SUFFIX))
        dialog.setNameFilters([gettext("Records ({endings})", endings=endings), gettext("All files (*)")])
        dialog.setFileMode(QFileDialog.FileMode.ExistingFiles)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.filesSelected.connect(self._take_files)
        dialog.open()

    def _toggle_trash(self) -> None:
        self._presenter.show_trash(not self._presenter.state.in_trash)

    def _ask_to_empty(self) -> None:
        count = self._presenter.state.total
        text = ngettext("Delete {count} run for ever?", "Delete {count} runs for ever?", count)
        detail = gettext(
            "The trash of {folder} is emptied. Nothing brings a deleted run back.",
            folder=self._presenter.state.folder,
        )
        delete = ngettext("Delete {count} run", "Delete {count} runs", count)
        ask(self, text, detail, delete, self._presenter.empty_trash)

    def _show_middle(self, state: RunsState) -> None:
        count = ngettext("{count} run", "{count} runs", state.total)
        if state.in_trash:
            count = gettext("Trash: {runs}", runs=count)
        if state.filter != RunFilter():
            count = gettext("{shown} of {total}", shown=len(state.rows), total=count)
        self._count.setText(count if state.is_listed else "")
        hint = gettext("{folder}\nShow the runs of another folder (Ctrl+L)", folder=state.folder)
        set_tool_tip(self._folder, hint)
        self._folder.folder = state.folder
        self._empty.setText(_empty_text(state))
        was_empty = self._middle.currentIndex() == 1
        self._middle.setCurrentIndex(0 if state.rows else 1)
        if state.rows and was_empty and not self._text.text():
            self._table.setFocus()

    def _apply_filter(self) -> None:
        series = self._series.currentText() if self._series.currentIndex() > 0 else ""
        status = StatusFilter(self._status.currentData())
        self._presenter.set_filter(RunFilter(self._text.text(), series, status))

    def _connect(self) -> None:
        for changed in (self._text.textChanged, self._series.activated, self._status.activated):
            changed.connect(lambda _: self._apply_filter())
        bind_button(self._trash, "Ctrl+T", gettext("Runs in the trash, or those of the folder again"), self)
        bind_button(self._import, "Ctrl+I", gettext("Records of other programs, which become runs"), self)
        self._table.selected.connect(self._presenter.select)
        self._table.sort_requested.connect(self._presenter.sort_by)
        self._table.open_requested.connect(self._presenter.open_selected)
        self._preview.zoomed.connect(self._presenter.zoom_overlay)
        self._metadata.edited.connect(self._presenter.edit)
        add_shortcut(self, "Ctrl+F", gettext("Search"), self.focus_search)
        add_shortcut(self, "Ctrl+L", gettext("Show the runs of another folder"), self._folder.ask)
        add_shortcut(self, "F5", gettext("Look into the folder again"), self._presenter.refresh)
        self._actions.add_keys(self, self._table)

    def _lay_out(self) -> None:
        self._text.setPlaceholderText(gettext("Search name, series, operator, note   Ctrl+F"))
        self._text.setClearButtonEnabled(True)
        self._text.setAccessibleName(gettext("Search"))
        self._series.setAccessibleName(gettext("Series"))
        self._status.setAccessibleName(gettext("Which runs"))
        top = make_row(
            (self._text, 1),
            self._series,
            self._status,
            self._count,
            self._import,
            self._folder,
            self._trash,
            spacing=8,
        )
        self._middle.addWidget(self._table)
        self._empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._empty.setContentsMargins(24, 24, 24, 24)
        self._middle.addWidget(self._empty)
        middle = make_row((make_frame(self._middle), 1), self._side, spacing=8)
        make_column(top, (middle, 1), self._actions, spacing=8, margins=(8, 8), of=self)


def _empty_text(state: RunsState) -> str:
    if not state.is_listed:
        return gettext("Looking into the folder")
    if state.in_trash and not state.total:
        return gettext("The trash of {folder} is empty.", folder=state.folder)
    if state.total:
        return gettext("No run is like that. Change the words above, or choose All runs.")
    return gettext(
        "There are no runs in {folder} yet. Record a pullback, drop files here, or choose another folder.",
        folder=state.folder,
    )
