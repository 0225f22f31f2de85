"""What leaves a driver: blocks of samples with their flags, and counts of what was lost."""

import operator
from dataclasses import dataclass, field, fields
from enum import IntFlag

import numpy as np

from drivers.arrays import Counts, Flags, Floats, Ints, UInt8s


class SampleStatus(IntFlag):
    """Flags of one sample, as stored in the run file (`status`)."""

    GOOD = 0
    MISSING = 1  # never arrived; the row replaces it
    DAMAGED = 2  # arrived with a wrong checksum or cut short; the row replaces it
    OVERLOAD_TABLE = 4
    OVERLOAD_RELATIVE = 8
    TABLE_MISSING = 16  # two devices: only the reading of gauge 1 is missing or damaged
    RELATIVE_MISSING = 32


ABSENT = SampleStatus.MISSING | SampleStatus.DAMAGED
"""Rows with one of these flags have no reading: their counts are 0."""

ABSENT_BY_GAUGE = (ABSENT | SampleStatus.TABLE_MISSING, ABSENT | SampleStatus.RELATIVE_MISSING)
"""For gauge 1 and gauge 2: rows with one of these flags have no reading of it, and its count is 0."""

INCOMPLETE = SampleStatus.MISSING | SampleStatus.TABLE_MISSING | SampleStatus.RELATIVE_MISSING
"""Rows with one of these flags lack a reading that never arrived."""


_OVERLOADS = np.array([SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE])


def overload_status(is_over: Flags) -> Ints:
    """Flags of `SampleStatus` (n,), from whether each gauge is overloaded (n, 2); (n, 1) for one gauge."""
    flags: Ints = is_over @ _OVERLOADS[: is_over.shape[1]]
    return flags


@dataclass(frozen=True, eq=False, slots=True)
class SampleBlock:
    """Consecutive samples of both channels, gaps included as flagged rows.

    Blocks of one source join without a hole: the next block's `first_index` is this one's
    `first_index + len(self)`.
    """

    first_index: int  # index of the first row, counted from the first good sample of the stream (0)
    counts: Counts
    """(n, 2) int32 or float64: readings of table gauge and relative gauge in the device's own unit; 0 where
    absent."""
    status: UInt8s  # (n,) uint8: `SampleStatus` flags of each row
    arrival_ns: int  # host's monotonic time (ns) after the read that brought the last byte of the block
    device_time_s: Floats | None = None
    """(n,) float64: the device's own time of each row, unwrapped, from 0 at index 0; None if it sends
    none."""

    def __len__(self) -> int:
        return len(self.status)


@dataclass(slots=True)
class Losses:
    """Counts of a stream. `samples` counts every row, missing and damaged ones included."""

    samples: int = 0
    missing: int = 0
    """Proven lost by a sequence number."""
    missing_estimated: int = 0  # lost according to elapsed time and rate, where there is no sequence number
    damaged: int = 0
    overloaded: int = 0
    discarded_bytes: int = 0
    """Bytes outside good frames and lines."""
    restarts: int = 0  # restarts of the device within the stream; the rows between are estimated
    repeated: int = 0  # frames or lines that came twice; one of the two was left out
    unexplained_drops: int = 0
    """How often the device reported dropped samples while its sequence shows no gap."""

    def __add__(self, other: "Losses") -> "Losses":
        return Losses(*map(operator.add, _counts(self), _counts(other)))

    def __sub__(self, other: "Losses") -> "Losses":
        return Losses(*map(operator.sub, _counts(self), _counts(other)))


_counts = operator.attrgetter(*(one.name for one in fields(Losses)))  # `astuple` takes ten times as long


@dataclass(frozen=True, slots=True)
class ChannelFilter:
    """Low-pass filter of a channel: `order` moving averages over one window each."""

    order: int
    corner_hz: float  # where the amplitude has fallen by 3 dB


@dataclass(frozen=True, slots=True)
class DeviceIdentity:
    """What a device reports of itself."""

    protocol: str
    name: str
    firmware: str = ""
    serial_number: str = ""
    settings: dict[str, str] = field(default_factory=dict)
