"""Presenter of the Record screen: dispatches events to the reducer, carries out effects, shows the state."""

import time
from functools import partial
from typing import TYPE_CHECKING

from app.acquisition.guidance import guidance_for
from app.acquisition.messages import Command, PullbackState
from app.acquisition.ring import RingRows
from app.presenters.base import Chip, Presenter, Tone
from app.presenters.connection import Connection
from app.presenters.navigator import StandContext
from app.presenters.record import state
from app.presenters.record.model import RecordModel
from app.presenters.record.reducer import Effect, reduce
from app.presenters.record.state import Action, Cue, TaskDone, TaskFailed
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from config.schema import Gauges
from messages.i18n import N_, gettext, translate

if TYPE_CHECKING:
    from app.presenters.record import tasks
else:
    tasks = LazyModule("app.presenters.record.tasks")

_STEPS: tuple[tuple[str, frozenset[PullbackState]], ...] = (
    (N_("Zero"), frozenset({PullbackState.RECENTRE, PullbackState.ZERO})),
    (N_("Pull"), frozenset({PullbackState.PULLING})),
    (N_("Hold"), frozenset({PullbackState.HELD})),
    (N_("Armed"), frozenset({PullbackState.ARMED})),
    (N_("Slip"), frozenset({PullbackState.RELEASED, PullbackState.SLIPPING})),
    (N_("Tail"), frozenset({PullbackState.TAIL, PullbackState.NO_SLIP, PullbackState.RECORDING})),
    (N_("Store"), frozenset({PullbackState.CLOSING})),
    (N_("Result"), frozenset()),
)
_CUES = {
    PullbackState.RECENTRE: Cue.TROUBLE,
    PullbackState.PULLING: Cue.PULL,
    PullbackState.HELD: Cue.HOLD,
    PullbackState.ARMED: Cue.LET_GO,
    PullbackState.RELEASED: Cue.RELEASED,
}
_TARGET_SHOWN = (PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED)


class RecordPresenter(Presenter[state.RecordState]):
    """Leads the operator through one pullback test after another.

    `files` carries out tasks with run files, and is closed by `close`. `author` decides about runs.
    """

    CLOSE_S = 30.0  # time for tasks that are under way when the window is closed; an analysis takes a second

    def __init__(self, connection: Connection, stand: StandContext, files: Worker, author: str) -> None:
        self._model = RecordModel.of_stand(stand, author)
        super().__init__(record_state(self._model))
        self._connection = connection
        self._files = files
        self._unfinished: list[state.RecordTask] = []

    @property
    def is_recording(self) -> bool:
        session = self._model.session
        return session.is_recording or session.engine is PullbackState.CLOSING

    def dispatch(self, event: state.RecordEvent) -> None:
        before = self._model
        self._model, effects = reduce(before, event)
        for effect in effects:
            self._execute(effect)
        is_drawn_only = self._model.live.read_s == before.live.read_s
        if isinstance(event, state.ClockTicked | RingRows) and is_drawn_only:
            self._update(status_bar=self._model.status_bar, traces=self._model.live.traces)
        else:
            self._set_state(record_state(self._model))

    def enter(self) -> None:
        self.dispatch(state.Notification.SCREEN_ENTERED)

    def tick(self) -> None:
        """Take answers of the worker and new samples; to be called some 60 times a second."""
        self._files.poll()
        self.dispatch(state.ClockTicked(self._model.stand.clock()))
        rows = self._connection.new_rows()
        if rows is not None and len(rows):
            self.dispatch(rows)

    def on_gauges(self, gauges: Gauges) -> None:
        self.dispatch(gauges)

    def close(self) -> None:
        """Wait until decisions are stored, then end the worker."""
        until_s = time.monotonic() + self.CLOSE_S
        while self._unfinished and self._files.is_busy and time.monotonic() < until_s:
            self._files.poll()
            time.sleep(0.005)
        self._files.close()

    def _execute(self, effect: Effect) -> None:
        if isinstance(effect, Command):
            self._connection.send(effect)
            return
        if isinstance(effect, state.KeepRun | state.MoveToTrash | state.RestoreFromTrash | state.SavePlan):
            self._unfinished.append(effect)
        self._files.submit(
            tasks.execute,
            effect,
            done=lambda answer: self._on_task_ended(TaskDone(effect, answer)),
            failed=lambda failure: self._on_task_ended(TaskFailed(effect, failure.message)),
        )

    def _on_task_ended(self, event: TaskDone | TaskFailed) -> None:
        if event.task in self._unfinished:
            self._unfinished.remove(event.task)
        self.dispatch(event)


def record_state(model: RecordModel) -> state.RecordState:
    """Derive what the screen shows."""
    session, ended, decisions, allowed = model.session, model.ended, model.decisions, model.allowed
    primary = Action.ARM if ended is None else Action.NEXT
    return state.RecordState(
        guidance=_guidance(model),
        cue=_cue(model) if model.sounds else None,
        choices=model.next_runs.choices,
        plan=model.next_runs.plan,
        status_bar=model.status_bar,
        traces=model.live.traces,
        readings=model.live.readings,
        live_estimate=session.live_estimate,
        result=ended.result if ended else None,
        progress=ended.progress if ended else None,
        decision=decisions.pending.edited_note if decisions.pending else None,
        status_message=_status_message(model),
        undo=model.undo_text,
        allowed=allowed,
        primary=primary if primary in allowed and not (ended and ended.is_awaited) else None,
        connected=session.engine is not None,
    )


def _guidance(model: RecordModel) -> state.GuidanceState:
    session, ended = model.session, model.ended
    guide = partial(state.GuidanceState, steps=_steps(model))
    if ended is not None and ended.is_awaited:
        detail = gettext("The run is stored and is being compared with its simulation.")
        return guide(gettext("Finding friction"), detail)
    if ended is not None:
        return guide(gettext("Done"))
    if session.engine is None:
        return guide(gettext("Connect an amplifier"), gettext("Nothing is connected."))
    situation = model.situation(session.engine)
    if session.engine is PullbackState.CONNECTING and session.waiting_for and not situation.is_device_lost:
        return guide(gettext("One moment"), sentence(session.waiting_for))
    guidance = guidance_for(situation)
    tone = Tone.BAD if situation.is_device_lost else Tone.WARN if guidance.is_warning else Tone.PLAIN
    target = None if situation.is_device_lost else _target(model)
    return guide(translate(guidance.instruction), sentence(guidance.detail), tone, target)


def _target(model: RecordModel) -> state.PullbackTarget | None:
    situation = model.situation(model.session.engine or PullbackState.IDLE)
    position, pulled_m = situation.position, situation.pulled_m
    if situation.state not in _TARGET_SHOWN or position.pullback_m is None or not pulled_m >= 0.0:
        return None
    return state.PullbackTarget(1e3 * position.pullback_m, 1e3 * pulled_m, 1e3 * position.tolerance_m)


def _steps(model: RecordModel) -> tuple[state.Step, ...]:
    engine, ended = model.session.engine, model.ended
    now = next((number for number, (_, states) in enumerate(_STEPS) if engine in states), -1)
    if ended is not None:
        now = len(_STEPS) - (1 if ended.is_awaited else 0)
    steps = []
    for number, (name, _) in enumerate(_STEPS):
        status = state.StepStatus.DONE if number < now else state.StepStatus.AHEAD
        steps.append(state.Step(gettext(name), state.StepStatus.NOW if number == now else status))
    return tuple(steps)


def _cue(model: RecordModel) -> Cue | None:
    engine, ended = model.session.engine, model.ended
    if ended is not None:
        return None if ended.is_awaited else Cue.RESULT
    if engine is None:
        return None
    return Cue.TROUBLE if model.situation(engine).is_device_lost else _CUES.get(engine)


def _status_message(model: RecordModel) -> Chip:
    """Outcome of the last action, and the note of an idle engine, which is no instruction then."""
    message, session = model.decisions.message, model.session
    if not (session.is_idle and session.note):
        return message
    tone = Tone.BAD if message.tone is Tone.BAD else Tone.WARN
    parts = (message.text.rstrip("."), sentence(session.note))
    return Chip(". ".join(filter(None, parts)), tone, message.hint)
