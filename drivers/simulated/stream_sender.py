"""One stream of the simulated device, from its start to its end."""

import math
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.disturbances import DisturbanceKind, DisturbanceSchedule
from drivers.simulated.faults import LASTING_FAULTS, LOSING_FAULTS, FrameDamager, FrameFault
from drivers.simulated.transport import Transport
from drivers.simulated.wire import SimulatedProtocol

MAX_DAMAGE_LISTED = 10_000
"""Damaged and lost stretches beyond this many are counted, not listed."""


@dataclass(frozen=True, slots=True)
class DamagedStretch:
    """One frame that did not arrive whole, or all in a row that fell to one lasting fault."""

    first_index: int
    samples: int
    fault: FrameFault


@dataclass(slots=True)
class TransmissionLog:
    """Everything since the stream was started: sample index 0 is the first one counted here.

    `frames` and `samples` are those due by the device's clock; of these the damaged ones went out with a
    fault, the lost ones not at all (those that the port took a part of included).
    """

    rate_hz: float
    """What the device says that it sends."""
    true_rate_hz: float
    """Samples a second of the stand's own time."""
    started_s: float = 0.0
    """When sample 0 was taken, on the stand's own time."""
    frames: int = 0
    samples: int = 0
    frames_damaged: int = 0
    samples_damaged: int = 0
    frames_lost: int = 0
    samples_lost: int = 0
    samples_clipped: int = 0
    """Readings of either gauge beyond its range, arrived or not."""
    samples_flagged: int = 0
    """In frames that went out whole with an overload flag."""
    bytes_sent: int = 0
    damage: list[DamagedStretch] = field(default_factory=list)

    def add(self, samples: int, fault: FrameFault | None) -> None:
        """Count the next frame."""
        if fault is not None:
            self._add_fault(samples, fault)
        self.frames += 1
        self.samples += samples

    def _add_fault(self, samples: int, fault: FrameFault) -> None:
        if fault in LOSING_FAULTS:
            self.frames_lost += 1
            self.samples_lost += samples
        else:
            self.frames_damaged += 1
            self.samples_damaged += samples
        last = self.damage[-1] if self.damage else None
        if (
            last
            and fault in LASTING_FAULTS
            and last.fault is fault
            and last.first_index + last.samples == self.samples
        ):
            self.damage[-1] = replace(last, samples=last.samples + samples)
        elif len(self.damage) < MAX_DAMAGE_LISTED:
            self.damage.append(DamagedStretch(self.samples, samples, fault))


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
