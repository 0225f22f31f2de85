"""Where a test stands, as far as the engine and the operator have brought it, and what may be done then."""

from collections.abc import Callable
from dataclasses import dataclass

from app.acquisition.messages import PullbackState, RunEnded, RunSettings, StandPosition, StateChanged
from app.presenters.base import Chip
from app.presenters.record.guidance import PullbackStage, ScreenStage
from app.presenters.record.state import Action, LiveEstimate
from messages.i18n import gettext

RECORDING = frozenset(
    {
        PullbackState.RECENTRE,
        PullbackState.ZERO,
        PullbackState.PULLING,
        PullbackState.HELD,
        PullbackState.ARMED,
        PullbackState.RELEASED,
        PullbackState.SLIPPING,
        PullbackState.NO_SLIP,
        PullbackState.TAIL,
        PullbackState.RECORDING,
    }
)
_NOTHING_KNOWN = frozenset({PullbackState.ZERO, PullbackState.PULLING, PullbackState.RECORDING})
"""States in which what was known is of another run, or of a table let down."""
_AT_REST = StandPosition()
_NOT_RUNNING = LiveEstimate()


@dataclass(slots=True)
class PullbackSession:
    """What is known of the test at this moment."""

    engine: PullbackState | None = None
    """What the engine said last; None without one."""
    after_run: ScreenStage | None = None
    """A run has ended and is still in sight."""
    is_command_pending: bool = False
    """The engine was asked for something and has not answered."""
    standing: StandPosition = _AT_REST
    note: str = ""
    loss_reason: str = ""
    waiting_for: str = ""
    series: str = ""
    """Of the run that was armed last."""
    name: str = ""
    """Of its file."""
    run_note: str = ""
    """As it was armed."""
    remaining_runs: int = 0
    """Runs that follow it by themselves."""
    ended: RunEnded | None = None
    live_estimate: LiveEstimate = _NOT_RUNNING
    """What is known of it while it is recorded."""
    simulated: bool = False
    """The stand pulls and lets go by itself."""
    true_friction: float | None = None
    """f_d of a simulated stand."""

    @property
    def is_recording(self) -> bool:
        """Tell whether samples go into a run."""
        return self.engine in RECORDING

    @property
    def is_idle(self) -> bool:
        """Tell whether a run could be armed."""
        return self.engine is PullbackState.IDLE

    @property
    def is_in_sight(self) -> bool:
        """Tell whether a run is asked for, recorded, or still looked at."""
        is_stored = self.engine is PullbackState.CLOSING
        return self.is_recording or is_stored or self.after_run is not None or self.is_command_pending

    @property
    def is_free(self) -> bool:
        """Tell whether there is room to look at a run of before."""
        return not self.is_in_sight

    @property
    def stage(self) -> PullbackStage:
        """What the operator is told about."""
        return self.after_run or self.engine or ScreenStage.OFFLINE

    def is_awaiting_result(self, path: str) -> bool:
        """Tell whether this run is waited for to be identified."""
        return self.after_run is ScreenStage.FINDING and self.ended is not None and self.ended.path == path

    def connect(self, engine: PullbackState | None) -> None:
        """Another engine, or none; the result of the last run stays in sight."""
        self.engine, self.standing = engine, StandPosition()
        self.is_command_pending, self.remaining_runs = False, 0
        self.note = self.loss_reason = ""

    def arm(self, run: RunSettings, count: int) -> None:
        """The engine is asked for so many runs."""
        self.is_command_pending, self.remaining_runs = True, count - 1
        self.series, self.run_note, self.name = run.series or "", run.note, ""

    def on_run_ended(self, event: RunEnded) -> None:
        """A run has ended; it is looked at if it left a file."""
        self.is_command_pending, self.ended, self.remaining_runs = False, event, event.remaining
        if event.path:
            self.after_run = ScreenStage.FINDING

    def on_state_changed(self, event: StateChanged) -> None:
        """The engine came to a state; a run that nobody asked for just now follows by itself."""
        if event.state in RECORDING and not self.is_recording and not self.is_command_pending:
            self.remaining_runs = max(self.remaining_runs - 1, 0)
        if event.state in _NOTHING_KNOWN:
            self.live_estimate = _NOT_RUNNING
        self.engine, self.standing, self.note = event.state, event.position, event.note
        self.is_command_pending, self.waiting_for = False, ""

    def allowed(self, *, decides: bool) -> frozenset[Action]:
        """What can be done; `decides` where a run waits for what is to become of it."""
        if self.is_command_pending:
            return frozenset()
        if self.is_recording:
            return frozenset({Action.STOP})
        allowed = {Action.ARM} if self.is_idle else set()
        if self.is_idle and self.after_run is None:
            allowed.add(Action.TARE)
        if self.after_run is not None:
            allowed.add(Action.NEXT)
        if decides:
            allowed |= {Action.DISCARD} | ({Action.REPEAT} if self.is_idle else set())
        return frozenset(allowed)

    def run_chip(self, words: Callable[[str], str], next_series: str) -> Chip:
        """Which run of its series is recorded, or is next, by `words` for a series."""
        if not self.is_in_sight:
            return Chip(words(next_series))
        more = (
            gettext(", {count} more by themselves", count=self.remaining_runs) if self.remaining_runs else ""
        )
        return Chip(words(self.series or next_series) + more, hint=self.name)

    def next_action(self) -> Action | None:
        """The action that is usual now."""
        return {None: Action.ARM, ScreenStage.DONE: Action.NEXT}.get(self.after_run)
