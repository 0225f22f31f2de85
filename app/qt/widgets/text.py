"""Labels by role, chips (words with a tone), and grids of labelled values."""

import html
import re
from collections.abc import Sequence
from typing import TypeVar

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QResizeEvent, QTextDocumentFragment
from PySide6.QtWidgets import (
    QBoxLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from analysis.formatting import unbreakable
from app.presenters.base import EMPTY_CHIP, Chip, LabelledValue, Tone
from app.presenters.results import ResultRow
from app.qt.theme import TextRole, font, set_property
from messages.control_characters import show_control_characters
from messages.i18n import gettext

_Value = TypeVar("_Value")
_Fill = TypeVar("_Fill")
_NUMBER_GAP = 8  # pixels between a number and its uncertainty
_SLACK = 0.97  # figures grow in whole pixels: not quite in proportion to their font
_FACTOR_MIN = 0.05  # of the usual size: smaller figures are not to be read
_SYMBOL = re.compile(r"\b([fuva])_(d|s|max)\b")
_MARKUP = re.compile("<sub>|&nbsp;")
_ESCAPED_MARKUP = re.compile("&lt;/?sub&gt;|&amp;nbsp;")


class Label(QLabel):
    """Shows text as it is: of markup in it only subscripts are obeyed, and control characters are visible."""

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._text = ""
        self.setText(text)

    def text(self) -> str:
        """Return the text as it was set."""
        return self._text

    def setText(self, text: str) -> None:  # noqa: N802
        self._text = text
        is_rich = _MARKUP.search(text) is not None
        self.setTextFormat(Qt.TextFormat.RichText if is_rich else Qt.TextFormat.PlainText)
        unbroken = unbreakable(text)
        super().setText(markup(unbroken) if is_rich else show_control_characters(unbroken))

    def set_rich_text(self, rich: str) -> None:
        """Show HTML; what is foreign in it must be escaped."""
        self._text = rich
        self.setTextFormat(Qt.TextFormat.RichText)
        super().setText(rich)


def markup(text: str) -> str:
    """HTML that shows a text as it is; of markup in it only subscripts and hard spaces are obeyed."""
    escaped = html.escape(show_control_characters(text), quote=False).replace("\n", "<br>")
    return _ESCAPED_MARKUP.sub(lambda found: html.unescape(found[0]), escaped)


def set_tool_tip(target: QWidget | QTableWidgetItem | QAction, text: str) -> None:
    """Show a text as it is while the mouse rests on something."""
    target.setToolTip(tool_tip(text))


def tool_tip(text: str) -> str:
    """Text of a tool tip, which Qt takes for HTML where it looks like that."""
    is_rich = "<" in text or "&" in text
    return f"<span>{markup(text)}</span>" if is_rich else show_control_characters(text)


def button_text(name: str) -> str:
    """Text of a button or an action: an ampersand is none that marks a key."""
    return show_control_characters(name).replace("&", "&&")


def label(
    text: str = "",
    role: TextRole = TextRole.TEXT,
    *,
    muted: bool = False,
    wrap: bool = False,
    parent: QWidget | None = None,
) -> Label:
    """Text of a role, its symbols set; wrapped text may be selected with the mouse."""
    made = Label(set_subscripts(text), parent)
    made.setFont(font(role))
    made.setWordWrap(wrap)
    if wrap:
        made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    if muted:
        made.setProperty("role", "muted")
    return made


def show_chip(target: QLabel, chip: Chip) -> None:
    """Write a chip into a label; an empty one hides it. The mark before the word tells the tone by shape."""
    mark = {"ok": "✓ ", "warn": "▲ ", "bad": "■ "}.get(chip.tone.value, "")
    target.setText(set_subscripts(mark + chip.text) if chip.text else "")
    set_tool_tip(target, chip.hint)
    _set_shown(target, bool(chip.text))
    set_property(target, "tone", chip.tone.value)


def stopped_chip(stopped_at: str) -> Chip:
    """Chip above values of a device whose last sample came at this time of day; empty while it sends."""
    return Chip(gettext("No samples since {time}", time=stopped_at), Tone.BAD) if stopped_at else EMPTY_CHIP


def set_text_or_hide(target: QLabel, text: str) -> None:
    target.setText(text)
    _set_shown(target, bool(text))


def _set_shown(part: QWidget, shown: bool) -> None:
    """Show or hide a part; one without a parent yet would be a window of its own, which takes the focus."""
    if part.parentWidget() is not None or not shown:
        part.setVisible(shown)


def padded(values: Sequence[_Value], count: int, fill: _Fill) -> list[_Value | _Fill]:
    """Cut or fill values up to the number of labels that show them."""
    return [*values[:count], *[fill] * (count - len(values))]


def set_subscripts(text: str) -> str:
    """Set the symbols in sentences of the analysis: f_d with a subscript."""
    return _SYMBOL.sub(r"\1<sub>\2</sub>", text)


def plain_text(rich: str) -> str:
    """What a screen reader says of rich text: a subscript without its tags."""
    return QTextDocumentFragment.fromHtml(markup(rich)).toPlainText()


def symbol_text(rich: str) -> str:
    """A symbol without markup: `f_d` for an f with the subscript d."""
    return plain_text(re.sub(r"<sub>(.*?)</sub>", r"_\1", rich))


def break_path(path: str) -> str:
    """Let a long path wrap at its separators."""
    return path.replace("/", "/\u200b").replace("\\", "\\\u200b")


class ElidedLabel(Label):
    """Muted line that is elided where it does not fit; the tool tip holds the whole text."""

    def __init__(self) -> None:
        super().__init__()
        self._line = ""
        self.setFont(font(TextRole.TEXT))
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def set_line(self, text: str, *, is_error: bool = False) -> None:
        self._line = text
        set_tool_tip(self, text)
        set_property(self, "tone", "bad" if is_error else "plain")
        set_property(self, "role", "" if is_error else "muted")
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        self.setText(self.fontMetrics().elidedText(self._line, Qt.TextElideMode.ElideRight, self.width()))


class ValueLabel(QWidget):
    """A number in large figures with its uncertainty and unit in smaller ones, and its name above it.

    Where they do not fit beside one another the uncertainty stands below; then the figures become smaller.
    """

    def __init__(self, value: TextRole, spread: TextRole, *, named: bool = False) -> None:
        super().__init__()
        self._named = named
        self._name = label(role=TextRole.LABEL, muted=True, wrap=True)
        self._roles = (value, spread)
        self._value = label(role=value)
        self._spread = label(role=spread)
        for part in (self._value, self._spread):
            part.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._numbers = QHBoxLayout()
        self._numbers.setSpacing(_NUMBER_GAP)
        self._numbers.addWidget(self._value, 0, Qt.AlignmentFlag.AlignBaseline)
        self._numbers.addWidget(self._spread, 1, Qt.AlignmentFlag.AlignBaseline)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self._name)
        layout.addLayout(self._numbers)
        self._name.setVisible(named)
        self.setMinimumWidth(1)  # of the column, not of the figures

    def show_row(self, row: ResultRow | None) -> None:
        _set_shown(self, row is not None)
        if row is None:
            return
        if self._named:
            self._name.setText(f"{row.symbol}\u2002{row.name}")
        self._value.setText(row.value)
        set_text_or_hide(self._spread, row.uncertainty_text)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        shown = [part for part in (self._value, self._spread) if part.text()]
        self._scale_fonts(1.0)
        widths = [part.sizeHint().width() for part in shown]
        is_wide = sum(widths) + _NUMBER_GAP * (len(widths) - 1) > self.width()
        ways = QBoxLayout.Direction
        self._numbers.setDirection(ways.TopToBottom if is_wide else ways.LeftToRight)
        heights = [part.sizeHint().height() for part in shown] or [0]
        names = self._name.sizeHint().height() if self._named else 0
        self.setMinimumHeight(names + (sum(heights) if is_wide else max(heights)))  # a low card scrolls
        factor, widest = 1.0, max(widths, default=0)
        while widest > self.width() > 0 and factor > _FACTOR_MIN:  # hinting widens small figures again
            factor *= _SLACK * self.width() / widest
            self._scale_fonts(factor)
            widest = max(part.sizeHint().width() for part in shown)

    def _scale_fonts(self, factor: float) -> None:
        for part, role in zip((self._value, self._spread), self._roles, strict=True):
            scaled = font(role)
            scaled.setPointSizeF(factor * scaled.pointSizeF())
            if part.font() != scaled:
                part.setFont(scaled)


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
