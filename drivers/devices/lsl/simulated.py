"""A simulated LSL stream: an outlet of liblsl, with stamps of the simulated device's clock."""

import numpy as np

from drivers.arrays import Floats, Int32s, UInt8s
from drivers.devices.lsl import DRIVER
from drivers.devices.lsl.source import LslSettings
from drivers.simulated.lsl_outlet import open_outlet
from drivers.simulated.protocol import SimulatedProtocol
from drivers.simulated.transport import Transport
from drivers.stream import parse_settings
from drivers.stream_packets import pack_chunk

_CHUNK_HZ = 200.0  # chunks a second, where there are as many samples
_MAX_SAMPLES = 100


class SimulatedStream(SimulatedProtocol):
    """Sends chunks of samples; a damaged one is lost as a whole, because LSL sends nothing that is broken."""

    streams_on_open = True

    def __init__(self, settings: LslSettings) -> None:
        self._channels = (settings.table, settings.relative)
        self._rate_hz = 0.0

    def open_transport(self, rate_hz: float) -> Transport:
        return open_outlet(rate_hz, 1 + max(self._channels))

    def samples_per_frame(self, rate_hz: float) -> int:
        self._rate_hz = rate_hz
        return min(max(round(rate_hz / _CHUNK_HZ), 1), _MAX_SAMPLES)

    def encode(self, _first_sequence: int, counts: Int32s, _status: UInt8s, times_s: Floats) -> list[bytes]:
        size = len(counts) // len(times_s)
        values = np.zeros((len(counts), 1 + max(self._channels)))
        values[:, self._channels] = counts
        steps_s = np.arange(size) / self._rate_hz
        return [
            pack_chunk(first_s + steps_s, values[k * size : (k + 1) * size], 0.0, 0)
            for k, first_s in enumerate(times_s)
        ]


def make_protocol(settings: dict[str, str]) -> SimulatedStream:
    """The simulated stream with its own settings. Raises SettingsError."""
    return SimulatedStream(parse_settings(LslSettings, settings, DRIVER.name))
