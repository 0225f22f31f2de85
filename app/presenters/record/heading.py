"""Keeps the header of Record up to date: who sends, how well, and how much room there is."""

import datetime
from collections.abc import Callable
from dataclasses import replace

from app.acquisition.messages import Health
from app.acquisition.ring import RingRows
from app.presenters.base import Chip
from app.presenters.record.header import GaugeWatch, device_chip, disk_chip, lost_chip, rate_text
from app.presenters.record.state import Header
from config.schema import Gauges
from messages.i18n import gettext

_SILENT_S = 2.0
"""The engine says something twice a second; a busy machine may make it late."""


class Heading:
    """The header as it stands.

    Parameters
    ----------
    gauges : Gauges
    today : callable
        Day, to tell whether a calibration has expired.
    clock : callable
        Seconds that only rise.
    """

    def __init__(
        self, gauges: Gauges, today: Callable[[], datetime.date], clock: Callable[[], float]
    ) -> None:
        self.header = Header()
        self._gauges = gauges
        self._today = today
        self._clock = clock
        self._watches = self._new_watches()
        self._device = ""
        self._lost = ""
        self._heard_s = 0.0

    def start(self, device: str) -> None:
        """Another device is connected, or none."""
        self._device, self._lost = device, ""
        self._watches = self._new_watches()
        self.header = Header(device_chip(device), run=self.header.run) if device else Header()

    def take_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use now."""
        self._gauges = gauges
        self._watches = self._new_watches()

    def connected(self, device: str, rate_hz: float) -> None:
        """The device answers."""
        self._device = device
        self._put(device=device_chip(device), rate=rate_text(rate_hz))

    def lose(self, message: str) -> None:
        """The device is away; back if there is nothing to say."""
        self._lost = message
        self._put(device=device_chip(self._device, message))

    def hear(self) -> None:
        """The engine has said something."""
        self._heard_s = self._clock()

    def listen(self) -> None:
        """Notice an engine that says nothing."""
        silent_s = self._clock() - self._heard_s
        if not self._lost:
            self._put(device=device_chip(self._device, silent_s=silent_s if silent_s > _SILENT_S else 0.0))

    def health(self, health: Health) -> None:
        """How the stream does."""
        self._put(
            rate=rate_text(health.rate_hz),
            lost=lost_chip(health),
            disk=disk_chip(health.free_disk_bytes, health.bytes_per_s),
        )

    def watch(self, rows: RingRows) -> None:
        """Look at the newest rows."""
        today = self._today()
        self._put(gauges=tuple(watch.look(rows, today) for watch in self._watches))

    def put_run(self, run: Chip) -> None:
        """Which run it is."""
        self._put(run=run)

    def _new_watches(self) -> tuple[GaugeWatch, GaugeWatch]:
        gauges = self._gauges
        return GaugeWatch(gettext("Gauge 1"), 0, gauges.table), GaugeWatch(
            gettext("Gauge 2"), 1, gauges.relative
        )

    def _put(self, **changes: object) -> None:
        self.header = replace(self.header, **changes)  # type: ignore[arg-type]
