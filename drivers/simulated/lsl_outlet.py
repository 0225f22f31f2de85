"""An LSL outlet as the port of a simulated device."""

import os
import time

from drivers.envelope import Unwrapper
from drivers.lsl_link import LslOutlet
from drivers.simulated.identity import STREAM_ID_PREFIX
from drivers.simulated.transport import Transport
from drivers.stream_packets import unpack_chunk

_NAME = "Slipstand simulated stand"
_POLL_S = 0.002


class _Outlet(Transport):
    """What is sent are packed chunks. The first sample of a stream is stamped with the present time."""

    resets_device = False
    burst_s = 0.05

    def __init__(self, rate_hz: float, channels: int) -> None:
        self._facts = (_NAME, f"{STREAM_ID_PREFIX}{os.getpid()}", rate_hz, channels)
        self._outlet: LslOutlet | None = LslOutlet(*self._facts)
        self._unwrapper = Unwrapper()
        self._origin_s = self._last_s = 0.0

    @property
    def url(self) -> str:
        return f"lsl://{self._facts[1]}"

    def wait(self, timeout_s: float) -> None:
        time.sleep(min(_POLL_S, max(0.0, timeout_s)))

    def receive(self) -> bytes | None:
        return b"" if self._outlet is not None and self._outlet.has_readers else None

    def send(self, data: bytes) -> int:
        for read in self._unwrapper.feed(data):
            chunk = unpack_chunk(read)
            if chunk is None or self._outlet is None:
                continue
            stamps_s, values = chunk
            if not self._origin_s or stamps_s[0] < self._last_s:
                self._origin_s = self._outlet.now_s() - float(stamps_s[-1])
            self._last_s = float(stamps_s[-1])
            self._outlet.send(stamps_s + self._origin_s, values)
        return len(data)

    def unplug(self) -> None:
        if self._outlet is not None:
            self._outlet.close()
        self._outlet = None

    def plug_in(self) -> None:
        if self._outlet is None:
            self._outlet = LslOutlet(*self._facts)


def open_outlet(rate_hz: float, channels: int) -> Transport:
    """Offer a stream of this nominal rate. Raises PortUnavailableError without pylsl."""
    return _Outlet(rate_hz, channels)
