"""Colours are distinguishable, the typeface is present, and the theme follows the system."""

import itertools
import os
import subprocess
import sys

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFont, QFontInfo, QFontMetricsF, QGuiApplication
from PySide6.QtWidgets import QApplication, QLabel, QMenu, QTableWidget, QTreeView, QWidget
from pytestqt.qtbot import QtBot

from app.qt.theme import DARK, FAMILY, LIGHT, TextRole, Theme, Tokens, font


def luminance(colour: str) -> float:
    """Relative luminance by WCAG 2.2."""
    parts = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in QColor(colour).getRgbF()[:3]
    ]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("tokens", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["bg", "surface"])
@pytest.mark.parametrize(
    ("name", "least"),
    [(name, 4.5) for name in ("text", "muted", "accent", "ok", "warn", "bad", "channel_1", "channel_2")],
)
def test_contrast_reaches_wcag_aa(tokens: Tokens, ground: str, name: str, least: float) -> None:
    assert contrast(getattr(tokens, name), getattr(tokens, ground)) >= least


@pytest.mark.parametrize("tokens", [LIGHT, DARK], ids=["light", "dark"])
def test_words_on_the_accent_can_be_read(tokens: Tokens) -> None:
    assert contrast(tokens.on_accent, tokens.accent) >= 4.5


def test_black_on_white_is_the_known_contrast() -> None:
    assert contrast("#000000", "#FFFFFF") == pytest.approx(21.0)


@pytest.mark.parametrize("role", list(TextRole))
def test_the_typeface_is_ours_with_figures_of_one_width(theme: Theme, role: TextRole) -> None:
    made = font(role)
    assert QFontInfo(made).family() == FAMILY
    assert QFontInfo(made).pixelSize() == pytest.approx(role.value[0], abs=0.6)
    widths = {QFontMetricsF(made).horizontalAdvance(figure) for figure in "0123456789"}
    assert len(widths) == 1


def test_weights_are_drawn_not_only_asked_for(theme: Theme) -> None:
    plain, strong = (
        QFontMetricsF(font(role)).horizontalAdvance("Slipstand") for role in (TextRole.TEXT, TextRole.STRONG)
    )
    assert strong > plain


def test_the_style_sheet_takes_nothing_from_outside_the_tokens(theme: Theme) -> None:
    for tokens, scheme in itertools.product((LIGHT, DARK), (Qt.ColorScheme.Light, Qt.ColorScheme.Dark)):
        theme.fix(scheme)
        known = {getattr(theme.tokens, name) for name in Tokens.__slots__}
        sheet = theme.parent().styleSheet()
        assert "$" not in sheet
        used = {word.strip(";") for word in sheet.split() if word.startswith("#")}
        assert used <= known
        assert (theme.tokens is tokens) == (
            scheme is (Qt.ColorScheme.Dark if tokens is DARK else Qt.ColorScheme.Light)
        )
    theme.fix(Qt.ColorScheme.Light)


def test_the_theme_follows_the_system(theme: Theme, qapp: QApplication, qtbot: QtBot) -> None:
    label = QLabel("word")
    qtbot.addWidget(label)
    system = qapp.styleHints().colorSchemeChanged
    try:
        theme.fix(Qt.ColorScheme.Unknown)
        system.emit(Qt.ColorScheme.Dark)
        assert theme.tokens is DARK
        assert label.palette().windowText().color() == QColor(DARK.text)
        system.emit(Qt.ColorScheme.Light)
        assert theme.tokens is LIGHT
    finally:
        theme.fix(Qt.ColorScheme.Light)
    system.emit(Qt.ColorScheme.Dark)
    assert theme.tokens is LIGHT, "fixed"


@pytest.mark.parametrize("kind", [QTableWidget, QTreeView, QMenu])
def test_the_typeface_holds_where_the_system_gives_a_class_its_own(
    qapp: QApplication, theme: Theme, qtbot: QtBot, kind: type[QWidget]
) -> None:
    """Windows does so for views and menus, at the start and whenever its theme changes."""
    del theme
    before = qapp.font(kind.__name__)
    qapp.setFont(QFont("serif"), kind.__name__)
    try:
        made = kind()
        qtbot.addWidget(made)
        made.ensurePolished()
        assert made.font().family() == FAMILY
        if isinstance(made, QTableWidget):
            made.horizontalHeader().ensurePolished()
            assert made.horizontalHeader().font().family() == FAMILY
    finally:
        qapp.setFont(before, kind.__name__)


_WIDTHS = """
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import QApplication
from app.qt.theme import TextRole, Theme, font
app = QApplication([])
Theme(app)
print([QFontMetricsF(font(role)).horizontalAdvance("Friction coefficient 0.123") for role in TextRole])
"""


def test_text_is_as_wide_without_a_configuration_of_fonts():
    """Minimal systems have none: text of 11 px is 4 % wider there unless it is said otherwise."""

    def widths(**variables: str) -> str:
        return subprocess.run(
            [sys.executable, "-c", _WIDTHS],
            env=os.environ | variables, check=True, capture_output=True, text=True,
        ).stdout  # fmt: skip

    assert widths() == widths(FONTCONFIG_SYSROOT="/absent")


def test_the_plugin_of_windows_not_the_system_tells_who_fits_letters(monkeypatch):
    """Windows without a screen draws by FreeType too: its texts were a pixel wider than their columns."""
    monkeypatch.setattr(sys, "platform", "win32")
    assert font(TextRole.TEXT).hintingPreference() is QFont.HintingPreference.PreferVerticalHinting
    monkeypatch.setattr(QGuiApplication, "platformName", lambda: "windows")
    assert font(TextRole.TEXT).hintingPreference() is QFont.HintingPreference.PreferDefaultHinting
