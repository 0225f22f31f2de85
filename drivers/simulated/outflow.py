"""One stream of the simulated device, from its start to its end."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.account import TransmissionLog
from drivers.simulated.disturbances import DisturbanceKind, DisturbanceSchedule
from drivers.simulated.faults import LOSING_FAULTS, FrameDamager, FrameFault
from drivers.simulated.transport import Transport
from drivers.simulated.wire import SimulatedProtocol


class Signal(Protocol):
    """What the device's converter reads, sample after sample."""

    def take(self, count: int) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
        """Counts (count, 2) of the next samples and their overload bits of `SampleStatus` (count,)."""


class Stream(Protocol):
    """Samples since one start of the device."""

    def send_due(self, now_ns: int, has_reader: bool) -> float:
        """Take and send what is due at the host's monotonic time; return seconds until to look again."""


@dataclass(frozen=True, slots=True)
class WireOutput:
    """Where bytes go, how they look, and what becomes of them."""

    transport: Transport
    packing: SimulatedProtocol
    damager: FrameDamager
    disturbances: DisturbanceSchedule


@dataclass(frozen=True, slots=True)
class DeviceClock:
    """The device's own clock and counter.

    Attributes
    ----------
    rate_hz : float
        Samples a second of this clock.
    first_sequence : int
        What the counter of samples reads at sample 0.
    first_time_s : float
        What the clock reads at sample 0 (s).
    """

    rate_hz: float
    first_sequence: int = 0
    first_time_s: float = 0.0


class StreamSender:
    """Samples on their way since one start.

    Parameters
    ----------
    line : Line
    signal : Signal
    clock : DeviceClock
    account : WireAccount
        Kept up to date.
    started_ns : int
        Host's monotonic time of sample 0.
    """

    _STEP_S = 0.001
    _CATCHING_UP = 1.25
    """A stream that is late is sent so many times as fast: readers of real devices bear little more."""

    def __init__(
        self, line: WireOutput, signal: Signal, clock: DeviceClock, account: TransmissionLog, started_ns: int
    ) -> None:
        self._line = line
        self._signal = signal
        self._clock = clock
        self._account = account
        self._started_ns = started_ns
        self._n = line.packing.samples_per_frame(account.rate_hz)
        self._burst = math.ceil(line.transport.burst_s * account.true_rate_hz / self._n)
        self._allowed = float(self._burst)
        self._stepped_ns = started_ns

    def send_due(self, now_ns: int, has_reader: bool) -> float:
        """Send the frames that are complete by now; return seconds until the next one is."""
        rate_hz = self._account.true_rate_hz
        taken = math.floor((now_ns - self._started_ns) * 1e-9 * rate_hz) + 1
        frames = min(taken // self._n - self._account.frames, self._allowance(now_ns))
        if frames > 0:
            self._send(frames, has_reader)
            self._allowed -= frames
        complete = (self._account.frames + 1) * self._n - 1
        return max(complete / rate_hz - (now_ns - self._started_ns) * 1e-9, self._STEP_S)

    def _allowance(self, now_ns: int) -> int:
        """How many frames may be sent now: what time has brought, one burst at most.

        One frame more is saved, or else what steps of whole milliseconds earn beyond a burst were lost, and
        with it the catching up.
        """
        rate_hz = self._CATCHING_UP * self._account.true_rate_hz / self._n
        earned = (now_ns - self._stepped_ns) * 1e-9 * rate_hz
        self._allowed = min(self._allowed + earned, self._burst + 1.0)
        self._stepped_ns = now_ns
        return min(math.floor(self._allowed), self._burst)

    def _send(self, frames: int, is_heard: bool) -> None:
        account, packing = self._account, self._line.packing
        counts, status = self._signal.take(frames * self._n)
        packed, taken_s = self._packed(frames, counts, status)
        ran_on = self._line.damager.is_line_open
        carried = [self._carried(frame, at_s) for frame, at_s in zip(packed, taken_s, strict=True)]
        data = b"".join(part for part, _ in carried)
        room = self._line.transport.send(data) if is_heard else 0
        if room < len(data):
            self._line.damager.is_line_open = self._is_unfinished(data[:room], ran_on and is_heard)
        account.bytes_sent += room
        account.samples_clipped += int(np.count_nonzero(status))
        clipped = status.reshape(frames, self._n)
        flagged = [packing.flags_overload and bool(row.any()) for row in clipped]
        self._count(carried, flagged, room, FrameFault.CUT if is_heard else FrameFault.NO_READER)

    def _packed(
        self, frames: int, counts: NDArray[np.int32], status: NDArray[np.uint8]
    ) -> tuple[list[bytes], list[float]]:
        """Frames of the next samples, and when (s, stand's time) the first sample of each was taken."""
        account, clock = self._account, self._clock
        first = account.samples + self._n * np.arange(frames)
        taken_s = account.started_s + first / account.true_rate_hz
        device_s = (
            clock.first_time_s + first / clock.rate_hz + self._line.disturbances.clock_offset_s(taken_s)
        )
        packed = self._line.packing.encode(account.samples + clock.first_sequence, counts, status, device_s)
        return packed, taken_s.tolist()

    def _is_unfinished(self, taken: bytes, was_unfinished: bool) -> bool:
        """Tell whether what the port took, or what stood there before, waits for the end of its line."""
        return not taken.endswith(self._line.packing.line_end) if taken else was_unfinished

    def _carried(self, frame: bytes, at_s: float) -> tuple[bytes, FrameFault | None]:
        match self._line.disturbances.wire_fault(at_s):
            case DisturbanceKind.STALL:
                return b"", FrameFault.STALL
            case DisturbanceKind.GARBAGE:
                return self._line.damager.garbage(frame)
        return self._line.damager.damage(frame)

    def _count(
        self,
        carried: list[tuple[bytes, FrameFault | None]],
        flagged: list[bool],
        room: int,
        beyond: FrameFault,
    ) -> None:
        """Count frames of which the port took `room` bytes, and the rest fell to the fault `beyond`."""
        end = 0
        for (data, fault), is_flagged in zip(carried, flagged, strict=True):
            end += len(data)
            happened = fault if end <= room or fault in LOSING_FAULTS else beyond
            self._account.add(self._n, happened)
            if is_flagged and happened is None:
                self._account.samples_flagged += self._n
