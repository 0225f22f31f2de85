"""Raw bytes of a run, as received: copied from the journal into the run file, and read back."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from app.runs.columns import is_finished
from app.runs.journal import JournalRecord, JournalSpan, RecordKind, UnreadableJournalError, read_journal
from app.runs.schema import WIRE_ARRIVAL, WIRE_COLUMNS, WIRE_DATA, WIRE_END

_BATCH_BYTES = 1 << 20
"""Bytes copied at once: one compressed write of HDF5 a megabyte, whatever the length of a run."""


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


def copy_raw_bytes(file: h5py.File, journal: JournalSpan) -> int:
    """Append a journal's raw bytes to an open file. Returns their CRC-32. Raises UnreadableJournalError."""
    checksum = 0
    try:
        for records in _batches(journal):
            data = b"".join(record.data for record in records)
            checksum = zlib.crc32(data, checksum)
            first = len(file[WIRE_DATA.path])
            lengths = np.array([len(record.data) for record in records], np.uint64)
            _append(file[WIRE_DATA.path], np.frombuffer(data, np.uint8))
            _append(file[WIRE_ARRIVAL.path], np.array([record.arrival_ns for record in records], np.int64))
            _append(file[WIRE_END.path], np.uint64(first) + np.cumsum(lengths))
    except UnreadableJournalError:
        for column in WIRE_COLUMNS:
            file[column.path].resize((0,))
        raise
    return checksum


def read_raw_bytes(file: h5py.File) -> RawBytes:
    """All received bytes of a run file; none of a run that was never closed, whose journal holds them."""
    if not is_finished(file):
        return RawBytes(np.empty(0, np.uint8), np.empty(0, np.int64), np.empty(0, np.uint64))
    return RawBytes(*(file[column.path][:] for column in WIRE_COLUMNS))


def _batches(journal: JournalSpan) -> Iterator[list[JournalRecord]]:
    """Received bytes, about a batch at a time. Raises UnreadableJournalError."""
    batch: list[JournalRecord] = []
    size = 0
    try:
        for record in read_journal(Path(journal.path), journal.start):
            if record.kind is RecordKind.WIRE:
                batch.append(record)
                size += len(record.data)
            if size >= _BATCH_BYTES:
                yield batch
                batch, size = [], 0
    except (OSError, ValueError) as error:
        raise UnreadableJournalError(str(error)) from None
    if batch:
        yield batch


def _append(dataset: h5py.Dataset, values: NDArray[np.generic]) -> None:
    first = len(dataset)
    dataset.resize((first + len(values),))
    dataset[first:] = values
