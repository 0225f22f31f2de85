"""Presenter of the Record screen: dispatches events to the reducer, carries out effects, shows the state."""

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from app.acquisition.guidance import guidance_for
from app.acquisition.messages import Command, PullbackState
from app.acquisition.ring import RingRows
from app.presenters.base import Chip, Presenter, Tone
from app.presenters.connection import Connection
from app.presenters.navigator import StandContext
from app.presenters.record import state
from app.presenters.record.model import EndedRun, RecordModel
from app.presenters.record.reducer import Effect, reduce
from app.presenters.record.state import Action, Cue, TaskDone, TaskFailed
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from config.schema import Gauges, Stand
from messages.i18n import N_, gettext, translate

if TYPE_CHECKING:
    from app.presenters.record import tasks
else:
    tasks = LazyModule("app.presenters.record.tasks")

_HELD = frozenset({PullbackState.HELD, PullbackState.ARMED})
_TAIL = frozenset({PullbackState.TAIL, PullbackState.NO_SLIP, PullbackState.RECORDING})
_STEPS: tuple[tuple[str, frozenset[PullbackState], frozenset[PullbackState]], ...] = (
    (N_("Zero"), frozenset({PullbackState.RECENTRE, PullbackState.ZERO}), frozenset({PullbackState.ZERO})),
    (N_("Pull"), frozenset({PullbackState.PULLING}), _HELD | {PullbackState.RELEASED}),
    (N_("Hold"), frozenset({PullbackState.HELD}), _HELD),
    (N_("Armed"), frozenset({PullbackState.ARMED}), frozenset({PullbackState.ARMED})),
    (
        N_("Slip"),
        frozenset({PullbackState.RELEASED, PullbackState.SLIPPING}),
        frozenset({PullbackState.SLIPPING}),
    ),
    (N_("Tail"), _TAIL, _TAIL),
    (N_("Store"), frozenset({PullbackState.CLOSING}), frozenset({PullbackState.CLOSING})),
)
"""Name of each step, the states during it, and those of which one shows afterwards that it happened."""
_RESULT = N_("Result")
_CUES = {
    PullbackState.RECENTRE: Cue.TROUBLE,
    PullbackState.PULLING: Cue.PULL,
    PullbackState.HELD: Cue.HOLD,
    PullbackState.ARMED: Cue.LET_GO,
    PullbackState.RELEASED: Cue.RELEASED,
}
_RELEASED = frozenset({PullbackState.RELEASED, PullbackState.SLIPPING, PullbackState.RECORDING}) | _TAIL
_TARGET_SHOWN = (PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED)


class RecordPresenter(Presenter[state.RecordState]):
    """Leads the operator through one pullback test after another.

    `files` carries out tasks with run files, and is closed by `close`. `author` decides about runs.
    `count_simulated` changes whether simulated runs count in the plan.
    """

    CLOSE_S = 30.0  # time for tasks that are under way when the window is closed; an analysis takes a second

    def __init__(
        self,
        connection: Connection,
        stand: StandContext,
        files: Worker,
        author: str,
        count_simulated: Callable[[bool], object] = lambda _: None,
    ) -> None:
        self._model = RecordModel.of_stand(stand, author)
        super().__init__(record_state(self._model))
        self._connection = connection
        self._files = files
        self.count_simulated = count_simulated
        self._unfinished: list[state.RecordTask] = []

    @property
    def is_recording(self) -> bool:
        session = self._model.session
        return session.is_recording or session.engine is PullbackState.CLOSING

    @property
    def fate_when_closed(self) -> str:
        """What becomes of the run that is being recorded if the window is closed; empty without one."""
        session = self._model.session
        if not session.is_recording:
            return ""
        if session.disarms:
            return gettext(
                "A run of {series} is armed. Closing the window disarms it: nothing is recorded",
                series=session.run.series,
            )
        if session.reached & _RELEASED:
            return gettext(
                "A run of {series} is being recorded. Closing the window ends it now: it is kept without a"
                " decision, and does not count in the plan",
                series=session.run.series,
            )
        return gettext(
            "A run of {series} is being recorded. Closing the window ends it before the release: it is kept"
            " without a decision, and does not count in the plan",
            series=session.run.series,
        )

    def dispatch(self, event: state.RecordEvent) -> None:
        before = self._model
        self._model, effects = reduce(before, event)
        for effect in effects:
            self._execute(effect)
        is_drawn_only = self._model.live.read_s == before.live.read_s
        if isinstance(event, state.ClockTicked | RingRows) and is_drawn_only:
            self._update(status_bar=self._model.shown_status_bar, traces=self._model.live.traces)
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

    def on_stand(self, stand: Stand) -> None:
        self.dispatch(stand)

    def close(self) -> None:
        """Wait until decisions are stored, then end the worker."""
        until_s = time.perf_counter() + self.CLOSE_S
        while self._unfinished and self._files.is_busy and time.perf_counter() < until_s:
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
        status_bar=model.shown_status_bar,
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
        disarms=session.disarms,
        connected=session.engine is not None,
        title=_title(model),
    )


def _title(model: RecordModel) -> tuple[str, ...]:
    session, run = model.session, model.ended.run if model.ended else model.session.run
    name = run.name if model.is_run_shown else ""
    if session.engine is None:
        state_text = ""
    elif session.loss_reason:
        state_text = gettext("device lost")
    elif session.engine is PullbackState.CONNECTING:
        state_text = gettext("connecting")
    elif session.is_idle:
        state_text = gettext("ready")
    else:
        state_text = gettext("recording: {step}", step=_step_name(session.engine))
    return tuple(filter(None, (name, session.device, state_text)))


def _step_name(engine: PullbackState) -> str:
    return next((gettext(name) for name, states, _ in _STEPS if engine in states), "")


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
    """Steps of the test; those that happened are ticked, whatever came after them."""
    ended = model.ended
    engine = model.session.engine if ended is None else None
    reached = model.session.reached if ended is None else ended.reached
    steps = []
    for name, states, happened in _STEPS:
        status = state.StepStatus.DONE if happened & reached else state.StepStatus.AHEAD
        steps.append(state.Step(gettext(name), state.StepStatus.NOW if engine in states else status))
    return (*steps, state.Step(gettext(_RESULT), _result_status(ended)))


def _result_status(ended: EndedRun | None) -> state.StepStatus:
    if ended is not None and ended.is_awaited:
        return state.StepStatus.NOW
    is_identified = ended is not None and ended.is_identified
    return state.StepStatus.DONE if is_identified else state.StepStatus.AHEAD


def _cue(model: RecordModel) -> Cue | None:
    engine, ended = model.session.engine, model.ended
    if ended is not None:
        return None if ended.is_awaited else Cue.RESULT
    if engine is None:
        return None
    situation = model.situation(engine)
    is_trouble = situation.is_device_lost or situation.is_early_release
    return Cue.TROUBLE if is_trouble else _CUES.get(engine)


def _status_message(model: RecordModel) -> Chip:
    """Outcome of the last action, and the note of an idle engine, which is no instruction then."""
    message, session = model.decisions.message, model.session
    if not (session.is_idle and session.note):
        return message
    tone = Tone.BAD if message.tone is Tone.BAD else Tone.WARN
    parts = (message.text.rstrip("."), sentence(session.note))
    return Chip(". ".join(filter(None, parts)), tone, message.hint)
