"""One run from arming to its end: the trigger says when it begins and ends, here it is done."""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto

from app.acquisition.errors import JournalError
from app.acquisition.journal.journal import Journal
from app.acquisition.journal.tap import CheckpointWriter, JournalTap
from app.acquisition.messages import (
    EndReason,
    Event,
    PullbackState,
    RunEnded,
    RunSettings,
    RunStarted,
    StateChanged,
)
from app.acquisition.pullback.plan import ObservedSlip, PullbackPlan, Transition
from app.acquisition.pullback.trigger import create_trigger
from app.acquisition.run_file import RunFile, Writer, end_reason, start_time
from app.acquisition.stream.connection import RawRead, ReadQueue
from app.acquisition.stream.live_stream import DecodedRead, ReadHistory, merge_reads
from app.acquisition.stream.monitors import RATE_TEMPLATE, is_rate_wrong, rate_note
from app.runs.blocks import BlockLayout
from app.runs.errors import RunError
from app.runs.journal import JournalSpan
from app.runs.metadata import EndMetadata, Events, RunMetadata
from app.runs.writer_client import OpenRun
from drivers.clock import TimeBase
from drivers.samples import Losses
from messages.message import EMPTY, Message, joined, message, message_of

_NOTES_MAX = 100
"""Of a run: a cable that is loose for hours says something else each time."""
_FOLLOW_S = 0.07
"""How often a run is followed that may wait: what is done for so many samples at once costs less."""


class Latency(Enum):
    """How soon what comes must be followed."""

    BATCHED = auto()
    """Nobody at the stand waits for it."""
    INTERACTIVE = auto()
    """It may call for the operator's next step."""
    IMMEDIATE = auto()
    """The table is held and may be released, which must be reported at once."""


@dataclass(frozen=True)
class RecordingContext:
    """What a recording needs of the engine that it runs in.

    Attributes
    ----------
    intake : Intake
        Gives the journal each read before it is decoded.
    """

    read_queue: ReadQueue
    history: ReadHistory
    """Holds each read before the recording takes it."""
    writer: Writer
    """Idle."""
    time_base: Callable[[int, int], TimeBase]
    """Gives the time base of the samples from one index to another."""
    emit: Callable[[Event], None]
    """Takes what is to be told."""


class Recording:
    """A run that was asked for.

    Parameters
    ----------
    settings : RunSettings
        Checked.
    metadata : RunMetadata
        With its rate, and the time of arming for the start.
    rate_hz : float
        Nominal samples a second.
    journal : Journal
        Empty but for its header.
    last_slip : SeenSlip, optional
        How far the plate went in the run before.
    """

    def __init__(
        self,
        settings: RunSettings,
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
        self._around = context
        self._armed_index = context.history.next_index
        plan = _plan(metadata, rate_hz, last_slip)
        self._trigger = create_trigger(settings, plan, self._armed_index, context.history)
        self._marks = CheckpointWriter(journal, self._armed_index, rate_hz, context.time_base)
        self._feed = JournalTap(journal)
        self._gathered: list[DecodedRead] = []
        self._followed_index = self._armed_index
        self._file: RunFile | None = None
        self._path_is_told = False
        self._ended: EndReason | None = None
        self._time_base = TimeBase()
        self._notes: list[Message] = []
        self._left_out = 0
        self._state = PullbackState.RECORDING if settings.trigger == "none" else PullbackState.ZERO
        self._take_what_was_heard()
        self._look_at_marks()
        self._tell(self._state, self._armed_index, self._trigger.note)
        if self._trigger.state is not self._state:  # the second before was rest enough
            self._tell(self._trigger.state, self._armed_index, self._trigger.note)

    @property
    def is_unattended(self) -> bool:
        """Tell whether it comes to its end without anybody at the stand."""
        return self._trigger.is_unattended

    @property
    def latency(self) -> Latency:
        """How soon what comes must be followed."""
        if self._trigger.awaits_release:
            return Latency.IMMEDIATE
        return (
            Latency.BATCHED if self.is_unattended or self._settings.trigger == "none" else Latency.INTERACTIVE
        )

    @property
    def confirmed_start_index(self) -> int | None:
        """First sample of a run that is sure to have been released; None before that."""
        facts = self._trigger.measurement
        return self._trigger.start_index if facts.release_confirmed else None

    @property
    def observed_slip(self) -> ObservedSlip | None:
        """How far the plate went; None where that was not seen."""
        facts = self._trigger.measurement
        if facts.excursion is None or not facts.release_confirmed or not facts.pulled_m:
            return None
        return ObservedSlip(self.metadata.series, facts.pulled_m, facts.excursion)

    @property
    def journal_bytes(self) -> int:
        """Size of the journal, which is copied into the run file at the end."""
        return self._journal.size

    @property
    def is_ending(self) -> bool:
        """Tell whether nothing more is recorded."""
        return self._ended is not None

    def add(self, chunks: Sequence[DecodedRead]) -> None:
        """Record what reads brought; it is in the history already, and in the journal."""
        if self.is_ending:
            return
        self._gathered += chunks
        new = self._around.history.next_index - self._followed_index
        if self.latency is not Latency.BATCHED or new >= _FOLLOW_S * self._rate_hz:
            self._catch_up()

    def end(self, reason: EndReason, message: Message = EMPTY, *, keep_rest: bool = True) -> None:
        """End the run and keep it; without a release, what is there of the time since arming.

        With `keep_rest` false, a run in which the table was not even pulled back leaves no file.
        """
        self._catch_up()
        if self.is_ending:
            return
        self._ended = reason
        self._around.read_queue.close_tap()
        self._say(message, first=True)
        try:
            is_wanted = keep_rest or not self._trigger.is_at_rest
            if self._file is None and is_wanted and self._around.history.next_index > 0:
                # Since arming, or before it if nothing came since; never more than the history holds.
                history = self._around.history
                self._open(max(history.first_index, min(self._armed_index, history.next_index - 1)))
        except RunError as error:
            self._say(message_of(error))
        if self._file is None:  # there is nothing to keep
            with contextlib.suppress(JournalError):
                self._journal.close()
            self._journal.remove()
        else:
            self._tell(PullbackState.CLOSING, self._file.next_index)
            self._file.close(self._ending(self._file))

    def end_if_enough(self) -> None:
        """End the run if it was to last until no more is gained by waiting."""
        if self._settings.duration_s is None and self._settings.trigger == "pullback":
            self.end(EndReason.ENOUGH)

    def add_note(self, note: Message) -> None:
        """Tell the operator something that is kept with the run."""
        if not self.is_ending:
            self._say(note)
            self.show_note(note)

    def show_note(self, note: Message) -> None:
        """Tell the operator something about the state that it is in."""
        self._tell(self._state, self._around.history.next_index, note)

    def poll(self) -> RunEnded | None:
        """Tell what has come about meanwhile; return the run's end once its file is safe."""
        self._follow_journal()
        file = self._file
        if file is None:
            return self._run_ended("", Losses()) if self.is_ending else None
        if file.path.done() and not self._path_is_told:
            self._path_is_told = True
            file.record_path()
            self._tell_path(file)
        if not file.close_result.done():
            return None
        outcome = file.close_result.result()
        self._ended = outcome.fault or self._ended
        self._say(outcome.message, first=True)
        return self._run_ended(outcome.path, file.statistics.losses())

    def _follow_journal(self) -> None:
        moved = self._journal.move_message
        if moved and moved not in self._notes:
            self._say(moved)
            self.show_note(moved)

    def _follow(self, turn: Transition) -> None:
        if turn.is_stored:
            self._say(turn.note)
        if turn.end_reason is None:
            self._tell(turn.state, turn.index, turn.note)

    def _tell_path(self, file: RunFile) -> None:
        error = file.path.exception()
        if error is None:
            self._around.emit(RunStarted(str(file.path.result())))
        elif isinstance(error, Exception):
            self.end(end_reason(error), message_of(error))

    def _take_what_was_heard(self) -> None:
        """Begin the journal with what the history holds, and have it go on with all that comes."""
        heard, intake = list(self._around.history.reads()), self._around.read_queue
        intake.open_tap(self._feed.on_read, (RawRead(chunk.arrival_ns, chunk.data) for chunk in heard))
        try:
            self._note_places(heard)
        except JournalError:
            intake.close_tap()
            raise

    def _catch_up(self) -> None:
        """Follow what has come since the last time, in one piece."""
        gathered, self._gathered = self._gathered, []
        if self.is_ending or not gathered:
            return
        faults = list[Exception]()
        try:
            self._note_places(gathered)
        except JournalError as error:  # what came goes into the run all the same
            faults.append(error)
        try:
            self._follow_chunk(merge_reads(gathered))
        except RunError as error:
            faults.append(error)
        if faults:
            self.end(end_reason(faults[0]), message_of(faults[0]))

    def _follow_chunk(self, chunk: DecodedRead) -> None:
        self._followed_index = self._around.history.next_index
        for rows in chunk.rows:
            for turn in self._trigger.add_samples(rows):
                self._follow(turn)
        self._look_at_marks()
        self._store(chunk)

    def _look_at_marks(self) -> None:
        self._marks.update(self._feed.decoded_reads, self._followed_index, self._trigger.measurement)

    def _note_places(self, chunks: list[DecodedRead]) -> None:
        for chunk in chunks:
            self._feed.note_decoded(chunk, self._around.history.first_index)

    def _store(self, chunk: DecodedRead) -> None:
        start_index, end = self._trigger.start_index, self._trigger.end
        end_index = None if end is None else end[0]
        if self._file is not None:
            self._file.append(chunk, end_index)
        elif start_index is not None and start_index < self._around.history.next_index:
            self._open(start_index, end_index)
        if end is not None and self._around.history.next_index >= end[0]:
            self.end(end[1])

    def _open(self, start_index: int, end_index: int | None = None) -> None:
        """Begin the run file, and store what the history holds of the run."""
        history = self._around.history
        first_index = max(start_index, history.first_index)
        if first_index > start_index:
            kept_s = self._settings.pretrigger_s - (first_index - start_index) / self._rate_hz
            self._say(
                message(
                    "only {kept_s:.3g} s of the {pretrigger_s:g} s before the release could be kept: the"
                    " stream had just begun",
                    kept_s=kept_s,
                    pretrigger_s=self._settings.pretrigger_s,
                )
            )
        chunks = list(history.reads(first_index))
        self._file = RunFile(
            self._around.writer,
            OpenRun(
                self._settings.directory,
                self.metadata.replace(start_time=start_time(chunks[-1], first_index, self._rate_hz)),
                BlockLayout(counts="int32" if chunks[-1].rows[0].counts.dtype.kind == "i" else "float64"),
                JournalSpan(str(self._journal.path), self._feed.offset_of(first_index)),
                self._journal.identifier,
            ),
            self._journal,
            first_index,
            self._rate_hz,
            self._feed,
        )
        self._file.append_earlier(chunks, end_index)

    def _ending(self, file: RunFile) -> EndMetadata:
        facts = self._trigger.measurement
        self._time_base = self._around.time_base(file.start_index, file.next_index)
        self._say(self._clock_note())
        self._say(self._time_base.skew_message)
        dwell_s = None
        if facts.release_index is not None and facts.held_index is not None:
            dwell_s = (facts.release_index - facts.held_index) / self._rate_hz
        return EndMetadata(
            ended=str(self._ended),
            end_time=file.current_time(),
            events=Events(
                pulled_back_s=file.time_s(facts.held_index),
                armed_s=file.time_s(self._armed_index),
                release_s=file.time_s(facts.release_index),
                slip_end_s=file.time_s(facts.slip_end_index),
                rest_s=file.time_s(facts.rest_index),
            ),
            losses=file.statistics.losses(),
            time_base=self._time_base,
            dwell_s=dwell_s,
            zero_m=facts.zero_m,
            relative_zero_m=facts.relative_zero_m,
            held_m=facts.held_m,
            message=str(self._message()),
        )

    def _clock_note(self) -> Message:
        """Sentence about a clock that is far off; empty where one was given during the run."""
        is_said = any(note.template == RATE_TEMPLATE for note in self._notes)
        if is_said or not is_rate_wrong(self._time_base):
            return EMPTY
        return rate_note(self._time_base.scale, self._rate_hz)

    def _run_ended(self, path: str, losses: Losses) -> RunEnded:
        return RunEnded(
            path=path,
            ended=self._ended or EndReason.STOPPED,
            samples=losses.samples,
            missing=losses.missing,
            missing_estimated=losses.missing_estimated,
            damaged=losses.damaged,
            overloaded=losses.overloaded,
            rate_hz=self._rate_hz,
            release_s=None
            if self._file is None
            else self._file.time_s(self._trigger.measurement.release_index),
            message=self._message(),
            time_base=self._time_base,
        )

    def _say(self, note: Message, *, first: bool = False) -> None:
        if not note or note in self._notes:
            return
        if len(self._notes) >= _NOTES_MAX and not first:
            self._left_out += 1
        else:
            self._notes.insert(0 if first else len(self._notes), note)

    def _message(self) -> Message:
        notes = list(self._notes)
        if self._left_out:
            notes.append(message("{count} further notes are left out", count=self._left_out))
        return joined(notes, ". ") if notes else EMPTY

    def _tell(self, state: PullbackState, index: int, note: Message = EMPTY) -> None:
        self._state = state
        self._around.emit(StateChanged(state, index / self._rate_hz, note, self._trigger.position))


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
