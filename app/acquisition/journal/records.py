"""Metadata records of a journal: written as facts of the run become known, read by `recovery`."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from app.acquisition.errors import RecoveryError
from app.acquisition.messages import PortSettings, RunSettings
from app.runs.blocks import BlockLayout
from app.runs.journal import JournalRecord, RecordKind, read_journal
from app.runs.metadata import EndMetadata, Events, RunMetadata
from drivers.clock import TimeBase
from drivers.samples import Losses
from messages.i18n import N_


class JournalHeader(msgspec.Struct, frozen=True, tag=True):
    """First record of a journal: what is needed to decode the bytes that follow."""

    port: PortSettings
    run: RunSettings
    metadata: RunMetadata  # with the time of arming for the start
    identifier: str
    program: str


class Continued(msgspec.Struct, frozen=True, tag=True):
    """The journal begins after so many reads of its run, which stay on a disk that hangs or is gone."""

    reads: int


class Known(msgspec.Struct, frozen=True):
    """Measurement of the pullback until then, as sample indices and displacements (m); None where unknown."""

    zero_m: float | None = None
    relative_zero_m: float | None = None
    held_m: float | None = None
    held_index: int | None = None
    release_index: int | None = None
    release_confirmed: bool = False
    slip_end_index: int | None = None
    rest_index: int | None = None


class Mark(msgspec.Struct, frozen=True, tag=True):
    """Checkpoint: how far the stream had come after so many reads, and what was known of the run then."""

    next_index: int
    armed_index: int
    known: Known
    time_base: TimeBase
    reads: int | None = None
    """Decoded by then; None for all that stand before this record. More may: a read is decoded later."""


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The run file is begun: the run is confirmed."""

    start_index: int
    start_time: datetime.datetime
    layout: BlockLayout
    wire_start: int  # byte of the journal from which on its bytes go into the run file
    reads: int | None = None
    """Decoded by then, None for all before this record; the account of later ones counts for the run."""


class Named(msgspec.Struct, frozen=True, tag=True):
    """The run file is there, under its final name."""

    path: str


class Ended(msgspec.Struct, frozen=True, tag=True):
    """Nothing more is recorded; the file is only to be completed."""

    end_index: int
    ending: EndMetadata


def end_metadata(
    mark: Mark,
    start_index: int,
    rate_hz: float,
    ended: str,
    end_time: datetime.datetime,
    losses: Losses,
    notes: str,
) -> EndMetadata:
    """End metadata of a run that began at sample `start_index`, from its last checkpoint."""
    known, dwell_s = mark.known, None
    if known.release_index is not None and known.held_index is not None:
        dwell_s = (known.release_index - known.held_index) / rate_hz

    def time_s(index: int | None) -> float | None:
        return None if index is None else (index - start_index) / rate_hz

    return EndMetadata(
        ended=ended,
        end_time=end_time,
        events=Events(
            pulled_back_s=time_s(known.held_index),
            armed_s=time_s(mark.armed_index),
            release_s=time_s(known.release_index),
            slip_end_s=time_s(known.slip_end_index),
            rest_s=time_s(known.rest_index),
        ),
        losses=losses,
        time_base=mark.time_base,
        dwell_s=dwell_s,
        zero_m=known.zero_m,
        relative_zero_m=known.relative_zero_m,
        held_m=known.held_m,
        message=notes,
    )


MetadataRecord = JournalHeader | Continued | Mark | Opened | Named | Ended
decode_metadata_record: Callable[[bytes], MetadataRecord] = msgspec.json.Decoder(MetadataRecord).decode


@dataclass(frozen=True)
class JournalSummary:
    """The last metadata record of each kind in a journal; None for those that its engine could not write."""

    path: Path
    header: JournalHeader
    checkpoint: Mark | None
    opened: Opened | None
    named: Named | None
    ended: Ended | None
    earlier_reads: int
    """Reads of the run that came before the first one of this journal."""
    wire_bytes: int
    end: int
    """Byte after the last whole record; behind it nothing is trusted."""

    @property
    def rate_hz(self) -> float:
        """Nominal samples a second."""
        return self.header.metadata.rate_hz or 0.0


def read_summary(path: Path) -> JournalSummary:
    """Read the metadata records of a journal. Raises RecoveryError if it cannot be read or is no journal."""
    records: dict[type[MetadataRecord], Any] = {}
    wire_bytes, end = 0, 0
    try:
        for record in read_journal(path):
            end = record.end
            if record.kind is RecordKind.WIRE:
                wire_bytes += len(record.data)
            else:
                decoded = _decode(path, record)
                records[type(decoded)] = decoded
    except OSError as error:
        raise RecoveryError(
            "{path} cannot be read ({reason}). Check its rights", path=path, reason=error.strerror or error
        ) from None
    except ValueError:
        raise RecoveryError(
            "{path} is not a journal of Slipstand. Nothing was done to it", path=path
        ) from None
    header: JournalHeader | None = records.get(JournalHeader)
    if header is None or not header.metadata.rate_hz:
        raise RecoveryError(
            "{path} was cut off before its first sample. Delete it, it holds no data", path=path
        )
    return JournalSummary(
        path,
        header,
        checkpoint=records.get(Mark),
        opened=records.get(Opened),
        named=records.get(Named),
        ended=records.get(Ended),
        earlier_reads=records.get(Continued, Continued(0)).reads,
        wire_bytes=wire_bytes,
        end=end,
    )


def _decode(path: Path, record: JournalRecord) -> MetadataRecord:
    try:
        return decode_metadata_record(record.data)
    except msgspec.DecodeError as error:
        fault = " ".join(str(error).split())[:120]
        template = N_("{path} is of another version of Slipstand ({fault}). Recover it with that one")
        raise RecoveryError(template, path=path, fault=fault) from None
