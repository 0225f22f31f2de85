"""Layout of a journal: `MAGIC`, then received bytes with arrival times, each record with length and checksum.

A record that was cut short or does not match its checksum ends the journal: nothing behind it is trusted.
"""

import struct
import zlib
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

import msgspec

from app.runs.lock import is_being_recorded

SUFFIX = ".journal"
MAGIC = b"SLIPSTAND-JRNL1\n"
_HEADER = struct.Struct("<BxxxIq")
"""Kind, length, arrival time; a CRC-32 over these and the data follows, then the data."""
_FRONT = struct.Struct("<BxxxIqI")
_LENGTH_MAX = 1 << 26
_SEARCHED_BYTES = 1 << 20
_PIECE_BYTES = 1 << 20  # read at once


class RecordKind(IntEnum):
    """What a record holds."""

    WIRE = 0  # bytes as they came
    NOTE = 1  # A JSON document about the run, such as its metadata


_KINDS = {int(kind): kind for kind in RecordKind}


class JournalRecord(NamedTuple):
    """One record, from byte `start` of the journal up to byte `end`."""

    kind: RecordKind
    arrival_ns: int
    data: bytes
    start: int
    end: int


class UnreadableJournalError(Exception):
    """The journal is gone, or is none."""


class JournalSpan(msgspec.Struct, frozen=True):
    """The part of a journal that belongs to one run: from byte `start` to its end at the time of closing."""

    path: str
    start: int = 0

    def size(self) -> int:
        """Bytes of the journal. Raises UnreadableJournalError."""
        try:
            return Path(self.path).stat().st_size
        except OSError as error:
            raise UnreadableJournalError(str(error)) from None


def encode_record(data: bytes, arrival_ns: int, kind: RecordKind = RecordKind.WIRE) -> bytes:
    """One record, ready to be appended."""
    checksum = zlib.crc32(data, zlib.crc32(_HEADER.pack(kind, len(data), arrival_ns)))
    return _FRONT.pack(kind, len(data), arrival_ns, checksum) + data


def is_read(record: bytes) -> bool:
    """Tell whether an encoded record holds received bytes."""
    return record[0] == RecordKind.WIRE


def read_journal(path: Path, start: int = 0) -> Iterator[JournalRecord]:
    """Records of a journal from byte `start` to its end or first torn record. Raises OSError, ValueError."""
    with path.open("rb", buffering=0) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError(f"{path} is not a Slipstand journal")
        place, data = file.seek(max(start, len(MAGIC))), b""
        while piece := file.read(_PIECE_BYTES):
            data += piece
            used = 0
            for record in _whole_records(data, place):
                yield record
                used = record.end - place
            place, data = place + used, data[used:]
            if _is_torn(data):
                return


def has_record_behind(path: Path, start: int) -> bool:
    """Tell whether a whole record stands anywhere from byte `start` on. Raises OSError.

    True for more than a megabyte, which is not searched: no power cut leaves so much that was not synced.
    """
    with path.open("rb") as file:
        file.seek(start)
        data = file.read(_SEARCHED_BYTES + 1)
    if len(data) > _SEARCHED_BYTES:
        return True
    return any(_is_record(data, place) for place in range(len(data) - _FRONT.size + 1))


def _is_record(data: bytes, start: int) -> bool:
    number, length, _, checksum = _FRONT.unpack_from(data, start)
    first = start + _FRONT.size
    if number not in _KINDS or length > len(data) - first:
        return False
    before = zlib.crc32(data[start : start + _HEADER.size])
    return bool(zlib.crc32(data[first : first + length], before) == checksum)


def _whole_records(data: bytes, place: int) -> Iterator[JournalRecord]:
    """Records at the begin of `data`, which stand at byte `place` of the journal, up to a torn one."""
    start, size = 0, len(data)
    while (first := start + _FRONT.size) <= size:
        number, length, arrival_ns, checksum = _FRONT.unpack_from(data, start)
        end = first + length
        content, kind = data[first:end], _KINDS.get(number)
        if end > size or kind is None:
            return
        if zlib.crc32(content, zlib.crc32(data[start : start + _HEADER.size])) != checksum:
            return
        yield JournalRecord(kind, arrival_ns, content, place + start, place + end)
        start = end


def _is_torn(data: bytes) -> bool:
    """Tell whether `data` begin with a record that more bytes cannot make whole."""
    if len(data) < _FRONT.size:
        return False
    number, length, *_ = _FRONT.unpack_from(data)
    return number not in _KINDS or length > _LENGTH_MAX or len(data) >= _FRONT.size + length


def find_journals(folder: Path) -> Iterator[Path]:
    """Files named like journals, in a folder and those below it, by name; hidden ones are left out."""
    for path in sorted(folder.rglob(f"*{SUFFIX}")):
        if not any(part.startswith(".") for part in path.relative_to(folder).parts):
            yield path.absolute()


def unfinished_journals(folder: Path) -> list[Path]:
    """Journals in a folder itself whose engine is gone; empty where there is no such folder."""
    paths = sorted(folder.glob(f"*{SUFFIX}"))
    return [path for path in paths if _is_journal(path) and not is_being_recorded(path)]


def _is_journal(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:  # gone meanwhile, or not ours to read
        return False
