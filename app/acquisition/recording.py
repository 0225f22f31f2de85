"""One run from arming to its end. The trigger decides when it begins and ends; here it is carried out."""

import contextlib
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from pathlib import Path

import msgspec

from app.acquisition import messages
from app.acquisition.errors import JournalError
from app.acquisition.journal.journal import CheckpointWriter, Journal, JournalTap
from app.acquisition.journal.records import Known, Mark, end_metadata
from app.acquisition.pullback.plan import ObservedSlip, PullbackPlan
from app.acquisition.pullback.trigger import Trigger
from app.acquisition.run_file import RunFile, end_reason, sentences, start_time
from app.acquisition.stream.connection import RawRead, ReadQueue
from app.acquisition.stream.live_stream import DecodedRead, ReadHistory, merge_reads
from app.acquisition.stream.monitors import RATE_TEMPLATE, is_rate_wrong, rate_note
from app.runs.blocks import BlockLayout
from app.runs.errors import RunError
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata, RunMetadata
from app.runs.writer_client import OpenRun, WriterClient
from drivers.clock import TimeBase
from drivers.samples import Losses
from messages.i18n import N_
from messages.message import EMPTY, Message, message, message_of

_NOTES_MAX = 100  # of a run: a cable that is loose for hours gives a new note each time
_STALL_TOLD_S = 1.0  # the operator is told of a disk that takes nothing for so long
_HANGS_S = 4.0  # and the run ends after so long
_DISCARD_S = 0.5  # longest that the removal of a journal without a run is waited for
_FOLLOW_S = 0.07
"""How often a run is followed that may wait: what is done for so many samples at once costs less."""


class Latency(Enum):
    """How soon new samples must be processed."""

    BATCHED = auto()  # nobody waits for it
    IDENTIFIED = auto()  # the live identification follows the motion; nobody at the stand waits
    INTERACTIVE = auto()  # it may call for the operator's next step
    IMMEDIATE = auto()  # the table is held and may be released, which must be reported at once


@dataclass(frozen=True)
class RecordingContext:
    """What a recording needs of the engine that it runs in."""

    read_queue: ReadQueue
    history: ReadHistory
    writer: WriterClient
    time_base: Callable[[int, int], TimeBase]
    emit: Callable[[messages.Event], None]
    is_simulated: bool = False


class Recording:
    """A requested run. Its `settings` are checked, its journal has nothing but the header."""

    def __init__(
        self,
        settings: messages.RunSettings,
        metadata: RunMetadata,
        rate_hz: float,
        journal: Journal,
        context: RecordingContext,
        last_slip: ObservedSlip | None = None,
    ) -> None:
        self._settings = settings
        self.metadata = metadata
        self._rate_hz = rate_hz
        self._journal = journal
        self._context = context
        self._history = context.history
        self._armed_index = context.history.next_index
        plan = replace(_plan(metadata, rate_hz, last_slip), is_simulated=context.is_simulated)
        self._trigger = Trigger(settings, plan, self._armed_index, context.history)
        self._checkpoints = CheckpointWriter(journal, self._armed_index, rate_hz, context.time_base)
        self._tap = JournalTap(journal)
        self._pending: list[DecodedRead] = []
        self._followed_index = self._armed_index
        self._file: RunFile | None = None
        self._is_path_sent = False
        self._ended: messages.EndReason | None = None
        self._time_base = TimeBase()
        self._notes: list[Message] = []
        self._omitted_notes = 0
        self._state = (
            messages.PullbackState.RECORDING if settings.trigger == "none" else messages.PullbackState.ZERO
        )
        self._note = EMPTY
        self._is_at_rest = True  # as reported last
        self._is_stall_told = False
        self._open_tap()
        self._update_checkpoint()
        self._send_state(self._state, self._armed_index, self._trigger.note)
        if self._trigger.state is not self._state:  # the second before was rest enough
            self._send_state(self._trigger.state, self._armed_index, self._trigger.note)

    @property
    def directory(self) -> str:
        """Folder of the runs."""
        return str(Path(self._settings.directory).absolute())

    @property
    def is_unattended(self) -> bool:
        return self._trigger.is_unattended

    @property
    def latency(self) -> Latency:
        if self._trigger.awaits_release:
            return Latency.IMMEDIATE
        if self.confirmed_start_index is not None:
            return Latency.IDENTIFIED
        return Latency.BATCHED if self._settings.trigger == "none" else Latency.INTERACTIVE

    @property
    def expects_release(self) -> bool:
        """Tell whether a release may come soon; without a trigger, since the table has moved."""
        return self._settings.trigger != "none" or not self._trigger.is_table_at_rest

    @property
    def ends_s(self) -> float:
        """Time until the samples of the run are complete; infinite where only a motion ends it."""
        end = self._trigger.end
        return math.inf if end is None else (end[0] - self._history.next_index) / self._rate_hz

    @property
    def confirmed_start_index(self) -> int | None:
        return self._trigger.start_index if self._trigger.measurement.release_confirmed else None

    @property
    def observed_slip(self) -> ObservedSlip | None:
        measurement = self._trigger.measurement
        if measurement.excursion is None or not measurement.release_confirmed or not measurement.pulled_m:
            return None
        return ObservedSlip(self.metadata.series, measurement.pulled_m, measurement.excursion)

    @property
    def journal_bytes(self) -> int:
        return self._journal.size

    @property
    def is_ending(self) -> bool:
        return self._ended is not None

    def add(self, reads: Sequence[DecodedRead]) -> None:
        """Record what reads brought; they are in the history already, and in the journal."""
        if self.is_ending:
            return
        self._pending += reads
        new = self._history.next_index - self._followed_index
        if self.latency not in (Latency.BATCHED, Latency.IDENTIFIED) or new >= _FOLLOW_S * self._rate_hz:
            self._follow_pending()

    def end(self, reason: messages.EndReason, message: Message = EMPTY, *, keep_rest: bool = True) -> None:
        """End the run; unless `keep_rest`, one in which the table was not pulled back leaves no file."""
        self._follow_pending()
        if self.is_ending:
            return
        self._ended = reason
        self._context.read_queue.close_tap()
        self._store_note(message, first=True)
        try:
            is_wanted = keep_rest or not self._trigger.is_at_rest
            if self._file is None and is_wanted and self._history.next_index > 0:
                # Since arming, or before it if nothing came since; never more than the history holds.
                armed_index = min(self._armed_index, self._history.next_index - 1)
                self._open(max(self._history.first_index, armed_index))
        except RunError as error:
            self._store_note(message_of(error))
        if self._file is None:  # there is nothing to keep
            discarding = threading.Thread(target=self._discard_journal, name="closing", daemon=True)
            discarding.start()
            discarding.join(_DISCARD_S)
        else:
            self._send_state(messages.PullbackState.CLOSING, self._file.next_index)
            self._file.close(self._ending(self._file))

    def end_if_enough(self) -> None:
        if self._settings.duration_s is None and self._settings.trigger == "pullback":
            self.end(messages.EndReason.ENOUGH)

    def add_note(self, note: Message) -> None:
        if note and not self.is_ending:
            self._store_note(note)
            self.show_note(note)

    def show_note(self, note: Message) -> None:
        self._send_state(self._state, self._history.next_index, note)

    def poll(self) -> messages.RunEnded | None:
        """Report what has happened to journal and file; return the run's end once its file is safe."""
        self._follow_disk()
        moved = self._journal.move_message
        if moved and moved not in self._notes:
            self._store_note(moved)
            self.show_note(moved)
        file = self._file
        if file is None:
            return self._run_ended("", Losses()) if self.is_ending else None
        if file.path.done() and not self._is_path_sent:
            self._is_path_sent = True
            file.record_path()
            self._send_path(file)
        if not file.close_result.done():
            return None
        result = file.close_result.result()
        self._ended = result.fault or self._ended
        self._notes = [*result.notes, *(note for note in self._notes if note not in result.notes)]
        return self._run_ended(result.path, file.statistics.losses())

    def _discard_journal(self) -> None:
        with contextlib.suppress(JournalError):
            self._journal.close()
        self._journal.remove()

    def _follow_disk(self) -> None:
        """Tell of a disk that takes nothing, and end the run where it does not come back soon."""
        stalled_s = self._journal.stalled_s
        if stalled_s < _STALL_TOLD_S or self._journal.left is not None:
            self._is_stall_told = False
            return
        if not self._is_stall_told:
            self._is_stall_told = True
            template = N_("the disk of {folder} takes nothing any more: check the disk, or its network")
            self.show_note(message(template, folder=self.directory))
        if stalled_s > _HANGS_S and not self.is_ending and self._journal.leave_hanging_disk():
            template = N_("the disk of {folder} has taken nothing for {stalled_s:.0f} s")
            hangs = message(template, folder=self.directory, stalled_s=stalled_s)
            self.end(messages.EndReason.WRITE_ERROR, hangs)

    def _send_path(self, file: RunFile) -> None:
        error = file.path.exception()
        if error is None:
            self._context.emit(messages.RunStarted(str(file.path.result())))
        elif isinstance(error, Exception):
            self.end(end_reason(error), message_of(error))

    def _open_tap(self) -> None:
        reads, read_queue = list(self._history.reads()), self._context.read_queue
        read_queue.open_tap(self._tap.on_read, (RawRead(read.arrival_ns, read.data) for read in reads))
        try:
            self._note_decoded(reads)
        except JournalError:
            read_queue.close_tap()
            raise

    def _follow_pending(self) -> None:
        pending, self._pending = self._pending, []
        if self.is_ending or not pending:
            return
        faults = list[Exception]()
        try:
            self._note_decoded(pending)
        except JournalError as error:  # what came goes into the run all the same
            faults.append(error)
        try:
            self._follow(merge_reads(pending))
        except RunError as error:
            faults.append(error)
        if faults:
            self.end(end_reason(faults[0]), message_of(faults[0]))

    def _follow(self, read: DecodedRead) -> None:
        self._followed_index = self._history.next_index
        for rows in read.rows:
            for transition in self._trigger.add_samples(rows):
                if transition.is_stored:
                    self._store_note(transition.note)
                if transition.end_reason is None:
                    self._send_state(transition.state, transition.index, transition.note)
            if self._trigger.is_at_rest is not self._is_at_rest:
                self.show_note(self._note)
        self._update_checkpoint()
        self._store(read)

    def _update_checkpoint(self) -> None:
        self._checkpoints.update(self._tap.decoded_reads, self._followed_index, self._trigger.measurement)

    def _note_decoded(self, reads: list[DecodedRead]) -> None:
        for read in reads:
            self._tap.note_decoded(read, self._history.first_index)

    def _store(self, read: DecodedRead) -> None:
        start_index, end = self._trigger.start_index, self._trigger.end
        end_index = None if end is None else end[0]
        if self._file is not None:
            self._file.append(read, end_index)
        elif start_index is not None and start_index < self._history.next_index:
            self._open(start_index, end_index)
        if end is not None and self._history.next_index >= end[0]:
            self.end(end[1])

    def _open(self, start_index: int, end_index: int | None = None) -> None:
        """Begin the run file, and store what the history holds of the run. Raises RunError."""
        first_index = max(start_index, self._history.first_index)
        if first_index > start_index:
            kept_s = self._settings.pretrigger_s - (first_index - start_index) / self._rate_hz
            self._store_note(
                message(
                    "only {kept_s:.3g} s of the {pretrigger_s:g} s before the release could be kept: the"
                    " stream had just begun",
                    kept_s=kept_s,
                    pretrigger_s=self._settings.pretrigger_s,
                )
            )
        reads = list(self._history.reads(first_index))
        started = start_time(reads[-1], first_index, self._rate_hz)
        is_integer = reads[-1].rows[0].counts.dtype.kind == "i"
        request = OpenRun(
            self._settings.directory,
            self.metadata.replace(start_time=started),
            BlockLayout(counts="int32" if is_integer else "float64"),
            JournalSpan(str(self._journal.path), self._tap.offset_of(first_index)),
            self._journal.identifier,
        )
        writer = self._context.writer
        self._file = RunFile(writer, request, self._journal, first_index, self._rate_hz, self._tap)
        self._file.append_all(reads, end_index)

    def _ending(self, file: RunFile) -> EndMetadata:
        self._time_base = self._context.time_base(file.start_index, file.next_index)
        is_rate_noted = any(note.template == RATE_TEMPLATE for note in self._notes)
        if is_rate_wrong(self._time_base) and not is_rate_noted:
            self._store_note(rate_note(self._time_base.scale, self._rate_hz))
        self._store_note(self._time_base.skew_message)
        known = msgspec.convert(self._trigger.measurement, Known, from_attributes=True)
        return end_metadata(
            Mark(file.next_index, self._armed_index, known, self._time_base),
            file.start_index,
            self._rate_hz,
            str(self._ended),
            file.current_time(),
            file.statistics.losses(),
            str(self._message()),
        )

    def _run_ended(self, path: str, losses: Losses) -> messages.RunEnded:
        file, release_index = self._file, self._trigger.measurement.release_index
        return messages.RunEnded(
            path=path,
            ended=self._ended or messages.EndReason.STOPPED,
            samples=losses.samples,
            missing=losses.missing,
            missing_estimated=losses.missing_estimated,
            damaged=losses.damaged,
            overloaded=losses.overloaded,
            rate_hz=self._rate_hz,
            release_s=None if file is None else file.time_s(release_index),
            message=self._message(),
            time_base=self._time_base,
        )

    def _store_note(self, note: Message, *, first: bool = False) -> None:
        if not note or note in self._notes:
            return
        if len(self._notes) >= _NOTES_MAX and not first:
            self._omitted_notes += 1
        else:
            self._notes.insert(0 if first else len(self._notes), note)

    def _message(self) -> Message:
        omitted = message("{count} further notes are left out", count=self._omitted_notes)
        return sentences(*self._notes, omitted if self._omitted_notes else EMPTY)

    def _send_state(self, state: messages.PullbackState, index: int, note: Message = EMPTY) -> None:
        self._state, self._note, self._is_at_rest = state, note, self._trigger.is_at_rest
        self._context.emit(messages.StateChanged(state, index / self._rate_hz, note, self._trigger.position))


def _plan(metadata: RunMetadata, rate_hz: float, last_slip: ObservedSlip | None) -> PullbackPlan:
    gauge = metadata.gauges.relative
    plan = PullbackPlan(
        rate_hz,
        metadata.pullback_m,
        relative_range_m=gauge.range_m,
        gauge_2_on_base=gauge.measures == "plate",
    )
    if last_slip is None:
        return plan
    expected = last_slip.expected_excursion(metadata.series, metadata.pullback_m)
    return replace(plan, expected_excursion=expected, side=1 if last_slip.pulled_m > 0.0 else -1)
