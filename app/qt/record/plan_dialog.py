"""Dialog of the series plan: a table that is edited in place. It does not block the window."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.presenters.base import Chip, Tone
from app.presenters.record import next_runs
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import Action, PlanEdited, PlanState
from app.qt.theme import TextRole
from app.qt.widgets.inputs import ESCAPE_AND_ENTER, CheckBox, ShortcutSafeEdit, make_button
from app.qt.widgets.layouts import STRETCH, make_column, make_row
from app.qt.widgets.shortcuts import bind_button
from app.qt.widgets.text import label, set_tool_tip, show_chip
from messages.i18n import N_, gettext

_HELP = N_(
    "Series in the order in which they are measured, each with its repeats. What is done is counted from the"
    " folder of runs; what lies in its trash does not count. Each change holds at once."
)
_ADD_HINT = N_("1FFM0 x3, 2SS* x5: * and ? stand for any part of a series")
_TITLES = (N_("Series"), N_("Repeats"), N_("Done"), "")
_REPEATS = 1
"""Column that is edited."""
_SIZE = 520, 560


class PlanDialog(QDialog):
    def __init__(self, presenter: RecordPresenter, parent: QWidget) -> None:
        super().__init__(parent)
        self._presenter = presenter
        self._plan, self._series = PlanState(), ""
        self._table = _make_table()
        self._add = ShortcutSafeEdit(ESCAPE_AND_ENTER - {Qt.Key.Key_Escape})
        self._message = label(wrap=True)
        self._simulated = CheckBox(gettext("Simulated runs count, too"))
        self._simulated.clicked.connect(presenter.count_simulated)
        self._buttons = {
            name: make_button(gettext(text), act)
            for name, (text, act) in {
                "up": (N_("Up"), lambda: self._move(-1)),
                "down": (N_("Down"), lambda: self._move(1)),
                "remove": (N_("Remove"), self._remove),
                "undo": (N_("Undo"), lambda: presenter.dispatch(Action.UNDO_PLAN)),
            }.items()
        }
        self._close = make_button(gettext("Close"), self.close)
        self._lay_out()
        self._connect()

    def open_with(self, plan: PlanState, series: str) -> None:
        self.show_plan(plan, series)
        self.show()
        self.raise_()
        (self._table if plan.progress else self._add).setFocus()

    def show_plan(self, plan: PlanState, series: str) -> None:
        """Show the plan; `series` is recorded next."""
        self._plan, self._series = plan, series
        self._simulated.setChecked(plan.counts_simulated)
        self._table.blockSignals(True)
        self._table.setRowCount(len(plan.progress))
        for row, one in enumerate(plan.progress):
            state = gettext("full") if one.is_full else gettext("next") if one.series == series else ""
            for column, text in enumerate((one.series, str(one.planned), str(one.done), state)):
                _show_cell(self._table, row, column, text, one.description)
        self._table.blockSignals(False)
        words = gettext("{done} of {planned} runs are there", done=plan.done, planned=plan.planned)
        said = Chip(words if plan.planned else gettext("Nothing is planned"))
        show_chip(self._message, Chip(plan.error, Tone.BAD) if plan.error else said)
        for name in ("up", "down", "remove"):
            self._buttons[name].setEnabled(bool(plan.progress))
        self._buttons["undo"].setEnabled(plan.can_undo)

    def _edit(self, text: str) -> None:
        self._presenter.dispatch(PlanEdited(text))

    def _on_cell(self, item: QTableWidgetItem) -> None:
        if item.column() == _REPEATS:
            self._edit(next_runs.plan_with_repeats(self._plan.progress, item.row(), item.text()))
            self.show_plan(self._plan, self._series)  # the old number, where the new one cannot be

    def _on_added(self) -> None:
        self._edit(next_runs.plan_with_added(self._plan.progress, self._add.text()))
        if not self._plan.error:
            self._add.clear()

    def _move(self, by: int) -> None:
        row = self._table.currentRow()
        if 0 <= row + by < len(self._plan.progress) and row >= 0:
            self._edit(next_runs.plan_with_moved(self._plan.progress, row, by))
            self._table.selectRow(row + by)

    def _remove(self) -> None:
        rows = {index.row() for index in self._table.selectionModel().selectedRows()}
        self._edit(next_runs.plan_without(self._plan.progress, rows))
        if self._plan.progress:
            self._table.selectRow(min(min(rows, default=0), len(self._plan.progress) - 1))

    def _connect(self) -> None:
        self._table.itemChanged.connect(self._on_cell)
        self._add.left.connect(self._on_added)
        keys: dict[str, tuple[str, str, QWidget]] = {
            "up": ("Alt+Up", gettext("Measure the series earlier"), self),
            "down": ("Alt+Down", gettext("Measure the series later"), self),
            "remove": ("Del", gettext("Take the selected series out of the plan"), self._table),
            "undo": ("Ctrl+Z", gettext("Take the last change of the plan back"), self),
        }
        for name, (key, words, owner) in keys.items():
            bind_button(self._buttons[name], key, words, owner, focused=owner is self._table)

    def _lay_out(self) -> None:
        self._add.setPlaceholderText(gettext(_ADD_HINT))
        self._add.setAccessibleName(gettext("Series to add"))
        add = make_button(gettext("Add"), self._on_added)
        add.setDefault(True)
        make_column(
            label(gettext("Series plan"), TextRole.HEADING),
            label(gettext(_HELP), muted=True, wrap=True),
            (self._table, 1),
            make_row(*self._buttons.values(), STRETCH, spacing=8),
            make_row((self._add, 1), add, spacing=8),
            make_row((self._message, 1), self._simulated, self._close, spacing=12),
            spacing=12,
            margins=(16, 16),
            of=self,
        )
        self.setWindowTitle(gettext("Series plan"))
        self.resize(*_SIZE)


def _make_table() -> QTableWidget:
    table = QTableWidget(0, len(_TITLES))
    table.setHorizontalHeaderLabels([gettext(title) for title in _TITLES])
    table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
    table.horizontalHeader().setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    table.verticalHeader().hide()
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setTabKeyNavigation(False)
    table.setShowGrid(False)
    table.setAlternatingRowColors(True)
    table.setAccessibleName(gettext("Series plan"))
    return table


def _show_cell(table: QTableWidget, row: int, column: int, text: str, hint: str) -> None:
    item = table.item(row, column)
    if item is None:
        item = QTableWidgetItem()
        if column != _REPEATS:
            item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEditable)
        table.setItem(row, column, item)
    if item.text() != text:
        item.setText(text)
    if column != _REPEATS:  # any change of a cell would take away what is being typed there
        set_tool_tip(item, hint)
