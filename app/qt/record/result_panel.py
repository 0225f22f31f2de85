"""The right column after a run: f_d large, the verdict in words, what else was found, where it is stored."""

from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from app.presenters.base import Chip, Tone
from app.presenters.results import Result
from app.qt.theme import TextRole
from app.qt.widgets.text import ValueLabel, break_path, label, show_chip

_MOST_ROWS = 4
_MOST_CAUTIONS = 6


class ResultPanel(QWidget):
    """Shows a `Result`."""

    def __init__(self) -> None:
        super().__init__()
        self._name = label(role=TextRole.HEADING)
        self._headline = ValueLabel(TextRole.INSTRUCTION, TextRole.NUMBER)
        self._comparison = label(muted=True, wrap=True)
        self._verdict = label(role=TextRole.HEADING)
        self._fit = label(muted=True, wrap=True)
        self._rows = [ValueLabel(TextRole.NUMBER, TextRole.HEADING, named=True) for _ in range(_MOST_ROWS)]
        self._ending = label(wrap=True)
        self._cautions = [label(wrap=True) for _ in range(_MOST_CAUTIONS)]
        self._path = label(role=TextRole.LABEL, muted=True, wrap=True)
        self._lay_out()

    def show_result(self, result: Result) -> None:
        """Write a result."""
        self._name.setText(" ".join(part for part in (result.headline.symbol, result.headline.name) if part))
        self._headline.show_row(result.headline)
        for target, text in (
            (self._comparison, result.comparison),
            (self._fit, result.fit),
            (self._path, break_path(result.path)),
        ):
            _write(target, text)
        show_chip(self._verdict, result.model_status)
        show_chip(self._ending, result.end_status)
        for index, row in enumerate(self._rows):
            row.show_row(result.rows[index] if index < len(result.rows) else None)
        for index, target in enumerate(self._cautions):
            text = result.warnings[index] if index < len(result.warnings) else ""
            show_chip(target, Chip(text, Tone.WARN))

    def _lay_out(self) -> None:
        layout = QVBoxLayout(self)
        layout.setContentsMargins(16, 16, 16, 16)
        layout.setSpacing(8)
        for widget in (self._name, self._headline, self._comparison):
            layout.addWidget(widget)
        layout.addSpacing(4)
        layout.addWidget(self._verdict)
        layout.addWidget(self._fit)
        layout.addSpacing(4)
        for row in self._rows:
            layout.addWidget(row)
        for caution in self._cautions:
            layout.addWidget(caution)
        layout.addStretch(1)
        layout.addWidget(self._ending)
        layout.addWidget(self._path)


def _write(target: QLabel, text: str) -> None:
    target.setText(text)
    target.setVisible(bool(text))
