"""What all decoders share: pieces that fit a cache, an unfinished rest, and the host's clock for gaps."""

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from drivers.rows import Packets, losses_from_state, sample_blocks
from drivers.samples import Losses, SampleBlock


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
