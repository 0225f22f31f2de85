"""What a journal says of its run beside the bytes: written as it becomes known, read by `recovery`."""

import datetime
from dataclasses import dataclass
from pathlib import Path

import msgspec

from app.acquisition.errors import RecoveryError
from app.acquisition.messages import PortSettings, RunSettings
from app.runs.blocks import BlockLayout
from app.runs.journal import JournalRecord, RecordKind, read_journal
from app.runs.metadata import EndMetadata, RunMetadata
from drivers.clock import TimeBase


class JournalHeader(msgspec.Struct, frozen=True, tag=True):
    """First record of a journal: what is needed to make samples of the bytes that follow."""

    port: PortSettings
    run: RunSettings
    metadata: RunMetadata
    """With the time of arming for the start."""
    identifier: str
    """UUID that the run file has too."""
    program: str


class Known(msgspec.Struct, frozen=True):
    """What was found of the pullback, as sample indices and displacements (m); None where it was not yet."""

    zero_m: float | None = None
    relative_zero_m: float | None = None
    held_m: float | None = None
    held_index: int | None = None
    release_index: int | None = None
    release_confirmed: bool = False
    slip_end_index: int | None = None
    rest_index: int | None = None


class Mark(msgspec.Struct, frozen=True, tag=True):
    """How far the stream had come with so many reads of the journal, and what was known of the run then."""

    next_index: int
    """Of the sample that comes next, counted from the first one of the stream."""
    armed_index: int
    known: Known
    time_base: TimeBase
    reads: int | None = None
    """Decoded by then; None for all that stand before this record. More may: a read is decoded later."""


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The run file is begun: the run is sure."""

    start_index: int
    """Sample that is stored first."""
    start_time: datetime.datetime
    layout: BlockLayout
    wire_start: int
    """Byte of the journal from which on its bytes go into the run file."""
    reads: int | None = None
    """Decoded by then, None for all before this record; the account of later ones counts for the run."""


class Named(msgspec.Struct, frozen=True, tag=True):
    """The run file is there, under its final name."""

    path: str


class Ended(msgspec.Struct, frozen=True, tag=True):
    """Nothing more is recorded; the file is only to be completed."""

    end_index: int
    """Sample before which the run ends."""
    ending: EndMetadata


MetadataRecord = JournalHeader | Mark | Opened | Named | Ended
_NOTES: msgspec.json.Decoder[MetadataRecord] = msgspec.json.Decoder(MetadataRecord)


def encode_metadata_record(note: MetadataRecord) -> bytes:
    """Data of a record of kind `RecordKind.NOTE`."""
    return msgspec.json.encode(note)


def decode_metadata_record(data: bytes) -> MetadataRecord:
    """Read what `encode_note` wrote. Raises msgspec.DecodeError, or ValueError from what it holds."""
    return _NOTES.decode(data)


@dataclass(frozen=True)
class JournalSummary:
    """The notes of a journal; None for what its engine did not live to write.

    Attributes
    ----------
    mark : Mark or None
        The last one.
    """

    path: Path
    """Of the journal."""
    header: JournalHeader
    checkpoint: Mark | None
    opened: Opened | None
    named: Named | None
    ended: Ended | None
    wire_bytes: int
    """Received bytes that it holds."""
    is_torn: bool
    """There is more behind the last whole record."""

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
        raise RecoveryError(
            "{path} cannot be read ({reason}). Check its rights", path=path, reason=error.strerror or error
        ) from None
    except ValueError:
        raise RecoveryError(
            "{path} is not a journal of Slipstand. Nothing was done to it", path=path
        ) from None
    header = notes.get(JournalHeader)
    if not isinstance(header, JournalHeader) or not header.metadata.rate_hz:
        raise RecoveryError(
            "{path} was cut off before its first sample. Delete it, it holds no data", path=path
        )
    return _story(path, header, notes, wire_bytes, is_torn)


def _note(path: Path, record: JournalRecord) -> MetadataRecord:
    try:
        return decode_metadata_record(record.data)
    except msgspec.DecodeError as error:
        fault = " ".join(str(error).split())[:120]
        raise RecoveryError(
            "{path} is of another version of Slipstand ({fault}). Recover it with that one",
            path=path,
            fault=fault,
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
