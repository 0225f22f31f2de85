"""A box shows by its shape whether it is ticked, in both themes."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot

from app.qt.theme import Theme
from app.qt.widgets.inputs import CheckBox


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


def test_a_box_that_cannot_be_ticked_now_keeps_its_mark(theme: Theme, qtbot: QtBot) -> None:
    box = CheckBox("")
    qtbot.addWidget(box)
    box.setChecked(True)
    box.setEnabled(False)
    box.show()
    assert theme.tokens.muted.lower() in shades(box)
