"""Messages of the Harp protocol: what host and device say to each other.

`type | length | address | port | payload type | [seconds u32 | 32 us u16] | payload | checksum`,
little-endian; the length counts what follows it, the checksum is the sum of all bytes before it
(harp-tech protocol, device.loadcells/device.yml).
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

READ, WRITE, EVENT = 1, 2, 3
ERROR = 0x08
"""Bit of the type of a reply: the device could not do it."""
PORT = 0xFF
U8, U16, S16 = 0x01, 0x02, 0x82
HAS_TIMESTAMP = 0x10
"""Bit of the payload type: a time comes first."""
MIN_MESSAGE_BYTES = 6
MAX_MESSAGE_BYTES = 256
WHO_AM_I = 1232
TICKS_PER_S = 31_250
_TIME = 6
_HEAD = 5
_ACTIVE = 0x01
_MODE_AND_MUTE = 0x13
_LOAD_CELL_EVENTS = 0x01


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
class Message:
    """A message without its time."""

    kind: int
    address: int
    payload: bytes = b""

    @property
    def number(self) -> int:
        """The payload as a whole number."""
        return int.from_bytes(self.payload, "little")


def encode(message: Message, payload_type: int, time_ticks: int | None = None) -> bytes:
    """One message; with a time (in 32 us), as devices send them."""
    payload = message.payload
    if time_ticks is not None:
        payload_type |= HAS_TIMESTAMP
        payload = struct.pack("<IH", *divmod(time_ticks, TICKS_PER_S)) + payload
    data = bytes([message.kind, 4 + len(payload), message.address, PORT, payload_type]) + payload
    return data + bytes([sum(data) & 0xFF])


def encode_read(register: Register) -> bytes:
    """Request for what a register holds."""
    return encode(Message(READ, register), PAYLOAD_TYPES[register])


def encode_write(register: Register, value: int) -> bytes:
    """Request that puts a whole number into a register."""
    payload = value.to_bytes(PAYLOAD_TYPES[register], "little")
    return encode(Message(WRITE, register, payload), PAYLOAD_TYPES[register])


def encode_start() -> bytes:
    """Request that lets the samples come."""
    return encode_write(Register.ACQUISITION, 1)


def encode_stop() -> bytes:
    """Request that ends them."""
    return encode_write(Register.ACQUISITION, 0)


def with_active_mode(operation: int) -> int:
    """What `OPERATION` must hold for events to be sent and requests answered."""
    return operation & ~_MODE_AND_MUTE | _ACTIVE


def with_load_cells(events: int) -> int:
    """What `EVENTS` must hold for samples to be sent, the others left as they are."""
    return events | _LOAD_CELL_EVENTS


def find_messages(data: bytes) -> tuple[list[Message], int]:
    """Whole messages in `data`, rubbish passed over, and how many bytes are done with."""
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
            messages.append(Message(data[at], data[at + 2], data[start : end - 1]))
            at = end
    return messages, at


def find_reply(received: bytes, register: Register) -> Message | None:
    """What the device says of a register, done or not; None while it says nothing."""
    for message in find_messages(received)[0]:
        if message.address == register and message.kind & ~ERROR in (READ, WRITE):
            return message
    return None
