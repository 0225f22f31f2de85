"""Registers of a transmitter: channels, their values, and the requests that read them."""

import struct
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from msgspec import Meta, Struct, field

from drivers.devices.modbus.frames import MAX_REGISTERS, Function, Request
from drivers.devices.modbus.tcp_frames import MAX_UNIT, TcpRequest

WORD_BITS = 16


class Framing(StrEnum):
    """What surrounds the body of a frame."""

    RTU = "rtu"  # on serial lines, and behind device servers that pass bytes on
    TCP = "tcp"


_REQUESTS: dict[Framing, type[Request]] = {Framing.RTU: Request, Framing.TCP: TcpRequest}


class ValueType(StrEnum):
    """Format of a value."""

    INT16 = "int16"
    UINT16 = "uint16"
    INT32 = "int32"
    UINT32 = "uint32"
    FLOAT32 = "float32"


class ByteOrder(StrEnum):
    """Order of the bytes of two registers, A the most significant; one register has the first two."""

    ABCD = "ABCD"
    CDAB = "CDAB"
    BADC = "BADC"
    DCBA = "DCBA"


_CODES = {
    ValueType.INT16: ">h",
    ValueType.UINT16: ">H",
    ValueType.INT32: ">i",
    ValueType.UINT32: ">I",
    ValueType.FLOAT32: ">f",
}

_Register = Annotated[int, Meta(ge=0, le=0xFFFF)]
_Bit = Annotated[int, Meta(ge=0, le=WORD_BITS - 1)]


class Channel(Struct, frozen=True):
    """Registers of one gauge; the names on the wire are the keys of a register map."""

    unit: Annotated[int, Meta(ge=0, le=MAX_UNIT)]
    function: Function
    """Function that reads it, 3 or 4."""
    register: _Register  # first register, counted from 0
    kind: ValueType = field(default=ValueType.INT32, name="type")
    order: ByteOrder = ByteOrder.ABCD
    scale: float = 1.0
    """Counts for one step of the value."""
    status_register: _Register | None = None
    """Register with the state of the value, whose bits are counted from 0, the least significant."""
    overload_bits: tuple[_Bit, ...] = ()  # one of these marks an overload
    fault_bits: tuple[_Bit, ...] = ()  # one of these marks an invalid value
    max_hole: Annotated[int, Meta(ge=0, le=MAX_REGISTERS)] = 0
    """Registers that are not needed, between two that are, over which one request may read."""
    sign_bit: _Bit | None = None  # marks a negative value, whose own sign is then ignored
    zero_register: _Register | None = None  # register that takes the command which sets the value to zero
    zero_value: Annotated[int, Meta(ge=0, le=0xFFFF)] | None = None
    zero_function: Function = Function.WRITE_SINGLE

    @property
    def registers(self) -> int:
        return struct.calcsize(_CODES[self.kind]) // 2


@dataclass(frozen=True, slots=True)
class ChannelValue:
    """Value of a channel: counts, whether they are clipped, and whether they are invalid."""

    counts: float
    is_overloaded: bool = False
    is_faulty: bool = False


def decode_channel(channel: Channel, value: bytes, status_word: int) -> ChannelValue:
    """Value in the bytes of its registers and its status register (0 where there is none)."""
    (raw,) = struct.unpack(_CODES[channel.kind], reorder_bytes(value, channel.order))
    if channel.sign_bit is not None and status_word >> channel.sign_bit & 1:
        raw = -abs(raw)
    return ChannelValue(
        counts=raw * channel.scale,
        is_overloaded=bool(status_word & _mask(channel.overload_bits)) or raw in _limits(channel.kind),
        is_faulty=bool(status_word & _mask(channel.fault_bits)) or raw - raw != 0,  # neither nan nor infinite
    )


def encode_channel(channel: Channel, reading: ChannelValue) -> tuple[bytes, int]:
    """Bytes of the registers and status register for a value, limited to their range."""
    raw, word = reading.counts / channel.scale, 0
    if channel.sign_bit is not None and raw < 0:
        raw, word = -raw, 1 << channel.sign_bit
    if channel.kind is not ValueType.FLOAT32:
        low, high = _limits(channel.kind)
        raw = min(max(round(raw), low), high)
    word |= _mask(channel.overload_bits) if reading.is_overloaded else 0
    word |= _mask(channel.fault_bits) if reading.is_faulty else 0
    return reorder_bytes(struct.pack(_CODES[channel.kind], raw), channel.order), word


def reorder_bytes(data: bytes, order: ByteOrder) -> bytes:
    """Bytes of one or two registers from `order` to `ABCD`, or back: each order is its own inverse."""
    if order in (ByteOrder.BADC, ByteOrder.DCBA):
        data = b"".join(data[at : at + 2][::-1] for at in range(0, len(data), 2))
    if order in (ByteOrder.CDAB, ByteOrder.DCBA):
        data = data[2:] + data[:2]
    return data


def _limits(kind: ValueType) -> tuple[int, ...]:
    if kind is ValueType.FLOAT32:
        return ()
    bits = 8 * struct.calcsize(_CODES[kind])
    low = -(1 << bits - 1) if kind in (ValueType.INT16, ValueType.INT32) else 0
    return low, low + (1 << bits) - 1


def _mask(bits: tuple[int, ...]) -> int:
    return sum(1 << bit for bit in bits)


@dataclass(frozen=True, slots=True)
class Poll:
    """One sample of all channels."""

    requests: tuple[Request, ...]
    """In the order in which they are sent; one where all registers are adjacent in one unit. The time of the
    first is that of the sample."""
    channels: tuple[Channel, ...]

    @property
    def gauge_requests(self) -> tuple[int, int]:
        """Numbers of the requests that read the first and the last channel."""
        return self._request_of(self.channels[0]), self._request_of(self.channels[-1])

    def channel_values(self, answers: list[bytes]) -> list[ChannelValue]:
        values = []
        for channel in self.channels:
            state = channel.status_register
            word = 0 if state is None else int.from_bytes(self._find(answers, channel, state, 1), "big")
            value = self._find(answers, channel, channel.register, channel.registers)
            values.append(decode_channel(channel, value, word))
        return values

    def _request_of(self, channel: Channel, register: int | None = None) -> int:
        wanted = channel.register if register is None else register
        return next(
            number
            for number, request in enumerate(self.requests)
            if (request.unit, request.function) == (channel.unit, channel.function)
            and request.register <= wanted < request.register + request.count
        )

    def _find(self, answers: list[bytes], channel: Channel, register: int, registers: int) -> bytes:
        number = self._request_of(channel, register)
        start = 2 * (register - self.requests[number].register)
        return answers[number][start : start + 2 * registers]


def plan_poll(channels: tuple[Channel, ...], framing: Framing = Framing.RTU) -> Poll:
    """The fewest requests that read only the needed registers, and holes as large as the channels allow."""
    make_request = _REQUESTS[framing]
    spans: dict[tuple[int, Function], list[tuple[int, int]]] = {}
    for channel in channels:
        needed = spans.setdefault((channel.unit, channel.function), [])
        needed.append((channel.register, channel.register + channel.registers))
        if channel.status_register is not None:
            needed.append((channel.status_register, channel.status_register + 1))
    max_hole = min(channel.max_hole for channel in channels)
    requests = tuple(
        make_request(unit, function, first, end - first)
        for (unit, function), parts in spans.items()
        for first, end in _merge_spans(parts, max_hole)
    )
    return Poll(requests, channels)


def _merge_spans(spans: list[tuple[int, int]], max_hole: int) -> list[tuple[int, int]]:
    """Join spans with at most `max_hole` registers between them, while one request may read them."""
    joined: list[tuple[int, int]] = []
    for first, end in sorted(spans):
        if joined and first <= joined[-1][1] + max_hole and end - joined[-1][0] <= MAX_REGISTERS:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((first, end))
    return joined
