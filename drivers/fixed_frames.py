"""Frames of one length without sequence number and checksum, found by the bytes that are alike in all."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from drivers.arrays import Counts, Ints, Records, UInt8s
from drivers.compiled import compiled, inlined
from drivers.packets import (
    MAX_GAP_S,
    PACKET,
    LossEstimator,
    PacketDecoder,
    count_estimated_packets,
    frames_in,
    state_type,
)


class FixedFrameDecoder(PacketDecoder):
    """Bytes to sample blocks, a sample a frame; a device adds `_find_frames` and `_read_frames`.

    A row stands for each frame that came broken. Frames that did not come are estimated from the host's
    clock, in `losses` alone. A wrong bit within a value is not noticed. After a broken connection, rows stand
    for the time until the next frame.

    `state` is a `state_type` with the field `garbage`, bytes since the last good frame.
    """

    _has_time = False

    def __init__(self, state: np.dtype[np.void], length: int, rate_hz: float, max_gap_s: float) -> None:
        super().__init__(state, rate_hz, max_gap_s)
        self._length = length
        self._loss_estimator = LossEstimator(rate_hz)

    def expect_restart(self) -> None:
        self._state["garbage"] += len(self._unfinished)
        super().expect_restart()

    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        buffer = np.frombuffer(data, dtype=np.uint8)
        offsets = np.empty(len(data) // self._length, dtype=np.int64)
        broken = np.empty(len(offsets), dtype=np.int64)
        found, used = self._find_frames(buffer, offsets, broken)
        offsets, self._unfinished = offsets[:found], data[used:]
        counts, status = self._read_frames(buffer, offsets)
        packets = np.zeros(found, dtype=PACKET)
        packets["samples"] = 1
        packets["status"] = status
        packets["damaged"] = broken[:found]
        if self._arrival_ns is None:
            packets["damaged"][:1] = 0
        if found and self._state[0]["restarting"]:
            gap = self._rows_since(arrival_ns, found)
            packets["damaged"][0] = min(gap, broken[0])
            packets["missing"][0] = gap - packets["damaged"][0]
        count_estimated_packets(packets, self._state)
        if found:
            self._state["restarts"] += self._state["restarting"]
            self._state["restarting"] = 0
        return packets, counts

    @abstractmethod
    def _find_frames(self, buffer: UInt8s, offsets: Ints, broken: Ints) -> tuple[int, int]:
        """Fill offsets of good frames and how many came broken before each; returns frames and used bytes."""

    @abstractmethod
    def _read_frames(self, buffer: UInt8s, offsets: Ints) -> tuple[Counts, Ints]:
        """Counts (n, 2) and flags of `SampleStatus` (n,) of the frames at `offsets` (n,)."""


def read_numbers(buffer: UInt8s, offsets: Ints, places: list[int], size: int) -> Ints:
    """Unsigned whole numbers of `size` bytes, high byte first, at `places` (m) of the frames, (n, m)."""
    at = np.add.outer(offsets, places)
    numbers = buffer[at].astype(np.int64)
    for byte in range(1, size):
        numbers = numbers << 8 | buffer[at + byte]
    return numbers


@dataclass(frozen=True, slots=True)
class FrameMarks:
    """What is alike in all frames of a device."""

    length: int
    marks: tuple[tuple[int, int, int], ...]
    """Place of a byte, its bits that are alike, and their value."""
    ahead: int = 1
    """Bytes after a frame that must fit too. The frame waits for them."""
    confirming: int = 1
    """Whole frames that must fit after one that does not follow a good one at once."""


STATE = state_type("garbage begun in_step", "")
"""What the decoder keeps between calls: bytes since the last good frame, whether a frame began with the first
of them, and whether the next frame is expected at once."""


class MarkedFrameDecoder(FixedFrameDecoder):
    """A `FixedFrameDecoder` of frames that are known by their marks; a device adds `_read_frames`."""

    def __init__(self, marks: FrameMarks, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        super().__init__(STATE, marks.length, rate_hz, max_gap_s)
        self._ahead, self._confirming = marks.ahead, marks.confirming
        self._pattern = np.zeros((2, marks.length), dtype=np.uint8)  # bits that are alike, and their value
        for place, bits, value in marks.marks:
            self._pattern[:, place] = bits, value

    def expect_restart(self) -> None:
        self._state["in_step"] = 0
        super().expect_restart()

    def _find_frames(self, buffer: UInt8s, offsets: Ints, broken: Ints) -> tuple[int, int]:
        found, used = find_marked_frames(
            buffer, self._pattern, self._ahead, self._confirming, self._state, offsets, broken
        )
        return int(found), int(used)


@compiled
def find_marked_frames(
    buffer: UInt8s, pattern: UInt8s, ahead: int, confirming: int, states: Records, offsets: Ints, broken: Ints
) -> tuple[int, int]:
    """Offsets of the good frames in `buffer`, and how many came broken before each.

    A bad candidate costs one byte. Returns the number of frames and of used bytes; at most `confirming` + 1
    frames are left. `states` (1,) is updated.
    """
    state = states[0]
    length = pattern.shape[1]
    at = found = 0
    while True:
        span = length + ahead if state.in_step else length * (1 + confirming)
        if at + span > len(buffer):
            break
        if _fits(buffer, at, span, pattern):
            offsets[found] = at
            broken[found] = max(state.begun, frames_in(state.garbage, length))
            state.garbage = state.begun = 0
            state.in_step = 1
            found += 1
            at += length
            continue
        if state.garbage == 0 and _fits(buffer, at, 1, pattern):
            state.begun = 1
        state.garbage += 1
        state.in_step = 0
        at += 1
    state.discarded_bytes += at - found * length
    return found, at


@inlined
def _fits(buffer: UInt8s, at: int, span: int, pattern: UInt8s) -> bool:
    length = pattern.shape[1]
    for i in range(span):
        place = i % length
        if buffer[at + i] & pattern[0, place] != pattern[1, place]:
            return False
    return True
