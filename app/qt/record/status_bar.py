"""The strip on top of Record: device, rate, losses, gauges, disk, run."""

from dataclasses import replace

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QWidget

from app.presenters.base import EMPTY_CHIP, Chip
from app.presenters.record.state import StatusBar
from app.qt.theme import TextRole
from app.qt.widgets.text import label, show_chip
from messages.i18n import gettext

_WIDE, _NARROW = 24, 10
_MARGIN = 12
_LEAST = 72
"""Pixels that a name cut short keeps."""


class StatusBarWidget(QFrame):
    """Always in sight: where it is narrow, gaps shrink, then the names of device and run are cut short."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("role", "bar")
        self._device = label(role=TextRole.STRONG)
        self._rate = label()
        self._lost = label()
        self._gauges = (label(), label())
        self._disk = label()
        self._run = label(role=TextRole.STRONG)
        self._full = {self._device: "", self._run: ""}
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(_MARGIN, 8, _MARGIN, 8)
        for widget in (self._device, self._rate, self._lost, *self._gauges):
            self._row.addWidget(widget)
        self._row.addStretch(1)
        self._row.addWidget(self._run)
        self._row.addWidget(self._disk)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self._names()

    def show_status(self, header: StatusBar) -> None:
        """Write a header."""
        show_chip(self._device, replace(header.device, text=gettext(header.device.text)))  # "no device"
        _write(self._rate, header.rate)
        show_chip(self._run, header.run)
        show_chip(self._lost, header.lost_samples)
        show_chip(self._disk, header.disk)
        for index, target in enumerate(self._gauges):
            show_chip(target, _chip(header.gauges, index))
        self._full = {target: target.text() for target in self._full}
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Show as much of the names as fits."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        for target, text in self._full.items():
            target.setText(text)
        spacing = _WIDE if self._over(_WIDE) <= 0 else _NARROW
        self._row.setSpacing(spacing)
        for target, text in self._full.items():
            if (over := self._over(spacing)) > 0:
                room = max(target.sizeHint().width() - over, _LEAST)
                target.setText(target.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, room))
                target.setToolTip(target.toolTip() or text)

    def _over(self, spacing: int) -> int:
        """By how much the words are too wide."""
        shown = [w for w in self.findChildren(QLabel) if w.isVisibleTo(self)]
        wanted = sum(w.sizeHint().width() for w in shown) + spacing * len(shown)
        return wanted + 2 * _MARGIN + 2 - self.width()

    def _names(self) -> None:
        for widget, name in (
            (self._device, gettext("Device")),
            (self._rate, gettext("Measured sample rate")),
            (self._lost, gettext("Lost samples")),
            (self._disk, gettext("Free disk space")),
            (self._run, gettext("Run of its series")),
        ):
            widget.setAccessibleName(name)


def _write(target: QLabel, text: str) -> None:
    target.setText(text)
    target.setVisible(bool(text))


def _chip(chips: tuple[Chip, ...], index: int) -> Chip:
    return chips[index] if index < len(chips) else EMPTY_CHIP
