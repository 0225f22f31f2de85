"""How a measurement frame of a GSV is laid out: `AA | header | status | payload | 85`."""

from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import ProtocolError
from drivers.gsv.commands import END, SYNC

HEADER_BYTES = 3
MAX_CHANNELS = 16
MAX_FRAME_BYTES = HEADER_BYTES + 4 * MAX_CHANNELS + 1
MEASUREMENT = 0x10
"""Header: type 00, serial interface; its low four bits are the number of channels less one."""
TYPE_AND_INTERFACE = 0xF0
INDICATOR = 0x80
"""Set in the status of every measurement frame."""
OVERLOAD = 0x03
"""Status bits: an input is overloaded (0), a six-axis sensor is out of its range (1)."""


class ValueKind(IntEnum):
    """How a channel's value is written, as in bits 6-4 of the status."""

    INT16 = 1
    INT24 = 2
    FLOAT32 = 3

    @property
    def size(self) -> int:
        """Bytes of a value."""
        return self + 1


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """What all measurement frames of a stream have in common.

    Attributes
    ----------
    channels : int
        Values in a frame, 1 to 16.
    kind : ValueKind
    table, relative : int
        Channels of the two gauges, from 1 on.

    Raises
    ------
    ProtocolError
        If a gauge's channel is not in the frame.
    """

    channels: int
    kind: ValueKind = ValueKind.FLOAT32
    table: int = 1
    relative: int = 2

    def __post_init__(self) -> None:
        for name, channel in (("table", self.table), ("relative", self.relative)):
            if not 1 <= channel <= self.channels:
                raise ProtocolError(
                    f"the device sends {self.channels} channels and the {name} gauge is to be {channel}: "
                    f"set {name} to its channel, or let the device send that channel too"
                )

    @property
    def length(self) -> int:
        """Bytes of a frame."""
        return HEADER_BYTES + self.channels * self.kind.size + 1

    @property
    def header(self) -> int:
        """Second byte of a frame."""
        return MEASUREMENT | (self.channels - 1)

    def offset(self, channel: int) -> int:
        """Place of a channel's value (from 1 on) in a frame."""
        return HEADER_BYTES + (channel - 1) * self.kind.size


def find_layout(data: bytes) -> tuple[int, ValueKind] | None:
    """Channels and kind of the measurement frames in `data`; None while there are not two in a row.

    A second frame just after the first must be whole as well, since the bytes that begin and end a
    frame may stand in a value too.
    """
    at = data.find(SYNC)
    while 0 <= at <= len(data) - HEADER_BYTES:
        found = _layout_at(data, at)
        if found is not None and _layout_at(data, at + HEADER_BYTES + found[0] * found[1].size + 1) == found:
            return found
        at = data.find(SYNC, at + 1)
    return None


def _layout_at(data: bytes, at: int) -> tuple[int, ValueKind] | None:
    """Channels and kind of a frame that is whole at `at`."""
    if len(data) < at + HEADER_BYTES or data[at] != SYNC or data[at + 1] & TYPE_AND_INTERFACE != MEASUREMENT:
        return None
    kind = (data[at + 2] & ~INDICATOR) >> 4
    if not data[at + 2] & INDICATOR or kind not in tuple(ValueKind):
        return None
    channels = (data[at + 1] & 0x0F) + 1
    end = at + HEADER_BYTES + channels * ValueKind(kind).size
    return (channels, ValueKind(kind)) if len(data) > end and data[end] == END else None
