"""Reducer of the Record screen: model and event in, new model and effects out."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.acquisition import messages as engine
from app.acquisition.messages import EndReason, PullbackState
from app.acquisition.ring import RingRows
from app.presenters import results
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Progress, SimulationStarted, Tone
from app.presenters.device_status import DeviceStatus
from app.presenters.record import live, state
from app.presenters.record.model import (
    RECORDING_STATES,
    ArmedRun,
    EndedRun,
    RecordedRun,
    RecordModel,
    Snapshot,
    monitors_of,
)
from app.presenters.record.next_runs import NextRuns
from app.presenters.record.state import Action, AnalysisFailed, AnalysisProgress, TaskDone, TaskFailed
from app.presenters.results import Result, sentence
from config.schema import Gauges, Settings, Stand
from messages.i18n import gettext, ngettext
from messages.message import Message

Effect = engine.Command | state.RecordTask  # a command for the engine, or a task for the worker

_NEW_MOTION = frozenset({PullbackState.ZERO, PullbackState.PULLING, PullbackState.RECORDING})
"""States that end the live estimate: it was of another run, or of a table that was let down."""


def reduce(model: RecordModel, event: state.RecordEvent) -> tuple[RecordModel, tuple[Effect, ...]]:
    """Apply an event: return the new model, and what the presenter has to send."""
    reduction = _Reduction(model)
    reduction.apply(event)
    if not isinstance(event, state.ClockTicked | RingRows):
        reduction.finish()
    return reduction.model, tuple(reduction.effects)


def _disarmed() -> Chip:
    return Chip(gettext("Disarmed. Nothing was recorded"))


class _Reduction:
    """Changes by one event: replaces `model` step by step, and collects `effects`."""

    def __init__(self, model: RecordModel) -> None:
        self.model = model
        self.effects: list[Effect] = []

    def apply(self, event: state.RecordEvent) -> None:
        model = self.model
        match event:
            case RingRows():
                self._on_samples(event)
            case state.ClockTicked(now_s):
                self._on_clock(now_s)
            case Action():
                self._on_action(event)
            case state.Notification.SCREEN_ENTERED if model.next_runs.is_loaded:
                self._count_completed()  # runs may have been moved or brought back on Runs
            case state.Notification.SCREEN_ENTERED:
                self._load_plan()
            case state.SeriesChosen(series):
                self._choose_series(series)
            case state.RunForm():
                if model.next_runs.choices.editable:
                    self._save(model.next_runs.with_form(event))
            case state.PlanEdited(text):
                self._set(next_runs=model.next_runs.with_plan(text))
                if not self.model.next_runs.plan.error:
                    self._save(self.model.next_runs)
            case state.NoteEdited(note):
                if (pending := model.decisions.pending) is not None:
                    self._set_decisions(pending=replace(pending, edited_note=note))
            case state.PlotResized(width_px):
                self._set(live=replace(model.live, width_px=max(width_px, live.PIXELS_MIN)))
            case state.PlotZoomed(span):
                self._set(live=model.live.zoomed(span))
            case TaskDone(task, answer):
                self._on_task_done(task, answer)
            case AnalysedRun() | AnalysisFailed() | AnalysisProgress():
                self._on_identification(event)
            case TaskFailed(task, message):
                self._on_task_failed(task, message)
            case state.Connecting(device, waiting_for):
                self._leave_ended()
                self._set_session(true_friction=None, waiting_for=waiting_for)
                self._load_plan()
                self._start_over(PullbackState.CONNECTING, device)
            case state.Notification.DISCONNECTED:
                self._set_session(simulated=False)
                self._set(next_runs=model.next_runs.with_fixed_series("", ""))
                self._start_over(None, "")
            case DeviceStatus():
                self._set(live=model.live.dated(event.stopped_at))
            case SimulationStarted(series, true_friction):
                self._set_session(simulated=True, true_friction=true_friction)
                hint = gettext("The simulated stand runs this series.")
                self._set(next_runs=model.next_runs.with_fixed_series(series, hint))
            case Settings():
                self._on_settings(event)
            case Gauges():
                self._set(stand=replace(model.stand, gauges=event), monitors=monitors_of(event))
            case Stand():
                stand = replace(model.stand, stand=event, all_series=event.all_series)
                self._set(stand=stand, next_runs=model.next_runs.with_all_series(event.all_series))
            case state.Notification.RUNS_CHANGED:
                self._count_completed()
            case _:
                self._on_engine(event)

    def finish(self) -> None:
        model, session = self.model, self.model.session
        editable = not session.is_recording and not session.is_command_pending
        if editable is not model.next_runs.choices.editable:
            self._set(next_runs=model.next_runs.with_choices(editable=editable))
        self._set_bar(run=self._run_chip(), simulated=live.simulated_chip(session.simulated))

    # --- the operator ---

    def _on_action(self, action: Action) -> None:
        model = self.model
        match action:
            case Action.UNDO if model.undo_text:
                self._undo()
            case Action.UNDO_PLAN:
                self._save(model.next_runs.with_plan_undone())
            case Action.UNTARE if Action.TARE in model.allowed:
                self._set(live=model.live.untared())
                self._forget_last()
            case _ if action not in model.allowed:
                return
            case Action.TARE:
                tared = model.live.tared()
                self._set(live=tared or model.live)
                self._forget_last()
                self._set_decisions(message=live.tare_chip(tared))
            case Action.ARM:
                self._arm()
            case Action.STOP:
                self._set_session(is_command_pending=True)
                self.effects.append(engine.Stop())
            case Action.NEXT:
                self._close_ended()
            case Action.REPEAT if model.ended is not None:
                self._move_to_trash()
                self._choose_series(model.ended.run.series)
                self._arm(count=1)
            case Action.DISCARD:
                self._move_to_trash()
                self._close_ended()

    def _choose_series(self, series: str) -> None:
        if self.model.next_runs.can_choose_series:
            self._save(self.model.next_runs.with_choices(series=series))

    def _arm(self, count: int | None = None) -> None:
        """Send the next run to the engine, or show why it cannot be recorded."""
        series, ended = self.model.next_runs.series, self.model.ended
        reason = self.model.next_runs.why_not_armed(series)
        if ended is not None and ended.is_left:
            name = Path(ended.event.path).stem
            reason = Chip(gettext("Decide about {name} first", name=name), Tone.WARN)
        if not reason.text:
            self._close_ended()
            reason = self.model.next_runs.why_not_armed(series)
        if reason.text:
            self._set_decisions(message=reason)
            return
        next_runs = self.model.next_runs
        run, count = next_runs.run_settings(self.model.stand.directory), count or next_runs.run_count
        armed = ArmedRun(run.series or "", note=run.note)
        if self.model.decisions.message == _disarmed():
            self._set_decisions(message=EMPTY_CHIP)
        self._set_session(is_command_pending=True, remaining_runs=count - 1, run=armed)
        self.effects.append(engine.Arm(run, count))

    def _on_settings(self, settings: Settings) -> None:
        next_runs = self.model.next_runs.with_suggested_operator(settings.operator)
        before, counts_simulated = next_runs.counts_simulated, settings.count_simulated
        self._set(sounds=settings.sounds, next_runs=replace(next_runs, counts_simulated=counts_simulated))
        if counts_simulated is not before and next_runs.is_requested:
            self._count_completed()

    # --- decisions about runs ---

    def _decide(self) -> RecordedRun | None:
        run = self.model.decisions.pending
        if run is not None:
            self._set_decisions(pending=None, last=run, trash_path="")
        return run

    def _keep(self, run: RecordedRun) -> None:
        storing = {**self.model.decisions.storing, run.path: run}
        self._set_decisions(storing=storing, message=run.storing_message)
        self.effects.append(state.KeepRun(run.path, self.model.author, run.note_to_store, run.has_results))

    def _move_to_trash(self) -> None:
        run = self._decide()
        if run is not None:
            message = Chip(gettext("Moving {name} to the trash", name=run.name))
            self._set_decisions(is_moving=True, message=message)
            self.effects.append(state.MoveToTrash(run.path, self.model.author, run.note_to_store))
        if self.model.ended is not None and self.model.ended.result is not None:
            self._set(next_runs=self.model.next_runs.with_run(self.model.ended.result.path))

    def _close_ended(self) -> None:
        """Prepare the next run: the one that is shown is kept unless it was decided about."""
        model, ended = self.model, self.model.ended
        if ended is None:
            return
        if ended.result is None:
            self._set_decisions(to_keep=model.decisions.to_keep | {ended.event.path})
        elif ended.result.path:
            self._set(snapshot=Snapshot(ended, model.live, model.next_runs.series))
        run = self._decide()
        next_runs = model.next_runs.with_decision()
        if run is not None:
            self._keep(run)
        if run is not None and run.has_results:
            counted = next_runs.with_run(run.path, ended.run.series) if ended.counts else next_runs
            next_runs = counted.with_next_series()
        self._set(live=self.model.live.restarted(), ended=None)
        self._save(next_runs)
        self._set_session(live_estimate=state.LiveEstimate())

    def _leave_ended(self) -> None:
        """Another device is connected: the run that is shown still waits for its decision."""
        ended = self.model.ended
        if ended is not None and ended.event.path:
            self._set(ended=replace(ended, is_left=True))
        else:
            self._close_ended()

    def _undo(self) -> None:
        decisions = self.model.decisions
        run, trash_path = decisions.last, decisions.trash_path
        self._set_decisions(last=None, trash_path="")
        if run is None:
            return
        if trash_path:
            self._set_decisions(restoring=run)
            self.effects.append(state.RestoreFromTrash(trash_path))
            return
        self._ask_again(run)

    def _ask_again(self, run: RecordedRun) -> None:
        """Show the previous run until it is decided about; its note may or may not have been stored."""
        self._set_decisions(pending=replace(run, note=None), message=EMPTY_CHIP)
        snapshot = self.model.snapshot
        if snapshot is None or snapshot.ended.result is None:
            return
        ended = replace(snapshot.ended, result=replace(snapshot.ended.result, path=run.path))
        self._set(ended=ended, live=self.model.live.with_earlier(snapshot.live))
        self._choose_series(snapshot.next_series)
        self._save(self.model.next_runs.with_undecided(run.path))

    # --- answers of the worker ---

    def _on_task_done(self, task: state.RecordTask, answer: Any) -> None:
        model = self.model
        match task:
            case state.LoadPlan():
                self._save(model.next_runs.with_loaded_plan(answer))
                self._remind_of(answer.tests.undecided)
            case state.CountCompletedRuns():
                self._set(next_runs=model.next_runs.with_completed(answer).with_next_series())
            case state.KeepRun(path):
                self._on_kept(path)
            case state.MoveToTrash(path):
                self._on_moved(path, answer)
            case state.RestoreFromTrash():
                self._on_restored(answer)
        if isinstance(task, state.KeepRun | state.MoveToTrash | state.RestoreFromTrash):
            self._count_completed()

    def _on_kept(self, path: str) -> None:
        decisions = self.model.decisions
        storing = dict(decisions.storing)
        run = storing.pop(path, None)
        self._set_decisions(storing=storing)
        if run is not None and decisions.message == run.storing_message:  # a newer message stays
            self._set_decisions(message=run.stored_message)

    def _on_moved(self, path: str, trash_path: str) -> None:
        last, text = self.model.decisions.last, gettext("Moved {name} to the trash", name=Path(path).stem)
        self._set_decisions(is_moving=False, message=Chip(text, Tone.WARN, trash_path))
        if last is not None and last.path == path:
            self._set_decisions(trash_path=trash_path)

    def _on_restored(self, path: str) -> None:
        """Ask about a restored run again, or keep it if another one is shown."""
        restoring = self.model.decisions.restoring
        self._set_decisions(restoring=None)
        if restoring is None:
            return
        run = replace(restoring, path=path)
        if self.model.is_run_shown:
            self._keep(run)
            text = gettext("Brought back {name}: it counts again", name=run.name)
        else:
            self._ask_again(run)
            text = gettext("Brought back {name}", name=run.name)
        self._set_decisions(message=Chip(text, Tone.OK))

    def _on_task_failed(self, task: state.RecordTask, message: Message) -> None:
        """Show why a task failed; the files are as they were."""
        is_moving = self.model.decisions.is_moving and not isinstance(task, state.MoveToTrash)
        self._set_decisions(is_moving=is_moving, message=Chip(sentence(message), Tone.BAD))
        if isinstance(task, state.LoadPlan):  # the stored plan cannot be read; the runs can
            self._count_completed()

    def _remind_of(self, undecided: Sequence[str]) -> None:
        """Name the runs that were left without a decision when the window was closed."""
        if undecided:
            text = ngettext(
                "{name} still waits for a decision, and does not count: analyse it on Runs to keep it, or"
                " move it to the trash there",
                "{count} runs still wait for a decision, and do not count: analyse them on Runs to keep"
                " them, or move them to the trash there",
                len(undecided),
                name=Path(undecided[0]).stem,
            )
            self._set_decisions(message=Chip(text, Tone.WARN))

    def _load_plan(self) -> None:
        if not self.model.next_runs.is_requested:
            self._set(next_runs=replace(self.model.next_runs, is_requested=True))
            counts_simulated = self.model.next_runs.counts_simulated
            self.effects.append(state.LoadPlan(str(self.model.stand.directory), counts_simulated))

    def _save(self, next_runs: NextRuns) -> None:
        next_runs, task = next_runs.to_save(str(self.model.stand.directory))
        self._set(next_runs=next_runs)
        if task is not None:
            self.effects.append(task)

    def _count_completed(self) -> None:
        counts_simulated = self.model.next_runs.counts_simulated
        self.effects.append(state.CountCompletedRuns(str(self.model.stand.directory), counts_simulated))

    # --- identification of the run ---

    def _on_identification(self, event: AnalysedRun | AnalysisFailed | AnalysisProgress) -> None:
        model = self.model
        path = str(event.path)
        ended = model.ended
        if ended is None or ended.result is not None or ended.event.path != path:
            self._on_late_identification(event, path)
            return
        match event:
            case AnalysisProgress(_, progress):
                self._set(ended=replace(ended, progress=progress))
            case AnalysedRun():
                result = results.make_result(event, ended.true_friction)
                self._set_result(ended, result, RecordedRun.of(event))
            case AnalysisFailed(_, message):
                result = results.failed_result(message, path, ended.event.ended)
                self._set_result(ended, result, RecordedRun(path, ended.run.note, ended.run.note))

    def _on_late_identification(
        self, event: AnalysedRun | AnalysisFailed | AnalysisProgress, path: str
    ) -> None:
        """Keep a run that the operator has gone on from; without a result it stays as it is."""
        to_keep = self.model.decisions.to_keep
        if isinstance(event, AnalysisProgress) or path not in to_keep:
            return
        self._set_decisions(to_keep=to_keep - {path})
        if isinstance(event, AnalysedRun):
            self._set_decisions(last=None, trash_path="")
            self._keep(RecordedRun.of(event))

    def _set_result(self, ended: EndedRun, result: Result, pending: RecordedRun) -> None:
        ended = replace(ended, result=result, is_identified=pending.has_results, progress=None)
        self._set(ended=ended)
        self._set_decisions(pending=pending)

    # --- engine and connection ---

    def _start_over(self, reported: PullbackState | None, device: str) -> None:
        """Another engine reports from now on, or none; the result of the last run stays."""
        model = self.model
        self._set_session(engine=reported, position=engine.StandPosition(), note="", loss_reason="")
        self._set_session(device=device, is_command_pending=False, remaining_runs=0)
        bar = state.StatusBar()
        if device:
            bar = state.StatusBar(live.device_chip(device), run=model.status_bar.run)
        gauges = model.stand.gauges
        traces = model.live.reconnected(gauges)
        if model.ended is None:
            traces = traces.cleared(model.pullback_m)
            self._set_session(live_estimate=state.LiveEstimate())
        else:
            traces = traces.with_earlier(model.live)
        self._set(status_bar=bar, monitors=monitors_of(gauges), live=traces)

    def _on_engine(self, event: engine.Event) -> None:
        model = self.model
        self._set_session(heard_s=self.model.stand.clock())
        match event:
            case engine.StateChanged():
                self._on_state(event)
            case engine.Connected(device, _, rate_hz, simulated=is_simulated):
                self._set_session(device=device, simulated=model.session.simulated or is_simulated)
                self._set_bar(device=live.device_chip(device), rate=live.rate_text(rate_hz))
            case engine.Reconnecting(message):
                self._set_loss(sentence(message))
            case engine.Reconnected():
                self._set_loss("")
            case engine.Health():
                lost, disk = live.lost_samples_chip(event), live.disk_chip(event)
                self._set_bar(rate=live.rate_text(event.rate_hz), lost_samples=lost, disk=disk)
            case engine.LiveResult():
                self._set_session(live_estimate=live.live_estimate(event))
            case engine.RunStarted(path):
                self._set_session(run=replace(self.model.session.run, name=Path(path).stem))
                self._save(self.model.next_runs.with_undecided(path))
            case engine.RunEnded():
                self._on_run_ended(event)

    def _on_state(self, event: engine.StateChanged) -> None:
        if event.state in RECORDING_STATES:
            self._close_ended()
        session = self.model.session
        remaining = session.remaining_runs
        follows = not session.is_recording and not session.is_command_pending
        if event.state in RECORDING_STATES and follows:  # without a command: the next run in a row
            remaining = max(remaining - 1, 0)
        self._set(live=self.model.live.on_state(event.state, event.since_s, event.position))
        reached = session.reaching(event.state, event.position)
        self._set_session(engine=event.state, reached=reached, position=event.position, note=event.note)
        self._set_session(remaining_runs=remaining, is_command_pending=False, waiting_for="")
        if event.state in _NEW_MOTION:
            self._set_session(live_estimate=state.LiveEstimate())

    def _on_run_ended(self, event: engine.RunEnded) -> None:
        session = self.model.session
        self._set_session(is_command_pending=False, remaining_runs=event.remaining)
        if not event.path and event.ended is EndReason.STOPPED and not event.message:
            self._on_disarmed()
            return
        self._set_session(run=replace(session.run, name=""))
        counts = not session.simulated or self.model.next_runs.counts_simulated
        ended = EndedRun(event, session.run, session.reached, session.true_friction, counts=counts)
        if event.path:
            self._save(self.model.next_runs.with_undecided(event.path).after_recording())
            ended = replace(ended, progress=Progress(gettext("Identifying")))
        else:
            reason = event.message or gettext("nothing was recorded")
            ended = replace(ended, result=results.failed_result(reason, "", event.ended))
        self._set(ended=ended, live=self.model.live.stopped())
        self._forget_last()

    def _on_disarmed(self) -> None:
        """The operator stopped before the table was pulled back: there is no run."""
        self._set(live=self.model.live.restarted())
        self._set_decisions(message=_disarmed())

    def _set_loss(self, reason: str) -> None:
        self._set_session(loss_reason=reason)
        self._set_bar(device=live.device_chip(self.model.session.device, reason))

    # --- time and samples ---

    def _on_clock(self, now_s: float) -> None:
        session = self.model.session
        if session.engine in (None, PullbackState.CONNECTING) or session.loss_reason:
            return
        self._set_bar(device=live.device_chip(session.device, silent_s=now_s - session.heard_s))

    def _on_samples(self, rows: RingRows) -> None:
        model, today = self.model, self.model.stand.today()
        first, second = model.monitors
        monitors = first.with_rows(rows), second.with_rows(rows)
        live = model.live.with_rows(rows, model.pullback_m, model.shown_plate_range)
        self._set(monitors=monitors, live=live)
        self._set_bar(gauges=tuple(monitor.chip(rows, today) for monitor in monitors))

    # --- changes of the model ---

    def _run_chip(self) -> Chip:
        model, session = self.model, self.model.session
        if not model.is_run_shown:
            return Chip(model.run_text(model.next_runs.series))
        run = model.ended.run if model.ended else session.run
        text = model.run_text(run.series or model.next_runs.series)
        if session.remaining_runs:
            text += gettext(", {count} more by themselves", count=session.remaining_runs)
        return Chip(text, hint=run.name)

    def _forget_last(self) -> None:
        """Drop message and undo: something else has happened since the last decision."""
        self._set_decisions(message=EMPTY_CHIP, last=None, trash_path="")

    def _set(self, **changes: Any) -> None:
        self.model = replace(self.model, **changes)

    def _set_decisions(self, **changes: Any) -> None:
        self.model = replace(self.model, decisions=replace(self.model.decisions, **changes))

    def _set_session(self, **changes: Any) -> None:
        self.model = replace(self.model, session=replace(self.model.session, **changes))

    def _set_bar(self, **changes: Any) -> None:
        bar = replace(self.model.status_bar, **changes)
        if bar != self.model.status_bar:
            self.model = replace(self.model, status_bar=bar)
