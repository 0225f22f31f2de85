"""Messages of the Harp protocol and load cell events, encoded and decoded.

`type | length | address | port | payload type | [seconds u32 | 32 us u16] | payload | checksum`,
little-endian; the length counts the bytes after it, the checksum is the sum of all bytes before it
(harp-tech protocol, device.loadcells/device.yml).
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from drivers.arrays import Counts, Flags, Floats, Ints, Record, Records, UInt8s, record_type
from drivers.clock import rate_from_steps
from drivers.compiled import compiled, inlined
from drivers.line_counting import BY_TIME, STATE, count_lines, make_rules
from drivers.packets import MAX_GAP_S, PACKET, PacketDecoder
from messages.i18n import N_
from messages.message import Message, message

READ, WRITE, EVENT = 1, 2, 3
ERROR = 0x08
"""Bit of the type of a reply: the device refuses."""
PORT = 0xFF
U8, U16, S16 = 0x01, 0x02, 0x82
HAS_TIMESTAMP = 0x10
"""Bit of the payload type: a timestamp comes first."""
MIN_MESSAGE_BYTES = 6
WHO_AM_I = 1232
TICKS_PER_S = 31_250
_TIME = 6
_HEAD = 5
_ACTIVE = 0x01
_MODE_AND_MUTE = 0x13
LOAD_CELL_EVENTS = 0x01
"""Bit of `EVENTS`: samples are sent."""


class Register(IntEnum):
    """Addresses."""

    WHO_AM_I = 0
    FIRMWARE_HIGH = 6
    FIRMWARE_LOW = 7
    OPERATION = 10
    SERIAL_NUMBER = 13
    ACQUISITION = 32
    LOAD_CELLS = 33
    EVENTS = 90


PAYLOAD_TYPES = {
    Register.WHO_AM_I: U16,
    Register.FIRMWARE_HIGH: U8,
    Register.FIRMWARE_LOW: U8,
    Register.OPERATION: U8,
    Register.SERIAL_NUMBER: U16,
    Register.ACQUISITION: U8,
    Register.EVENTS: U8,
}
"""Payload type of the registers that are read and written here."""


@dataclass(frozen=True, slots=True)
class HarpMessage:
    """A message without its time."""

    kind: int
    address: int
    payload: bytes = b""

    @property
    def number(self) -> int:
        return int.from_bytes(self.payload, "little")


def encode(content: HarpMessage, payload_type: int, time_ticks: int | None = None) -> bytes:
    """One message; devices send it with a time (in 32 us)."""
    payload = content.payload
    if time_ticks is not None:
        payload_type |= HAS_TIMESTAMP
        payload = struct.pack("<IH", *divmod(time_ticks, TICKS_PER_S)) + payload
    data = bytes([content.kind, 4 + len(payload), content.address, PORT, payload_type]) + payload
    return data + bytes([sum(data) & 0xFF])


def encode_read(register: Register) -> bytes:
    """Request for the value of a register."""
    return encode(HarpMessage(READ, register), PAYLOAD_TYPES[register])


def encode_write(register: Register, value: int) -> bytes:
    """Request that writes a whole number into a register."""
    payload = value.to_bytes(PAYLOAD_TYPES[register], "little")
    return encode(HarpMessage(WRITE, register, payload), PAYLOAD_TYPES[register])


START, STOP = encode_write(Register.ACQUISITION, 1), encode_write(Register.ACQUISITION, 0)


def with_active_mode(operation: int) -> int:
    """Value of `OPERATION` at which events are sent and requests answered."""
    return operation & ~_MODE_AND_MUTE | _ACTIVE


def find_messages(data: bytes) -> tuple[list[HarpMessage], int]:
    """Whole messages in `data`, garbage skipped, and the number of bytes that were used."""
    messages = []
    at = 0
    while at + MIN_MESSAGE_BYTES <= len(data):
        end = at + 2 + data[at + 1]
        if data[at] & ~ERROR not in (READ, WRITE, EVENT) or data[at + 1] < MIN_MESSAGE_BYTES - 2:
            at += 1
        elif end > len(data):
            break
        elif sum(data[at : end - 1]) & 0xFF != data[end - 1]:
            at += 1
        else:
            start = at + _HEAD + (_TIME if data[at + 4] & HAS_TIMESTAMP else 0)
            messages.append(HarpMessage(data[at], data[at + 2], data[start : end - 1]))
            at = end
    return messages, at


def find_reply(received: bytes, register: Register) -> HarpMessage | None:
    """Reply of the device about a register, done or refused; None while there is none."""
    replies = (one for one in find_messages(received)[0] if one.kind & ~ERROR in (READ, WRITE))
    return next((reply for reply in replies if reply.address == register), None)


CHANNELS = 8
EVENT_BYTES = 28
"""Bytes of a load cell event."""
VALUES_OFFSET = 11  # place of its first value


LINE = record_type("start end good overload discarded", "time sequence table relative")
"""An event, or as many bytes of garbage; with the bytes of this call that were discarded before it."""
_LENGTH_BYTE = EVENT_BYTES - 2
_ADDRESS = int(Register.LOAD_CELLS)
_PAYLOAD = S16 | HAS_TIMESTAMP
_ERROR_MASK = 0xF7


@compiled
def find_events(buffer: UInt8s, channels: Ints, garbage: int, lines: Records) -> tuple[int, int, int, int]:
    """Events in `buffer` and what is none, as `lines`.

    `garbage` is the number of bytes since the last whole message. After a whole message any whole message is
    skipped; after garbage only an event is believed, because a checksum of eight bits passes too much.
    Returns the number of lines, the numbers of bytes used and discarded, and the garbage until then.
    """
    at = found = discarded = 0
    while at + MIN_MESSAGE_BYTES <= len(buffer):
        size = 0
        kind = buffer[at] & _ERROR_MASK
        may_begin = 1 <= kind <= EVENT and buffer[at + 1] >= MIN_MESSAGE_BYTES - 2
        if _is_event(buffer, at) if garbage else may_begin:
            size = 2 + int(buffer[at + 1])
            if at + size > len(buffer):
                break
            if not _is_whole(buffer, at, size):
                size = 0
        if size == 0:
            if garbage % EVENT_BYTES == 0:
                lines[found].start = lines[found].end = at
                lines[found].good = lines[found].overload = 0
                found += 1
            garbage += 1
            discarded += 1
            at += 1
            continue
        if _is_event(buffer, at):
            _fill_line(lines[found], buffer, at, channels, discarded)
            found += 1
        garbage = 0
        at += size
    return found, at, discarded, garbage


@inlined
def _is_event(buffer: UInt8s, at: int) -> bool:
    return bool(
        buffer[at] == EVENT
        and buffer[at + 1] == _LENGTH_BYTE
        and buffer[at + 2] == _ADDRESS
        and buffer[at + 3] == PORT
        and buffer[at + 4] == _PAYLOAD
    )


@inlined
def _is_whole(buffer: UInt8s, at: int, size: int) -> bool:
    total = 0
    for place in range(at, at + size - 1):
        total += buffer[place]
    return bool(total & 0xFF == buffer[at + size - 1])


@inlined
def _fill_line(line: Record, buffer: UInt8s, at: int, channels: Ints, discarded: int) -> None:
    line.start = at
    line.end = at + EVENT_BYTES
    line.good = 1
    line.overload = 0
    seconds = 0
    for place in range(3, -1, -1):
        seconds = seconds << 8 | int(buffer[at + 5 + place])
    line.time = float(seconds * TICKS_PER_S + (int(buffer[at + 9]) | int(buffer[at + 10]) << 8))
    line.table = _value(buffer, at + VALUES_OFFSET + 2 * channels[0])
    line.relative = _value(buffer, at + VALUES_OFFSET + 2 * channels[1])
    line.discarded = discarded


@inlined
def _value(buffer: UInt8s, at: int) -> float:
    value = int(buffer[at]) | int(buffer[at + 1]) << 8
    return float(value - 65536 if value >= 32768 else value)


FULL_SCALE = 32767  # largest reading
_MAX_HELD_BYTES = 1024
BOARD_CHANNELS = 4
"""Channels of one reader board; a board that is not plugged in gives 0 in all of them, without any flag
(harp-tech, device.loadcells, Firmware/LoadCells/interrupts.c)."""
ABSENT_EVENTS = 100
"""So many events, 0.1 s, with 0 in all channels of a board show that it is absent: amplifiers have noise."""
_MAX_ZERO_BYTES = 1 << 14  # of zeros that wait until they show whether the board is absent


def encode_events(
    times_s: Floats, counts: Counts, table: int = 0, relative: int = 1, idle_count: int = 0
) -> UInt8s:
    """Events as a device without faults sends them; channels without a gauge are `idle_count`.

    `times_s` (n,) is device time, sent in steps of 32 us; `counts` (n, 2) table and relative, limited to 16
    bits and sent on channels `table` and `relative`, 0 to 7. Returns (n, 28) uint8, an event a row.
    """
    wire = np.zeros((len(counts), EVENT_BYTES), dtype=np.uint8)
    wire[:, :5] = EVENT, EVENT_BYTES - 2, Register.LOAD_CELLS, PORT, S16 | HAS_TIMESTAMP
    seconds, ticks = np.divmod(np.rint(np.asarray(times_s) * TICKS_PER_S).astype(np.int64), TICKS_PER_S)
    wire[:, 5:9] = seconds.astype("<u4").view(np.uint8).reshape(-1, 4)
    wire[:, 9:11] = ticks.astype("<u2").view(np.uint8).reshape(-1, 2)
    values = np.full((len(counts), CHANNELS), idle_count, dtype="<i2")
    values[:, [table, relative]] = np.clip(counts, -FULL_SCALE - 1, FULL_SCALE)
    wire[:, VALUES_OFFSET:-1] = values.view(np.uint8)
    wire[:, -1] = wire.sum(axis=1)
    return wire


class EventDecoder(PacketDecoder):
    """Bytes to sample blocks; the device's times show lost samples.

    An event that comes k periods after the one before shows k - 1 lost ones (`missing_estimated`); as many
    of them as the bytes between can have held are damaged. Other messages are skipped. A time out of sequence
    is believed only if the next event confirms it, because a checksum of eight bits passes one in 256 damaged
    events. `table` and `relative` are the channels of the gauges. Readings of `overload_count` are overloads.
    Events without the reader board of a gauge are damaged; the first of them wait until that is certain.
    """

    def __init__(
        self,
        rate_hz: float,
        table: int = 0,
        relative: int = 1,
        overload_count: float = FULL_SCALE,
        max_gap_s: float = MAX_GAP_S,
    ) -> None:
        super().__init__(STATE, rate_hz, max_gap_s)
        self._channels = np.array([table, relative])
        tick_s, wraps = 1 / TICKS_PER_S, (float((1 << 32) * TICKS_PER_S), 0.0)
        self._rules = make_rules(BY_TIME, rate_hz, tick_s, tick_s, wraps, overload_count, max_gap_s)
        self._garbage = 0
        self._is_absent = dict.fromkeys(sorted({table // BOARD_CHANNELS, relative // BOARD_CHANNELS}), False)
        """By the number of each reader board that has a gauge."""
        self._warnings: list[Message] = []

    def expect_restart(self) -> None:
        self._state["broken"] += self._state["started"] * bool(self._unfinished)
        self._garbage = 0
        self._is_absent = dict.fromkeys(self._is_absent, False)
        super().expect_restart()

    def take_warnings(self) -> list[Message]:
        warnings, self._warnings = self._warnings, []
        return warnings

    def _find_packets(self, data: bytes, arrival_ns: int) -> tuple[Records, Counts]:
        lines, used, discarded, self._garbage = _scan(data, self._channels, self._garbage)
        found, self._unfinished = len(lines), data[used:]
        packets = np.empty(found, dtype=PACKET)
        counts = np.empty((found, 2))
        self._state["restart_rows"] = self._rows_since(arrival_ns, found)
        hold_from = len(data) - _MAX_HELD_BYTES
        certain = self._reject_absent_boards(data, lines)
        good, done = count_lines(lines[:certain], hold_from, self._state, self._rules, packets, counts)
        if done < found:
            self._unfinished = data[int(lines[done]["start"]) :]
            discarded = int(lines[done]["discarded"])
            self._garbage = 0
        self._state["discarded_bytes"] += discarded
        return packets[:good], counts[:good]

    def _reject_absent_boards(self, data: bytes, lines: Records) -> int:
        """Make events without a board bad; returns how many lines come before zeros that are yet too few."""
        events, certain = np.flatnonzero(lines["good"]), len(lines)
        if not len(events):
            return certain
        starts = lines["start"][events]
        for board, was_absent in self._is_absent.items():
            self._is_absent[board] = False
            for begin, end in _true_runs(are_zeros(data, starts, board)):
                goes_on, is_last = begin == 0 and was_absent, end == len(events)
                waits_too_long = is_last and len(data) - starts[begin] > _MAX_ZERO_BYTES
                if goes_on or waits_too_long or end - begin >= ABSENT_EVENTS:
                    lines["good"][events[begin:end]] = 0
                    self._is_absent[board] = is_last
                    self._warnings += [] if was_absent else [absent_board_warning(board)]
                elif is_last:
                    certain = min(certain, int(events[begin]))
        return certain


def are_zeros(data: bytes, starts: Ints, board: int) -> Flags:
    """Whether all channels of a reader board (0 or 1) are 0 in the events that begin at `starts` (n,)."""
    first = VALUES_OFFSET + 2 * BOARD_CHANNELS * board
    places = np.add.outer(starts, np.arange(first, first + 2 * BOARD_CHANNELS))
    zeros: Flags = (np.frombuffer(data, dtype=np.uint8)[places] == 0).all(axis=1)
    return zeros


def absent_board_warning(board: int) -> Message:
    """What to do about a reader board that is not plugged in."""
    first = BOARD_CHANNELS * board
    template = N_("channels {first} to {last} all read exactly 0: plug their reader board in")
    return message(template, first=first, last=first + BOARD_CHANNELS - 1)


def absent_boards(data: bytes) -> list[int]:
    """Reader boards of whose channels all good events in `data` have 0; none without enough events."""
    lines, *_ = _scan(data, np.zeros(2, dtype=np.int64), 0)
    starts = lines["start"][lines["good"] != 0]
    if len(starts) < ABSENT_EVENTS:
        return []
    return [board for board in range(CHANNELS // BOARD_CHANNELS) if are_zeros(data, starts, board).all()]


def _true_runs(flags: Flags) -> list[tuple[int, int]]:
    """First and last place, the latter exclusive, of each run of true values in (n,)."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _scan(data: bytes, channels: Ints, garbage: int) -> tuple[Records, int, int, int]:
    lines = np.empty(2 * len(data) // EVENT_BYTES + 2, dtype=LINE)
    buffer = np.frombuffer(data, dtype=np.uint8)
    found, used, discarded, garbage = find_events(buffer, channels, garbage, lines)
    return lines[:found], used, discarded, garbage


def event_times(data: bytes) -> Floats:
    """Times (in 32 us) of the good events in `data`."""
    lines, *_ = _scan(data, np.zeros(2, dtype=np.int64), 0)
    times: Floats = lines["time"][lines["good"] != 0]
    return times


def rate_from_events(data: bytes) -> float | None:
    """Samples a second by the device's own times; None while there are too few events."""
    return rate_from_steps(np.diff(event_times(data)) / TICKS_PER_S, 1 / TICKS_PER_S)
