"""What two cursors read, in a small table at the top right of the curves."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QWidget

from app.presenters.identify.state import Cursors
from app.qt.theme import TextRole
from app.qt.widgets.layouts import make_column
from app.qt.widgets.text import label
from messages.i18n import gettext

_RIGHT = Qt.AlignmentFlag.AlignRight


class CursorBar(QWidget):
    """Shows `Cursors`; hidden without."""

    def __init__(self) -> None:
        super().__init__()
        self._grid = QGridLayout()
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(0)
        self._grid.setColumnStretch(0, 1)
        self._period = label(role=TextRole.STRONG)
        self._hint = label(gettext("← → move, with Shift by ten; A and B choose"), TextRole.LABEL, muted=True)
        below = QHBoxLayout()
        below.addWidget(self._hint, 1)
        below.addWidget(self._period)
        make_column(self._grid, below, margins=(16, 4), of=self)
        self._labels: dict[tuple[int, int], QLabel] = {}
        self.hide()

    def show_cursors(self, cursors: Cursors | None) -> None:
        self.setVisible(cursors is not None)
        if cursors is None:
            return
        rows = (("", "t", *cursors.symbols), *cursors.cells)
        for place in self._labels.keys() - {(r, c) for r, row in enumerate(rows) for c in range(len(row))}:
            self._labels[place].hide()
        for number, texts in enumerate(rows):
            for column, text in enumerate(texts):
                cell = self._cell(number, column)
                cell.setText(text)
                cell.show()
        self._period.setText(cursors.period)

    def _cell(self, row: int, column: int) -> QLabel:
        if (row, column) not in self._labels:
            made = label(role=TextRole.STRONG if column == 0 else TextRole.TEXT)
            if row == 0:
                made = label(role=TextRole.LABEL, muted=True)
            self._labels[row, column] = made
            self._grid.addWidget(made, row, column + 1, _RIGHT)
        return self._labels[row, column]
