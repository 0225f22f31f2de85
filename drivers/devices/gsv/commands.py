"""Requests to a GSV-8 or GSV-6, and its responses.

Request `AA | 90 + n | command | n bytes | 85`, response `AA | 50 + n | error | n bytes | 85`, numbers
big-endian (me-systeme, gsv86lib).
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import SettingsError
from messages.i18n import N_
from messages.message import Message, message

SYNC = 0xAA
END = 0x85
OK, OK_CHANGED = 0x00, 0x01
UNKNOWN_COMMAND = 0x40
WRONG_VALUE = 0x52
REQUEST = 0x90
"""Second byte of a request; the bits of `LENGTH` are the number of parameter bytes."""
LENGTH = 0x0F
_ANSWER = 0x50
_SHORTEST = 4
_ERRORS = {
    UNKNOWN_COMMAND: N_("the command is not known"),
    0x41: N_("the command is not for this model"),
    0x51: N_("wrong channel"),
    WRONG_VALUE: N_("wrong value"),
    0x54: N_("the value is too large"),
    0x55: N_("the value is too small"),
    0x5C: N_("the value does not fit the other settings"),
    0x70: N_("no right to do so"),
    0x71: N_("blocked"),
    0x72: N_("a password is needed"),
    0x82: N_("fault of the converter"),
    0x92: N_("the device is busy"),
}


class Code(IntEnum):
    """Commands."""

    SET_ZERO = 0x0C
    SERIAL_NUMBER = 0x1F
    STOP = 0x23
    START = 0x24
    FIRMWARE = 0x2B
    GET_VALUE = 0x3B
    SET_FORMAT = 0x81
    READ_RATE = 0x8A
    WRITE_RATE = 0x8B
    SET_INPUT = 0xA3


class InputType(IntEnum):
    """What is wired to a channel of a GSV-8; it sets the input range."""

    BRIDGE_8_75_V = 0x00
    BRIDGE_5_V = 0x01
    BRIDGE_2_5_V = 0x02
    SINGLE_ENDED = 0x03


@dataclass(frozen=True, slots=True)
class Response:
    """Response of a device to a request."""

    error: int
    payload: bytes = b""

    @property
    def is_ok(self) -> bool:
        """Whether the device did it, maybe with the nearest possible value."""
        return self.error in (OK, OK_CHANGED)

    @property
    def fault(self) -> Message:
        return message(_ERRORS.get(self.error, N_("error {number:02X}")), number=self.error)


def encode_request(code: Code, parameters: bytes = b"") -> bytes:
    """A request with at most 15 bytes of parameters."""
    return bytes([SYNC, REQUEST | len(parameters), code]) + parameters + bytes([END])


def write_rate(rate_hz: float) -> bytes:
    """Request that sets the rate. Raises SettingsError above 48 kHz, the highest rate of any GSV."""
    if not 0 < rate_hz <= 48_000:
        template = N_("rate {rate_hz:g} Hz cannot be set: give 1 to 48000, as the amplifier allows")
        raise SettingsError(template, rate_hz=rate_hz)
    return encode_request(Code.WRITE_RATE, struct.pack(">f", rate_hz))


def set_float() -> bytes:
    """Request to send values as 32-bit floats."""
    return encode_request(Code.SET_FORMAT, bytes([1, 0x00, 0x10]))


def set_input(channel: int, kind: InputType) -> bytes:
    """Request that sets the input range of a channel (from 1)."""
    return encode_request(Code.SET_INPUT, bytes([channel, kind]))


def encode_response(error: int, payload: bytes = b"") -> bytes:
    """A response, as a device sends it."""
    return bytes([SYNC, _ANSWER | len(payload), error]) + payload + bytes([END])


def find_response(received: bytes) -> Response | None:
    """The first whole response in `received`; None while there is none."""
    at = received.find(SYNC)
    while 0 <= at <= len(received) - _SHORTEST:
        length = received[at + 1] & LENGTH
        end = at + _SHORTEST + length
        if received[at + 1] & ~LENGTH == _ANSWER and end <= len(received) and received[end - 1] == END:
            return Response(received[at + 2], received[at + 3 : end - 1])
        at = received.find(SYNC, at + 1)
    return None


def rate_from_response(response: Response) -> float | None:
    """Samples a second from the response to `READ_RATE`; None if it holds no rate."""
    if not response.is_ok or len(response.payload) != struct.calcsize(">f"):
        return None
    rate_hz = float(struct.unpack(">f", response.payload)[0])
    return rate_hz if 0 < rate_hz < float("inf") else None


def serial_number_from_response(response: Response) -> str:
    """Serial number, a u32 (me-systeme, GSV-6PI example); "" if the device does not send one."""
    numbers = _unpack(response, ">I")
    return str(numbers[0]) if numbers else ""


def firmware_from_response(response: Response) -> str:
    """Firmware version, two u16 (me-systeme, MEGSV86x64.h); "" if the device does not send one."""
    return ".".join(map(str, _unpack(response, ">HH")))


def _unpack(response: Response, layout: str) -> tuple[int, ...]:
    is_number = response.is_ok and len(response.payload) == struct.calcsize(layout)
    return struct.unpack(layout, response.payload) if is_number else ()
