"""The right column of Identify: f_d with verdict and warnings, laws, results, classical figures, budget."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.identify.state import BudgetRow, ClassicalRow, IdentifyState, ModelRow
from app.presenters.results import Result, ResultRow
from app.qt.theme import TextRole
from app.qt.widgets.layouts import make_column
from app.qt.widgets.selectable_rows import GridRow, SelectableRows
from app.qt.widgets.text import (
    ValueLabel,
    break_path,
    label,
    plain_text,
    set_tool_tip,
    show_chip,
    symbol_text,
)
from messages.i18n import gettext


class ResultsPanel(QWidget):
    """Built anew for each run and law; the classical figures come later."""

    def __init__(self, state: IdentifyState, show_model: Callable[[str], None]) -> None:
        super().__init__()
        self._show_model = show_model
        self._classical = make_column(spacing=8)
        layout = make_column(spacing=8, margins=(16, 16), of=self)
        result = state.result
        if result is None:
            return
        _add_headline(layout, state, result)
        if state.models:
            _add_section(layout, gettext("Friction laws"), self._models(state.models))
        _add_section(layout, gettext("Results"), _results(state.rows))
        layout.addLayout(self._classical)
        self.show_classical(state.classical)
        if state.budget:
            title = gettext("Uncertainty of {quantity}", quantity=result.headline.symbol)
            _add_section(layout, title, _budget(title, state.budget))
        layout.addStretch(1)
        layout.addWidget(label(break_path(result.path), TextRole.LABEL, muted=True, wrap=True))

    def show_classical(self, rows: tuple[ClassicalRow, ...]) -> None:
        if rows and not self._classical.count():
            _add_section(self._classical, gettext("Classical figures"), _classical(rows))

    def _models(self, models: tuple[ModelRow, ...]) -> QWidget:
        titles = ("", "f<sub>d</sub>", gettext("residual / noise"), "")
        lines: list[Sequence[QWidget]] = [_heads(titles)]
        rows = []
        for model in models:
            cells = list(self._model_cells(model))
            copied = (model.law, model.effects, model.friction, model.ratio, model.status.text)
            rows.append(GridRow(len(lines), len(lines) + len(cells) - 1, copied))
            lines += cells
        copied_titles = (
            gettext("law"),
            gettext("effects"),
            "f_d",
            gettext("residual / noise"),
            gettext("verdict"),
        )
        return SelectableRows(
            gettext("Friction laws"), _grid(lines, (0, 3), right=(1, 2, 3)), copied_titles, rows
        )

    def _model_cells(self, row: ModelRow) -> Iterator[Sequence[QWidget]]:
        button = QPushButton(row.law)
        button.setProperty("role", "row")
        button.setCheckable(True)
        button.setChecked(row.is_shown)
        set_tool_tip(button, gettext("Show the curves and results of this law"))
        law = " ".join(filter(None, (row.law, row.effects)))
        button.setAccessibleName(gettext("{law}: show its curves and results", law=law))
        button.clicked.connect(lambda: self._choose(button, row))
        role = TextRole.STRONG if row.is_shown else TextRole.TEXT
        yield button, label(row.friction, role), label(row.ratio, role), _chip(row.status, role)
        if row.effects:
            effects = label(row.effects, TextRole.LABEL, muted=True, wrap=True)
            effects.setContentsMargins(7, 0, 0, 4)
            yield (effects,)

    def _choose(self, button: QPushButton, row: ModelRow) -> None:
        button.setChecked(row.is_shown)  # the presenter decides which is shown
        self._show_model(row.name)


def _add_headline(layout: QVBoxLayout, state: IdentifyState, result: Result) -> None:
    headline = ValueLabel(TextRole.NUMBER, TextRole.HEADING, named=True)
    headline.show_row(result.headline)
    layout.addWidget(headline)
    layout.addWidget(_chip(result.model_status, TextRole.HEADING))
    for text in filter(None, (result.fit, result.comparison)):
        layout.addWidget(label(text, muted=True, wrap=True))
    for chip in (state.model_note, state.missing_data, *(Chip(text, Tone.WARN) for text in result.warnings)):
        if chip.text:
            layout.addWidget(_chip(chip, TextRole.TEXT))
    if result.about_stand:
        layout.addSpacing(8)
        layout.addWidget(label(gettext("About the stand"), TextRole.HEADING))
    for text in result.about_stand:
        layout.addWidget(_chip(Chip(text, Tone.WARN), TextRole.TEXT))


def _add_section(layout: QVBoxLayout, title: str, rows: QWidget) -> None:
    layout.addSpacing(8)
    layout.addWidget(label(title, TextRole.HEADING))
    layout.addWidget(rows)


def _results(results: tuple[ResultRow, ...]) -> QWidget:
    cells = [
        (
            label(row.symbol),
            label(row.name, muted=True, wrap=True),
            label(row.value),
            label(row.uncertainty_text),
        )
        for row in results
    ]
    titles = (gettext("symbol"), gettext("quantity"), gettext("value"), "u", gettext("unit"))
    copied = [(symbol_text(row.symbol), row.name, row.value, row.uncertainty, row.unit) for row in results]
    return _rows(gettext("Results"), _grid(cells, (1,), right=(2,)), titles, copied)


def _classical(rows: tuple[ClassicalRow, ...]) -> QWidget:
    heads = _heads(("", "", gettext("classical"), gettext("fitted")))
    grid = _grid([heads, *map(_classical_cells, rows)], (1, 2), right=(2, 3))
    titles = (gettext("symbol"), gettext("quantity"), gettext("classical"), gettext("fitted"))
    copied = [(symbol_text(row.symbol), plain_text(row.name), row.classical, row.fitted) for row in rows]
    return _rows(gettext("Classical figures"), grid, titles, copied, first_line=1)


def _budget(title: str, rows: tuple[BudgetRow, ...]) -> QWidget:
    grid = _grid(map(_budget_cells, rows), (0, 1), right=(2,))
    titles, copied = (gettext("source"), "u"), [(row.source, row.value) for row in rows]
    return _rows(plain_text(title), grid, titles, copied)


def _rows(
    name: str,
    grid: QGridLayout,
    titles: Sequence[str],
    copied: Sequence[tuple[str, ...]],
    first_line: int = 0,
) -> SelectableRows:
    """Rows of one line each."""
    rows = [GridRow(line, line, cells) for line, cells in enumerate(copied, start=first_line)]
    return SelectableRows(name, grid, titles, rows)


def _grid(
    rows: Iterable[Sequence[QWidget]], stretched: Collection[int], *, right: Collection[int]
) -> QGridLayout:
    """Lay out cells; those of the columns `right` are aligned there. A cell alone takes all columns."""
    grid = QGridLayout()
    grid.setHorizontalSpacing(8)
    grid.setVerticalSpacing(4)
    for column in stretched:
        grid.setColumnStretch(column, 1)
    for row, cells in enumerate(rows):
        for column, cell in enumerate(cells):
            if len(cells) == 1:
                grid.addWidget(cell, row, column, 1, -1)
            elif column not in right:
                grid.addWidget(cell, row, column)
            elif isinstance(cell, QLabel) and cell.wordWrap():  # aligned itself, it keeps all the width
                cell.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                grid.addWidget(cell, row, column)
            else:
                grid.addWidget(cell, row, column, Qt.AlignmentFlag.AlignRight)
    return grid


def _heads(titles: Iterable[str]) -> Sequence[QWidget]:
    return [label(title, TextRole.LABEL, muted=True) for title in titles]


def _classical_cells(row: ClassicalRow) -> Sequence[QWidget]:
    classical = label(row.classical, wrap=len(row.classical) > 24)
    set_tool_tip(classical, row.hint)
    return label(row.symbol), label(row.name, muted=True, wrap=True), classical, label(row.fitted)


def _budget_cells(row: BudgetRow) -> Sequence[QWidget]:
    bar = QProgressBar()
    bar.setTextVisible(False)
    bar.setRange(0, 1000)
    bar.setValue(round(1000 * row.share))
    bar.setAccessibleName(f"{row.source}: {row.value}")
    return label(row.source, wrap=True), bar, label(row.value, muted=not row.share)


def _chip(chip: Chip, role: TextRole) -> QLabel:
    made = label(role=role, wrap=True)
    show_chip(made, chip)
    return made
