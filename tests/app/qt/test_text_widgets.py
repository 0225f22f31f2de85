"""Texts as the window sets them."""

import pytest
from looking import clipped_words, plain
from PySide6.QtWidgets import QApplication, QBoxLayout, QLabel, QWidget
from pytestqt.qtbot import QtBot

from app.presenters.results import ResultRow
from app.qt.theme import TextRole, Theme, font
from app.qt.widgets.layouts import make_column
from app.qt.widgets.text import ValueLabel, label, set_subscripts


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        ("f_d falls with v_max", "f<sub>d</sub> falls with v<sub>max</sub>"),
        ("f_s > f_d & more", "f<sub>s</sub> > f<sub>d</sub> & more"),
        ("n<sub>1</sub> and u_s", "n<sub>1</sub> and u<sub>s</sub>"),
        ("p < 0.001 & more", "p < 0.001 & more"),
        ("20261122T144336_f_data.h5", "20261122T144336_f_data.h5"),
    ],
)
def test_symbols_in_sentences_are_set(said: str, seen: str) -> None:
    assert set_subscripts(said) == seen


def test_a_label_shows_no_markup(qapp: object) -> None:
    assert plain(QLabel.text(label("f_s < f_d & more"))) == "fs < fd & more"


LONG = (
    ResultRow("f<sub>d</sub>", "dynamic friction coefficient", "0.10030", "0.00064"),
    ResultRow("f<sub>d</sub>", "dynamic friction coefficient", "0.100301234", "0.000000064"),
    ResultRow("T", "period of the joint motion", "−12345.678901", "0.000048", "ms"),
    ResultRow(
        "T", "period of the joint motion", "319.9421234567890123456789", "0.0000000000000000000048", "ms"
    ),
    ResultRow("f<sub>d</sub>", "коэффициент трения скольжения", "не определено"),
    ResultRow("", "", "Nothing has come out of this"),
)


@pytest.mark.parametrize("width", [150, 330, 346, 600])
@pytest.mark.parametrize("row", LONG, ids=lambda row: row.value)
@pytest.mark.parametrize(
    "roles", [(TextRole.INSTRUCTION, TextRole.NUMBER), (TextRole.NUMBER, TextRole.HEADING)]
)
@pytest.mark.usefixtures("theme")  # whose typeface is that of the window
def test_a_number_fits_its_column_at_any_number_of_digits(
    qtbot: QtBot, roles: tuple[TextRole, TextRole], row: ResultRow, width: int
) -> None:
    column = QWidget()
    shown = ValueLabel(*roles, named=True)
    make_column(shown, of=column)
    qtbot.addWidget(column)
    column.resize(width, 300)
    column.show()
    qtbot.waitExposed(column)
    shown.show_row(row)
    QApplication.processEvents()
    assert column.width() == width
    assert clipped_words(column) == []
    texts = [part.text() for part in (shown._value, shown._spread) if part.isVisible()]
    assert " ".join(texts) == f"{row.value} {row.uncertainty_text}".strip()


def test_a_number_is_as_large_as_its_column_allows(qtbot: QtBot, theme: Theme) -> None:
    shown = ValueLabel(TextRole.INSTRUCTION, TextRole.NUMBER)
    qtbot.addWidget(shown)
    shown.resize(600, 120)
    shown.show()  # a hidden widget is not told of its size
    shown.show_row(LONG[1])
    assert shown._value.font() == font(TextRole.INSTRUCTION)
    assert shown._numbers.direction() is QBoxLayout.Direction.LeftToRight
    shown.resize(330, 120)
    QApplication.processEvents()
    assert shown._value.font() == font(TextRole.INSTRUCTION)
    assert shown._numbers.direction() is QBoxLayout.Direction.TopToBottom
    shown.resize(600, 120)
    shown.show_row(LONG[1])
    assert shown._numbers.direction() is QBoxLayout.Direction.LeftToRight
