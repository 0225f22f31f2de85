"""The right column of Identify: verdict, quantities, the models that were tried, budget, cautions."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QProgressBar, QVBoxLayout, QWidget

from app.presenters.identify.state import BudgetRow, IdentifyState, ModelRow
from app.presenters.results import ResultRow
from app.presenters.screen import Chip, Tone
from app.qt.theme import Type
from app.qt.widgets.text import break_path, label, show_chip


class Findings(QWidget):
    """Built anew for each run."""

    def __init__(self, state: IdentifyState) -> None:
        super().__init__()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(8)
        result = state.result
        if result is None:
            return
        verdict = label(role=Type.HEADING)
        show_chip(verdict, result.verdict)
        layout.addWidget(verdict)
        for text in (result.fit, result.comparison):
            if text:
                layout.addWidget(label(text, muted=True, wrap=True))
        _section(layout, "Results")
        layout.addLayout(_quantities(state.rows))
        if state.models:
            _section(layout, "Models")
            layout.addLayout(_models(state.models))
        if state.budget:
            _section(layout, "Uncertainty of f<sub>d</sub>")
            layout.addLayout(_budget(state.budget))
        for text in result.cautions:
            caution = label(wrap=True)
            show_chip(caution, Chip(text, Tone.WARN))
            layout.addWidget(caution)
        layout.addStretch(1)
        layout.addWidget(label(break_path(result.path), Type.LABEL, muted=True, wrap=True))


def _section(layout: QVBoxLayout, title: str) -> None:
    layout.addSpacing(8)
    layout.addWidget(label(title, Type.HEADING))


def _quantities(rows: tuple[ResultRow, ...]) -> QGridLayout:
    grid = _grid()
    for line, row in enumerate(rows):
        grid.addWidget(label(row.symbol), line, 0)
        grid.addWidget(label(row.word, muted=True), line, 1)
        grid.addWidget(label(row.value), line, 2, Qt.AlignmentFlag.AlignRight)
        grid.addWidget(label(row.spread), line, 3)
    grid.setColumnStretch(1, 1)
    return grid


def _models(rows: tuple[ModelRow, ...]) -> QGridLayout:
    grid = _grid()
    for column, title in enumerate(("", "f<sub>d</sub>", "residual", "BIC")):
        grid.addWidget(label(title, Type.LABEL, muted=True), 0, column, _side(column))
    for line, row in enumerate(rows, start=1):
        for column, text in enumerate((row.name, row.friction, row.residual, row.bic)):
            made = label(text, Type.STRONG if row.chosen else Type.TEXT)
            grid.addWidget(made, line, column, _side(column))
    grid.setColumnStretch(0, 1)
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
