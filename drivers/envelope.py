"""Envelopes: received bytes with the host's arrival time and the number of the port.

Answers of a polled device, and reads of two ports, are wrapped before they are stored or decoded. So the
stored bytes of a run hold all that its decoder needs to make the same samples again.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

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
    """One read of one port."""

    port: int  # number of the port, from 0
    arrival_ns: int  # host's monotonic time (ns, `drivers.host_time.host_ns`) after the read
    data: bytes  # as received; b"" marks where the connection of this port broke


def wrap(port: int, arrival_ns: int, data: bytes) -> bytes:
    """Envelope of a read; several of them where it is longer than 65,535 bytes.

    `port` is 0 to 255 (else ValueError), `arrival_ns` the time after the read; b"" marks a broken link.
    """
    if not 0 <= port <= _MAX_PORT:
        raise ValueError(f"port {port} has no place in an envelope: give 0 to {_MAX_PORT}")
    wrapped = b""
    for start in range(0, max(len(data), 1), MAX_DATA_BYTES):
        part = data[start : start + MAX_DATA_BYTES]
        fields = _FIELDS.pack(MAGIC, port, len(part), arrival_ns, zlib.crc32(part))
        wrapped += fields + _CHECK.pack(crc16(fields)) + part
    return wrapped


class Unwrapper:
    """Decodes envelopes from bytes in any cut; bytes outside an envelope are discarded and counted.

    After a bad candidate it goes on one byte further, so that neither garbage nor a cut envelope hides a
    whole one. The length is used only if the checksum of the header is right. At most one envelope, 64 KiB,
    is kept unfinished.
    """

    def __init__(self) -> None:
        self.discarded_bytes = 0  # bytes outside whole envelopes
        self._unfinished = b""

    @property
    def unfinished_bytes(self) -> int:
        return len(self._unfinished)

    def feed(self, data: bytes) -> Iterator[StampedRead]:
        """Reads that `data` completes. Exhaust it."""
        data = self._unfinished + data
        at = 0
        while True:
            start = _candidate(data, at)
            self.discarded_bytes += start - at
            at, body = start, start + HEADER_BYTES
            if body > len(data):
                break
            fields = data[at : at + _FIELDS.size]
            _, port, length, arrival_ns, check = _FIELDS.unpack(fields)
            is_good = _CHECK.unpack_from(data, at + _FIELDS.size) == (crc16(fields),)
            end = body + length
            if is_good and end > len(data):
                break
            if is_good and zlib.crc32(data[body:end]) == check:
                yield StampedRead(port, arrival_ns, data[body:end])
                at = end
            else:
                self.discarded_bytes += 1
                at += 1
        self._unfinished = data[at:]


def _candidate(data: bytes, at: int) -> int:
    """Position of the magic from `at` on, or of its beginning at the end of the data; else their end."""
    found = data.find(MAGIC, at)
    if found >= 0:
        return found
    first = max(at, len(data) - len(MAGIC) + 1)
    return next((tail for tail in range(first, len(data)) if MAGIC.startswith(data[tail:])), len(data))
