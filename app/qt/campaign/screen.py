"""The Campaign screen: Table 1 as it fills, Fig. 2 below it, what all runs say at the right."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QFrame, QMenu, QPushButton, QStackedWidget, QVBoxLayout, QWidget

from app.presenters.base import EMPTY_CHIP, Chip, Progress, Tone
from app.presenters.campaign.presenter import CampaignPresenter
from app.presenters.campaign.state import CampaignState, CampaignSummary, Product
from app.qt.campaign.friction_plot import FrictionPlot
from app.qt.campaign.sections import SelectedRuns, make_sections
from app.qt.campaign.table import SeriesTable
from app.qt.theme import TextRole, Theme
from app.qt.widgets.folder_button import FolderButton, OpenFolderButton
from app.qt.widgets.inputs import CheckBox, ProgressBar, ask_for_folder, connect_chosen, make_button
from app.qt.widgets.layouts import STRETCH, clear, make_column, make_frame, make_row, make_scroll_area
from app.qt.widgets.shortcuts import add_shortcut, bind_button
from app.qt.widgets.text import ElidedLabel, break_path, label, set_tool_tip, show_chip
from app.reports.table.formats import FORMAT_OF_ENDING
from messages.i18n import N_, gettext, ngettext

_COLUMN_WIDTH = 360
_TABLE_SHARE, _FIGURE_SHARE = 3, 2
_WORDS_WIDTH = 200
_TARGETS: dict[Product, tuple[str, tuple[str, ...]]] = {
    Product.TABLE: ("table-1", tuple(FORMAT_OF_ENDING)),
    Product.FIGURES: ("", ()),
    Product.REPORT: ("report", (".pdf",)),
}
"""Proposed name and endings; a folder has none. Each has a filter: Windows appends its first ending."""


class CampaignScreen(QWidget):
    """Draws `CampaignState`."""

    def __init__(self, theme: Theme, presenter: CampaignPresenter) -> None:
        super().__init__()
        self._presenter = presenter
        self._shown = CampaignState("", CampaignSummary(()))
        self._title = label(role=TextRole.HEADING)
        self._message = label()
        self._open_folder = OpenFolderButton()
        self._working = _Working(presenter)
        self._simulated = label(role=TextRole.STRONG)
        self._count_simulated = CheckBox("")
        self._count_simulated.clicked.connect(presenter.navigator.count_simulated)
        hint = gettext("In the table, the figures and what is exported, beside recorded runs")
        set_tool_tip(self._count_simulated, hint)
        self._keep = make_button("", presenter.save_results)
        set_tool_tip(self._keep, gettext("Keep new results in their runs: the next gathering is quicker"))
        self._export = QPushButton(gettext("Export…"))
        self._undo = make_button(gettext("Undo"), presenter.undo)
        title = gettext("Gather the runs of a folder")
        self._folder = FolderButton(title, lambda: presenter.recent_folders, presenter.choose_folder)
        refresh = make_button(gettext("Refresh"), presenter.refresh)
        self._table = SeriesTable(theme)
        self._table.row_selected.connect(presenter.select_series)
        self._table.row_opened.connect(presenter.open_row)
        self._ahead = ElidedLabel()
        self._plot = FrictionPlot(theme)
        self._chosen = SelectedRuns(presenter)
        self._sections = QVBoxLayout()
        self._empty = _Empty(presenter, self._folder.ask)
        self._stack = QStackedWidget()
        self._stack.addWidget(self._make_page())
        self._stack.addWidget(self._empty)
        buttons = (self._keep, self._export, self._undo, self._folder, refresh)
        sources = (self._simulated, self._count_simulated)
        top = make_row(self._title, *sources, (self._working, 1), *buttons, spacing=8, margins=(4, 0))
        make_column(
            top,
            make_row(self._message, self._open_folder, STRETCH, spacing=8),
            (self._stack, 1),
            spacing=8,
            margins=(8, 8),
            of=self,
        )
        menu = QMenu(self)
        for product in Product:
            action = menu.addAction(gettext(product.value))
            action.triggered.connect(partial(self._ask_for_target, product))
        self._export.setMenu(menu)
        add_shortcut(self, "Ctrl+E", gettext("Export table, figures or report"), self._export.showMenu)
        bind_button(self._undo, "Ctrl+Z", gettext("Take back the last leaving out or taking in"), self)
        bind_button(refresh, "F5", gettext("Gather the folder again"), self)
        add_shortcut(self, "Ctrl+L", gettext("Gather another folder"), self._folder.ask)

    def show_state(self, state: CampaignState) -> None:
        old, self._shown = self._shown, state
        summary, before = state.summary, old.summary
        self._show_head(state)
        is_empty = not summary.run_count and not summary.faults
        self._stack.setCurrentIndex(1 if is_empty else 0)
        if is_empty:
            self._empty.show_state(state)
        if state.columns != old.columns:
            self._table.show_columns(state.columns)
        if summary.rows != before.rows:
            self._table.show_rows(tuple(row for row in summary.rows if not row.is_empty))
            ahead = _series_ahead(summary)
            self._ahead.set_line(ahead)
            self._ahead.setVisible(bool(ahead))
        if summary.contacts != before.contacts:
            self._plot.show_contacts(summary.contacts)
        if (state.selected, state.selected_runs) != (old.selected, old.selected_runs):
            self._chosen.show_runs(state.selected, state.selected_runs)
        if summary != before:
            clear(self._sections)
            self._sections.addWidget(make_sections(summary, self._presenter))
        if len(summary.excluded) > len(before.excluded) and old.is_gathered:
            self._chosen.clear_reason()
            self._table.setFocus()  # in the field of the reason Ctrl+Z would take back letters

    def _show_head(self, state: CampaignState) -> None:
        summary = state.summary
        counted = ngettext("{count} run", "{count} runs", summary.run_count)
        of_all = gettext("Campaign: {runs} in {series} series", runs=counted, series=summary.series_count)
        self._title.setText(of_all if summary.run_count else gettext("Campaign"))
        self._folder.folder = state.folder
        set_tool_tip(self._folder, gettext("{folder}\nGather another folder (Ctrl+L)", folder=state.folder))
        self._keep.setText(ngettext("Keep {count} result", "Keep {count} results", summary.unsaved_count))
        self._keep.setVisible(summary.unsaved_count > 0 and state.progress is None)
        self._undo.setEnabled(bool(state.undo_text))
        self._export.setEnabled(summary.run_count > 0 and state.progress is None)
        self._working.show_progress(state.progress)
        show_chip(self._message, state.message)
        show_chip(self._simulated, _simulated_chip(summary))
        self._count_simulated.setVisible(summary.is_mixed)
        self._count_simulated.setChecked(summary.simulated_counts)
        text = ngettext("{count} simulated run", "{count} simulated runs", summary.simulated_count)
        self._count_simulated.setText(text)
        self._open_folder.show_folder(state.written_to)

    def _ask_for_target(self, product: Product) -> None:
        name, endings = _TARGETS[product]
        export = partial(self._presenter.export, product)
        folder = self._presenter.recent.export_folder or self._shown.folder
        if not endings:
            ask_for_folder(self, gettext("Export"), folder, export)
            return
        dialog = QFileDialog(self, gettext("Export"), folder)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        filters = [f"{ending[1:].upper()} (*{ending})" for ending in endings]
        dialog.setNameFilters(filters)

        def propose(chosen: str) -> None:
            ending = endings[filters.index(chosen)]
            typed = [Path(path) for path in dialog.selectedFiles()]
            stem = typed[0].stem if typed and typed[0].suffix else name
            dialog.setDefaultSuffix(ending)
            dialog.selectFile(f"{stem}{ending}")

        propose(filters[0])
        dialog.filterSelected.connect(propose)
        connect_chosen(dialog, export)
        dialog.open()

    def _make_page(self) -> QWidget:
        page = QWidget()
        ahead = make_row((self._ahead, 1), margins=(8, 4))
        table = make_column((self._table, 1), ahead)
        tables, figures = (make_frame(table), _TABLE_SHARE), (make_frame(self._plot), _FIGURE_SHARE)
        left = make_column(tables, figures, spacing=8)
        content = QWidget()
        make_column(self._chosen, (self._sections, 1), of=content)
        side = make_frame(make_scroll_area(content))
        side.setFixedWidth(_COLUMN_WIDTH)
        make_row((left, 1), side, spacing=8, of=page)
        return page


def _simulated_chip(summary: CampaignSummary) -> Chip:
    if not summary.simulated_counts:
        return EMPTY_CHIP
    if summary.is_mixed:
        return Chip(gettext("SIMULATED and recorded"), Tone.WARN)
    return Chip(gettext("SIMULATED"), Tone.WARN)


def _series_ahead(summary: CampaignSummary) -> str:
    ahead = [row.label for row in summary.rows if row.is_empty]
    if not ahead:
        return ""
    return ngettext(
        "{count} series has no run yet: {names}",
        "{count} series have no run yet: {names}",
        len(ahead),
        names=", ".join(ahead),
    )


class _Working(QWidget):
    """A bar with words and Cancel, while something goes on."""

    def __init__(self, presenter: CampaignPresenter) -> None:
        super().__init__()
        self._words = label(muted=True)
        self._bar = ProgressBar()
        self._bar.setMaximumWidth(200)
        self._cancel = make_button(gettext("Cancel"), presenter.cancel)
        layout = make_row(self._words, (self._bar, 1), self._cancel, spacing=12, margins=(12, 0), of=self)
        layout.addStretch(0)

    def show_progress(self, progress: Progress | None) -> None:
        self._bar.show_progress(progress)
        for part in (self._words, self._cancel):
            part.setVisible(progress is not None)
        if progress is not None:
            metrics, middle = self._words.fontMetrics(), Qt.TextElideMode.ElideMiddle
            self._words.setText(metrics.elidedText(progress.text, middle, _WORDS_WIDTH))
            set_tool_tip(self._words, progress.text)


class _Empty(QFrame):
    """In place of the table: what will be here, and how to get it."""

    def __init__(self, presenter: CampaignPresenter, choose_folder: Callable[[], None]) -> None:
        super().__init__()
        self.setProperty("role", "card")
        text = gettext("Here the runs of a folder become the paper's Table 1, Fig. 2 and its conclusions.")
        title = label(text, TextRole.HEADING, wrap=True)
        self._where = label(muted=True, wrap=True)
        for words in (title, self._where):
            words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        hint = gettext("Simulate 36 series, three tests each, into a new folder: some minutes")
        self._buttons = (
            make_button(gettext("Record"), presenter.navigator.show_record),
            make_button(gettext("Choose another folder"), choose_folder),
            make_button(gettext("Make the synthetic campaign"), presenter.simulate_campaign, hint),
        )
        layout = make_column(STRETCH, title, self._where, spacing=16, margins=(24, 24), of=self)
        for button in self._buttons:
            layout.addWidget(button, 0, Qt.AlignmentFlag.AlignHCenter)
        layout.addStretch(1)

    def show_state(self, state: CampaignState) -> None:
        for button in self._buttons:
            button.setVisible(state.progress is None)
        text = N_("The runs of {folder} have not been gathered. Refresh (F5) looks for them.")
        if state.progress is not None:
            text = N_("Looking through {folder}.")
        elif state.is_gathered:
            text = N_("There are no runs in {folder} yet.")
        self._where.setText(gettext(text, folder=break_path(state.folder)))
