"""What the host says to a GSV-8 or GSV-6, and what the device answers.

Request `AA | 90 + n | command | n bytes | 85`, answer `AA | 50 + n | error | n bytes | 85`, numbers
big-endian (me-systeme, gsv86lib).
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import SettingsError

SYNC = 0xAA
END = 0x85
ALL_CHANNELS = 0
OK = 0x00
OK_CHANGED = 0x01
"""Done, with another value than the one asked for."""
UNKNOWN_COMMAND = 0x40
WRONG_VALUE = 0x52
REQUEST = 0x90
"""Second byte of a request; `LENGTH` of its bits say how many bytes of parameters follow."""
LENGTH = 0x0F
_ANSWER = 0x50
_SHORTEST = 4
_ERRORS = {
    UNKNOWN_COMMAND: "the command is not known",
    0x41: "the command is not for this model",
    0x51: "wrong channel",
    WRONG_VALUE: "wrong value",
    0x54: "the value is too large",
    0x55: "the value is too small",
    0x5C: "the value does not fit the other settings",
    0x70: "no right to do so",
    0x71: "blocked",
    0x72: "a password is needed",
    0x82: "fault of the converter",
    0x92: "the device is busy",
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
    """What is wired to a channel of a GSV-8, which sets its input range."""

    BRIDGE_8_75_V = 0x00
    BRIDGE_5_V = 0x01
    BRIDGE_2_5_V = 0x02
    SINGLE_ENDED = 0x03


@dataclass(frozen=True, slots=True)
class Response:
    """What a device says to a request."""

    error: int
    payload: bytes = b""

    @property
    def is_ok(self) -> bool:
        """Whether the device did it, maybe with the nearest value that it can do."""
        return self.error in (OK, OK_CHANGED)

    @property
    def fault(self) -> str:
        """Why it did not, in words."""
        return _ERRORS.get(self.error, f"error {self.error:02X}")


def encode_request(code: Code, parameters: bytes = b"") -> bytes:
    """A request without or with parameters (at most 15 bytes)."""
    return bytes([SYNC, REQUEST | len(parameters), code]) + parameters + bytes([END])


def write_rate(rate_hz: float) -> bytes:
    """Request that sets the samples a second.

    Raises
    ------
    SettingsError
        For a rate that is no positive number of at most 48 kHz, which is the most any GSV sends.
    """
    if not 0 < rate_hz <= 48_000:
        raise SettingsError(f"rate {rate_hz:g} Hz cannot be set: give 1 to 48000, as the amplifier allows")
    return encode_request(Code.WRITE_RATE, struct.pack(">f", rate_hz))


def set_float() -> bytes:
    """Request for measured values as 32-bit floats."""
    return encode_request(Code.SET_FORMAT, bytes([1, 0x00, 0x10]))


def set_zero(channel: int = ALL_CHANNELS) -> bytes:
    """Request that makes the present reading of a channel (from 1 on) its zero."""
    return encode_request(Code.SET_ZERO, bytes([channel]))


def set_input(channel: int, kind: InputType) -> bytes:
    """Request that sets the input range of a channel (from 1 on)."""
    return encode_request(Code.SET_INPUT, bytes([channel, kind]))


def encode_response(error: int, payload: bytes = b"") -> bytes:
    """What a device answers."""
    return bytes([SYNC, _ANSWER | len(payload), error]) + payload + bytes([END])


def find_response(received: bytes) -> tuple[Response, int] | None:
    """The first whole answer in `received` and the place after it; None if there is none yet."""
    at = received.find(SYNC)
    while 0 <= at <= len(received) - _SHORTEST:
        length = received[at + 1] & LENGTH
        end = at + _SHORTEST + length
        if received[at + 1] & ~LENGTH == _ANSWER and end <= len(received) and received[end - 1] == END:
            return Response(received[at + 2], received[at + 3 : end - 1]), end
        at = received.find(SYNC, at + 1)
    return None


def rate_from_response(said: Response) -> float | None:
    """Samples a second from the answer to `READ_RATE`; None if it holds no rate."""
    if not said.is_ok or len(said.payload) != struct.calcsize(">f"):
        return None
    rate_hz = float(struct.unpack(">f", said.payload)[0])
    return rate_hz if 0 < rate_hz < float("inf") else None


def text_from_response(said: Response) -> str:
    """A serial number or version as text; "" if the device does not say it.

    How the bytes are to be read is not documented for all models: letters as letters, else dotted.
    """
    if not said.is_ok:
        return ""
    if said.payload and all(0x20 < byte < 0x7F for byte in said.payload):
        return said.payload.decode("ascii")
    return ".".join(str(byte) for byte in said.payload)
