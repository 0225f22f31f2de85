"""The bytes as they came: from a journal into a run file, and out of it."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from app.runs import schema as names
from app.runs.journal import (
    JournalRecord,
    JournalSpan,
    RecordKind,
    UnreadableJournalError,
    read_journal,
)
from app.runs.validation import is_finished

_AT_ONCE_BYTES = 1 << 20


@dataclass(frozen=True, eq=False, slots=True)
class RawBytes:
    """Received bytes: chunk i is `data[end[i - 1]:end[i]]`, read by `arrival_ns[i]` (monotonic)."""

    data: NDArray[np.uint8]
    arrival_ns: NDArray[np.int64]
    end: NDArray[np.uint64]

    def chunks(self) -> Iterator[tuple[bytes, int]]:
        """Bytes and arrival time (ns) of each read, in order: what a decoder is fed with."""
        first = 0
        for end, arrival_ns in zip(self.end.tolist(), self.arrival_ns.tolist(), strict=True):
            yield self.data[first:end].tobytes(), arrival_ns
            first = end


def copy_raw_bytes(file: h5py.File, journal: JournalSpan) -> int:
    """Append the wire records of a journal to an open run file, about 1 MiB at a time.

    Returns
    -------
    int
        CRC-32 of the bytes.

    Raises
    ------
    UnreadableJournalError
        The file then holds no wire bytes.
    """
    checksum = 0
    try:
        for records in _batches(_records(journal)):
            data = b"".join(record.data for record in records)
            checksum = zlib.crc32(data, checksum)
            _extend(file, data, records)
    except UnreadableJournalError:
        for path in (names.WIRE_DATA, names.WIRE_ARRIVAL, names.WIRE_END):
            file[path].resize((0,))
        raise
    return checksum


def read_raw_bytes(file: h5py.File) -> RawBytes:
    """All received bytes of a run file; none of a run that was never closed, whose journal has them."""
    if not is_finished(file):
        return RawBytes(np.empty(0, np.uint8), np.empty(0, np.int64), np.empty(0, np.uint64))
    return RawBytes(file[names.WIRE_DATA][:], file[names.WIRE_ARRIVAL][:], file[names.WIRE_END][:])


def _records(journal: JournalSpan) -> Iterator[JournalRecord]:
    try:
        for record in read_journal(Path(journal.path), journal.start):
            if record.kind is RecordKind.WIRE:
                yield record
    except (OSError, ValueError) as error:
        raise UnreadableJournalError(str(error)) from None


def _batches(records: Iterator[JournalRecord]) -> Iterator[list[JournalRecord]]:
    batch: list[JournalRecord] = []
    size = 0
    for record in records:
        batch.append(record)
        size += len(record.data)
        if size >= _AT_ONCE_BYTES:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


def _extend(file: h5py.File, data: bytes, records: list[JournalRecord]) -> None:
    lengths = np.array([len(record.data) for record in records], np.uint64)
    first = len(file[names.WIRE_DATA])
    _append(file[names.WIRE_DATA], np.frombuffer(data, np.uint8))
    _append(file[names.WIRE_ARRIVAL], np.array([record.arrival_ns for record in records], np.int64))
    _append(file[names.WIRE_END], np.uint64(first) + np.cumsum(lengths))


def _append(dataset: h5py.Dataset, values: NDArray[np.generic]) -> None:
    first = len(dataset)
    dataset.resize((first + len(values),))
    dataset[first:] = values
