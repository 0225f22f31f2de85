"""State of the Record screen: what the view draws, tasks for its worker, and events that change it."""

from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum, auto
from typing import Any

from app.acquisition.messages import Event
from app.acquisition.ring import RingRows
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Progress, SimulationStarted, Tone
from app.presenters.decimated_history import Polyline
from app.presenters.device_status import DeviceStatus
from app.presenters.results import Result, ResultRow
from app.runs.next_tests import NextTests
from config.schema import Gauges, Settings, Stand
from messages.i18n import N_, gettext
from messages.message import Message

_NO_DEVICE = Chip(N_("no device"))
_DOTS_MAX = 6
"""More dots cannot be counted at a glance: figures are shown instead."""


@dataclass(frozen=True, slots=True)
class StatusBar:
    """`stopped_at` is the time of day that rate, losses and gauges are of; empty while they are live."""

    device: Chip = _NO_DEVICE
    rate: str = ""
    lost_samples: Chip = EMPTY_CHIP
    gauges: tuple[Chip, ...] = ()
    disk: Chip = EMPTY_CHIP
    run: Chip = EMPTY_CHIP
    stopped_at: str = ""
    simulated: Chip = EMPTY_CHIP

    def dated(self, stopped_at: str) -> "StatusBar":
        """Status of a device whose samples have stopped."""
        lost, gauges = _stale(self.lost_samples), tuple(map(_stale, self.gauges))
        return replace(self, lost_samples=lost, gauges=gauges, stopped_at=stopped_at)


def _stale(chip: Chip) -> Chip:
    return replace(chip, tone=Tone.STALE)


class StepStatus(StrEnum):
    DONE = "done"
    NOW = "now"
    AHEAD = "ahead"


@dataclass(frozen=True, slots=True)
class Step:
    name: str
    status: StepStatus = StepStatus.AHEAD


@dataclass(frozen=True, slots=True)
class PullbackTarget:
    """Nominal and current pullback, both positive."""

    target_mm: float
    now_mm: float
    tolerance_mm: float

    @property
    def full_mm(self) -> float:
        """End of the bar: beyond the target, so that overshoot is visible."""
        return 1.25 * self.target_mm

    @property
    def is_reached(self) -> bool:
        return abs(self.now_mm - self.target_mm) <= self.tolerance_mm


@dataclass(frozen=True, slots=True)
class GuidanceState:
    instruction: str
    detail: str = ""
    tone: Tone = Tone.PLAIN
    target: PullbackTarget | None = None
    steps: tuple[Step, ...] = ()


Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TraceMarks:
    """Marks over and under the traces. Times (s) on the shown axis, displacements in mm."""

    before_release: Span | None = None
    release_s: float | None = None
    slip: Span | None = None
    target_mm: Span | None = None
    """Allowed displacement of the table at the end of the pull."""
    table_range_mm: Span | None = None
    relative_range_mm: Span | None = None
    plate_range_mm: Span | None = None
    """Allowed position of the plate before the pull: its slip then fits the range of gauge 2."""


@dataclass(frozen=True, eq=False, slots=True)
class Traces:
    """Both channels in mm against the shown time axis (s), from `span[0]` to `span[1]`.

    The value axes reach from minus to plus `table_limit_mm` and `relative_limit_mm`.
    """

    table: Polyline = field(default_factory=Polyline.empty)
    relative: Polyline = field(default_factory=Polyline.empty)
    span: Span = (-10.0, 0.0)
    time_title: str = N_("time from now, s")
    table_limit_mm: float = 15.0
    relative_limit_mm: float = 15.0
    marks: TraceMarks = TraceMarks()


@dataclass(frozen=True, slots=True)
class LiveReadings:
    """`stopped_at` as in `StatusBar`."""

    table: str = "–"
    relative: str = "–"
    origin: str = ""
    stopped_at: str = ""


@dataclass(frozen=True, slots=True)
class LiveEstimate:
    rows: tuple[ResultRow, ...] = ()
    note: str = ""


@dataclass(frozen=True, slots=True)
class RunForm:
    """Form of the next runs, as typed; conditions by the field names of `Conditions`."""

    operator: str = ""
    note: str = ""
    count: str = "1"
    temperature_c: str = ""
    humidity_percent: str = ""
    plate_id: str = ""
    contact_id: str = ""
    surface_preparation: str = ""
    run_in_number: str = ""


@dataclass(frozen=True, slots=True)
class RunChoices:
    series: str
    all_series: tuple[str, ...]
    series_hint: str = ""
    series_fixed: bool = False
    form: RunForm = RunForm()
    summary: str = ""
    form_error: str = ""
    editable: bool = True


@dataclass(frozen=True, slots=True)
class SeriesProgress:
    series: str
    done: int
    planned: int

    @property
    def is_full(self) -> bool:
        return self.done >= self.planned

    @property
    def dots(self) -> str:
        """`●●○`, or `4/10` for many runs."""
        if self.planned > _DOTS_MAX:
            return f"{self.done}/{self.planned}"
        done = min(self.done, self.planned)
        return "●" * done + "○" * (self.planned - done)

    @property
    def description(self) -> str:
        """Sentence for tool tips and screen readers."""
        template = N_("{series}: {done} of {planned} runs are there")
        return gettext(template, series=self.series, done=self.done, planned=self.planned)


@dataclass(frozen=True, slots=True)
class PlanState:
    progress: tuple[SeriesProgress, ...] = ()
    text: str = ""
    error: str = ""
    counts_simulated: bool = False  # whether simulated runs are among those that are done
    can_undo: bool = False

    @property
    def planned(self) -> int:
        return sum(one.planned for one in self.progress)

    @property
    def done(self) -> int:
        """Number of completed runs, at most as many as planned of each series."""
        return sum(min(one.done, one.planned) for one in self.progress)


class Action(StrEnum):
    """Actions of the operator that need no further data."""

    TARE = "tare"
    UNTARE = "untare"
    ARM = "arm"
    STOP = "stop"
    NEXT = "next"  # keep the run, if one waits for a decision, and prepare the next
    REPEAT = "repeat"  # move the run to the trash and record the same series again
    DISCARD = "discard"
    UNDO = "undo"
    UNDO_PLAN = "undo-plan"  # take the last change of the plan back


class Cue(StrEnum):
    PULL = "pull"
    HOLD = "hold"
    LET_GO = "let-go"
    RELEASED = "released"
    RESULT = "result"
    TROUBLE = "trouble"


@dataclass(frozen=True, slots=True)
class RecordState:
    """What the Record screen shows. `allowed` are the possible actions, `primary` the usual next one."""

    guidance: GuidanceState
    choices: RunChoices
    status_bar: StatusBar = field(default_factory=StatusBar)
    traces: Traces = field(default_factory=Traces)
    readings: LiveReadings = field(default_factory=LiveReadings)
    live_estimate: LiveEstimate = field(default_factory=LiveEstimate)
    result: Result | None = None
    decision: str | None = None
    """Note of the run that waits for a decision; None without one."""
    progress: Progress | None = None
    plan: PlanState = field(default_factory=PlanState)
    status_message: Chip = EMPTY_CHIP
    undo: str = ""
    """What `Action.UNDO` takes back; empty where nothing can be."""
    cue: Cue | None = None
    allowed: frozenset[Action] = frozenset()
    primary: Action | None = None
    disarms: bool = False
    """`Action.STOP` keeps no run, since the table has not been pulled back."""
    connected: bool = False
    title: tuple[str, ...] = ()
    """Run, device and state of the recording, as far as there are any."""


@dataclass(frozen=True, slots=True)
class LoadPlan:
    """Read the stored plan of a folder, and count its completed runs."""

    folder: str
    counts_simulated: bool = False


@dataclass(frozen=True, slots=True)
class LoadedPlan:
    tests: NextTests
    completed: tuple[tuple[str, str], ...] = ()
    """Path and series of each completed run."""


@dataclass(frozen=True, slots=True)
class CountCompletedRuns:
    """List the completed runs of a folder; the answer is as `LoadedPlan.completed`."""

    folder: str
    counts_simulated: bool = False


@dataclass(frozen=True, slots=True)
class SavePlan:
    folder: str
    tests: NextTests


@dataclass(frozen=True, slots=True)
class KeepRun:
    """Store the note of a run if it has changed, and its analysis if it `has_results`."""

    path: str
    author: str
    note: str | None = None
    has_results: bool = False


@dataclass(frozen=True, slots=True)
class MoveToTrash:
    """Move a run to the trash, with a note if one was typed; the answer is its path there."""

    path: str
    author: str
    note: str | None = None


@dataclass(frozen=True, slots=True)
class RestoreFromTrash:
    path: str


RecordTask = LoadPlan | CountCompletedRuns | SavePlan | KeepRun | MoveToTrash | RestoreFromTrash


@dataclass(frozen=True, slots=True)
class TaskDone:
    task: RecordTask
    answer: Any


@dataclass(frozen=True, slots=True)
class TaskFailed:
    task: RecordTask
    message: Message


@dataclass(frozen=True, slots=True)
class AnalysisProgress:
    """Progress of the identification of the run at `path`."""

    path: str
    progress: Progress


@dataclass(frozen=True, slots=True)
class AnalysisFailed:
    path: str
    message: Message


class Notification(Enum):
    """Events without data that the window sends."""

    SCREEN_ENTERED = auto()
    DISCONNECTED = auto()
    RUNS_CHANGED = auto()  # runs were added to the folder or removed from it


@dataclass(frozen=True, slots=True)
class SeriesChosen:
    series: str


@dataclass(frozen=True, slots=True)
class PlanEdited:
    text: str


@dataclass(frozen=True, slots=True)
class NoteEdited:
    note: str


@dataclass(frozen=True, slots=True)
class PlotResized:
    width_px: int


@dataclass(frozen=True, slots=True)
class PlotZoomed:
    """Part of the shown time axis that is in view; None is all of it."""

    span: Span | None


@dataclass(frozen=True, slots=True)
class Connecting:
    """A device is being connected; `waiting_for` names a process that is started first."""

    device: str
    waiting_for: str = ""


@dataclass(frozen=True, slots=True)
class ClockTicked:
    now_s: float


RecordEvent = (
    Action
    | Notification
    | SeriesChosen
    | RunForm
    | PlanEdited
    | NoteEdited
    | PlotResized
    | PlotZoomed
    | Connecting
    | DeviceStatus
    | SimulationStarted
    | RingRows
    | ClockTicked
    | AnalysedRun
    | Settings
    | Gauges
    | Stand
    | TaskDone
    | TaskFailed
    | AnalysisProgress
    | AnalysisFailed
    | Event
)
"""Settings, calibrations, the stand, an edited form, an analysed run and samples are events by themselves."""
