"""Measurement frames of a GSV-4, GSV-3 and GSV-2, encoded and decoded."""

from dataclasses import dataclass

import numpy as np

from drivers.arrays import Int32s, Ints, UInt8s
from drivers.fixed_frames import FrameMarks, MarkedFrameDecoder, read_numbers
from drivers.packets import MAX_GAP_S
from drivers.samples import overload_status

GSV_4, GSV_3, GSV_2 = "gsv-4", "gsv-3", "gsv-2"
CHANNELS = 4  # of a GSV-4
_VALUE_START = 1
_SWITCHES = 0x18
"""Bits of the status of a GSV-2 that may be set, its threshold switches; the others are reserved."""
_CONFIRMING_OF_SHORT = 8
"""Frames that must follow where only one byte in three is alike: readings may hold that byte too."""


@dataclass(frozen=True, slots=True)
class FrameFormat:
    """Frames of one model: values of `size` bytes, high byte first, with half the range added."""

    marks: FrameMarks
    places: tuple[int, ...]
    """Where the value of each channel begins."""
    size: int

    @property
    def zero(self) -> int:
        return 1 << 8 * self.size - 1

    @property
    def max_count(self) -> int:
        return self.zero - 1


FORMATS = {
    # me-systeme, GSV4_python_testScripts: A5, four values, 0D 0A
    GSV_4: FrameFormat(FrameMarks(11, ((0, 0xFF, 0xA5), (9, 0xFF, 0x0D), (10, 0xFF, 0x0A))), (1, 3, 5, 7), 2),
    # me-systeme, GSV-3-test-scripts: A5, one value
    GSV_3: FrameFormat(FrameMarks(3, ((0, 0xFF, 0xA5),), confirming=_CONFIRMING_OF_SHORT), (1,), 2),
    # GSV-2AS user manual, page 16: 2C, status, one value
    GSV_2: FrameFormat(FrameMarks(5, ((0, 0xFF, 0x2C), (1, 0xFF & ~_SWITCHES, 0)), confirming=4), (2,), 3),
}
"""By the name of the model."""


def channel_places(layout: FrameFormat, channels: tuple[int, ...]) -> list[int]:
    """Where the values of `channels` (from 1) begin; those of a model with one channel begin at its own."""
    if len(layout.places) == 1:
        return list(layout.places)
    return [layout.places[channel - 1] for channel in channels]


def encode_frames(layout: FrameFormat, counts: Int32s, channels: tuple[int, ...] = (1, 2)) -> UInt8s:
    """Frames as a device without faults sends them; channels without a gauge are 0.

    `counts` (n, 2) are table and relative, limited to the range. A model with one channel sends the first.
    Returns (n, layout.marks.length) uint8, a frame a row.
    """
    wire = np.zeros((len(counts), layout.marks.length), dtype=np.uint8)
    for place, _, value in layout.marks.marks:
        wire[:, place] = value
    for place in layout.places:
        wire[:, place] = layout.zero >> 8 * (layout.size - 1)
    shifted = np.clip(counts, -layout.zero, layout.max_count).astype(np.int64) + layout.zero
    for column, place in enumerate(channel_places(layout, channels)):
        for byte in range(layout.size):
            wire[:, place + byte] = shifted[:, column] >> 8 * (layout.size - 1 - byte) & 0xFF
    return wire


class FrameDecoder(MarkedFrameDecoder):
    """A `MarkedFrameDecoder` of these amplifiers, which marks a reading at an end of its range as overloaded.

    The sample of a frame is given once the next frame has begun. After a lost byte, frames of a GSV-3 are
    read one byte off for as long as the high byte of the readings is A5, as the first byte of a frame is:
    0.4 % of the range.
    """

    def __init__(
        self,
        layout: FrameFormat,
        rate_hz: float,
        channels: tuple[int, ...] = (1, 2),
        max_gap_s: float = MAX_GAP_S,
    ) -> None:
        super().__init__(layout.marks, rate_hz, max_gap_s)
        self._layout = layout
        self._places = channel_places(layout, channels)

    def _read_frames(self, buffer: UInt8s, offsets: Ints) -> tuple[Int32s, Ints]:
        layout = self._layout
        numbers = read_numbers(buffer, offsets, self._places, layout.size) - layout.zero
        counts = np.zeros((len(offsets), 2), dtype=np.int32)
        counts[:, : numbers.shape[1]] = numbers
        return counts, overload_status((numbers <= -layout.zero) | (numbers >= layout.max_count))


def count_frames(layout: FrameFormat, data: bytes) -> int:
    """Frames in `data`, the last one left out."""
    return sum(map(len, FrameDecoder(layout, 1.0).feed(data, 0)))
