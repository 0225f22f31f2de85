"""A wire and a clock for tests of the simulated device."""

import math

import numpy as np

from drivers.devices.slipstand_binary.codec import FrameDecoder
from drivers.devices.slipstand_binary.simulated import SimulatedBinary
from drivers.samples import SampleBlock
from drivers.simulated.device import DeviceSetup, SimulatedDevice


class Ramp:
    """Counts that are the sample's own index, and its negative."""

    def __init__(self, first: int = 0) -> None:
        self.next = first

    def take(self, count: int):
        index = np.arange(self.next, self.next + count, dtype=np.int32)
        self.next += count
        return np.column_stack([index, -index]), np.zeros(count, dtype=np.uint8)


def ramp_at(rate_hz: float, started_s: float) -> Ramp:
    """Counts are samples since the session began, whichever stream brings them."""
    return Ramp(round(rate_hz * started_s))


class Wire:
    """A transport that keeps what was sent, with room for `room` bytes between two emptyings."""

    url = "wire"
    burst_s = 0.004

    def __init__(self, room: int = 10**9, resets_device: bool = True) -> None:
        self.room = room
        self.resets_device = resets_device
        self.sent = bytearray()
        self.taken = 0
        self.inbox: bytes | None = b""
        self.is_plugged_in = True

    def wait(self, timeout_s: float) -> None:
        raise AssertionError("a device does not wait for itself")

    def receive(self) -> bytes | None:
        if self.inbox is None or not self.is_plugged_in:
            return None
        data, self.inbox = self.inbox, b""
        return data

    def send(self, data: bytes) -> int:
        assert self.is_plugged_in
        took = data[: max(0, self.room - (len(self.sent) - self.taken))]
        self.sent += took
        return len(took)

    def empty(self) -> None:
        self.taken = len(self.sent)

    def unplug(self) -> None:
        self.is_plugged_in = False

    def plug_in(self) -> None:
        self.is_plugged_in = True

    def close(self) -> None:
        pass


def run_for(device: SimulatedDevice, duration_s: float, start_ns: int = 0) -> int:
    """Step the device as often as it asks; return the time at which that ended."""
    now_ns, end_ns = start_ns, start_ns + round(duration_s * 1e9)
    while now_ns <= end_ns:
        now_ns += math.ceil(device.step(now_ns) * 1e9)
    return now_ns


def decoded(wire: Wire, rate_hz: float) -> tuple[list[SampleBlock], FrameDecoder]:
    decoder = FrameDecoder(rate_hz)
    return list(decoder.feed(bytes(wire.sent), 0)), decoder


def start(wire: Wire, setup: DeviceSetup, packing=None) -> SimulatedDevice:
    wire.inbox = b"S"
    return SimulatedDevice(wire, packing or SimulatedBinary(), ramp_at, setup)
