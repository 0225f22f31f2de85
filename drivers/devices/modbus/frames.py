"""Frames of Modbus: requests to read and write registers, and the answers to them; Modbus RTU.

A frame of RTU is `unit | function | ... | CRC`, whole numbers most significant byte first, the CRC least
significant byte first (MODBUS Application Protocol Specification V1.1b3; MODBUS over Serial Line V1.02,
2.5.1.2). What is before the CRC is the body of a frame, which `tcp_frames` has in common with it.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from messages.i18n import N_
from messages.message import EMPTY, Message, message

MAX_REGISTERS = 125  # registers that one request may read
MAX_UNIT = 247
EXCEPTION_BYTES = 5
REFUSED = 0x80
_HEAD = 3
_CHECK = 2
_ECHO_BYTES = 6


class Function(IntEnum):
    """Function codes."""

    READ_HOLDING = 3
    READ_INPUT = 4
    WRITE_SINGLE = 6
    WRITE_MULTIPLE = 16


READ_FUNCTIONS = (Function.READ_HOLDING, Function.READ_INPUT)
WRITE_FUNCTIONS = (Function.WRITE_SINGLE, Function.WRITE_MULTIPLE)

_EXCEPTIONS = {
    1: N_("illegal function"),
    2: N_("illegal data address"),
    3: N_("illegal data value"),
    4: N_("device failure"),
    5: N_("acknowledged, still working on it"),
    6: N_("device busy"),
    8: N_("memory parity error"),
    10: N_("gateway path unavailable"),
    11: N_("gateway target did not answer"),
}


@dataclass(frozen=True, slots=True)
class Request:
    """A request to a unit, in the framing of Modbus RTU."""

    unit: int
    function: Function
    register: int
    """First register, counted from 0."""
    count: int = 1  # registers read or written
    values: tuple[int, ...] = ()  # values to write; none where registers are read

    def encode(self) -> bytes:
        return with_crc(self.body)

    @property
    def body(self) -> bytes:
        """Unit, function and what follows, as in all framings."""
        body = struct.pack(">BBHH", self.unit, self.function, self.register, self._second)
        if self.function is Function.WRITE_MULTIPLE:
            body += struct.pack(f">B{self.count}H", 2 * self.count, *self.values)
        return body

    @property
    def response_bytes(self) -> int:
        return self._response_body_bytes + _CHECK

    @property
    def _response_body_bytes(self) -> int:
        return _HEAD + 2 * self.count if self.function in READ_FUNCTIONS else _ECHO_BYTES

    @property
    def is_repeated(self) -> bool:
        return self.function is Function.WRITE_SINGLE

    @property
    def is_numbered(self) -> bool:
        """Whether a response shows which request it answers."""
        return False

    @property
    def description(self) -> Message:
        last = self.register + self.count - 1
        several = N_("function {function:02d} for registers {register} to {last}")
        template = several if self.count > 1 else N_("function {function:02d} for register {register}")
        return message(template, function=self.function, register=self.register, last=last)

    @property
    def _second(self) -> int:
        return self.values[0] if self.function is Function.WRITE_SINGLE else self.count

    def is_complete(self, received: bytes) -> bool:
        """Whether as many bytes came as the response, or an exception, has; they may still be wrong."""
        is_exception = len(received) >= EXCEPTION_BYTES and received[1] == self.function | REFUSED
        return is_exception or len(received) >= self.response_bytes

    def parse_response(self, received: bytes) -> "Response":
        if len(received) < EXCEPTION_BYTES:
            return Response(fault=message("only {count} bytes came", count=len(received)))
        if with_crc(received[:-_CHECK]) != received:
            template = N_("{count} bytes came, {expected} with a right CRC are expected")
            return Response(fault=message(template, count=len(received), expected=self.response_bytes))
        return self.parse_response_body(received[:-_CHECK])

    def parse_response_body(self, body: bytes) -> "Response":
        """Response in a body of 3 bytes or more, which its framing has found whole."""
        if body[0] != self.unit:
            template = N_("unit {answered} answered where unit {unit} was asked")
            return Response(fault=message(template, answered=body[0], unit=self.unit))
        if body[1] == self.function | REFUSED:
            return exception_response(body[2])
        is_read = self.function in READ_FUNCTIONS
        is_wanted = body[1] == self.function and len(body) == self._response_body_bytes
        if is_read and is_wanted and body[2] == 2 * self.count:
            return Response(body[_HEAD:])
        echo = struct.pack(">HH", self.register, self._second)
        if not is_read and is_wanted and body[2:6] == echo:
            return Response()
        return Response(fault=message("it is the answer to another request"))

    def numbered(self, number: int) -> "Request":  # noqa: ARG002 - RTU numbers nothing
        """The same request with the number of its transaction, where the framing has one."""
        return self

    def split(self, received: bytes) -> tuple[bytes, bytes]:
        """What came before the response to this very request, and the response, whole or not."""
        return b"", received


@dataclass(frozen=True, slots=True)
class Response:
    """What came after a request: its registers, or why there are none."""

    data: bytes = b""  # the requested registers, two bytes each; none after a write
    fault: Message = EMPTY
    """Why this is no response, or why the device refuses; empty where it did what was asked."""
    is_exception: bool = False  # whether the device understood the request and refuses it

    @property
    def is_invalid(self) -> bool:
        """Whether these bytes are no response to the request."""
        return bool(self.fault) and not self.is_exception


def exception_response(code: int) -> Response:
    """Refusal of a device; its fault is the name in the specification, and the number."""
    name = message(_EXCEPTIONS.get(code, N_("unknown reason")))
    return Response(fault=message("{name} (exception {code})", name=name, code=code), is_exception=True)


def find_exception(received: bytes) -> Response | None:
    """The first exception in `received`, of any unit; None where there is none."""
    for at in range(len(received) - EXCEPTION_BYTES + 1):
        frame = received[at : at + EXCEPTION_BYTES]
        if frame[1] & REFUSED and frame[2] in _EXCEPTIONS and with_crc(frame[:-_CHECK]) == frame:
            return exception_response(frame[2])
    return None


def encode_read_response(unit: int, function: int, data: bytes) -> bytes:
    """Response of a unit whose registers hold `data`."""
    return with_crc(bytes([unit, function, len(data)]) + data)


def encode_exception(unit: int, function: int, code: int) -> bytes:
    """Exception response of a unit."""
    return with_crc(bytes([unit, function | REFUSED, code]))


def with_crc(frame: bytes) -> bytes:
    """`frame` followed by its checksum."""
    return frame + struct.pack("<H", crc16_modbus(frame))


def crc16_modbus(data: bytes) -> int:
    """CRC-16/MODBUS of `data` (CRC RevEng catalogue: polynomial 8005 reflected, check value 4B37)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def _remainder(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_TABLE = tuple(map(_remainder, range(256)))
