"""What a box and an empty field show, in both themes."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QLineEdit
from pytestqt.qtbot import QtBot

from app.qt.theme import Theme
from app.qt.widgets.inputs import CheckBox, show_default


@pytest.mark.parametrize("scheme", [Qt.ColorScheme.Light, Qt.ColorScheme.Dark], ids=["light", "dark"])
def test_a_ticked_box_has_a_mark_in_it(theme: Theme, qtbot: QtBot, scheme: Qt.ColorScheme) -> None:
    theme.fix(scheme)
    try:
        box = CheckBox("")
        qtbot.addWidget(box)
        box.show()
        assert shades(box) & {theme.tokens.accent.lower()} == set()
        box.setChecked(True)
        assert {theme.tokens.accent.lower(), theme.tokens.on_accent.lower()} <= shades(box)
    finally:
        theme.fix(Qt.ColorScheme.Light)


def shades(box: CheckBox) -> set[str]:
    """Colours of the box."""
    picture = box.grab().toImage()
    return {
        QColor(picture.pixel(x, y)).name()
        for x in range(2, min(picture.width(), 14))
        for y in range(picture.height())
    }


def test_the_value_of_an_empty_field_has_the_colour_of_values_and_an_example_that_of_notes(
    theme: Theme, qtbot: QtBot
) -> None:
    used, example = QLineEdit(), QLineEdit()
    for field in (used, example):
        qtbot.addWidget(field)
        field.setPlaceholderText("for example 45")
    show_default(used, "460800")
    for field in (used, example):
        field.ensurePolished()
    placeholder = QPalette.ColorRole.PlaceholderText
    assert used.placeholderText() == "460800"
    assert used.palette().color(placeholder) == QColor(theme.tokens.text)
    assert example.palette().color(placeholder) == QColor(theme.tokens.muted)


def test_a_box_that_cannot_be_ticked_now_keeps_its_mark(theme: Theme, qtbot: QtBot) -> None:
    box = CheckBox("")
    qtbot.addWidget(box)
    box.setChecked(True)
    box.setEnabled(False)
    box.show()
    assert theme.tokens.muted.lower() in shades(box)
