"""Frames of Modbus TCP: the body of a Modbus frame behind the number of its transaction.

`transaction u16 | protocol u16, 0 | length u16 of what follows | body`, without a checksum (MODBUS Messaging
on TCP/IP Implementation Guide V1.0b, 3.1.3). A server repeats the transaction in its response.
"""

import struct
from dataclasses import dataclass, replace

from drivers.devices.modbus.frames import REFUSED, Request, Response, exception_response
from messages.i18n import N_
from messages.message import message

MAX_UNIT = 255  # for a device that is addressed by its IP address alone; 0 is accepted too (guide, 4.4.2.1)
_HEADER = struct.Struct(">HHH")
_MODBUS = b"\0\0"
_BODY_BYTES = range(3, 255)  # from an exception to a response with 125 registers
_TRANSACTIONS = 1 << 16


@dataclass(frozen=True, slots=True)
class TcpRequest(Request):
    """A request to a unit, in the framing of Modbus TCP."""

    transaction: int | None = None
    """Number of a request that is sent; None where the number of a response is not checked."""

    def encode(self) -> bytes:
        return with_header(self.transaction or 0, self.body)

    @property
    def response_bytes(self) -> int:
        return _HEADER.size + self._response_body_bytes

    @property
    def is_numbered(self) -> bool:
        return True

    def numbered(self, number: int) -> "TcpRequest":
        return replace(self, transaction=number % _TRANSACTIONS)

    def is_complete(self, received: bytes) -> bool:
        return self._find(received) is not None

    def split(self, received: bytes) -> tuple[bytes, bytes]:
        found = self._find(received)
        return (b"", received) if found is None else (received[: found.start], received[found])

    def parse_response(self, received: bytes) -> Response:
        if len(received) < _HEADER.size + _BODY_BYTES[0]:
            return Response(fault=message("only {count} bytes came", count=len(received)))
        transaction, _, length = _HEADER.unpack_from(received)
        if received[2:4] != _MODBUS or length != len(received) - _HEADER.size:
            template = N_("{count} bytes came, which are no frame of Modbus TCP; {expected} are expected")
            return Response(fault=message(template, count=len(received), expected=self.response_bytes))
        if self.transaction not in (None, transaction):
            return Response(fault=message("it is the answer to another request"))
        return self.parse_response_body(received[_HEADER.size :])

    def _find(self, received: bytes) -> slice | None:
        """Place of the whole frame with the number of this request, behind other frames and garbage."""
        mark = struct.pack(">H", self.transaction or 0) + _MODBUS
        start = received.find(mark)
        while start >= 0:
            length = int.from_bytes(received[start + 4 : start + _HEADER.size], "big")
            end = start + _HEADER.size + length
            if length in _BODY_BYTES and end <= len(received):
                return slice(start, end)
            start = received.find(mark, start + 1)
        return None


def find_tcp_exception(received: bytes) -> Response | None:
    """The exception with which `received` begins, of any unit; None where there is none."""
    size = _HEADER.size + _BODY_BYTES[0]
    if len(received) < size or received[2:6] != _MODBUS + struct.pack(">H", _BODY_BYTES[0]):
        return None
    return exception_response(received[size - 1]) if received[size - 2] & REFUSED else None


def find_bodies(data: bytes) -> tuple[list[tuple[int, bytes]], int]:
    """Transaction and body of the frames in `data`, and how many bytes were used."""
    found, at = [], 0
    while at + _HEADER.size <= len(data):
        transaction, protocol, length = _HEADER.unpack_from(data, at)
        if protocol or length not in _BODY_BYTES:
            at += 1
            continue
        end = at + _HEADER.size + length
        if end > len(data):
            break
        found.append((transaction, data[at + _HEADER.size : end]))
        at = end
    return found, at


def with_header(transaction: int, body: bytes) -> bytes:
    """`body` behind its header."""
    return _HEADER.pack(transaction, 0, len(body)) + body
