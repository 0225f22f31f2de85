"""The reads of a journal once more, with their samples, numbered as they were while they came."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from app.acquisition.errors import RecoveryError
from app.acquisition.journal.notes import Mark, Opened, decode_note
from app.acquisition.journal.story import Story
from app.acquisition.messages import PortSettings
from app.acquisition.stream.calibration import calibrated
from app.acquisition.stream.history import Chunk, difference
from app.runs.journal import MAGIC, RecordKind, read_journal
from drivers.errors import DriverError, SettingsError
from drivers.registry import find_protocol
from drivers.samples import Losses
from drivers.source import SampleSource


@dataclass(frozen=True, eq=False, slots=True)
class Replayed:
    """A read of the journal.

    Attributes
    ----------
    chunk : Chunk
        With the numbers that its samples had in the stream.
    start : int
        Byte of the journal at which its record begins.
    is_in_run : bool
        It came after the run file was begun.
    """

    chunk: Chunk
    start: int
    is_in_run: bool


class Replay:
    """Decodes a journal by the very code that decoded its bytes live. Iterate over it once.

    A journal may begin amid a stream, so its samples are counted anew; the first mark tells by how many
    that is too few. Later ones are compared: `differs` tells whether one did not agree.
    """

    def __init__(self, story: Story) -> None:
        self.differs = False
        self._story = story
        self._source = _source(story)
        self._losses = Losses()
        self._offset: int | None = None
        self._is_in_run = False

    def __iter__(self) -> Iterator[Replayed]:
        waiting: list[Replayed] = []
        start = len(MAGIC)
        for record in read_journal(self._story.path):
            if record.kind is RecordKind.WIRE:
                waiting.append(self._replayed(record.data, record.arrival_ns, start))
            else:
                self._take_note(record.data)
            if self._offset is not None:
                yield from (self._numbered(read, self._offset) for read in waiting)
                waiting.clear()
            start = record.end
        self._offset = self._offset or 0
        yield from (self._numbered(read, self._offset) for read in waiting)

    def _replayed(self, data: bytes, arrival_ns: int, start: int) -> Replayed:
        gauges = self._story.header.metadata.gauges
        try:
            blocks = list(self._source.decode(data, arrival_ns))
        except DriverError as error:
            raise RecoveryError(
                f"{self._story.path}: its bytes make no sense ({error}). It stays as it is"
            ) from None
        before, self._losses = self._losses, replace(self._source.losses)
        rows = tuple(calibrated(block, gauges) for block in blocks)
        return Replayed(
            Chunk(data, arrival_ns, rows, difference(self._losses, before)), start, self._is_in_run
        )

    def _take_note(self, data: bytes) -> None:
        note = decode_note(data)
        if isinstance(note, Opened):
            self._is_in_run = True
        elif isinstance(note, Mark) and self._losses.samples:
            ahead = note.next_index - self._losses.samples
            self.differs = self.differs or self._offset not in (None, ahead)
            self._offset = ahead if self._offset is None else self._offset

    def _numbered(self, read: Replayed, offset: int) -> Replayed:
        rows = tuple(replace(rows, first_index=rows.first_index + offset) for rows in read.chunk.rows)
        return replace(read, chunk=replace(read.chunk, rows=rows))


def _source(story: Story) -> SampleSource:
    header = story.header
    try:
        source = _made(header.port, story.rate_hz)
        source.prepare()
    except DriverError as error:
        raise RecoveryError(f"{story.path} cannot be decoded ({error}). It stays as it is") from None
    return source


def _made(port: PortSettings, rate_hz: float) -> SampleSource:
    """A source at the rate of the run, or one that measures it again where no device can be set to it."""
    protocol = find_protocol(port.protocol)
    try:
        return protocol.make_source(port.device, rate_hz)
    except SettingsError:
        return protocol.make_source(port.device, port.rate_hz)
