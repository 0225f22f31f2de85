"""How stream and disk fare, told twice a second."""

import time
from collections.abc import Callable

from app.acquisition.disk_room import DiskDemand
from app.acquisition.free_space import FreeSpacePoller
from app.acquisition.messages import Health
from app.acquisition.stream.live_stream import LiveStream

_EVERY_S = 0.5


class HealthReporter:
    """Looks after a stream and the disk that its runs go to.

    Parameters
    ----------
    stream : LiveStream
    space : FreeSpace
    demand : callable
        Tells what a run writes.
    """

    def __init__(self, stream: LiveStream, space: FreeSpacePoller, demand: Callable[[], DiskDemand]) -> None:
        self._stream = stream
        self._space = space
        self._demand = demand
        self._due_s = 0.0

    def poll(self) -> Health | None:
        """How they are; None if that was told half a second ago or later. Look often."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return None
        self._due_s = now_s + _EVERY_S
        clock, losses = self._stream.recent_clock(), self._stream.losses
        return Health(
            rate_hz=self._stream.rate_hz if clock is None else clock.rate_hz,
            samples=losses.samples,
            missing=losses.missing,
            missing_estimated=losses.missing_estimated,
            damaged=losses.damaged,
            overloaded=losses.overloaded,
            free_disk_bytes=self._space.free_bytes or 0,
            bytes_per_s=self._demand().bytes_per_s,
        )
