"""From units (frames or lines) and the gaps before them to rows without a hole.

Every decoder reduces its bytes to units: a run of good samples, and how many samples were lost
before it. What a unit becomes in a `SampleBlock` is the same for all devices and stands here.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.compiled import compiled, inlined
from drivers.samples import Losses, SampleBlock, SampleStatus

MAX_BLOCK_ROWS = 65536
"""A long gap becomes several blocks, so that no single one is large."""

MAX_GAP_S = 600.0
"""A longer gap is not believed: the device began anew."""

PACKET = np.dtype(
    [
        ("damaged", np.int64),  # rows before the unit that came broken
        ("missing", np.int64),  # rows before the unit that never came, proven or estimated
        ("time_s", np.float64),  # device time of the unit's first sample
        ("samples", np.int32),
        ("status", np.int32),
    ],
    align=True,
)

CURSOR = np.dtype(
    [
        ("unit", np.int64),
        ("lost", np.int64),  # rows of its gap that are laid out
        ("sample", np.int64),  # first sample of the unit
        ("time_s", np.float64),  # of the row before
    ],
    align=True,
)
"""How far the units are laid out."""

LOSS_FIELDS = [(account.name, np.int64) for account in fields(Losses)]
"""Members that a decoder's memory shares with `Losses`."""

Record: TypeAlias = Any
"""One element of a structured array inside compiled code, its fields as attributes."""

_SLACK_S = 1.0
_SLACK = 0.02
"""A busy computer takes bytes so late, and a device's clock is wrong by so much at most. A device that
counts anew is further off unless it was unplugged within its first second."""

_MISSING = int(SampleStatus.MISSING)
_DAMAGED = int(SampleStatus.DAMAGED)


@dataclass(frozen=True, eq=False, slots=True)
class Packets:
    """What one call of a decoder found.

    Attributes
    ----------
    units : (u,) UNIT
        Good units in order of arrival.
    counts : (s, 2) int32 or float64
        Samples of all units, one after the other.
    first_index : int
        Row of the first lost or good sample of the first unit.
    rows : int
        Good and lost samples together.
    last_time_s : float
        Device time of the row before `first_index`.
    period_s : float
        Nominal time between the samples of a unit.
    timed : bool
        Whether the device sends its time.
    arrival_ns : int
        Host's time of the read that completed the units.
    """

    packets: NDArray[np.void]
    counts: NDArray[np.int32] | NDArray[np.float64]
    first_index: int
    rows: int
    last_time_s: float
    period_s: float
    timed: bool
    arrival_ns: int


def losses_from_state(memory: NDArray[np.void]) -> Losses:
    """The account that a decoder's memory (1,) holds in its `LOSS_FIELDS`."""
    stream = memory[0]
    return Losses(**{name: int(stream[name]) for name, _ in LOSS_FIELDS})


def sample_blocks(found: Packets) -> Iterator[SampleBlock]:
    """Rows of `found`, absent ones included, in blocks of at most `MAX_BLOCK_ROWS`."""
    cursor = np.zeros(1, dtype=CURSOR)
    cursor["time_s"] = found.last_time_s
    done = 0
    while done < found.rows:
        rows = min(found.rows - done, MAX_BLOCK_ROWS)
        counts = np.empty((rows, 2), dtype=found.counts.dtype)
        status = np.empty(rows, dtype=np.uint8)
        times_s = np.empty(rows)
        rows = fill_rows(found.packets, found.counts, found.period_s, cursor, counts, status, times_s)
        yield SampleBlock(
            first_index=found.first_index + done,
            counts=counts[:rows],
            status=status[:rows],
            arrival_ns=found.arrival_ns,
            device_time_s=times_s[:rows] if found.timed else None,
        )
        done += rows


@inlined
def is_plausible_gap(stream: Record, gap: int) -> bool:
    """Whether the host's clock has room for the `gap` that a device tells after the link was broken.

    A device that lost its power counts anew, and its numbers are as good as random then.
    """
    slack = _SLACK_S / stream.period_s + _SLACK * stream.restart_rows
    return bool(abs(gap - stream.restart_rows) <= slack)


@compiled
def fill_rows(
    units: NDArray[np.void],
    samples: NDArray[np.int32] | NDArray[np.float64],
    period_s: float,
    cursor: NDArray[np.void],
    counts: NDArray[np.int32] | NDArray[np.float64],
    status: NDArray[np.uint8],
    times_s: NDArray[np.float64],
) -> int:
    """Fill one block (counts, status, times) from `cursor` on; returns how many rows it took."""
    place = cursor[0]
    row = 0
    while place.unit < len(units):
        unit = units[place.unit]
        row = _fill_gap(unit, place, row, counts, status, times_s)
        if place.lost < unit.damaged + unit.missing or row + unit.samples > len(status):
            break
        for k in range(unit.samples):
            counts[row, 0] = samples[place.sample, 0]
            counts[row, 1] = samples[place.sample, 1]
            status[row] = unit.status
            times_s[row] = unit.time_s + k * period_s
            place.sample += 1
            row += 1
        place.time_s = times_s[row - 1]
        place.lost = 0
        place.unit += 1
    return row


@inlined
def _fill_gap(
    unit: Record,
    place: Record,
    row: int,
    counts: NDArray[np.int32] | NDArray[np.float64],
    status: NDArray[np.uint8],
    times_s: NDArray[np.float64],
) -> int:
    """Rows before a unit, as far as the block has room; their times lie evenly between the neighbours'."""
    left = unit.damaged + unit.missing - place.lost
    step_s = (unit.time_s - place.time_s) / (left + 1)
    for _ in range(min(left, len(status) - row)):
        place.time_s += step_s
        counts[row, 0] = counts[row, 1] = 0
        status[row] = _DAMAGED if place.lost < unit.damaged else _MISSING
        times_s[row] = place.time_s
        place.lost += 1
        row += 1
    return row


class PacketDecoder(ABC):
    """A `drivers.stream.Decoder` to which a device adds how its units are read (`_read`).

    Parameters
    ----------
    memory : (1,) structured
        What the device's loops remember, with the fields `LOSS_FIELDS` and `restarting`.
    rate_hz : float
        Nominal rate, > 0.
    max_gap_s : float
        Longest time that rows stand for.
    """

    _piece_bytes = 1 << 16
    """Long stretches are decoded in pieces that fit a processor's cache."""

    def __init__(self, state: NDArray[np.void], rate_hz: float, max_gap_s: float) -> None:
        self._state = state
        self._rate_hz = rate_hz
        self._max_gap = round(max_gap_s * rate_hz)
        self._unfinished = b""
        self._arrival_ns: int | None = None
        """When the last good unit came."""

    @property
    def losses(self) -> Losses:
        """The account until now."""
        return losses_from_state(self._state)

    @property
    def unfinished_bytes(self) -> int:
        """Bytes kept for the next call, at most 3 kB and of most devices a frame."""
        return len(self._unfinished)

    def expect_restart(self) -> None:
        """The link was broken: the device goes on if the host's clock bears it out, else it began anew."""
        self._state["restarting"] = self._arrival_ns is not None
        self._state["discarded_bytes"] += len(self._unfinished)
        self._unfinished = b""

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Blocks that `data` completes; what is unfinished is kept. Exhaust it."""
        for start in range(0, len(data), self._piece_bytes):
            found = self._read(self._unfinished + data[start : start + self._piece_bytes], arrival_ns)
            if found is not None:
                self._arrival_ns = arrival_ns
                yield from sample_blocks(found)

    @abstractmethod
    def _read(self, data: bytes, arrival_ns: int) -> Packets | None:
        """Units in `data`, which begins with the rest of before; keeps the new rest."""

    def _rows_since(self, arrival_ns: int, samples: int) -> int:
        """Rows that the host's clock has room for since the last good unit, less those that came."""
        if self._arrival_ns is None:
            return 0
        elapsed = round((arrival_ns - self._arrival_ns) * 1e-9 * self._rate_hz)
        return min(max(elapsed - samples, 0), self._max_gap)
