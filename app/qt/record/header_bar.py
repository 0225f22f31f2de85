"""The strip on top of Record: device, rate, losses, gauges, disk, run."""

from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QWidget

from app.presenters.record.state import Header
from app.presenters.screen import NO_CHIP, Chip
from app.presenters.words import tr
from app.qt.theme import Type
from app.qt.widgets.text import label, show_chip


class HeaderBar(QFrame):
    """Always in sight."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setProperty("role", "bar")
        self._device = label(role=Type.STRONG)
        self._rate = label()
        self._lost = label()
        self._gauges = (label(), label())
        self._disk = label()
        self._run = label(role=Type.STRONG)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(12, 8, 12, 8)
        layout.setSpacing(24)
        for widget in (self._device, self._rate, self._lost, *self._gauges):
            layout.addWidget(widget)
        layout.addStretch(1)
        layout.addWidget(self._run)
        layout.addWidget(self._disk)
        self._names()

    def show_header(self, header: Header) -> None:
        """Write a header."""
        show_chip(self._device, header.device)
        _write(self._rate, header.rate)
        show_chip(self._run, header.run)
        show_chip(self._lost, header.lost)
        show_chip(self._disk, header.disk)
        for index, target in enumerate(self._gauges):
            show_chip(target, _chip(header.gauges, index))

    def _names(self) -> None:
        for widget, name in (
            (self._device, tr("Device")),
            (self._rate, tr("Measured sample rate")),
            (self._lost, tr("Lost samples")),
            (self._disk, tr("Free disk space")),
            (self._run, tr("Run of its series")),
        ):
            widget.setAccessibleName(name)


def _write(target: QLabel, text: str) -> None:
    target.setText(text)
    target.setVisible(bool(text))


def _chip(chips: tuple[Chip, ...], index: int) -> Chip:
    return chips[index] if index < len(chips) else NO_CHIP
