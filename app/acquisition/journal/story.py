"""What a journal tells of its run, read in one pass over its notes."""

from dataclasses import dataclass
from pathlib import Path

import msgspec

from app.acquisition.errors import RecoveryError
from app.acquisition.journal.notes import (
    Ended,
    JournalHeader,
    Mark,
    MetadataRecord,
    Named,
    Opened,
    decode_metadata_record,
)
from app.runs.journal import JournalRecord, RecordKind, read_journal


@dataclass(frozen=True)
class JournalSummary:
    """The notes of a journal; None for what its engine did not live to write.

    Attributes
    ----------
    path : Path
        Of the journal.
    header : JournalHeader
    mark : Mark or None
        The last one.
    opened, named, ended
    wire_bytes : int
        Received bytes that it holds.
    is_torn : bool
        There is more behind the last whole record.
    """

    path: Path
    header: JournalHeader
    checkpoint: Mark | None
    opened: Opened | None
    named: Named | None
    ended: Ended | None
    wire_bytes: int
    is_torn: bool

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second."""
        return self.header.metadata.rate_hz or 0.0


def read_summary(path: Path) -> JournalSummary:
    """Read the notes of a journal.

    Raises
    ------
    RecoveryError
        It cannot be read, is no journal, or was cut off before anything could be told.
    """
    notes: dict[type[MetadataRecord], MetadataRecord] = {}
    wire_bytes, end = 0, 0
    try:
        for record in read_journal(path):
            end = record.end
            if record.kind is RecordKind.WIRE:
                wire_bytes += len(record.data)
            else:
                note = _note(path, record)
                notes[type(note)] = note
        is_torn = path.stat().st_size > end
    except OSError as error:
        raise RecoveryError(f"{path} cannot be read ({error.strerror or error}). Check its rights") from None
    except ValueError:
        raise RecoveryError(f"{path} is not a journal of Slipstand. Nothing was done to it") from None
    header = notes.get(JournalHeader)
    if not isinstance(header, JournalHeader) or not header.metadata.rate_hz:
        raise RecoveryError(f"{path} was cut off before its first sample. Delete it, it holds no data")
    return _story(path, header, notes, wire_bytes, is_torn)


def _note(path: Path, record: JournalRecord) -> MetadataRecord:
    try:
        return decode_metadata_record(record.data)
    except msgspec.DecodeError as error:
        fault = " ".join(str(error).split())[:120]
        raise RecoveryError(
            f"{path} is of another version of Slipstand ({fault}). Recover it with that one"
        ) from None


def _story(
    path: Path,
    header: JournalHeader,
    notes: dict[type[MetadataRecord], MetadataRecord],
    wire_bytes: int,
    is_torn: bool,
) -> JournalSummary:
    mark, opened, named, ended = (notes.get(kind) for kind in (Mark, Opened, Named, Ended))
    return JournalSummary(
        path=path,
        header=header,
        checkpoint=mark if isinstance(mark, Mark) else None,
        opened=opened if isinstance(opened, Opened) else None,
        named=named if isinstance(named, Named) else None,
        ended=ended if isinstance(ended, Ended) else None,
        wire_bytes=wire_bytes,
        is_torn=is_torn,
    )
