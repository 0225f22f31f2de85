"""Raw bytes of a run, as they were received."""

from collections.abc import Iterator
from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from app.runs.reader import Run
from app.runs.schema import WIRE_COLUMNS


@dataclass(frozen=True, eq=False, slots=True)
class RawBytes:
    """Received bytes: chunk i is `data[end[i - 1]:end[i]]`, read by `arrival_ns[i]` (monotonic)."""

    data: NDArray[np.uint8]
    arrival_ns: NDArray[np.int64]
    end: NDArray[np.uint64]

    def chunks(self) -> Iterator[tuple[bytes, int]]:
        """Bytes and arrival time (ns) of each read, in order, as a decoder takes them."""
        first = 0
        for end, arrival_ns in zip(self.end.tolist(), self.arrival_ns.tolist(), strict=True):
            yield self.data[first:end].tobytes(), arrival_ns
            first = end


def load_raw_bytes(run: Run) -> RawBytes:
    with h5py.File(run.path, "r") as file:
        return RawBytes(*(file[column.path][:] for column in WIRE_COLUMNS))
