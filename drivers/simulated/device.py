"""The simulated device, paced by a clock of its own; it never waits for its reader."""

import logging
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from drivers.errors import SettingsError
from drivers.simulated import faults, stream_sender
from drivers.simulated.faults import Disturbance, DisturbanceKind, FaultRates
from drivers.simulated.protocol import Command, CommandKind, CommandParser, PolledProtocol, SimulatedProtocol
from drivers.simulated.stream_sender import Signal, StreamSender, TransmissionLog
from drivers.simulated.transport import Transport
from messages.i18n import N_

_log = logging.getLogger(__name__)
_SEQUENCES = 1 << 32
_UPDATE_S = 0.02

SignalFactory: TypeAlias = Callable[[float, float], Signal]
"""Makes the signal of a new stream from samples a second and first sample, both on the stand's time."""


@dataclass(frozen=True, slots=True)
class DeviceSetup:
    """Properties of a simulated device."""

    rate_hz: float  # sample rate at power-on (Hz), as the device reports it
    clock_ppm: float = 0.0  # how much the device's clock is fast (1e-6)
    rate_error: float = 0.0  # fraction by which it samples faster than it reports; its times are right
    first_sequence: int = 0  # number of sample 0; it wraps at 2**32
    first_time_s: float = 0.0
    faults: FaultRates = field(default_factory=FaultRates)
    disturbances: tuple[Disturbance, ...] = ()
    seed: int | None = None
    began_ns: int | None = None
    """Host's monotonic time at which the stand's own time is 0, which makes several devices show one motion;
    None: the stand's time begins with each session."""

    def __post_init__(self) -> None:
        if not 0 <= self.first_sequence < _SEQUENCES:
            template = N_("first_sequence {value} is no counter: give 0 to {most}")
            raise SettingsError(template, value=self.first_sequence, most=_SEQUENCES - 1)


def make_device(
    transport: Transport, protocol: SimulatedProtocol, signal_at: SignalFactory, setup: DeviceSetup
) -> "SimulatedDevice":
    """The device for a protocol: one that sends, or one that is polled."""
    if isinstance(protocol, PolledProtocol):
        return PolledDevice(transport, protocol, signal_at, setup)
    return SimulatedDevice(transport, protocol, signal_at, setup)


class SimulatedDevice:
    """Firmware of the simulated amplifier. The caller runs `step` as often as it asks for.

    A stream starts by command, or when the port is opened; sample k is taken at k / rate of the device's own
    clock. The stand's own time begins with a session: a stream that is started afresh. A stream that is
    started after the last one was interrupted (cable, power, an overflow, or a reader that left without a
    command) continues the session, because the stand does not wait. A stream that resumed by itself may be
    stopped and started once within the session.
    """

    _NO_STREAM_S = 0.02

    def __init__(
        self, transport: Transport, protocol: SimulatedProtocol, signal_at: SignalFactory, setup: DeviceSetup
    ) -> None:
        self._transport = transport
        self._protocol = protocol
        self._signal_at = signal_at
        self._setup = setup
        self._rate_hz = setup.rate_hz
        self._schedule = faults.DisturbanceSchedule(setup.disturbances)
        damager = faults.FrameDamager(setup.faults, protocol.line_end, setup.seed)
        self._output = stream_sender.WireOutput(transport, protocol, damager, self._schedule)
        self._parser = CommandParser(protocol.find_commands)
        self._has_reader = False
        self._cable_fault: DisturbanceKind | None = None
        self._stream: _Stream | None = None
        self._was_interrupted = False
        self._resumed_by_itself = False
        self._session_ns: int | None = None
        self.log = TransmissionLog(setup.rate_hz, setup.rate_hz)
        """Of the running stream, or of the last one."""
        self.earlier_logs: list[TransmissionLog] = []  # of earlier streams of this session
        self.streams = 0  # streams started until now

    @property
    def has_reader(self) -> bool:
        return self._has_reader

    @property
    def is_streaming(self) -> bool:
        return self._stream is not None

    @property
    def disturbances(self) -> tuple[Disturbance, ...]:
        return self._schedule.disturbances

    @property
    def is_plugged_in(self) -> bool:
        return self._cable_fault is None

    def disturb(self, disturbance: Disturbance, now_ns: int) -> None:
        _log.info("disturbance: %s", disturbance)
        self._schedule.add(disturbance, self.time_s(now_ns))

    def step(self, now_ns: int) -> float:
        """Do what is due at `now_ns` of the host's monotonic clock; returns seconds to wait at most."""
        self._follow_cable(now_ns)
        received = self._transport.receive()
        if received is not None:
            self._receive(received, now_ns)
        elif self._has_reader:
            self._has_reader = False
            if self._transport.resets_device:
                self._stream = None
            self._was_interrupted = self.is_streaming
        wait_s = self._stream.send_due(now_ns, self._has_reader) if self._stream else self._NO_STREAM_S
        if isinstance(self._stream, stream_sender.BufferedSender) and self._stream.is_over:
            self._stream, self._was_interrupted = None, True
        return wait_s

    def time_s(self, now_ns: int) -> float:
        """The stand's own time."""
        if self._session_ns is None:
            self._session_ns = now_ns
        return (now_ns - self._session_ns) * 1e-9

    def _follow_cable(self, now_ns: int) -> None:
        fault = self._schedule.cable_fault(self.time_s(now_ns))
        if fault is self._cable_fault:
            return
        if self._cable_fault is None:
            self._transport.unplug()
            self._has_reader = False
            self._was_interrupted = self._was_interrupted or self.is_streaming
        if fault is DisturbanceKind.POWER:
            self._stream = None
            self._rate_hz = self._setup.rate_hz
        if fault is None:
            self._transport.plug_in()
        self._cable_fault = fault

    def _receive(self, received: bytes, now_ns: int) -> None:
        if not self._has_reader:
            self._has_reader = True
            self._parser = CommandParser(self._protocol.find_commands)
            if self._protocol.streams_on_open and self._stream is None:
                was_interrupted = self._was_interrupted
                self._start(now_ns)
                self._resumed_by_itself = was_interrupted
        for command in self._parser.feed(received):
            self._respond(command, self._execute(command, now_ns), now_ns)

    def _respond(self, command: Command, is_done: bool, now_ns: int) -> None:
        answer = self._protocol.respond(command, is_done, self._rate_hz)
        is_stalled = self._schedule.wire_fault(self.time_s(now_ns)) is DisturbanceKind.STALL
        if answer and not is_stalled:
            self._transport.send(answer)

    def _execute(self, command: Command, now_ns: int) -> bool:
        match command.kind:
            case CommandKind.START if self._stream is None:
                self._start(now_ns)
            case CommandKind.STOP:
                self._stream = None
            case CommandKind.RATE:
                is_possible = self._stream is None and 1.0 <= command.rate_hz <= self._protocol.max_rate_hz
                self._rate_hz = command.rate_hz if is_possible else self._rate_hz
                return is_possible
        return True

    def _start(self, now_ns: int) -> None:
        if self._was_interrupted or self._resumed_by_itself:
            self.earlier_logs.append(self.log)
        else:
            self.earlier_logs = []
            self._session_ns = now_ns if self._setup.began_ns is None else self._setup.began_ns
            self._schedule.restart()
        self._was_interrupted = self._resumed_by_itself = False
        self.streams += 1
        device_rate_hz = self._rate_hz * (1.0 + self._setup.rate_error)
        true_rate_hz = device_rate_hz * (1.0 + self._setup.clock_ppm * 1e-6)
        self.log = TransmissionLog(self._rate_hz, true_rate_hz, self.time_s(now_ns))
        signal = self._signal_at(true_rate_hz, self.log.started_s)
        self._stream = self._make_stream(signal, device_rate_hz, now_ns)

    def _make_stream(self, signal: Signal, device_rate_hz: float, now_ns: int) -> "_Stream":
        clock = stream_sender.DeviceClock(
            device_rate_hz, self._setup.first_sequence, self._setup.first_time_s
        )
        kind = stream_sender.BufferedSender if self._protocol.buffer_bytes else StreamSender
        return kind(self._output, signal, clock, self.log, now_ns)


class PolledDevice(SimulatedDevice):
    """A `SimulatedDevice` that answers requests; faults damage its answers, which its log counts as frames.

    A request is on the wire for as long as its bytes take. Then the registers are read, and the answer is
    there when its own bytes have passed.
    """

    def __init__(
        self, transport: Transport, protocol: PolledProtocol, signal_at: SignalFactory, setup: DeviceSetup
    ) -> None:
        super().__init__(transport, protocol, signal_at, setup)
        self._registers = protocol
        self._requests: deque[tuple[int, Command, bool]] = deque()
        """When each is complete (ns), and whether the device could do it."""
        self._answers: deque[tuple[int, bytes]] = deque()

    def step(self, now_ns: int) -> float:
        wait_s = super().step(now_ns)
        if not self._has_reader:
            self._requests.clear()
            self._answers.clear()
        while self._requests and self._requests[0][0] <= now_ns:
            self._answer(*self._requests.popleft())
        while self._answers and self._answers[0][0] <= now_ns:
            self._transport.send(self._answers.popleft()[1])
        due_ns = [due for due, *_ in self._requests] + [due for due, _ in self._answers]
        return max(0.0, min([wait_s, *((due - now_ns) * 1e-9 for due in due_ns)]))

    def _respond(self, command: Command, is_done: bool, now_ns: int) -> None:
        on_wire_s = self._registers.request_bytes(command) * self._registers.byte_s
        self._requests.append((now_ns + round(on_wire_s * 1e9), command, is_done))

    def _answer(self, due_ns: int, command: Command, is_done: bool) -> None:
        answer = self._protocol.respond(command, is_done, self._rate_hz)
        if not answer:
            return
        sent, fault = self._output.distort(answer, self.time_s(due_ns))
        self.log.add(0, fault)
        self.log.bytes_sent += len(sent)
        if sent:
            takes_s = self._registers.turnaround_s + len(sent) * self._registers.byte_s
            self._answers.append((due_ns + round(takes_s * 1e9), sent))

    def _make_stream(self, signal: Signal, _device_rate_hz: float, now_ns: int) -> "_Stream":
        return RegisterUpdater(self._registers, signal, self.log, now_ns)


@dataclass(frozen=True, slots=True)
class RegisterUpdater:
    """Takes samples at their rate into the registers of a polled device, and counts them."""

    registers: PolledProtocol
    signal: Signal
    log: TransmissionLog
    started_ns: int

    def send_due(self, now_ns: int, has_reader: bool) -> float:  # noqa: ARG002 - registers need no reader
        taken = math.floor((now_ns - self.started_ns) * 1e-9 * self.log.true_rate_hz) + 1
        due = taken - self.log.samples
        if due > 0:
            counts, status = self.signal.take(due)
            self.registers.store_sample(counts[-1], int(status[-1]))
            self.log.samples += due
            self.log.samples_clipped += int(np.count_nonzero(status))
        return _UPDATE_S


_Stream: TypeAlias = StreamSender | RegisterUpdater
