"""Whether the samples that the screens show are live, or since when they are not."""

import datetime
import time
from collections.abc import Callable
from dataclasses import dataclass

from app.acquisition.messages import Connected, Event, Failed, Reconnected, Reconnecting
from app.acquisition.ring import RingRows
from app.presenters.base import SimulationStarted

SILENT_S = 2.0  # samples come sixty times a second; a busy computer delays them by less
_SILENT_SAMPLES = 5.0
"""A slow device is silent when so many of its samples are due."""


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """The connected device; `stopped_at` is the time of day of its last sample, empty while samples come."""

    device: str = ""
    stopped_at: str = ""

    @property
    def is_live(self) -> bool:
        return bool(self.device) and not self.stopped_at


class DeviceMonitor:
    """Follows the events and samples of one connection."""

    def __init__(
        self,
        clock: Callable[[], float] = time.perf_counter,
        now: Callable[[], datetime.datetime] = datetime.datetime.now,
    ) -> None:
        self._clock = clock
        self._now = now
        self.reset()

    def reset(self) -> None:
        """Nothing is connected."""
        self._device = ""
        self._is_lost = False
        self._silent_s = SILENT_S
        self._take_sample()

    def on_event(self, event: Event | SimulationStarted) -> None:
        match event:
            case Connected(device, _, rate_hz):
                self.reset()
                self._device = device
                self._silent_s = max(SILENT_S, _SILENT_SAMPLES / rate_hz)
            case Reconnecting():
                self._is_lost = True
            case Reconnected():
                self._is_lost = False
                self._take_sample()
            case Failed():
                self.reset()

    def on_rows(self, rows: RingRows) -> None:
        if len(rows):
            self._take_sample()

    def status(self) -> DeviceStatus:
        """Status now; ask when new samples were taken."""
        is_silent = self._clock() - self._sample_s > self._silent_s
        has_stopped = bool(self._device) and (self._is_lost or is_silent)
        return DeviceStatus(self._device, f"{self._sampled_at:%H:%M:%S}" if has_stopped else "")

    def _take_sample(self) -> None:
        self._sample_s, self._sampled_at = self._clock(), self._now()
