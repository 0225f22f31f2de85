"""Theme: colours of both schemes, typeface, palette and style sheet."""

from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from string import Template
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontDatabase, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication, QWidget

FAMILY = "IBM Plex Sans"
_STYLE = Path(__file__).with_name("theme.qss")


@dataclass(frozen=True, slots=True)
class Tokens:
    """Colours by role. The contrast of text is at least 4.5:1, of curves and marks 3:1 (WCAG 2.1, AA)."""

    bg: str
    surface: str
    line: str
    text: str
    muted: str
    accent: str
    on_accent: str
    ok: str
    warn: str
    bad: str
    channel_1: str
    channel_2: str
    simulation: str
    slip_alpha: float
    overlay: tuple[str, ...]
    """Runs drawn over one another."""


_SCHEMES: dict[str, tuple[Any, Any]] = {
    "bg": ("#F7F8FA", "#12161C"),
    "surface": ("#FFFFFF", "#1A2028"),
    "line": ("#D5DAE1", "#323B47"),
    "text": ("#1B2330", "#E8ECF1"),
    "muted": ("#5A6675", "#9DA9B8"),
    "accent": ("#0B5FA5", "#6DB3F2"),
    "on_accent": ("#FFFFFF", "#12161C"),
    "ok": ("#1E7B45", "#63C98A"),
    "warn": ("#8A5A00", "#E6B450"),
    "bad": ("#B3261E", "#FF8A80"),
    "channel_1": ("#0B5FA5", "#6DB3F2"),
    "channel_2": ("#B8500A", "#F2A65A"),
    "simulation": ("#1B2330", "#E8ECF1"),
    "slip_alpha": (0.10, 0.14),
    "overlay": (
        ("#0B5FA5", "#B8500A", "#1E7B45", "#8E3B8A", "#007C89", "#B3261E", "#7A6100", "#4A5568"),
        ("#6DB3F2", "#F2A65A", "#63C98A", "#D69BE0", "#5CC8D6", "#FF8A80", "#E6D06A", "#A7B1BF"),
    ),
}
"""Each colour of the light and of the dark scheme."""
LIGHT = Tokens(**{name: light for name, (light, _) in _SCHEMES.items()})
DARK = Tokens(**{name: dark for name, (_, dark) in _SCHEMES.items()})


SCHEMES = {"system": Qt.ColorScheme.Unknown, "light": Qt.ColorScheme.Light, "dark": Qt.ColorScheme.Dark}
"""By the names of `Settings.theme`."""


class TextRole(Enum):
    """Roles of text: size in px and weight. Figures of the typeface are tabular by themselves."""

    TEXT = (12.5, 400)
    STRONG = (12.5, 600)
    LABEL = (11.0, 400)
    HEADING = (15.0, 600)
    NUMBER = (28.0, 500)
    INSTRUCTION = (44.0, 600)


def font(role: TextRole) -> QFont:
    """Font of a role. Sizes are px on a screen of 96 dpi and follow the system's scaling of text.

    Widths are those of the typeface: FreeType would round those of letters without a configuration of fonts,
    and offscreen on Windows. The windows of Windows fit letters to pixels by themselves.
    """
    size_px, weight = role.value
    made = QFont(FAMILY)
    screen = QGuiApplication.primaryScreen()
    made.setPointSizeF(size_px * 72.0 / (screen.logicalDotsPerInchY() if screen else 96.0))
    made.setVariableAxis(QFont.Tag("wght"), weight)
    if QGuiApplication.platformName() != "windows":
        made.setHintingPreference(QFont.HintingPreference.PreferVerticalHinting)
    return made


def colour(token: str | QColor, alpha: float = 1.0) -> QColor:
    made = QColor(token)
    made.setAlphaF(alpha)
    return made


def mixed(token: str, ground: str, share: float) -> QColor:
    """Opaque colour that looks like `token` of opacity `share` on a ground; Qt draws it in less time."""
    ink, behind = QColor(token), QColor(ground)
    pairs = (
        (ink.red(), behind.red()),
        (ink.green(), behind.green()),
        (ink.blue(), behind.blue()),
    )
    return QColor(*(round(share * over + (1.0 - share) * under) for over, under in pairs))


def set_property(widget: QWidget, name: str, value: object) -> None:
    """Set a property that the style sheet uses, and apply the style again."""
    if widget.property(name) == value:
        return
    widget.setProperty(name, value)
    widget.style().unpolish(widget)
    widget.style().polish(widget)


class Theme(QObject):
    """Theme in use; emits `changed`. The scheme Unknown follows the system, Light and Dark are fixed."""

    changed = Signal()

    def __init__(self, app: QApplication, scheme: Qt.ColorScheme = Qt.ColorScheme.Unknown) -> None:
        super().__init__(app)
        self._app = app
        self._fixed = scheme
        self._of_system = app.styleHints().colorScheme()
        self.tokens = LIGHT
        _load_typeface()
        app.setStyle("Fusion")
        app.setFont(font(TextRole.TEXT))
        self._apply()
        app.styleHints().colorSchemeChanged.connect(self._follow)

    def fix(self, scheme: Qt.ColorScheme) -> None:
        self._fixed = scheme
        self._apply()

    def _follow(self, scheme: Qt.ColorScheme) -> None:
        self._of_system = scheme
        self._apply()

    def _apply(self) -> None:
        scheme = self._of_system if self._fixed is Qt.ColorScheme.Unknown else self._fixed
        self.tokens = DARK if scheme is Qt.ColorScheme.Dark else LIGHT
        self._app.setPalette(_palette(self.tokens))
        self._app.setStyleSheet(_style_sheet(self.tokens))
        self.changed.emit()


def _load_typeface() -> None:
    if FAMILY in QFontDatabase.families():
        return
    from fontpkg_ibm_plex_sans import ROOT

    for file in sorted(ROOT.rglob("*.ttf")):
        QFontDatabase.addApplicationFont(str(file))


_ROLES = {
    "bg": "Window AlternateBase",
    "surface": "Base Button ToolTipBase",
    "text": "WindowText Text ButtonText ToolTipText",
    "muted": "PlaceholderText",
    "accent": "Highlight Link Accent",
    "on_accent": "HighlightedText",
}
"""Roles of the palette by token."""


def _palette(tokens: Tokens) -> QPalette:
    palette = QPalette()
    for token, names in _ROLES.items():
        for name in names.split():
            palette.setColor(QPalette.ColorRole[name], QColor(getattr(tokens, token)))
    for role in (QPalette.ColorRole.WindowText, QPalette.ColorRole.Text, QPalette.ColorRole.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(tokens.muted))
    return palette


def _style_sheet(tokens: Tokens) -> str:
    return Template(_STYLE.read_text(encoding="utf-8")).substitute(asdict(tokens))
