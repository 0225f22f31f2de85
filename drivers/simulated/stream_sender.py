"""One stream of the simulated device, from its start to its end, and the log of what was sent."""

import math
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from drivers.arrays import Int32s, UInt8s
from drivers.simulated.faults import (
    LASTING_FAULTS,
    LOSING_FAULTS,
    DisturbanceKind,
    DisturbanceSchedule,
    FrameDamager,
    FrameFault,
)
from drivers.simulated.protocol import SimulatedProtocol
from drivers.simulated.transport import Transport

MAX_DAMAGE_LISTED = 10_000  # damaged and lost stretches beyond this number are counted, not listed


@dataclass(frozen=True, slots=True)
class DamagedStretch:
    """One frame that did not arrive whole, or consecutive frames of one lasting fault."""

    first_index: int
    samples: int
    fault: FrameFault


@dataclass(slots=True)
class TransmissionLog:
    """What was sent since the stream started; the first sample counted here has index 0.

    `frames` and `samples` are those due by the device's clock. Of these the damaged ones were sent with a
    fault, the lost ones not at all, or only in part.
    """

    rate_hz: float  # as the device reports it
    true_rate_hz: float  # samples a second of the stand's own time
    started_s: float = 0.0  # when sample 0 was taken, on the stand's own time
    frames: int = 0
    samples: int = 0
    frames_damaged: int = 0
    samples_damaged: int = 0
    frames_lost: int = 0
    samples_lost: int = 0
    samples_clipped: int = 0
    """Readings of either gauge beyond its range, sent or not."""
    samples_flagged: int = 0  # in frames that were sent whole with an overload flag
    bytes_sent: int = 0
    damage: list[DamagedStretch] = field(default_factory=list)

    def add(self, samples: int, fault: FrameFault | None) -> None:
        if fault in LOSING_FAULTS:
            self.frames_lost += 1
            self.samples_lost += samples
        elif fault is not None:
            self.frames_damaged += 1
            self.samples_damaged += samples
        last = self.damage[-1] if self.damage and fault in LASTING_FAULTS else None
        if last and last.fault is fault and last.first_index + last.samples == self.samples:
            self.damage[-1] = replace(last, samples=last.samples + samples)
        elif fault is not None and len(self.damage) < MAX_DAMAGE_LISTED:
            self.damage.append(DamagedStretch(self.samples, samples, fault))
        self.frames += 1
        self.samples += samples


class Signal(Protocol):
    """What the device's converter reads, sample after sample."""

    def take(self, count: int) -> tuple[Int32s, UInt8s]:
        """Counts (count, 2) of the next samples and their overload bits of `SampleStatus` (count,)."""


@dataclass(frozen=True, slots=True)
class WireOutput:
    """The way of a frame out of the device, with its faults."""

    transport: Transport
    protocol: SimulatedProtocol
    damager: FrameDamager
    disturbances: DisturbanceSchedule

    def distort(self, frame: bytes, at_s: float) -> tuple[bytes, FrameFault | None]:
        """Bytes of a frame on the wire at the stand's time `at_s`, and what happened to it."""
        match self.disturbances.wire_fault(at_s):
            case DisturbanceKind.STALL:
                return b"", FrameFault.STALL
            case DisturbanceKind.GARBAGE:
                return self.damager.garbage(frame)
        return self.damager.damage(frame)


@dataclass(frozen=True, slots=True)
class DeviceClock:
    """The device's own clock and counter of samples."""

    rate_hz: float
    first_sequence: int = 0
    first_time_s: float = 0.0


class StreamSender:
    """Sends the samples of one stream at their time, sample 0 at the host's monotonic `started_ns`."""

    _STEP_S = 0.001
    _CATCH_UP = 1.25
    """A late stream is sent so many times as fast; real devices never send much faster than their rate."""
    _BURST_LEAST = 64
    """Samples that may be sent at once at any rate, some kB: a process that gets the processor each 30 ms
    keeps pace at 2 kHz, and does not look like a device of a lower rate."""

    def __init__(
        self, output: WireOutput, signal: Signal, clock: DeviceClock, log: TransmissionLog, started_ns: int
    ) -> None:
        self._output = output
        self._signal = signal
        self._clock = clock
        self._log = log
        self._started_ns = started_ns
        self._n = output.protocol.samples_per_frame(log.rate_hz)
        burst = max(output.transport.burst_s * log.true_rate_hz, self._BURST_LEAST)
        self._burst = math.ceil(burst / self._n)
        self._allowed = float(self._burst)
        self._stepped_ns = started_ns

    def send_due(self, now_ns: int, has_reader: bool) -> float:
        """Send the frames that are complete by now; returns seconds until the next one is."""
        rate_hz = self._log.true_rate_hz
        taken = math.floor((now_ns - self._started_ns) * 1e-9 * rate_hz) + 1
        frames = min(taken // self._n - self._log.frames, self._allowance(now_ns))
        if frames > 0:
            self._send(frames, has_reader)
            self._allowed -= frames
        complete = (self._log.frames + 1) * self._n - 1
        return max(complete / rate_hz - (now_ns - self._started_ns) * 1e-9, self._STEP_S)

    def _allowance(self, now_ns: int) -> int:
        """Frames that may be sent now: what the time since the last step allows, one burst at most."""
        rate_hz = self._CATCH_UP * self._log.true_rate_hz / self._n
        earned = (now_ns - self._stepped_ns) * 1e-9 * rate_hz
        # One frame more is saved: steps of 1 ms would else lose the fraction that they earn beyond a burst.
        self._allowed = min(self._allowed + earned, self._burst + 1.0)
        self._stepped_ns = now_ns
        return min(math.floor(self._allowed), self._burst)

    def _send(self, frames: int, has_reader: bool) -> None:
        log, protocol, damager = self._log, self._output.protocol, self._output.damager
        counts, status = self._signal.take(frames * self._n)
        first = log.samples + self._n * np.arange(frames)
        taken_s = log.started_s + first / log.true_rate_hz
        offset_s = self._output.disturbances.clock_offset_s(taken_s)
        device_s = self._clock.first_time_s + first / self._clock.rate_hz + offset_s
        encoded = protocol.encode(log.samples + self._clock.first_sequence, counts, status, device_s)
        was_line_open = damager.is_line_open
        sent = list(map(self._output.distort, encoded, taken_s.tolist()))
        data = b"".join(part for part, _ in sent)
        room = self._deliver(data) if has_reader else 0
        if room < len(data):
            ended = data[:room].endswith(protocol.line_end)
            damager.is_line_open = not ended if room else was_line_open and has_reader
        log.bytes_sent += room
        log.samples_clipped += int(np.count_nonzero(status))
        end, beyond = 0, FrameFault.CUT if has_reader else FrameFault.NO_READER
        for (part, fault), row in zip(sent, status.reshape(frames, self._n), strict=True):
            end += len(part)
            happened = fault if end <= room or fault in LOSING_FAULTS else beyond
            log.add(self._n, happened)
            if protocol.flags_overload and happened is None and row.any():
                log.samples_flagged += self._n

    def _deliver(self, data: bytes) -> int:
        """Send; returns the number of bytes that are not lost."""
        return self._output.transport.send(data)


class BufferedSender(StreamSender):
    """Sends whole packets, keeps what the port does not take, and ends where there is no room for more."""

    def __init__(
        self, output: WireOutput, signal: Signal, clock: DeviceClock, log: TransmissionLog, started_ns: int
    ) -> None:
        super().__init__(output, signal, clock, log, started_ns)
        self._buffer = b""
        self._has_overflowed = False

    @property
    def is_over(self) -> bool:
        """Whether it has overflowed, and all that was kept is sent."""
        return self._has_overflowed and not self._buffer

    def send_due(self, now_ns: int, has_reader: bool) -> float:
        if not has_reader:
            self._buffer = b""
        if self._has_overflowed:
            self._buffer = self._buffer[self._output.transport.send(self._buffer) :]
            return self._STEP_S
        return super().send_due(now_ns, has_reader)

    def _deliver(self, data: bytes) -> int:
        protocol = self._output.protocol
        self._buffer += data
        whole = len(self._buffer) - len(self._buffer) % protocol.packet_bytes
        self._buffer = self._buffer[self._output.transport.send(self._buffer[:whole]) :]
        lost = max(0, len(self._buffer) - protocol.buffer_bytes)
        if lost:
            self._has_overflowed = True
            self._buffer = self._buffer[: protocol.buffer_bytes] + protocol.overflow()
        return len(data) - lost
