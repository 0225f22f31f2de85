"""The simulated device that answers when it is asked, each time after as long as wire and device take."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.commands import Command
from drivers.simulated.device import DeviceSetup, SimulatedDevice
from drivers.simulated.disturbances import DisturbanceKind
from drivers.simulated.faults import FaultRates, FrameDamager, FrameFault
from drivers.simulated.stream_sender import Signal, Stream, TransmissionLog
from drivers.simulated.transport import Transport
from drivers.simulated.wire import SimulatedProtocol


@runtime_checkable
class PolledProtocol(SimulatedProtocol, Protocol):
    """A protocol whose samples are not sent: the latest one stands in registers, to be asked for."""

    @property
    def byte_s(self) -> float:
        """Time of one byte on the wire (s)."""

    @property
    def turnaround_s(self) -> float:
        """From the end of a request to the beginning of its answer (s)."""

    def request_bytes(self, command: Command) -> int:
        """Length of a request."""

    def store_sample(self, counts: NDArray[np.int32], status: int) -> None:
        """Put a sample, (2,) counts and the overload bits of `SampleStatus`, into the registers."""


def make_device(
    transport: Transport,
    packing: SimulatedProtocol,
    signal_at: Callable[[float, float], Signal],
    setup: DeviceSetup,
) -> SimulatedDevice:
    """The device for a packing: one that sends, or one that is asked."""
    if isinstance(packing, PolledProtocol):
        return PolledDevice(transport, packing, signal_at, setup)
    return SimulatedDevice(transport, packing, signal_at, setup)


@dataclass(frozen=True, slots=True)
class _PendingRequest:
    """A request that is whole at `due_ns`."""

    due_ns: int
    command: Command
    is_done: bool


class PolledDevice(SimulatedDevice):
    """A `SimulatedDevice` whose faults befall its answers, which its account counts as frames.

    A request is on the wire for as long as its bytes take; then the registers are read as they stand, and
    the answer is there when its own bytes have passed.
    """

    def __init__(
        self,
        transport: Transport,
        packing: PolledProtocol,
        signal_at: Callable[[float, float], Signal],
        setup: DeviceSetup,
    ) -> None:
        super().__init__(transport, packing, signal_at, replace(setup, faults=FaultRates()))
        self._registers = packing
        self._damager = FrameDamager(setup.faults, packing.line_end, setup.seed)
        self._heard: deque[_PendingRequest] = deque()
        self._answers: deque[tuple[int, bytes]] = deque()

    def step(self, now_ns: int) -> float:
        """Do what is due at `now_ns` of the host's monotonic clock; return seconds to wait at most."""
        wait_s = super().step(now_ns)
        if not self._reader_is_there:
            self._heard.clear()
            self._answers.clear()
        while self._heard and self._heard[0].due_ns <= now_ns:
            self._answer(self._heard.popleft())
        while self._answers and self._answers[0][0] <= now_ns:
            self._transport.send(self._answers.popleft()[1])
        due_ns = [heard.due_ns for heard in self._heard] + [due for due, _ in self._answers]
        return max(0.0, min([wait_s, *((due - now_ns) * 1e-9 for due in due_ns)]))

    def _respond(self, command: Command, is_done: bool, now_ns: int) -> None:
        on_wire_s = self._registers.request_bytes(command) * self._registers.byte_s
        self._heard.append(_PendingRequest(now_ns + round(on_wire_s * 1e9), command, is_done))

    def _answer(self, heard: _PendingRequest) -> None:
        answer = self._packing.respond(heard.command, heard.is_done, self._rate_hz)
        if not answer:
            return
        carried, fault = self._carried(answer, self._time_s(heard.due_ns))
        self.log.add(0, fault)
        self.log.bytes_sent += len(carried)
        if carried:
            takes_s = self._registers.turnaround_s + len(carried) * self._registers.byte_s
            self._answers.append((heard.due_ns + round(takes_s * 1e9), carried))

    def _carried(self, answer: bytes, at_s: float) -> tuple[bytes, FrameFault | None]:
        match self._script.wire_fault(at_s):
            case DisturbanceKind.STALL:
                return b"", FrameFault.STALL
            case DisturbanceKind.GARBAGE:
                return self._damager.garbage(answer)
        return self._damager.damage(answer)

    def _make_stream(self, signal: Signal, device_rate_hz: float, now_ns: int) -> Stream:  # noqa: ARG002
        return RegisterUpdater(self._registers, signal, self.log, now_ns)


class RegisterUpdater:
    """Samples that are taken at their rate and not sent; stands where a streaming device has its outflow.

    Parameters
    ----------
    registers : PolledPacking
        Given the latest one.
    signal : Signal
    account : WireAccount
        Its samples are counted, its frames are the answers.
    started_ns : int
        Host's monotonic time of sample 0.
    """

    _OFTEN_S = 0.02

    def __init__(
        self, registers: PolledProtocol, signal: Signal, account: TransmissionLog, started_ns: int
    ) -> None:
        self._registers = registers
        self._signal = signal
        self._account = account
        self._started_ns = started_ns

    def send_due(self, now_ns: int, has_reader: bool) -> float:  # noqa: ARG002 - registers need no listener
        """Take the samples that are due; return seconds until to look again, requests or not."""
        rate_hz = self._account.true_rate_hz
        due = math.floor((now_ns - self._started_ns) * 1e-9 * rate_hz) + 1 - self._account.samples
        if due > 0:
            counts, status = self._signal.take(due)
            self._registers.store_sample(counts[-1], int(status[-1]))
            self._account.samples += due
            self._account.samples_clipped += int(np.count_nonzero(status))
        return self._OFTEN_S
