"""What the Record screen does: engine events and live rows in, one state out."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.acquisition.messages import (
    Connected,
    Event,
    Health,
    LiveResult,
    PullbackState,
    Reconnected,
    Reconnecting,
    RunEnded,
    RunStarted,
    StateChanged,
)
from app.acquisition.pullback.centring import PlateRoom
from app.acquisition.ring import RingRows
from app.presenters import numbers, results
from app.presenters.analysed import AnalysedRun
from app.presenters.record.bench import Bench, Recorder
from app.presenters.record.course import RECORDING, Course
from app.presenters.record.guidance import Situation, Stage, cue_of, guide
from app.presenters.record.header import STAND_MOVES, origin_words, tare_chip
from app.presenters.record.heading import Heading
from app.presenters.record.left import LeftRun
from app.presenters.record.live import LiveTraces
from app.presenters.record.paperwork import Paperwork
from app.presenters.record.running import running_of
from app.presenters.record.state import Action, PlanShown, Readings, RecordState, RunChoices, RunForm, Running
from app.presenters.screen import Presenter, Progress
from app.presenters.words import tr
from app.presenters.worker import Worker
from config.schema import Gauges, Settings

_NOTHING_KNOWN = frozenset({PullbackState.ZERO, PullbackState.PULLING, PullbackState.RECORDING})
"""States in which what was known is of another run, or of a table let down."""
_READINGS_EVERY_S = 0.1


class RecordPresenter(Presenter[RecordState]):
    """Leads through one pullback after another.

    Parameters
    ----------
    recorder : Recorder
    bench : Bench
    files : Worker
        Does what is to be done with run files. Closed by `close`.
    author : str
        Who decides about runs, for their history.
    connect_device : callable
        Leads to where a device is connected.
    """

    def __init__(
        self,
        recorder: Recorder,
        bench: Bench,
        files: Worker,
        author: str,
        connect_device: Callable[[], None] = lambda: None,
    ) -> None:
        self._paperwork = Paperwork(
            bench.all_series,
            bench.directory,
            files,
            author,
            self._show_desk,
            lambda: self._course.is_free,
            self._reopen,
        )
        self._desk, self._verdicts = self._paperwork.desk, self._paperwork.verdicts
        super().__init__(RecordState(guidance=guide(Situation()), choices=self._desk.choices))
        self._recorder = recorder
        self._bench = bench
        self._connect_device = connect_device
        self._heading = Heading(bench.gauges, bench.today, bench.clock)
        self._live = LiveTraces(bench.gauges.table.range_m, bench.gauges.relative.range_m)
        self._course = Course()
        self._left: LeftRun | None = None
        self._pixels = 800
        self._read_s = float("-inf")
        self._simulated = False
        self._sounds = False
        self._true_friction: float | None = None
        self._refresh()

    @property
    def is_recording(self) -> bool:
        """Tell whether a run is under way, or is still being stored."""
        return self._course.is_recording or self._course.engine is PullbackState.CLOSING

    # --- what the operator does ---

    def enter(self) -> None:
        """The screen is shown: what is planned and done belongs onto it."""
        self._desk.look_up()

    def tare(self) -> None:
        """Read both gauges from where they stand; calibration and what is stored stay as they are."""
        if Action.TARE in self.state.allowed:
            self._verdicts.forget()
            self._verdicts.said = tare_chip(self._live.tare_m) if self._live.tare() else STAND_MOVES
            self._read()

    def untare(self) -> None:
        """Read them by the calibration again."""
        if Action.TARE in self.state.allowed:
            self._live.untare()
            self._verdicts.forget()
            self._read()

    def arm(self) -> None:
        """Record the next pullback, also straight from the last result, which is kept then."""
        if Action.ARM in self.state.allowed:
            self._arm()

    def stop(self) -> None:
        """End the recording now and keep it."""
        if Action.STOP in self.state.allowed:
            self._course.asked = True
            self._recorder.stop()
            self._refresh()

    def next(self) -> None:
        """Keep the run with what was found in it, and make ready for the next."""
        if Action.NEXT in self.state.allowed:
            self._leave_result()
            self._refresh()

    def repeat(self) -> None:
        """Move the run to the trash, and record the same series again at once."""
        if Action.REPEAT in self.state.allowed:
            self._put_aside()
            self._desk.choose_series(self._course.series)
            self._arm(count=1)

    def discard(self) -> None:
        """Move the run to the trash."""
        if Action.DISCARD in self.state.allowed:
            self._put_aside()
            self._leave_result()
            self._refresh()

    def undo(self) -> None:
        """Take the last decision back: the run is asked about again."""
        if self.state.undo and self._verdicts.undo() and self._left is not None:
            self._reopen(self._left.result.path)
        self._refresh()

    def note_run(self, note: str) -> None:
        """Remark on the run that is to be decided about."""
        self._verdicts.type_note(note)
        self._change(decision=self._verdicts.decision)

    def connect_device(self) -> None:
        """Go where a device is connected."""
        self._connect_device()

    def choose_series(self, code: str) -> None:
        """Series of the next run: its pullback becomes the target."""
        self._desk.choose_series(code)
        self._refresh()

    def fill(self, form: RunForm) -> None:
        """Take what was filled in about the next tests."""
        self._desk.fill(form)
        self._refresh()

    def set_plan(self, text: str) -> bool:
        """Plan anew; False, with words in the state, where the text is no plan."""
        taken = self._desk.set_plan(text)
        self._refresh()
        return taken

    def resized(self, pixels: int) -> None:
        """Width of the plots."""
        self._pixels = max(pixels, 64)

    # --- what happens elsewhere ---

    def connecting(self, device: str, waiting_for: str = "") -> None:
        """A port is being opened; `waiting_for` says what is started before."""
        self._leave_result()
        self._true_friction = None
        self._course.waiting_for = waiting_for
        self._desk.look_up()
        self._start_over(PullbackState.CONNECTING, device)

    def simulate(self, series: str, true_friction: float) -> None:
        """The device is the simulated stand, which runs one series with a known truth."""
        self._simulated = True
        self._true_friction = true_friction
        self._desk.fix_series(series, tr("The simulated stand runs this series."))
        self._refresh()

    def take_settings(self, settings: Settings) -> None:
        """Whether states are heard, and who records unless somebody else has been written."""
        self._sounds = settings.sounds
        self._desk.suggest_operator(settings.operator)
        self._refresh()

    def take_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use from the next connection on; they tell of age and range at once."""
        self._bench = replace(self._bench, gauges=gauges)
        self._heading.take_gauges(gauges)

    def disconnected(self) -> None:
        """Nothing is connected any more; the result of the last run stays."""
        self._simulated = False
        self._desk.fix_series("", "")
        self._start_over(None, "")

    def handle(self, event: Event) -> None:
        """Take one event of the engine."""
        self._heading.hear()
        if isinstance(event, StateChanged):
            self._came_to(event)
        elif isinstance(event, Connected):
            self._heading.connected(event.device, event.rate_hz)
        elif isinstance(event, Reconnecting | Reconnected):
            self._course.lost = results.sentence(event.message) if isinstance(event, Reconnecting) else ""
            self._heading.lose(self._course.lost)
            self._refresh()
        elif isinstance(event, Health):
            self._heading.health(event)
        elif isinstance(event, LiveResult):
            self._change(running=running_of(event))
        elif isinstance(event, RunStarted):
            self._course.name = Path(event.path).stem
            self._refresh()
        elif isinstance(event, RunEnded):
            self._run_ended(event)
        self._change(header=self._heading.header)

    def tick(self) -> None:
        """Draw what has come since the last time, and take in what the worker has said."""
        if self._paperwork.poll():
            self._refresh()
        if self._course.engine not in (None, PullbackState.CONNECTING):
            self._heading.listen()
        rows = self._recorder.new_rows()
        if rows is not None and len(rows):
            self._take(rows)
        self._change(header=self._heading.header)

    def working(self, path: str, progress: Progress) -> None:
        """The run is being identified."""
        if self._course.awaits(path):
            self._change(progress=progress)

    def show_result(self, run: AnalysedRun) -> None:
        """A run that ended has been identified."""
        if self._course.awaits(str(run.path)):
            self._verdicts.take(run)
            self._finish(results.describe(run, self._true_friction))
        elif self._verdicts.take_passed(run):
            self._refresh()

    def show_failure(self, path: str, message: str) -> None:
        """A run that ended could not be identified."""
        course = self._course
        self._verdicts.take_passed_failure(path)
        if course.awaits(path) and course.ended is not None:
            self._verdicts.take_failure(path, course.run_note)
            self._finish(results.failure(message, path, course.ended.ended))

    def count_again(self) -> None:
        """There are other runs in the folder than before."""
        self._paperwork.count()

    def close(self) -> None:
        """End the worker, as soon as what was decided is stored."""
        self._paperwork.close()

    # --- inside ---

    def _show_desk(self, choices: RunChoices, plan: PlanShown) -> None:
        self._change(choices=choices, plan=plan)

    def _take(self, rows: RingRows) -> None:
        settled = self._live.settled
        self._live.append(rows)
        self._heading.watch(rows)
        if not settled:
            self._change(traces=self._live.draw(self._pixels, self._pullback_m(), self._shown_room()))
        if rows.time_s[-1] - self._read_s >= _READINGS_EVERY_S:
            self._read_s = float(rows.time_s[-1])
            self._read()

    def _arm(self, count: int | None = None) -> None:
        """Ask the engine for it, unless there is a reason not to, which is said."""
        series, reason = self._desk.choices.series, self._desk.form_chip()
        if not reason.text:
            self._leave_result()
            reason = self._desk.moved_on_from(series)
        if reason.text:
            self._verdicts.said = reason
            self._refresh()
            return
        run, count = self._desk.settings(count)
        self._course.arm(run, count)
        self._recorder.arm(run, count)
        self._refresh()

    def _came_to(self, event: StateChanged) -> None:
        if event.state in RECORDING:
            self._leave_result()
        if event.state in _NOTHING_KNOWN:
            self._change(running=Running())
        self._live.mark(event.state, event.since_s, event.standing)
        self._course.come_to(event)
        self._refresh()

    def _run_ended(self, event: RunEnded) -> None:
        self._course.end(event)
        self._live.stop()
        self._verdicts.forget()
        if event.path:
            self._desk.wait_for(event.path)
            self._desk.next_run()
            self._change(progress=Progress(tr("Identifying")))
            self._refresh()
        else:
            self._finish(results.failure(event.message or tr("nothing was recorded"), "", event.ended))

    def _read(self) -> None:
        newest = self._live.newest_m()
        table, relative = (numbers.millimetres(value, 2) for value in newest)
        self._change(readings=Readings(table, relative, origin_words(self._live)))
        self._refresh()

    def _finish(self, result: results.Result) -> None:
        self._course.after = Stage.DONE
        self._change(result=result, progress=None)
        self._refresh()

    def _leave_result(self) -> None:
        """Make room for the next run: this one is kept unless it was decided about."""
        course = self._course
        if course.after is None:
            return
        if course.after is Stage.FINDING and course.ended is not None:
            self._verdicts.pass_by(course.ended.path)
        if self.state.result is not None and self.state.result.path:
            self._left = LeftRun.of(
                self.state.result, self.state.traces, self._desk.choices.series, self._course
            )
        kept = self._verdicts.keep()
        course.after = None
        self._desk.wait_for("")
        if kept:
            self._desk.count_kept(kept, course.series)
            self._desk.advance()
        self._live.restart()
        self._change(result=None, progress=None, running=Running())

    def _put_aside(self) -> None:
        self._verdicts.put_aside()
        if self.state.result is not None:
            self._desk.count_gone(self.state.result.path)

    def _reopen(self, path: str) -> None:
        """Show the run that was left last, at `path` by now, to be decided about again."""
        if self._left is None:
            return
        left = self._left.at(path)
        left.return_to(self._course)
        self._live.hold()
        self._desk.choose_series(left.series)
        self._desk.wait_for(path)
        self._change(result=left.result, traces=left.traces)

    def _start_over(self, engine: PullbackState | None, device: str) -> None:
        self._course.connect(engine)
        self._read_s = float("-inf")
        self._live.untare()
        self._live.restart()
        self._live.history.clear()
        self._heading.start(device)
        self._change(readings=Readings())
        if self._course.after is None:
            empty = self._live.draw(self._pixels, self._pullback_m())
            self._change(result=None, progress=None, running=Running(), traces=empty)
        self._refresh()

    def _refresh(self) -> None:
        course, verdicts = self._course, self._verdicts
        self._desk.set_editable(not course.is_recording and not course.asked)
        situation = self._situation()
        self._heading.put_run(course.run_chip(self._desk.run_words, self.state.choices.series))
        allowed = course.allowed(decides=verdicts.decision is not None)
        self._change(
            header=self._heading.header,
            guidance=guide(situation),
            cue=cue_of(situation) if self._sounds else None,
            decision=verdicts.decision,
            said=verdicts.said,
            undo=verdicts.undo_words(is_free=course.is_free),
            allowed=allowed,
            primary=course.comes_next() if course.comes_next() in allowed else None,
            connected=course.engine is not None,
        )

    def _situation(self) -> Situation:
        gauge, course = self._bench.gauges.relative, self._course
        table_m, relative_m = (float(value) for value in self._live.newest_m() + self._live.zero_m)
        return Situation(
            where=course.where,
            standing=course.standing,
            table_m=table_m,
            plate_m=relative_m + table_m if gauge.measures == "plate" else relative_m,
            room=self._bench.room(self.state.choices.series),
            simulated=self._simulated,
            note=course.note,
            waiting_for=course.waiting_for,
            lost=course.lost,
        )

    def _shown_room(self) -> PlateRoom | None:
        """Where the plate may stand, while it has to be put back and gauge 2 can show where."""
        measures_it = self._bench.gauges.relative.measures == "relative"
        has_to = self._course.engine is PullbackState.RECENTRE
        return self._bench.room(self.state.choices.series) if measures_it and has_to else None

    def _pullback_m(self) -> float:
        return self._bench.pullback_m(self.state.choices.series)
