"""What a journal says of its run beside the bytes: written as it becomes known, read by `recovery`."""

import datetime

import msgspec

from app.acquisition.messages import PortSettings, RunSettings
from app.runs.layout import Layout
from app.runs.metadata import Ending, RunMetadata


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
    clock_scale: float = 1.0
    clock_scale_uncertainty: float = 0.0
    reads: int | None = None
    """Decoded by then; None for all that stand before this record. More may: a read is decoded later."""


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The run file is begun: the run is sure."""

    start_index: int
    """Sample that is stored first."""
    start_time: datetime.datetime
    layout: Layout
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
    ending: Ending


MetadataRecord = JournalHeader | Mark | Opened | Named | Ended
_NOTES: msgspec.json.Decoder[MetadataRecord] = msgspec.json.Decoder(MetadataRecord)


def encode_metadata_record(note: MetadataRecord) -> bytes:
    """Data of a record of kind `RecordKind.NOTE`."""
    return msgspec.json.encode(note)


def decode_metadata_record(data: bytes) -> MetadataRecord:
    """Read what `encode_note` wrote. Raises msgspec.DecodeError, or ValueError from what it holds."""
    return _NOTES.decode(data)
