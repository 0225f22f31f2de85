"""Theme: colours of both schemes, typeface, palette and style sheet."""

from dataclasses import dataclass
from enum import Enum
from string import Template

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontDatabase, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication, QWidget

FAMILY = "IBM Plex Sans"


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


LIGHT = Tokens(
    bg="#F7F8FA",
    surface="#FFFFFF",
    line="#D5DAE1",
    text="#1B2330",
    muted="#5A6675",
    accent="#0B5FA5",
    on_accent="#FFFFFF",
    ok="#1E7B45",
    warn="#8A5A00",
    bad="#B3261E",
    channel_1="#0B5FA5",
    channel_2="#B8500A",
    simulation="#1B2330",
    slip_alpha=0.10,
    overlay=("#0B5FA5", "#B8500A", "#1E7B45", "#8E3B8A", "#007C89", "#B3261E", "#7A6100", "#4A5568"),
)
DARK = Tokens(
    bg="#12161C",
    surface="#1A2028",
    line="#323B47",
    text="#E8ECF1",
    muted="#9DA9B8",
    accent="#6DB3F2",
    on_accent="#12161C",
    ok="#63C98A",
    warn="#E6B450",
    bad="#FF8A80",
    channel_1="#6DB3F2",
    channel_2="#F2A65A",
    simulation="#E8ECF1",
    slip_alpha=0.14,
    overlay=("#6DB3F2", "#F2A65A", "#63C98A", "#D69BE0", "#5CC8D6", "#FF8A80", "#E6D06A", "#A7B1BF"),
)


SCHEMES = {
    "system": Qt.ColorScheme.Unknown,
    "light": Qt.ColorScheme.Light,
    "dark": Qt.ColorScheme.Dark,
}
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
    """Font of a role. Sizes are px on a screen of 96 dpi and follow the system's scaling of text."""
    size_px, weight = role.value
    made = QFont(FAMILY)
    screen = QGuiApplication.primaryScreen()
    made.setPointSizeF(size_px * 72.0 / (screen.logicalDotsPerInchY() if screen else 96.0))
    made.setVariableAxis(QFont.Tag("wght"), weight)
    return made


def colour(token: str, alpha: float = 1.0) -> QColor:
    """Colour of a token, more or less transparent."""
    made = QColor(token)
    made.setAlphaF(alpha)
    return made


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


def _palette(tokens: Tokens) -> QPalette:
    roles = {
        QPalette.ColorRole.Window: tokens.bg,
        QPalette.ColorRole.Base: tokens.surface,
        QPalette.ColorRole.AlternateBase: tokens.bg,
        QPalette.ColorRole.Button: tokens.surface,
        QPalette.ColorRole.WindowText: tokens.text,
        QPalette.ColorRole.Text: tokens.text,
        QPalette.ColorRole.ButtonText: tokens.text,
        QPalette.ColorRole.ToolTipBase: tokens.surface,
        QPalette.ColorRole.ToolTipText: tokens.text,
        QPalette.ColorRole.PlaceholderText: tokens.muted,
        QPalette.ColorRole.Highlight: tokens.accent,
        QPalette.ColorRole.HighlightedText: tokens.on_accent,
        QPalette.ColorRole.Link: tokens.accent,
        QPalette.ColorRole.Accent: tokens.accent,
    }
    palette = QPalette()
    for role, token in roles.items():
        palette.setColor(role, QColor(token))
    for role in (QPalette.ColorRole.WindowText, QPalette.ColorRole.Text, QPalette.ColorRole.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(tokens.muted))
    return palette


def _style_sheet(tokens: Tokens) -> str:
    values = {name: getattr(tokens, name) for name in Tokens.__slots__}
    return Template(_STYLE).substitute(values)


_STYLE = """
QFrame[role="card"], QFrame[role="bar"] { background: $surface; border: 1px solid $line; border-radius: 6px; }
QFrame[role="plots"] { border: 2px solid transparent; border-radius: 6px; }
QFrame[role="plots"]:focus { border: 2px solid $accent; }
QFrame[role="rail"] { background: $surface; border: none; border-right: 1px solid $line; }
QScrollArea[role="column"], QScrollArea[role="column"] > QWidget > QWidget { background: $surface; }
QLabel[role="muted"] { color: $muted; }
QLabel[tone="ok"] { color: $ok; }
QLabel[tone="warn"] { color: $warn; }
QLabel[tone="bad"] { color: $bad; }
QLabel[channel="1"] { color: $channel_1; }
QLabel[channel="2"] { color: $channel_2; }
QLabel[step="ahead"] { color: $muted; }
QLabel[step="done"] { color: $ok; }
QLabel[step="now"] { color: $on_accent; background: $accent; border-radius: 6px; }

QFrame[role="notice"] {
    background: $surface; border: 1px solid $line; border-left: 4px solid $muted;
    border-radius: 6px; margin: 8px 8px 0 8px;
}
QFrame[role="notice"][tone="ok"] { border-left-color: $ok; }
QFrame[role="notice"][tone="warn"] { border-left-color: $warn; }
QFrame[role="notice"][tone="bad"] { border-left-color: $bad; }

QPushButton {
    background: $surface; color: $text; border: 1px solid $muted; border-radius: 6px;
    padding: 0 12px; min-height: 30px;
}
QPushButton:hover { border-color: $accent; }
QPushButton:pressed { background: $bg; }
QPushButton:focus { border: 2px solid $accent; padding: 0 11px; min-height: 28px; }
QPushButton:disabled { color: $muted; border-color: $line; background: $bg; }
QPushButton[primary="true"] { background: $accent; color: $on_accent; border-color: $accent; }
QPushButton[primary="true"]:hover { border-color: $text; }
QPushButton[primary="true"]:disabled { color: $muted; border-color: $line; background: $bg; }
QPushButton[primary="true"]:focus { border: 2px solid $text; }
QPushButton[scale="large"] { min-height: 54px; padding: 0 16px; }
QPushButton[scale="large"]:focus { min-height: 52px; padding: 0 15px; }
QPushButton:checked { border-color: $accent; color: $accent; }
QPushButton[role="row"] {
    border: 1px solid transparent; text-align: left; padding: 0 6px; min-height: 22px;
}
QPushButton[role="row"]:hover { border-color: $line; }
QPushButton[role="row"]:checked { border-color: $accent; color: $accent; }
QPushButton[role="row"]:focus { border: 2px solid $accent; padding: 0 5px; min-height: 20px; }

QPushButton[role="plan"] { border: 1px solid transparent; background: $bg; color: $muted; padding: 0 8px; }
QPushButton[role="plan"]:hover { border-color: $accent; }
QPushButton[role="plan"]:focus { border: 2px solid $accent; padding: 0 7px; }
QPushButton[role="plan"][state="full"] { color: $ok; }
QPushButton[role="plan"][state="now"] { color: $accent; border-color: $accent; background: $surface; }
QToolButton[role="fold"] { border: 1px solid transparent; border-radius: 4px; }
QToolButton[role="fold"]:hover, QToolButton[role="fold"]:focus { border-color: $accent; }

QToolButton[role="rail"] {
    border: 2px solid transparent; border-radius: 6px; color: $muted; padding: 8px 2px;
}
QToolButton[role="rail"]:hover { color: $text; background: $bg; }
QToolButton[role="rail"]:checked { color: $accent; background: $bg; }
QToolButton[role="rail"]:focus { border-color: $accent; }

QLineEdit, QComboBox {
    background: $surface; color: $text; border: 1px solid $muted; border-radius: 6px;
    padding: 0 8px; min-height: 30px;
}
QCheckBox::indicator {
    width: 14px; height: 14px; border: 1px solid $muted; border-radius: 3px; background: $surface;
}
QCheckBox::indicator:checked { background: $accent; border-color: $accent; }
QCheckBox::indicator:disabled { background: $bg; border-color: $line; }
QCheckBox::indicator:focus { width: 12px; height: 12px; border: 2px solid $accent; }
QCheckBox::indicator:checked:focus { border-color: $text; }
QPlainTextEdit { background: $surface; color: $text; border: 1px solid $line; border-radius: 6px; }
QPlainTextEdit:focus, QScrollArea:focus { border: 2px solid $accent; }
QLineEdit:focus, QComboBox:focus { border: 2px solid $accent; padding: 0 7px; min-height: 28px; }
QLineEdit { placeholder-text-color: $muted; }
QLineEdit:disabled, QComboBox:disabled { color: $muted; border-color: $line; background: $bg; }
QComboBox::drop-down { border: none; width: 24px; }
QComboBox QAbstractItemView {
    background: $surface; color: $text; border: 1px solid $line; outline: none;
    selection-background-color: $accent; selection-color: $on_accent;
}
QTableView {
    background: $surface; alternate-background-color: $bg; color: $text; border: none; outline: none;
    selection-background-color: $accent; selection-color: $on_accent;
}
/* With the frame of 3 px that Qt leaves around a cell, in line with the titles. */
QTableView::item { padding: 0 5px; border: none; }
QTableView::item:selected { background: $accent; color: $on_accent; }
QHeaderView { background: $surface; border: none; }
QHeaderView::section {
    background: $surface; color: $muted; border: none; border-bottom: 1px solid $line; padding: 6px 8px;
}
QHeaderView[role="tight"]::section { padding: 6px; }
QTabBar { background: $surface; font-weight: 400; }
QTabBar::tab {
    background: $surface; color: $text; border: none; border-bottom: 2px solid transparent;
    padding: 6px 10px; margin: 2px 0 2px 4px;
}
QTabBar QToolButton { background: $surface; border: 1px solid $line; border-radius: 4px; }
QTabBar::tab:hover { border-bottom-color: $line; }
QTabBar::tab:selected { color: $accent; border-bottom-color: $accent; }
QTabBar::tab:focus { color: $text; }
QTabBar::tab:disabled { color: $muted; }
QToolTip { background: $surface; color: $text; border: 1px solid $line; padding: 4px; }
QProgressBar {
    background: $bg; border: 1px solid $line; border-radius: 4px; max-height: 6px; min-height: 6px;
}
QProgressBar::chunk { background: $accent; border-radius: 3px; }
QScrollBar:vertical { background: transparent; width: 8px; }
QScrollBar::handle:vertical { background: $muted; border-radius: 4px; min-height: 24px; }
QScrollBar:horizontal { background: transparent; height: 8px; }
QScrollBar::handle:horizontal { background: $muted; border-radius: 4px; min-width: 24px; }
QAbstractScrollArea::corner { background: transparent; border: none; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0; height: 0; }
QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }
"""
