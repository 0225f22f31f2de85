"""Samples of a network stream as bytes: chunks of time stamps and values, and the description of the stream.

Samples of a stream come as numbers, and runs store bytes: so each chunk is packed when it comes, and a run is
decoded from what was packed.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np

from drivers.arrays import Floats
from drivers.envelope import StampedRead, wrap

CHUNK, DESCRIPTION = 0, 1
"""Number of the port in the envelope of each kind."""
DESCRIBE = b"describe"
"""What asks an open stream for its description."""
_HEADER = struct.Struct("<dH")
"""Offset from the clock of the stamps to this computer's (s), and number of channels."""
_MAX_VALUES = 500  # of an envelope, so that one is never longer than 4 kB


@dataclass(frozen=True, slots=True)
class StreamDescription:
    """What a stream tells of itself."""

    name: str
    kind: str
    source_id: str
    host: str
    channels: int
    rate_hz: float  # nominal; 0 where it is irregular
    labels: tuple[str, ...] = ()
    """Of its channels, where it has any."""


def pack_chunk(stamps_s: Floats, values: Floats, offset_s: float, arrival_ns: int) -> bytes:
    """Envelopes of samples: stamps (n,), values (n, channels)."""
    channels = values.shape[1]
    rows = np.column_stack([stamps_s, values]).astype("<f8")
    step = max(1, _MAX_VALUES // (1 + channels))
    header = _HEADER.pack(offset_s, channels)
    parts = (rows[at : at + step].tobytes() for at in range(0, len(rows), step))
    return b"".join(wrap(CHUNK, arrival_ns, header + part) for part in parts)


def unpack_chunk(read: StampedRead) -> tuple[Floats, Floats] | None:
    """Stamps (n,) on this computer's clock and values (n, channels); None where it is no chunk."""
    if read.port != CHUNK or len(read.data) < _HEADER.size:
        return None
    offset_s, channels = _HEADER.unpack_from(read.data)
    if (len(read.data) - _HEADER.size) % (8 * (1 + channels)):
        return None
    rows = np.frombuffer(read.data, dtype="<f8", offset=_HEADER.size).reshape(-1, 1 + channels)
    return rows[:, 0] + offset_s, rows[:, 1:]


def pack_description(description: StreamDescription, arrival_ns: int) -> bytes:
    """Envelope of a description."""
    return wrap(DESCRIPTION, arrival_ns, msgspec.json.encode(description))


def find_description(reads: Iterator[StampedRead]) -> StreamDescription | None:
    """The last whole description among reads; None without one."""
    found = None
    for read in reads:
        if read.port == DESCRIPTION:
            try:
                found = msgspec.json.decode(read.data, type=StreamDescription)
            except msgspec.DecodeError:
                continue
    return found
