"""Names and values under one another, in one column of values or several."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from app.presenters.base import LabelledValue
from app.qt.widgets.text import label


class ValueGrid(QWidget):
    """Draws facts; the labels are made once and written anew."""

    def __init__(self) -> None:
        super().__init__()
        self._labels: dict[tuple[int, int], QLabel] = {}
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(2)

    def show_values(self, facts: Sequence[LabelledValue]) -> None:
        self._show([(fact.label, fact.value) for fact in facts])

    def show_columns(self, titles: Sequence[str], columns: Sequence[Sequence[LabelledValue]]) -> None:
        rows = zip(*columns, strict=True)
        values = [(facts[0].label, *(fact.value for fact in facts)) for facts in rows]
        self._show([("", *titles), *values])

    def _show(self, rows: Sequence[tuple[str, ...]]) -> None:
        texts = {(row, column): text for row, line in enumerate(rows) for column, text in enumerate(line)}
        for place, text in texts.items():
            if place not in self._labels:
                self._labels[place] = self._add(place)
            self._labels[place].setText(text)
        for place, shown in self._labels.items():
            shown.setVisible(place in texts)

    def _add(self, place: tuple[int, int]) -> QLabel:
        is_name = place[1] == 0
        made = label(muted=is_name, wrap=not is_name)
        self._grid.addWidget(made, *place, Qt.AlignmentFlag.AlignTop)
        self._grid.setColumnStretch(place[1], 0 if is_name else 1)
        return made
