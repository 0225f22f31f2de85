"""One run from arming to its end, with a simulated motion and a fake writer."""

import datetime
import time
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.acquisition.journal.journal import create_journal
from app.acquisition.journal.records import JournalHeader
from app.acquisition.messages import (
    EndReason,
    PortSettings,
    PullbackState,
    RunEnded,
    RunSettings,
    RunStarted,
    StateChanged,
)
from app.acquisition.recording import Recording, RecordingContext
from app.acquisition.stream.connection import ReadQueue
from app.acquisition.stream.live_stream import DecodedRead, ReadHistory
from app.runs.blocks import StoredRun, calibrate
from app.runs.errors import DiskFullError, WriterBehindError
from app.runs.journal import RecordKind, read_journal
from app.runs.metadata import create_metadata
from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from app.simulated_stand.signal import StandSignal
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.samples import Losses, SampleBlock, SampleStatus
from messages.message import message

pytestmark = pytest.mark.usefixtures("no_thread_is_left")

TIMED = TimeBase(1.0, 1e-5)
RATE_HZ = 500.0
TIMETABLE = Timetable(rest_s=0.8, pull_s=0.6, hold_s=0.6, decay_s=3.0, recentre_s=0.5)
RELEASED = round(TIMETABLE.release_s * RATE_HZ)


def counts(samples: int):
    options = SimulatedStandOptions(seed=5)
    true = stand_truth(options, load_stand())
    motion = RepeatedPullback(true.pullback_m, released_motion(true, TIMETABLE), TIMETABLE)
    return StandSignal(motion, load_gauges(), options, RATE_HZ).take(samples)[0]


COUNTS = counts(2600)


class RememberingWriter:
    """Keeps what a run file would."""

    def __init__(self, *, open_error=None, append_error=None, raw_bytes_stored=True) -> None:
        self.request = None
        self.blocks = []
        self.ending = None
        self.open_error = open_error
        self.append_error = append_error
        self.failure = append_error if isinstance(append_error, DiskFullError) else None  # of its process
        self.raw_bytes_stored = raw_bytes_stored

    def open(self, request):
        self.request = request
        return answer(Path("/runs/run.h5"), self.open_error)

    def append(self, block):
        if self.append_error:
            raise self.append_error
        self.blocks.append(block)

    def close(self, ending):
        self.ending = ending
        samples = sum(len(block) for block in self.blocks)
        return answer(StoredRun(str(Path("/runs/run.h5")), samples, self.raw_bytes_stored), self.open_error)

    @property
    def time_s(self):
        return np.concatenate([block.time_s for block in self.blocks])

    @property
    def counts(self):
        return np.concatenate([block.counts for block in self.blocks])


def answer(value, error=None):
    future = Future()
    if error is None:
        future.set_result(value)
    else:
        future.set_exception(error)
    return future


class Bench:
    """A recording and what surrounds it; `play` gives it the samples of the simulated stand."""

    def __init__(
        self, folder, run=None, *, writer=None, heard=0, history_s=10.0, time_base=TIMED, status=None
    ):
        self.writer = writer or RememberingWriter()
        self.gauges = load_gauges()
        self.intake = ReadQueue()
        self.history = ReadHistory(round(history_s * RATE_HZ))
        self.events = []
        self.next = 0
        self.status = np.zeros(len(COUNTS), np.uint8) if status is None else status
        self.recording = None
        self.play(heard)
        run = run or RunSettings(str(folder), series="1FFM0", duration_s=1.0)
        now = datetime.datetime.now().astimezone()
        metadata = create_metadata(load_stand(), self.gauges, now, series=run.series, rate_hz=RATE_HZ)
        header = JournalHeader(PortSettings("port", "csv"), run, metadata, "a-uuid", "test")
        self.journal = create_journal(folder / "run.journal", header)
        around = RecordingContext(
            self.intake, self.history, self.writer, lambda *_: time_base, self.events.append
        )
        self.recording = Recording(run, metadata, RATE_HZ, self.journal, around)

    def play(self, until: int, size: int = 5) -> None:
        while self.next < until:
            end = min(self.next + size, until)
            part = slice(self.next, end)
            block = SampleBlock(self.next, COUNTS[part], self.status[part], 0)
            lost = Losses(missing_estimated=int(np.count_nonzero(self.status[part] & SampleStatus.MISSING)))
            chunk = DecodedRead(
                b"%d;" % self.next, time.monotonic_ns(), (calibrate(block, self.gauges),), lost
            )
            self.intake.put(chunk.arrival_ns, chunk.data)
            self.intake.take(0.0)
            self.history.add(chunk)
            if self.recording is not None:
                self.recording.add([chunk])
            self.next = end

    def ended(self) -> RunEnded:
        for _ in range(1000):
            ended = self.recording.poll()
            if ended is not None:
                return ended
            time.sleep(0.005)
        raise AssertionError("the run was not closed")

    def states(self):
        return [event.state for event in self.events if isinstance(event, StateChanged)]


@given(
    pretrigger_s=st.floats(0.0, 1.9),
    duration_s=st.floats(0.2, 2.0),
    size=st.integers(1, 300),
    heard=st.integers(0, 400),
)
@settings(deadline=None, max_examples=25)
def test_a_run_goes_from_pretrigger_to_duration_to_the_sample(
    tmp_path_factory, pretrigger_s, duration_s, size, heard
):
    folder = tmp_path_factory.mktemp("run")
    run = RunSettings(str(folder), series="1FFM0", pretrigger_s=pretrigger_s, duration_s=duration_s)
    bench = Bench(folder, run, heard=heard)
    bench.play(len(COUNTS), size)
    ended = bench.ended()
    before, after = round(pretrigger_s * RATE_HZ), round(duration_s * RATE_HZ)
    assert ended.ended is EndReason.DURATION
    assert ended.samples == before + after == len(bench.writer.time_s)
    assert ended.release_s == before / RATE_HZ == bench.writer.ending.events.release_s
    np.testing.assert_array_equal(bench.writer.time_s, np.arange(before + after) / RATE_HZ)
    first = int(np.flatnonzero((bench.writer.counts[0] == COUNTS).all(axis=1))[0])
    np.testing.assert_array_equal(bench.writer.counts, COUNTS[first : first + before + after])
    assert abs(first + before - RELEASED) <= 1
    assert str(ended.message) == ""


def test_states_and_file_are_told_in_order(tmp_path):
    bench = Bench(tmp_path)
    bench.play(len(COUNTS))
    ended = bench.ended()
    assert bench.states() == [
        PullbackState.ZERO,
        PullbackState.PULLING,
        PullbackState.PULLING,  # the pull has begun: from here on the run is kept
        PullbackState.HELD,
        PullbackState.ARMED,
        PullbackState.RELEASED,
        PullbackState.RELEASED,  # dated to the sample, now that it is sure
        PullbackState.SLIPPING,
        PullbackState.CLOSING,
    ]
    told = [event for event in bench.events if isinstance(event, StateChanged)]
    assert [event.position.keeps_run for event in told[:4]] == [False, False, True, True]
    assert [event for event in bench.events if isinstance(event, RunStarted)] == [RunStarted(ended.path)]
    ending = bench.writer.ending
    assert ending.ended == "duration"
    assert ending.dwell_s == pytest.approx(0.6 + 0.05, abs=0.1)
    assert ending.events.pulled_back_s == pytest.approx(1.0 - ending.dwell_s, abs=0.003)
    assert ending.events.armed_s == pytest.approx(1.0 - TIMETABLE.release_s, abs=0.003)


def test_zeros_and_hold_are_stored_as_measured_and_told_with_the_states(tmp_path):
    bench = Bench(tmp_path)
    bench.play(len(COUNTS))
    bench.ended()
    ending = bench.writer.ending
    assert ending.zero_m == pytest.approx(0.0, abs=10e-6)
    assert ending.relative_zero_m == pytest.approx(0.0, abs=10e-6)
    assert ending.held_m == pytest.approx(0.012, abs=15e-6)
    told = [event.position for event in bench.events if isinstance(event, StateChanged)]
    assert (told[0].pullback_m, told[0].tolerance_m) == (0.012, pytest.approx(0.24e-3))
    assert told[0].table_zero_m is None
    assert told[1].table_zero_m == pytest.approx(0.0, abs=10e-6)
    assert (told[-1].held_m, told[-1].side) == (ending.held_m, 1)


def test_how_far_the_plate_went_is_known_for_the_next_run(tmp_path):
    bench = Bench(tmp_path)
    bench.play(len(COUNTS))
    bench.ended()
    slip = bench.recording.observed_slip
    assert (slip.series, slip.pulled_m) == ("1FFM0", pytest.approx(0.012, abs=15e-6))
    relative = np.concatenate([block.readings[:, 1] for block in bench.writer.blocks])
    assert slip.excursion.low_m == pytest.approx(relative.min(), abs=0.2e-3)
    assert slip.excursion.high_m == pytest.approx(relative.max(), abs=0.2e-3)


def test_a_run_in_which_nothing_happened_leaves_no_file_where_none_is_wanted(tmp_path):
    bench = Bench(tmp_path)
    bench.play(100)
    bench.recording.end(EndReason.INTERRUPTED, keep_rest=False)
    ended = bench.ended()
    assert (ended.ended, ended.path, ended.samples) == (EndReason.INTERRUPTED, "", 0)
    assert list(tmp_path.iterdir()) == []
    again = Bench(tmp_path)
    again.play(RELEASED - 50)
    again.recording.end(EndReason.INTERRUPTED, keep_rest=False)
    assert again.ended().samples > 0, "the table was pulled back: that is kept"


@pytest.mark.parametrize("trigger", ["pullback", "none"])
def test_without_trigger_a_release_is_expected_once_the_table_moves(tmp_path, trigger):
    bench = Bench(tmp_path, RunSettings(str(tmp_path), series="1FFM0", trigger=trigger, duration_s=9.0))
    bench.play(round(0.9 * TIMETABLE.rest_s * RATE_HZ))
    assert bench.recording.expects_release is (trigger == "pullback")
    bench.play(RELEASED - 50)
    assert bench.recording.expects_release
    bench.recording.end(EndReason.STOPPED)
    bench.ended()


def test_metadata_begin_with_the_first_stored_sample(tmp_path):
    bench = Bench(tmp_path)
    bench.play(RELEASED + 200)
    bench.recording.end(EndReason.STOPPED)
    bench.ended()
    began = bench.writer.request.metadata.start_time
    ago_s = (datetime.datetime.now().astimezone() - began).total_seconds()
    # Played in an instant: the first stored sample lies as far back as samples were stored at opening.
    assert 1.0 < ago_s < 1.0 + 0.3 + 5.0


def test_an_unfilled_pretrigger_is_said(tmp_path):
    run = RunSettings(str(tmp_path), series="1FFM0", pretrigger_s=1.0, duration_s=0.5)
    late = RELEASED - 300
    bench = Bench(tmp_path, run)
    bench.next = late
    bench.history.next_index = late
    bench.play(len(COUNTS))
    ended = bench.ended()
    assert "only 0.6 s of the 1 s before the release" in str(ended.message)
    assert ended.samples == pytest.approx(300 + 250, abs=1)
    assert ended.release_s == pytest.approx(0.6, abs=0.003)


def test_stopped_before_a_release_it_keeps_what_came_since_arming(tmp_path):
    bench = Bench(tmp_path, heard=100)
    bench.play(400)
    bench.recording.end(EndReason.INTERRUPTED, message("told to stop"))
    bench.recording.end(EndReason.STOPPED, message("a second end changes nothing"))
    ended = bench.ended()
    assert (ended.ended, ended.samples, ended.release_s) == (EndReason.INTERRUPTED, 300, None)
    assert str(ended.message) == "told to stop"
    np.testing.assert_array_equal(bench.writer.counts, COUNTS[100:400])


def test_stopped_after_a_long_wait_it_keeps_what_the_history_holds(tmp_path):
    bench = Bench(tmp_path, heard=5, history_s=0.4)
    bench.play(395)
    bench.recording.end(EndReason.STOPPED)
    ended = bench.ended()
    assert 200 <= ended.samples <= 205
    np.testing.assert_array_equal(bench.writer.counts, COUNTS[395 - ended.samples : 395])


def test_without_a_single_sample_there_is_no_file_and_no_journal_left(tmp_path):
    bench = Bench(tmp_path)
    bench.recording.end(EndReason.STALLED, message("silent"))
    ended = bench.ended()
    assert (ended.path, ended.samples, str(ended.message)) == ("", 0, "silent")
    assert list(tmp_path.iterdir()) == []


def test_no_release_in_time_is_said_and_the_last_seconds_kept(tmp_path):
    run = RunSettings(str(tmp_path), series="1FFM0", trigger_timeout_s=0.5)
    bench = Bench(tmp_path, run)
    bench.play(300)
    ended = bench.ended()
    assert ended.ended is EndReason.TRIGGER_TIMEOUT
    assert "no release" in str(ended.message)
    assert ended.samples >= 250


@pytest.mark.parametrize("duration_s", [0.5, 1.234])
def test_without_trigger_a_run_begins_with_the_next_sample(tmp_path, duration_s):
    run = RunSettings(str(tmp_path), trigger="none", duration_s=duration_s)
    bench = Bench(tmp_path, run, heard=37)
    assert bench.recording.is_unattended
    bench.play(1500, 64)
    ended = bench.ended()
    count = round(duration_s * RATE_HZ)
    assert (ended.ended, ended.samples) == (EndReason.DURATION, count)
    np.testing.assert_array_equal(bench.writer.counts, COUNTS[37 : 37 + count])


def test_without_trigger_the_states_and_the_release_are_told_all_the_same(tmp_path):
    run = RunSettings(str(tmp_path), trigger="none", duration_s=4.0)
    bench = Bench(tmp_path, run)
    bench.play(len(COUNTS))
    ended = bench.ended()
    assert PullbackState.SLIPPING in bench.states()
    assert ended.release_s == pytest.approx(TIMETABLE.release_s, abs=0.003)


def test_only_a_run_that_needs_nobody_may_be_left_alone(tmp_path):
    bench = Bench(tmp_path)
    bench.play(RELEASED)
    assert not bench.recording.is_unattended
    bench.play(RELEASED + 100)
    assert bench.recording.is_unattended
    bench.recording.end(EndReason.STOPPED)
    bench.ended()


def test_every_row_is_counted_once_as_what_it_is(tmp_path):
    random = np.random.default_rng(3)
    status = np.zeros(len(COUNTS), np.uint8)
    kinds = np.array(
        [0, SampleStatus.MISSING, SampleStatus.DAMAGED, SampleStatus.OVERLOAD_RELATIVE], np.uint8
    )
    status[:] = random.choice(kinds, len(status), p=[0.9, 0.04, 0.03, 0.03])
    run = RunSettings(str(tmp_path), series="1FFM0", trigger="none", duration_s=3.0)
    bench = Bench(tmp_path, run, status=status, heard=3)
    bench.play(len(COUNTS))
    ended = bench.ended()
    stored = status[3:1503]
    assert ended.missing == 0
    assert ended.missing_estimated == np.count_nonzero(stored == SampleStatus.MISSING)
    assert ended.damaged == np.count_nonzero(stored == SampleStatus.DAMAGED)
    assert ended.overloaded == np.count_nonzero(stored == SampleStatus.OVERLOAD_RELATIVE)
    readings = np.concatenate([block.readings for block in bench.writer.blocks])
    absent = ended.missing + ended.missing_estimated + ended.damaged
    assert np.count_nonzero(np.isnan(readings[:, 0])) == absent
    assert bench.writer.ending.losses.samples == ended.samples == 1500


def test_the_journal_holds_all_reads_of_the_run_from_where_the_writer_was_told(tmp_path):
    writer = RememberingWriter(raw_bytes_stored=False)
    bench = Bench(tmp_path, writer=writer, heard=60)
    bench.play(len(COUNTS))
    ended = bench.ended()
    path = Path(writer.request.journal.path)
    assert str(path) in str(ended.message)
    everything = [r.data for r in read_journal(path) if r.kind is RecordKind.WIRE]
    assert everything[0] == b"0;"  # what was heard before arming is there too
    copied = [r.data for r in read_journal(path, writer.request.journal.start) if r.kind is RecordKind.WIRE]
    first = int(np.flatnonzero((writer.counts[0] == COUNTS).all(axis=1))[0])
    starts = [int(data[:-1]) for data in copied]
    assert first - 10 <= starts[0] < first
    assert starts[-1] >= first + ended.samples - 5


def test_the_journal_goes_when_the_run_is_safe(tmp_path):
    bench = Bench(tmp_path)
    bench.play(len(COUNTS))
    bench.ended()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("writer", "reason"),
    [
        (RememberingWriter(append_error=WriterBehindError("too slow")), EndReason.WRITE_ERROR),
        (RememberingWriter(append_error=DiskFullError("disk full")), EndReason.DISK_FULL),
        (RememberingWriter(open_error=DiskFullError("disk full")), EndReason.DISK_FULL),
    ],
)
def test_a_failing_writer_ends_the_run_with_its_reason_and_keeps_the_journal(tmp_path, writer, reason):
    bench = Bench(tmp_path, writer=writer)
    bench.play(RELEASED + 150)
    bench.recording.poll()
    ended = bench.ended()
    assert ended.ended is reason
    assert "too slow" in str(ended.message) or "disk full" in str(ended.message)
    assert [path.name for path in tmp_path.iterdir()] == ["run.journal"]


@pytest.mark.parametrize(("scale", "is_said"), [(1.00002, False), (0.995, False), (0.95, True)])
def test_a_clock_that_is_far_off_is_said_and_stored(tmp_path, scale, is_said):
    bench = Bench(tmp_path, time_base=TimeBase(scale, 1e-4))
    bench.play(len(COUNTS))
    ended = bench.ended()
    assert ("instead of 500" in str(ended.message)) is is_said
    assert bench.writer.ending.time_base == TimeBase(scale, 1e-4)


@pytest.mark.parametrize(("duration_s", "is_ending"), [(None, True), (3.0, False)])
def test_what_is_enough_ends_only_a_run_without_a_set_duration(tmp_path, duration_s, is_ending):
    bench = Bench(tmp_path, RunSettings(str(tmp_path), series="1FFM0", duration_s=duration_s))
    bench.play(round(RATE_HZ * 2.5))

    bench.recording.end_if_enough()

    assert bench.recording.is_ending is is_ending
    bench.recording.end(EndReason.STOPPED)
    assert bench.ended().ended is (EndReason.ENOUGH if is_ending else EndReason.STOPPED)


def test_a_run_keeps_a_hundred_notes_and_counts_the_others(tmp_path):
    bench = Bench(tmp_path)
    for number in range(150):
        bench.recording.add_note(message("the device was away for the {number}th time", number=number))
    bench.play(len(COUNTS))
    text = str(bench.ended().message)
    assert "for the 99th time" in text
    assert "for the 100th time" not in text
    assert text.endswith("50 further notes are left out")


def test_a_fault_that_ends_the_run_and_its_file_is_told_once(tmp_path):
    """The writer gives the same error to the rows that end the run and to its closing."""
    error = DiskFullError("the disk is full")
    bench = Bench(tmp_path, writer=RememberingWriter(append_error=error, open_error=error))
    bench.play(RELEASED + 200)
    bench.recording.end(EndReason.DISK_FULL, message("the disk is full"))
    ended = bench.ended()
    assert ended.ended is EndReason.DISK_FULL
    assert str(ended.message).count("the disk is full") == 1
