"""What two cursors read, in a small table at the top right of the curves."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from app.presenters.identify.cursors import Cursors
from app.presenters.words import tr
from app.qt.theme import Type
from app.qt.widgets.text import label

_ROWS, _COLUMNS = 3, 4


class CursorBar(QWidget):
    """Shows `Cursors`; hidden without."""

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(12, 4, 16, 4)
        grid.setHorizontalSpacing(16)
        grid.setVerticalSpacing(0)
        titles = ("", "t", "u<sub>1</sub>", "u<sub>2</sub> − u<sub>1</sub>")
        for column, title in enumerate(titles, start=1):
            grid.addWidget(label(title, Type.LABEL, muted=True), 0, column, Qt.AlignmentFlag.AlignRight)
        self._cells = [[self._cell(grid, row, column) for column in range(_COLUMNS)] for row in range(_ROWS)]
        self._period = label(role=Type.STRONG)
        self._hint = label(tr("← → move, with Shift by ten; A and B choose"), Type.LABEL, muted=True)
        grid.addWidget(self._period, 2, 0)
        grid.addWidget(self._hint, 3, 0)
        grid.setColumnStretch(0, 1)
        self.hide()

    def show_cursors(self, cursors: Cursors | None) -> None:
        """Write what is read; None hides it all."""
        self.setVisible(cursors is not None)
        if cursors is None:
            return
        for made, texts in zip(self._cells, cursors.cells, strict=True):
            for cell, text in zip(made, texts, strict=True):
                cell.setText(text)
        self._period.setText(cursors.period)
        spoken = "; ".join(" ".join(texts) for texts in cursors.cells)
        self.setAccessibleName(f"{spoken}; {cursors.period}")

    def _cell(self, grid: QGridLayout, row: int, column: int) -> QLabel:
        made = label(role=Type.STRONG if column == 0 else Type.TEXT)
        grid.addWidget(made, row + 1, column + 1, Qt.AlignmentFlag.AlignRight)
        return made
