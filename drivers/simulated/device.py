"""The simulated device: paced by a clock of its own, never waiting for whoever reads it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.account import WireAccount
from drivers.simulated.commands import Command, CommandReader, Order
from drivers.simulated.faults import Damager, Fault, FaultRates
from drivers.simulated.transport import Transport
from drivers.simulated.wire import Packing
from drivers.slipstand_binary.commands import FirmwareIdentity, identity_line

FIRMWARE = "simulated-1"
MAX_RATE_HZ = 100_000.0


class Signal(Protocol):
    """What the device's converter reads, sample after sample from index 0."""

    def take(self, count: int) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
        """Counts (count, 2) of the next samples and their overload bits of `SampleStatus` (count,)."""


@dataclass(frozen=True, slots=True)
class DeviceSetup:
    """What a simulated device is like.

    Attributes
    ----------
    rate_hz : float
        Sample rate at power-on (Hz).
    clock_ppm : float
        How much the device's clock is fast (1e-6).
    faults : FaultRates
        Damage done to its frames.
    seed : int or None
        Makes the damage repeatable.
    """

    rate_hz: float
    clock_ppm: float = 0.0
    faults: FaultRates = field(default_factory=FaultRates)
    seed: int | None = None


class SimulatedDevice:
    """Firmware of the simulated amplifier; `step` it as often as it asks.

    Sample k is taken at k / rate of the device's own clock, counted from the start of the stream. A
    stream starts when asked for, or with the opening of the port, and ends when the port is closed.

    Parameters
    ----------
    transport : Transport
        Where bytes go and commands come from.
    packing : Packing
        Protocol spoken.
    signal_at : callable
        Makes the signal of a new stream for a sample rate (Hz).
    setup : DeviceSetup
    """

    _NO_STREAM_S = 0.02

    def __init__(
        self,
        transport: Transport,
        packing: Packing,
        signal_at: Callable[[float], Signal],
        setup: DeviceSetup,
    ) -> None:
        self._transport = transport
        self._packing = packing
        self._signal_at = signal_at
        self._rate_hz = setup.rate_hz
        self._clock_scale = 1.0 + setup.clock_ppm * 1e-6
        self._damager = Damager(setup.faults, packing.line_end, setup.seed)
        self._commands = CommandReader()
        self._reader_is_there = False
        self._stream: _Stream | None = None
        self.account = WireAccount(setup.rate_hz)
        """Of the running stream, or of the last one."""
        self.streams = 0
        """Streams started until now."""

    @property
    def is_streaming(self) -> bool:
        """Tell whether samples are being sent."""
        return self._stream is not None

    def step(self, now_ns: int) -> float:
        """Do what is due at `now_ns` of the host's monotonic clock; return seconds to wait at most."""
        received = self._transport.receive()
        if received is None:
            self._reader_is_there = False
            self._stream = None
            return self._NO_STREAM_S
        if not self._reader_is_there:
            self._power_up(now_ns)
        if self._packing.obeys_commands:
            for command in self._commands.feed(received):
                self._obey(command, now_ns)
        return self._stream.send_due(now_ns) if self._stream else self._NO_STREAM_S

    def _power_up(self, now_ns: int) -> None:
        self._reader_is_there = True
        self._commands = CommandReader()
        if not self._packing.obeys_commands:
            self._start(now_ns)

    def _obey(self, command: Command, now_ns: int) -> None:
        match command.order:
            case Order.START if self._stream is None:
                self._start(now_ns)
            case Order.STOP:
                self._stream = None
            case Order.IDENTIFY:
                self._transport.send(identity_line(FirmwareIdentity(FIRMWARE, self._rate_hz, 2)))
            case Order.RATE if self._stream is None and 1.0 <= command.rate_hz <= MAX_RATE_HZ:
                self._rate_hz = command.rate_hz

    def _start(self, now_ns: int) -> None:
        self.account = WireAccount(self._rate_hz)
        self.streams += 1
        self._stream = _Stream(
            self._transport,
            self._packing,
            self._signal_at(self._rate_hz),
            self._damager,
            self.account,
            now_ns,
            self._rate_hz * self._clock_scale,
        )


class _Stream:
    """Samples on their way since one start."""

    _STEP_S = 0.001
    _BURST_S = 0.004
    """At most so much is sent a step: after a stall of this process the reader gets time to follow."""

    def __init__(
        self,
        transport: Transport,
        packing: Packing,
        signal: Signal,
        damager: Damager,
        account: WireAccount,
        started_ns: int,
        true_rate_hz: float,
    ) -> None:
        self._transport = transport
        self._packing = packing
        self._signal = signal
        self._damager = damager
        self._account = account
        self._started_ns = started_ns
        self._true_rate_hz = true_rate_hz
        self._n = packing.samples_per_frame(account.rate_hz)
        self._burst = math.ceil(self._BURST_S * account.rate_hz / self._n)

    def send_due(self, now_ns: int) -> float:
        """Send the frames that are complete by now; return seconds until the next one is."""
        taken = math.floor((now_ns - self._started_ns) * 1e-9 * self._true_rate_hz) + 1
        frames = min(taken // self._n - self._account.frames, self._burst)
        if frames > 0:
            self._send(frames)
        complete = (self._account.frames + 1) * self._n - 1
        due_s = complete / self._true_rate_hz - (now_ns - self._started_ns) * 1e-9
        return max(due_s, self._STEP_S)

    def _send(self, frames: int) -> None:
        counts, status = self._signal.take(frames * self._n)
        packed = self._packing.pack(self._account.samples, counts, status, self._account.rate_hz)
        carried = [self._damager.damage(frame) for frame in packed]
        taken = self._transport.send(b"".join(data for data, _ in carried))
        self._account.bytes_sent += taken
        end = 0
        for data, fault in carried:
            end += len(data)
            self._account.add(self._n, fault if end <= taken else Fault.CUT)
