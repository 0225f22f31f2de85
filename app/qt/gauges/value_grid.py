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
        self._show(
            {
                (row, column): text
                for row, fact in enumerate(facts)
                for column, text in enumerate((fact.label, fact.value))
            }
        )

    def show_columns(self, titles: Sequence[str], columns: Sequence[Sequence[LabelledValue]]) -> None:
        texts = {(0, number): title for number, title in enumerate(titles, start=1)}
        for row, facts in enumerate(zip(*columns, strict=True), start=1):
            texts[row, 0] = facts[0].label
            texts |= {(row, number): fact.value for number, fact in enumerate(facts, start=1)}
        self._show(texts)

    def _show(self, texts: dict[tuple[int, int], str]) -> None:
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
