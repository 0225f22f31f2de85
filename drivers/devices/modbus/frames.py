"""Frames of Modbus RTU: requests to read and write registers, and the answers to them.

`unit | function | ... | CRC`, whole numbers most significant byte first, the CRC least significant byte
first (MODBUS Application Protocol Specification V1.1b3; MODBUS over Serial Line V1.02, 2.5.1.2).
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from messages.i18n import N_
from messages.message import Message, message

MAX_REGISTERS = 125
"""Registers that one request may read."""
MAX_UNIT = 247
LONGEST = 256
EXCEPTION_BYTES = 5
_REFUSED = 0x80
_HEAD = 3
_CHECK = 2
_ECHO_BYTES = 8


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
    """A request to a unit."""

    unit: int
    """1 to 247."""
    function: Function
    register: int
    """First register, counted from 0."""
    count: int = 1
    """Registers read or written."""
    values: tuple[int, ...] = ()
    """Values to write; none where registers are read."""

    def encode(self) -> bytes:
        return with_crc(struct.pack(">BB", self.unit, self.function) + self._body())

    @property
    def response_bytes(self) -> int:
        """Length of a response that is no exception."""
        return _HEAD + 2 * self.count + _CHECK if self.function in READ_FUNCTIONS else _ECHO_BYTES

    @property
    def description(self) -> Message:
        """Function and registers, for messages."""
        first, last = self.register, self.register + self.count - 1
        if first == last:
            return message(
                "function {function:02d} for register {register}", function=self.function, register=first
            )
        return message(
            "function {function:02d} for registers {register} to {last}",
            function=self.function,
            register=first,
            last=last,
        )

    def _body(self) -> bytes:
        match self.function:
            case Function.WRITE_SINGLE:
                return struct.pack(">HH", self.register, self.values[0])
            case Function.WRITE_MULTIPLE:
                head = struct.pack(">HHB", self.register, self.count, 2 * self.count)
                return head + struct.pack(f">{self.count}H", *self.values)
        return struct.pack(">HH", self.register, self.count)


@dataclass(frozen=True, slots=True)
class RegisterResponse:
    """Response with the requested registers as bytes, two each; none after a write."""

    data: bytes


@dataclass(frozen=True, slots=True)
class ExceptionResponse:
    """A Modbus exception: the device understood the request and refuses it."""

    code: int

    @property
    def fault(self) -> Message:
        """Its name in the specification, and its number."""
        name = message(_EXCEPTIONS.get(self.code, N_("unknown reason")))
        return message("{name} (exception {code})", name=name, code=self.code)


@dataclass(frozen=True, slots=True)
class InvalidResponse:
    """Bytes that are no response to the request, and why."""

    fault: Message


def is_complete(request: Request, received: bytes) -> bool:
    """Whether as many bytes came as the response, or an exception, has; they may still be wrong."""
    if len(received) >= EXCEPTION_BYTES and received[1] == request.function | _REFUSED:
        return True
    return len(received) >= request.response_bytes


def parse_response(
    request: Request, received: bytes
) -> RegisterResponse | ExceptionResponse | InvalidResponse:
    """Decode the bytes that came after `request`."""
    if len(received) < EXCEPTION_BYTES:
        return InvalidResponse(message("only {count} bytes came", count=len(received)))
    if with_crc(received[:-_CHECK]) != received:
        return InvalidResponse(
            message(
                "{count} bytes came, {expected} with a right CRC are expected",
                count=len(received),
                expected=request.response_bytes,
            )
        )
    if received[0] != request.unit:
        return InvalidResponse(
            message(
                "unit {answered} answered where unit {unit} was asked",
                answered=received[0],
                unit=request.unit,
            )
        )
    if received[1] == request.function | _REFUSED:
        return ExceptionResponse(received[2])
    if not _matches_request(request, received):
        return InvalidResponse(message("it is the answer to another request"))
    return RegisterResponse(received[_HEAD:-_CHECK] if request.function in READ_FUNCTIONS else b"")


def find_exception(received: bytes) -> ExceptionResponse | None:
    """The first exception in `received`, of any unit; None where there is none."""
    for at in range(len(received) - EXCEPTION_BYTES + 1):
        frame = received[at : at + EXCEPTION_BYTES]
        if frame[1] & _REFUSED and frame[2] in _EXCEPTIONS and with_crc(frame[:-_CHECK]) == frame:
            return ExceptionResponse(frame[2])
    return None


def _matches_request(request: Request, received: bytes) -> bool:
    if received[1] != request.function or len(received) != request.response_bytes:
        return False
    if request.function in READ_FUNCTIONS:
        return received[2] == 2 * request.count
    second = request.values[0] if request.function is Function.WRITE_SINGLE else request.count
    return struct.unpack_from(">HH", received, 2) == (request.register, second)


def encode_read_response(unit: int, function: int, data: bytes) -> bytes:
    """Response of a unit whose registers hold `data`."""
    return with_crc(bytes([unit, function, len(data)]) + data)


def encode_exception(unit: int, function: int, code: int) -> bytes:
    """Exception response of a unit."""
    return with_crc(bytes([unit, function | _REFUSED, code]))


def with_crc(frame: bytes) -> bytes:
    """`frame` followed by its checksum."""
    return frame + struct.pack("<H", crc16_modbus(frame))


def crc16_modbus(data: bytes) -> int:
    """CRC-16/MODBUS of `data` (polynomial 8005 reflected, start FFFF, no final xor).

    The check value, of b"123456789", is 4B37 (CRC RevEng catalogue).
    """
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def _remainder(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_TABLE = tuple(map(_remainder, range(256)))
