"""Reads stamped by the host: envelopes around bytes that do not tell themselves when they came, or whence.

A polled device's answers, and two ports read as one, are wrapped before anything stores or decodes them.
So what a run keeps as the received bytes holds all that its decoder needs to make the same samples again.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from drivers.crc import crc16

MAGIC = b"\xa9SE1"
MAX_DATA_BYTES = 0xFFFF
"""A longer read becomes several envelopes of the same time."""
_FIELDS = struct.Struct("<4sBHqI")
"""Magic, port, length, arrival, CRC-32 of the data; then the CRC-16 of all these, then the data."""
_CHECK = struct.Struct("<H")
HEADER_BYTES = _FIELDS.size + _CHECK.size
_MAX_PORT = 0xFF


@dataclass(frozen=True, slots=True)
class StampedRead:
    """What one read of one port brought.

    Attributes
    ----------
    port : int
        Which port, from 0.
    arrival_ns : int
        Host's monotonic time (ns, `drivers.host_time.host_ns`) after the read.
    data : bytes
        As they came; none at all says that the link of this port was broken here.
    """

    port: int
    arrival_ns: int
    data: bytes


def wrap(port: int, arrival_ns: int, data: bytes) -> bytes:
    """Envelope of a read, or several one after the other where it is longer than 65,535 bytes.

    Parameters
    ----------
    port : int
        0 to 255.
    arrival_ns : int
        Host's monotonic time (ns) after the read.
    data : bytes
        b"" for a broken link.

    Raises
    ------
    ValueError
        If there is no such port.
    """
    if not 0 <= port <= _MAX_PORT:
        raise ValueError(f"port {port} has no place in an envelope: give 0 to {_MAX_PORT}")
    starts = range(0, max(len(data), 1), MAX_DATA_BYTES)
    return b"".join(_envelope(port, arrival_ns, data[at : at + MAX_DATA_BYTES]) for at in starts)


def _envelope(port: int, arrival_ns: int, data: bytes) -> bytes:
    fields = _FIELDS.pack(MAGIC, port, len(data), arrival_ns, zlib.crc32(data))
    return fields + _CHECK.pack(crc16(fields)) + data


class Unwrapper:
    """Takes envelopes apart again, wherever the bytes are cut; what fits no envelope is left out and counted.

    After a candidate that turns out to be none it goes on one byte further, so that neither rubbish nor a
    cut envelope takes a whole one with it. Of a candidate it believes the length only if the header's own
    checksum agrees; at most one envelope, 64 KiB, is kept unfinished.
    """

    def __init__(self) -> None:
        self.discarded_bytes = 0
        """Bytes that belonged to no whole envelope."""
        self._rest = b""

    @property
    def unfinished_bytes(self) -> int:
        """Bytes kept for the next call, fewer than an envelope of the largest size has."""
        return len(self._rest)

    def feed(self, data: bytes) -> Iterator[StampedRead]:
        """Reads that `data` completes; exhaust it."""
        data = self._rest + data
        at = 0
        while True:
            start = _candidate(data, at)
            self.discarded_bytes += start - at
            at, body = start, start + HEADER_BYTES
            header = _header(data, at) if body <= len(data) else None
            end = body if header is None else body + header.length
            if end > len(data):
                break
            held = data[body:end]
            if header is None or zlib.crc32(held) != header.data_check:
                self.discarded_bytes += 1
                at += 1
            else:
                yield StampedRead(header.port, header.arrival_ns, held)
                at = end
        self._rest = data[at:]


def _candidate(data: bytes, at: int) -> int:
    """Place from `at` on of the magic, or of its beginning where the data end in it; else their end."""
    found = data.find(MAGIC, at)
    if found >= 0:
        return found
    first = max(at, len(data) - len(MAGIC) + 1)
    return next((tail for tail in range(first, len(data)) if MAGIC.startswith(data[tail:])), len(data))


class _Header(NamedTuple):
    port: int
    length: int
    arrival_ns: int
    data_check: int


def _header(data: bytes, start: int) -> _Header | None:
    """What the fields say that begin with the magic; None where the header's own checksum disagrees."""
    fields = data[start : start + _FIELDS.size]
    if _CHECK.unpack_from(data, start + _FIELDS.size) != (crc16(fields),):
        return None
    return _Header(*_FIELDS.unpack(fields)[1:])
