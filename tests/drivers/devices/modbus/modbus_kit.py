"""A transmitter for tests: answers from the simulated registers, or with an error on demand."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from wire_helpers import join

from drivers.devices.modbus.decoder import ResponseDecoder, wrap_response
from drivers.devices.modbus.frames import Request, encode_read_response
from drivers.devices.modbus.maps import GAUGES
from drivers.devices.modbus.registers import Poll, plan_poll
from drivers.devices.modbus.simulated import make_protocol
from drivers.devices.modbus.source import ModbusSource, read_modbus_settings
from drivers.errors import DeviceLostError
from drivers.samples import SampleBlock
from drivers.simulated.protocol import CommandParser

COUNTS = np.array([70_000, -80_000], dtype=np.int32)


def poll_for(**settings: str) -> Poll:
    chosen, register_map = read_modbus_settings(settings)
    channels = tuple(register_map.channels[gauge] for gauge in chosen.gauges)
    return plan_poll(channels, register_map.framing)


def decoder_for(rate_hz: float = 100.0, **settings: str) -> ResponseDecoder:
    gauges = read_modbus_settings(settings)[0].gauges
    return ResponseDecoder(poll_for(**settings), tuple(GAUGES.index(gauge) for gauge in gauges), rate_hz)


class Clock:
    """The host's clock, which goes on only when somebody waits; stands in for `time`, too."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000_000

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("drivers.polling.host_ns", self.host_ns)
        monkeypatch.setattr("drivers.polling.time", self)
        monkeypatch.setattr("drivers.devices.modbus.source.time", self)

    def host_ns(self) -> int:
        return self.now_ns

    def perf_counter(self) -> float:
        return self.now_ns * 1e-9

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


class Transmitter:
    """A link whose device answers each request after `answer_s`; a silent read takes 50 ms, as of a port."""

    answer_s = 0.0025

    def __init__(self, clock: Clock, **settings: str) -> None:
        self._clock = clock
        self.registers = make_protocol(settings)
        self.registers.store_sample(COUNTS, 0)
        self._listener = CommandParser(self.registers.find_commands)
        self.waiting = b""
        self.sent: list[bytes] = []
        self.is_lost = self.has_echo = False
        self.on_wire: Callable[[bytes], bytes] = lambda answer: answer

    def read(self) -> bytes:
        if self.is_lost:
            raise DeviceLostError("the transmitter is gone")
        self._clock.sleep(self.answer_s if self.waiting else 0.05)
        data, self.waiting = self.waiting, b""
        return data

    def write(self, data: bytes) -> None:
        if self.is_lost:
            raise DeviceLostError("the transmitter is gone")
        self.sent.append(data)
        self.waiting += data if self.has_echo else b""
        for command in self._listener.feed(data):
            self.waiting += self.on_wire(self.registers.respond(command, True, 0.0))


def answer_of(request: Request, *values: int) -> bytes:
    """Answer to a request for 32-bit whole numbers."""
    return encode_read_response(request.unit, request.function, np.array(values, dtype=">i4").tobytes())


def polled(
    poll: Poll, counts: Iterable[tuple[int, int]], cells: Iterable[int], rate_hz: float
) -> list[bytes]:
    """Envelope of each poll of the generic map, measured in the middle of its cell."""
    (request,) = poll.requests
    return [
        wrap_response(0, round((cell + 0.5) * 1e9 / rate_hz), answer_of(request, *pair))
        for pair, cell in zip(counts, cells, strict=True)
    ]


def rows(source: ModbusSource, reads: Iterable[bytes]) -> SampleBlock:
    """The rows of some polls, of which none is left out."""
    return join(block for data in reads for block in source.decode(data, 0))


def decoded(decoder: ResponseDecoder, reads: Iterable[bytes]) -> list[SampleBlock]:
    return [block for data in reads for block in decoder.feed(data, 0)]
