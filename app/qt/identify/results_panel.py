"""The right column of Identify: f_d with verdict and warnings, laws, results, classical figures, budget."""

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.identify.state import BudgetRow, ClassicalRow, IdentifyState, ModelRow
from app.presenters.results import ResultRow
from app.qt.theme import TextRole
from app.qt.widgets.text import ValueLabel, break_path, label, show_chip
from messages.i18n import gettext


class ResultsPanel(QWidget):
    """Built anew for each run and law; the classical figures come later."""

    def __init__(self, state: IdentifyState, show_model: Callable[[str], None]) -> None:
        super().__init__()
        self._show_model = show_model
        self._checks = QWidget()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(8)
        if state.result is None:
            return
        self._add_headline(layout, state)
        self._add_models(layout, state.models)
        _section(layout, gettext("Results"))
        layout.addLayout(_quantities(state.rows))
        layout.addWidget(self._checks)
        self.show_classical(state.classical)
        if state.budget:
            _section(layout, gettext("Uncertainty of {quantity}", quantity=state.result.headline.symbol))
            layout.addLayout(_budget(state.budget))
        layout.addStretch(1)
        layout.addWidget(label(break_path(state.result.path), TextRole.LABEL, muted=True, wrap=True))

    def show_classical(self, rows: tuple[ClassicalRow, ...]) -> None:
        self._checks.setVisible(bool(rows))
        if rows and self._checks.layout() is None:
            layout = QVBoxLayout(self._checks)
            layout.setContentsMargins(0, 0, 0, 0)
            _section(layout, gettext("Classical figures"))
            layout.addLayout(_classical(rows))

    def _add_headline(self, layout: QVBoxLayout, state: IdentifyState) -> None:
        result = state.result
        if result is None:
            return
        headline = ValueLabel(TextRole.NUMBER, TextRole.HEADING, named=True)
        headline.show_row(result.headline)
        layout.addWidget(headline)
        layout.addWidget(_chip(result.model_status, TextRole.HEADING))
        for text in (result.fit, result.comparison):
            if text:
                layout.addWidget(label(text, muted=True, wrap=True))
        warnings = (Chip(text, Tone.WARN) for text in result.warnings)
        for chip in (state.model_note, state.missing_data, *warnings):
            if chip.text:
                layout.addWidget(_chip(chip, TextRole.TEXT))

    def _add_models(self, layout: QVBoxLayout, rows: tuple[ModelRow, ...]) -> None:
        if not rows:
            return
        _section(layout, gettext("Friction laws"))
        grid = _grid()
        for column, title in enumerate(("", "f<sub>d</sub>", gettext("residual / noise"), "")):
            grid.addWidget(label(title, TextRole.LABEL, muted=True), 0, column, _side(column))
        for line, row in enumerate(rows, start=1):
            grid.addWidget(self._button(row), line, 0)
            for column, text in enumerate((row.friction, row.ratio), start=1):
                grid.addWidget(label(text, _weight(row)), line, column, _side(column))
            grid.addWidget(_chip(row.status, _weight(row), wrap=False), line, 3, _side(3))
        grid.setColumnStretch(0, 1)
        layout.addLayout(grid)

    def _button(self, row: ModelRow) -> QPushButton:
        button = QPushButton(row.name)
        button.setProperty("role", "row")
        button.setCheckable(True)
        button.setChecked(row.is_shown)
        button.setToolTip(gettext("Show the curves and results of this law"))
        button.setAccessibleName(gettext("{law}: show its curves and results", law=row.name))
        button.clicked.connect(lambda: self._choose(button, row))
        return button

    def _choose(self, button: QPushButton, row: ModelRow) -> None:
        button.setChecked(row.is_shown)  # it is the presenter who says what is shown
        self._show_model(row.name)


def _chip(chip: Chip, role: TextRole, *, wrap: bool = True) -> QLabel:
    made = label(role=role, wrap=wrap)
    show_chip(made, chip)
    return made


def _weight(row: ModelRow) -> TextRole:
    return TextRole.STRONG if row.is_shown else TextRole.TEXT


def _section(layout: QVBoxLayout, title: str) -> None:
    layout.addSpacing(8)
    layout.addWidget(label(title, TextRole.HEADING))


def _quantities(rows: tuple[ResultRow, ...]) -> QGridLayout:
    grid = _grid()
    for line, row in enumerate(rows):
        grid.addWidget(label(row.symbol), line, 0)
        grid.addWidget(label(row.name, muted=True), line, 1)
        grid.addWidget(label(row.value), line, 2, Qt.AlignmentFlag.AlignRight)
        grid.addWidget(label(row.uncertainty_text), line, 3)
    grid.setColumnStretch(1, 1)
    return grid


def _classical(rows: tuple[ClassicalRow, ...]) -> QGridLayout:
    grid = _grid()
    for column, title in ((2, gettext("classical")), (3, gettext("fitted"))):
        grid.addWidget(label(title, TextRole.LABEL, muted=True), 0, column, Qt.AlignmentFlag.AlignRight)
    for line, row in enumerate(rows, start=1):
        grid.addWidget(label(row.symbol), line, 0)
        grid.addWidget(label(row.name, muted=True), line, 1)
        classical = label(row.classical, wrap=len(row.classical) > 24)
        classical.setAlignment(Qt.AlignmentFlag.AlignRight)
        classical.setToolTip(row.hint)
        grid.addWidget(classical, line, 2)
        grid.addWidget(label(row.fitted), line, 3, Qt.AlignmentFlag.AlignRight)
    grid.setColumnStretch(2, 1)
    return grid


def _budget(rows: tuple[BudgetRow, ...]) -> QGridLayout:
    grid = _grid()
    for line, row in enumerate(rows):
        bar = QProgressBar()
        bar.setTextVisible(False)
        bar.setRange(0, 1000)
        bar.setValue(round(1000 * row.share))
        bar.setAccessibleName(f"{row.source}: {row.value}")
        grid.addWidget(label(row.source), line, 0)
        grid.addWidget(bar, line, 1)
        grid.addWidget(label(row.value, muted=not row.share), line, 2, Qt.AlignmentFlag.AlignRight)
    grid.setColumnStretch(1, 1)
    return grid


def _grid() -> QGridLayout:
    grid = QGridLayout()
    grid.setHorizontalSpacing(8)
    grid.setVerticalSpacing(4)
    return grid


def _side(column: int) -> Qt.AlignmentFlag:
    return Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
