"""What the Record screen does: engine events and live rows in, one state out."""

from collections.abc import Callable
from dataclasses import replace

from app.acquisition.messages import Event, PullbackState
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import Presenter, Progress
from app.presenters.record.ended_run import EndedRun
from app.presenters.record.file_tasks import FileTasks
from app.presenters.record.guidance import GuidanceInput, cue_for, guidance_for
from app.presenters.record.live_display import LiveDisplay
from app.presenters.record.live_traces import LiveTraces
from app.presenters.record.pullback_session import PullbackSession
from app.presenters.record.reducer import (
    EngineEventReducer,
    guidance_input,
    shown_plate_range,
    status_message,
)
from app.presenters.record.stand_context import Recorder, StandContext
from app.presenters.record.state import Action, PlanState, RecordState, RunChoices, RunForm
from app.presenters.record.status_bar import StatusBarPresenter
from app.presenters.worker import Worker
from config.schema import Gauges, Settings
from messages.i18n import gettext


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
        bench: StandContext,
        files: Worker,
        author: str,
        connect_device: Callable[[], None] = lambda: None,
    ) -> None:
        self._course = course = PullbackSession()
        self._paperwork = FileTasks(
            bench.all_series,
            bench.directory,
            files,
            author,
            self._show_desk,
            lambda: course.is_free,
            self._show_again,
        )
        self._desk, self._verdicts = self._paperwork.desk, self._paperwork.verdicts
        super().__init__(RecordState(guidance=guidance_for(GuidanceInput()), choices=self._desk.choices))
        self._recorder = recorder
        self._bench = bench
        self._connect_device = connect_device
        self._heading = StatusBarPresenter(bench.gauges, bench.today, bench.clock)
        live = LiveTraces(bench.gauges.table.range_m, bench.gauges.relative.range_m)
        self._display = LiveDisplay(live)
        self._ended_run = EndedRun(course, self._desk, self._verdicts, self._display)
        self._engine = EngineEventReducer(course, self._heading, self._display, self._ended_run)
        self._sounds = False
        self._refresh()

    @property
    def is_recording(self) -> bool:
        """Tell whether a run is under way, or is still being stored."""
        return self._course.is_recording or self._course.engine is PullbackState.CLOSING

    # --- what the operator does ---

    def enter(self) -> None:
        """The screen is shown: what is planned and done belongs onto it."""
        self._desk.load_plan()

    def tare(self) -> None:
        """Read both gauges from where they stand; calibration and what is stored stay as they are."""
        if Action.TARE in self.state.allowed:
            self._verdicts.clear_last()
            self._verdicts.status = self._display.tare()
            self._refresh()

    def untare(self) -> None:
        """Read them by the calibration again."""
        if Action.TARE in self.state.allowed:
            self._display.untare()
            self._verdicts.clear_last()
            self._refresh()

    def arm(self) -> None:
        """Record the next pullback, also straight from the last result, which is kept then."""
        if Action.ARM in self.state.allowed:
            self._arm()

    def stop(self) -> None:
        """End the recording now and keep it."""
        if Action.STOP in self.state.allowed:
            self._course.is_command_pending = True
            self._recorder.stop()
            self._refresh()

    def next(self) -> None:
        """Keep the run with what was found in it, and make ready for the next."""
        if Action.NEXT in self.state.allowed:
            self._ended_run.close()
            self._refresh()

    def repeat(self) -> None:
        """Move the run to the trash, and record the same series again at once."""
        if Action.REPEAT in self.state.allowed:
            self._ended_run.move_to_trash()
            self._desk.choose_series(self._course.series)
            self._arm(count=1)

    def discard(self) -> None:
        """Move the run to the trash."""
        if Action.DISCARD in self.state.allowed:
            self._ended_run.move_to_trash()
            self._ended_run.close()
            self._refresh()

    def undo(self) -> None:
        """Take the last decision back: the run is asked about again."""
        if self.state.undo:
            self._ended_run.undo()
            self._refresh()

    def set_note(self, note: str) -> None:
        """Remark on the run that is to be decided about."""
        self._verdicts.set_note(note)
        self._update(decision=self._verdicts.decision)

    def connect_device(self) -> None:
        """Go where a device is connected."""
        self._connect_device()

    def choose_series(self, code: str) -> None:
        """Series of the next run: its pullback becomes the target."""
        self._desk.choose_series(code)
        self._refresh()

    def set_form(self, form: RunForm) -> None:
        """Take what was filled in about the next tests."""
        self._desk.set_form(form)
        self._refresh()

    def set_plan(self, text: str) -> bool:
        """Plan anew; False, with words in the state, where the text is no plan."""
        taken = self._desk.set_plan(text)
        self._refresh()
        return taken

    def set_plot_width(self, pixels: int) -> None:
        """Width of the plots."""
        self._display.resized(pixels)

    # --- what happens elsewhere ---

    def on_connecting(self, device: str, waiting_for: str = "") -> None:
        """A port is being opened; `waiting_for` says what is started before."""
        self._ended_run.close()
        self._course.true_friction = None
        self._course.waiting_for = waiting_for
        self._desk.load_plan()
        self._start_over(PullbackState.CONNECTING, device)

    def on_simulation_started(self, series: str, true_friction: float) -> None:
        """The device is the simulated stand, which runs one series with a known truth."""
        self._course.simulated = True
        self._course.true_friction = true_friction
        self._desk.fix_series(series, gettext("The simulated stand runs this series."))
        self._refresh()

    def set_settings(self, settings: Settings) -> None:
        """Whether states are heard, and who records unless somebody else has been written."""
        self._sounds = settings.sounds
        self._desk.suggest_operator(settings.operator)
        self._refresh()

    def set_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use from the next connection on; they tell of age and range at once."""
        self._bench = replace(self._bench, gauges=gauges)
        self._heading.set_gauges(gauges)

    def on_disconnected(self) -> None:
        """Nothing is connected any more; the result of the last run stays."""
        self._course.simulated = False
        self._desk.fix_series("", "")
        self._start_over(None, "")

    def on_event(self, event: Event) -> None:
        """Take one event of the engine."""
        self._engine.on_event(event)
        self._refresh()

    def tick(self) -> None:
        """Draw what has come since the last time, and take in what the worker has said."""
        if self._paperwork.poll():
            self._refresh()
        if self._course.engine not in (None, PullbackState.CONNECTING):
            self._heading.check_silence()
        rows = self._recorder.new_rows()
        if rows is not None and len(rows):
            self._heading.check_gauges(rows)
            room = shown_plate_range(self._course, self._bench, self.state.choices.series)
            if self._display.append(rows, self._pullback_m(), room):
                self._refresh()
        self._update(status_bar=self._heading.status_bar, traces=self._display.traces)

    def on_progress(self, path: str, progress: Progress) -> None:
        """The run is being identified."""
        self._ended_run.identifying(path, progress)
        self._update(progress=self._ended_run.progress)

    def on_identified(self, run: AnalysedRun) -> None:
        """A run that ended has been identified."""
        self._ended_run.identified(run)
        self._refresh()

    def on_not_identified(self, path: str, message: str) -> None:
        """A run that ended could not be identified."""
        self._ended_run.not_identified(path, message)
        self._refresh()

    def count_completed(self) -> None:
        """There are other runs in the folder than before."""
        self._paperwork.count_completed()

    def close(self) -> None:
        """End the worker, as soon as what was decided is stored."""
        self._paperwork.close()

    # --- inside ---

    def _show_desk(self, choices: RunChoices, plan: PlanState) -> None:
        self._update(choices=choices, plan=plan)

    def _show_again(self, path: str) -> None:
        self._ended_run.show_again(path)

    def _arm(self, count: int | None = None) -> None:
        """Ask the engine for it, unless there is a reason not to, which is said."""
        series, reason = self._desk.choices.series, self._desk.form_chip()
        if not reason.text:
            self._ended_run.close()
            reason = self._desk.moved_on_from(series)
        if reason.text:
            self._verdicts.status = reason
            self._refresh()
            return
        run, count = self._desk.settings(count)
        self._course.arm(run, count)
        self._recorder.arm(run, count)
        self._refresh()

    def _start_over(self, engine: PullbackState | None, device: str) -> None:
        self._engine.start_over(engine, device, self._pullback_m())
        self._refresh()

    def _pullback_m(self) -> float:
        return self._bench.pullback_m(self.state.choices.series)

    def _refresh(self) -> None:
        course, verdicts = self._course, self._verdicts
        self._desk.set_editable(not course.is_recording and not course.is_command_pending)
        series = self._desk.choices.series
        situation = guidance_input(course, self._bench, self._display.live, series)
        self._heading.set_run(course.run_chip(self._desk.run_text, series))
        allowed = course.allowed(decides=verdicts.decision is not None)
        self._update(
            status_bar=self._heading.status_bar,
            guidance=guidance_for(situation),
            cue=cue_for(situation) if self._sounds else None,
            traces=self._display.traces,
            readings=self._display.readings,
            live_estimate=course.live_estimate,
            result=self._ended_run.result,
            progress=self._ended_run.progress,
            decision=verdicts.decision,
            status_message=status_message(course, verdicts.status),
            undo=verdicts.undo_text(is_free=course.is_free),
            allowed=allowed,
            primary=course.next_action() if course.next_action() in allowed else None,
            connected=course.engine is not None,
        )
