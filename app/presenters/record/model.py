"""Model of the Record screen: everything that its state is derived from, immutable."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from app.acquisition.guidance import PullbackSituation
from app.acquisition.messages import PullbackState, RunEnded, StandPosition
from app.acquisition.pullback.plan import AllowedPlateRange
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Progress, Tone
from app.presenters.navigator import StandContext
from app.presenters.record.live import GaugeMonitor, LiveTraces
from app.presenters.record.next_runs import NextRuns
from app.presenters.record.state import Action, LiveEstimate, StatusBar
from app.presenters.results import FRICTION, Result, make_row
from config.schema import Gauges
from messages.i18n import gettext

_ORDER = tuple(PullbackState)
"""A test goes through its states in this order; from a state before, it begins again."""
_NOT_RECORDING = {PullbackState.CONNECTING, PullbackState.IDLE, PullbackState.CLOSING}
RECORDING_STATES = frozenset(PullbackState) - _NOT_RECORDING


@dataclass(frozen=True, slots=True)
class RecordedRun:
    path: str
    note: str | None
    """As stored; None where that is uncertain."""
    edited_note: str
    results_text: str = ""
    has_results: bool = False

    @classmethod
    def of(cls, run: AnalysedRun) -> "RecordedRun":
        return cls(str(run.path), run.note, run.note, _results_text(run), has_results=True)

    @property
    def name(self) -> str:
        return Path(self.path).stem

    @property
    def note_to_store(self) -> str | None:
        """Edited note; None where it is stored already."""
        return None if self.edited_note.strip() == self.note else self.edited_note.strip()

    @property
    def storing_message(self) -> Chip:
        return Chip(f"{self.results_text} {gettext('Keeping {name}', name=self.name)}".strip())

    @property
    def stored_message(self) -> Chip:
        return Chip(f"{self.results_text} {gettext('Kept {name}', name=self.name)}".strip(), Tone.OK)


@dataclass(frozen=True, slots=True)
class RunDecisions:
    """Decisions about recorded runs, one after another; the last one can be undone. No file is deleted."""

    pending: RecordedRun | None = None
    message: Chip = EMPTY_CHIP
    last: RecordedRun | None = None
    trash_path: str = ""
    """Where `last` lies in the trash; empty if it does not."""
    is_moving: bool = False
    restoring: RecordedRun | None = None
    """Is being moved out of the trash."""
    to_keep: frozenset[str] = frozenset()
    """Paths of runs to keep once they are identified: the operator went on before."""
    storing: Mapping[str, RecordedRun] = field(default_factory=dict)  # runs that are being kept, by path

    def undo_text(self, *, is_free: bool) -> str:
        """What undo does; a kept run is decided about again only if the screen `is_free`."""
        if self.last is None or self.is_moving:
            return ""
        if self.trash_path:
            return gettext("Bring back {name}", name=self.last.name)
        return gettext("Decide again about {name}", name=self.last.name) if is_free else ""


@dataclass(frozen=True, slots=True)
class ArmedRun:
    """Series, name of the file and note of the run that was armed last."""

    series: str = ""
    name: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Session:
    engine: PullbackState | None = None  # state that the engine reported last; None without an engine
    is_command_pending: bool = False  # the engine has not yet answered a command
    reached: frozenset[PullbackState] = frozenset()
    """States that the present test has gone through; ZERO only if the zero was measured."""
    position: StandPosition = field(default_factory=StandPosition)
    note: str = ""
    loss_reason: str = ""
    """Why the device is lost; empty while it is there."""
    waiting_for: str = ""  # process that is started before the engine reports
    simulated: bool = False
    true_friction: float | None = None
    device: str = ""
    heard_s: float = 0.0
    """Time of the last event of the engine."""
    run: ArmedRun = ArmedRun()
    remaining_runs: int = 0
    """Runs that follow without a command."""
    live_estimate: LiveEstimate = field(default_factory=LiveEstimate)

    @property
    def is_recording(self) -> bool:
        return self.engine in RECORDING_STATES

    @property
    def disarms(self) -> bool:
        """Tell whether stopping now leaves no run."""
        return self.is_recording and not self.position.keeps_run

    @property
    def is_idle(self) -> bool:
        return self.engine is PullbackState.IDLE

    def reaching(self, state: PullbackState, position: StandPosition) -> frozenset[PullbackState]:
        """States gone through when the test comes to `state`; going back, later ones are forgotten."""
        number = _ORDER.index(state)
        reached = {one for one in self.reached if _ORDER.index(one) < number} | {state}
        if number > _ORDER.index(PullbackState.ZERO):
            reached.discard(PullbackState.ZERO)
            if position.table_zero_m is not None:
                reached.add(PullbackState.ZERO)
        return frozenset(reached)


@dataclass(frozen=True, slots=True)
class EndedRun:
    """A run from its end until the operator goes on."""

    event: RunEnded
    run: ArmedRun
    reached: frozenset[PullbackState] = frozenset()
    true_friction: float | None = None
    """f_d of the simulated stand that the run was recorded from; None of a real one."""
    result: Result | None = None
    """None while the run is being identified."""
    is_identified: bool = False
    progress: Progress | None = None
    is_left: bool = False
    """Another device was connected since: going on with it decides nothing about the run."""
    counts: bool = True
    """Whether it counts in the plan once it is kept."""

    @property
    def is_awaited(self) -> bool:
        return self.result is None


@dataclass(frozen=True, eq=False, slots=True)
class Snapshot:
    """Screen at the moment when the operator went on from a run; undo returns to it."""

    ended: EndedRun
    live: LiveTraces
    next_series: str


@dataclass(frozen=True, eq=False, slots=True)
class RecordModel:
    stand: StandContext
    author: str
    """Who decides about runs, for their history."""
    next_runs: NextRuns
    live: LiveTraces
    monitors: tuple[GaugeMonitor, GaugeMonitor]
    session: Session = field(default_factory=Session)
    ended: EndedRun | None = None
    """Run that is shown; None while the next one is prepared or recorded."""
    snapshot: Snapshot | None = None
    decisions: RunDecisions = field(default_factory=RunDecisions)
    status_bar: StatusBar = field(default_factory=StatusBar)
    sounds: bool = False

    @classmethod
    def of_stand(cls, stand: StandContext, author: str) -> "RecordModel":
        next_runs, live = NextRuns.of_series(stand.all_series), LiveTraces.of_gauges(stand.gauges)
        return cls(stand, author, next_runs, live, monitors_of(stand.gauges))

    @property
    def pullback_m(self) -> float:
        return self.stand.pullback_m(self.next_runs.series)

    @property
    def shown_status_bar(self) -> StatusBar:
        stopped_at = self.live.stopped_at
        return self.status_bar.dated(stopped_at) if stopped_at else self.status_bar

    @property
    def is_run_shown(self) -> bool:
        session = self.session
        is_active = session.is_recording or session.engine is PullbackState.CLOSING
        return is_active or self.ended is not None or session.is_command_pending

    @property
    def allowed(self) -> frozenset[Action]:
        session = self.session
        if session.is_command_pending:
            return frozenset()
        if session.is_recording:
            return frozenset({Action.STOP})
        allowed = {Action.ARM} if session.is_idle else set()
        if self.ended is not None:
            allowed.add(Action.NEXT)
        elif session.is_idle and not self.live.stopped_at:
            allowed.add(Action.TARE)
        if self.decisions.pending is not None:
            allowed |= {Action.DISCARD} | ({Action.REPEAT} if self._can_repeat else set())
        return frozenset(allowed)

    @property
    def _can_repeat(self) -> bool:
        """Tell whether the connected device can record the run that is shown once more."""
        ended, next_runs = self.ended, self.next_runs
        if ended is None or not self.session.is_idle:
            return False
        is_same_series = next_runs.can_choose_series or next_runs.series == ended.run.series
        return is_same_series and self.session.simulated == (ended.true_friction is not None)

    @property
    def undo_text(self) -> str:
        """What `Action.UNDO` takes back; empty where nothing can be."""
        return self.decisions.undo_text(is_free=not self.is_run_shown)

    @property
    def shown_plate_range(self) -> AllowedPlateRange | None:
        """Allowed position of the plate, while it has to be pushed back and gauge 2 shows it."""
        is_measured = self.stand.gauges.relative.measures == "relative"
        if not is_measured or self.session.engine is not PullbackState.RECENTRE:
            return None
        return self.stand.allowed_plate_range(self.next_runs.series)

    def run_text(self, series: str) -> str:
        """Number of the run in its series, or that it does not count in the plan."""
        next_runs = self.next_runs
        if self.session.simulated and next_runs.plan.progress and not next_runs.counts_simulated:
            return gettext("{series}, not counted in the plan", series=series)
        return next_runs.run_text(series)

    def situation(self, state: PullbackState) -> PullbackSituation:
        session = self.session
        table_m, relative_m = (float(value) for value in self.live.newest_m())
        is_on_base = self.stand.gauges.relative.measures == "plate"
        return PullbackSituation(
            state=state,
            position=session.position,
            table_m=table_m,
            plate_m=relative_m + table_m if is_on_base else relative_m,
            plate_range=self.stand.allowed_plate_range(self.next_runs.series),
            simulated=session.simulated,
            note="" if session.is_idle else session.note,
            loss_reason=session.loss_reason,
        )


def monitors_of(gauges: Gauges) -> tuple[GaugeMonitor, GaugeMonitor]:
    return GaugeMonitor(0, gauges.table), GaugeMonitor(1, gauges.relative)


def _results_text(run: AnalysedRun) -> str:
    """`f_d = 0.1003 ± 0.0006.`; empty without f_d."""
    quantity = run.results.get(FRICTION.name)
    if quantity is None:
        return ""
    shown = make_row(FRICTION, quantity)
    return f"{shown.symbol} = {shown.value} {shown.uncertainty_text}".strip() + "."
