"""What the Record screen shows, as values, and what its view must be able to do."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from app.presenters.base import EMPTY_CHIP, Chip, Progress, Tone
from app.presenters.decimated_history import Polyline
from app.presenters.record.plan import SeriesProgress
from app.presenters.results import Result, ResultRow
from messages.i18n import N_

NO_DEVICE = Chip(N_("no device"))


@dataclass(frozen=True, slots=True)
class StatusBar:
    """Always in sight: device, true rate, losses, gauges, disk."""

    device: Chip = NO_DEVICE
    rate: str = ""
    lost_samples: Chip = EMPTY_CHIP
    gauges: tuple[Chip, ...] = ()
    disk: Chip = EMPTY_CHIP
    run: Chip = EMPTY_CHIP


class StepStatus(StrEnum):
    """Where a step of the stepper stands."""

    DONE = "done"
    NOW = "now"
    AHEAD = "ahead"


@dataclass(frozen=True, slots=True)
class Step:
    """One state of the pullback in the stepper."""

    name: str
    status: StepStatus = StepStatus.AHEAD


@dataclass(frozen=True, slots=True)
class PullbackTarget:
    """How far the table is pulled back, of how far it should be (mm, both positive)."""

    target_mm: float
    now_mm: float
    tolerance_mm: float

    @property
    def full_mm(self) -> float:
        """End of the bar: a little beyond the target, so that too far can be seen."""
        return 1.25 * self.target_mm

    @property
    def is_reached(self) -> bool:
        """Tell whether it may be held here."""
        return abs(self.now_mm - self.target_mm) <= self.tolerance_mm


@dataclass(frozen=True, slots=True)
class Guidance:
    """What the operator does now."""

    instruction: str
    detail: str = ""
    tone: Tone = Tone.PLAIN
    target: PullbackTarget | None = None
    steps: tuple[Step, ...] = ()


Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TraceMarks:
    """What is drawn over and under the traces. Times (s) on the axis shown, displacements in mm."""

    before_release: Span | None = None
    release_s: float | None = None
    slip: Span | None = None
    target_mm: Span | None = None
    """Between which the table is to be held."""
    table_range_mm: Span | None = None
    relative_range_mm: Span | None = None
    plate_room_mm: Span | None = None
    """Between which the plate is to stand before the pull, so that its slip fits gauge 2."""


@dataclass(frozen=True, eq=False, slots=True)
class Traces:
    """Both channels in mm against the shown time axis (s), from `span[0]` to `span[1]`.

    `table_limit_mm` and `relative_limit_mm` are the halves of the vertical axes.
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
    """The newest values, as text in mm."""

    table: str = "–"
    relative: str = "–"
    origin: str = ""
    """From where they count."""


@dataclass(frozen=True, slots=True)
class LiveEstimate:
    """What is known of the run while its motion dies away: rows as in a result, and what waiting brings."""

    rows: tuple[ResultRow, ...] = ()
    note: str = ""


@dataclass(frozen=True, slots=True)
class RunForm:
    """What the operator says about the next tests, as typed; conditions by the names of `Conditions`."""

    operator: str = ""
    note: str = ""
    """Of the next run alone."""
    count: str = "1"
    temperature_c: str = ""
    humidity_percent: str = ""
    plate_id: str = ""
    contact_id: str = ""
    surface_preparation: str = ""
    run_in_number: str = ""


@dataclass(frozen=True, slots=True)
class RunChoices:
    """What the next runs are."""

    series: str
    all_series: tuple[str, ...]
    series_hint: str = ""
    series_fixed: bool = False
    form: RunForm = RunForm()
    summary: str = ""
    """The form in a line."""
    form_error: str = ""
    editable: bool = True


@dataclass(frozen=True, slots=True)
class PlanState:
    """The series plan: each series with what is done of it, and the plan as typed."""

    progress: tuple[SeriesProgress, ...] = ()
    text: str = ""
    error: str = ""

    @property
    def planned(self) -> int:
        """Runs in all."""
        return sum(one.planned for one in self.progress)

    @property
    def done(self) -> int:
        """Those of them that are there."""
        return sum(min(one.done, one.planned) for one in self.progress)


@dataclass(frozen=True, slots=True)
class PendingDecision:
    """A run waits for what is to become of it; `note` is to be stored with it, whatever that is."""

    note: str = ""


class Action(StrEnum):
    """What can be done next."""

    TARE = "tare"
    ARM = "arm"
    STOP = "stop"
    NEXT = "next"
    """Keep the run, if there is one to decide about, and go on."""
    REPEAT = "repeat"
    DISCARD = "discard"


class Cue(StrEnum):
    """What the operator may want to hear."""

    PULL = "pull"
    HOLD = "hold"
    LET_GO = "let-go"
    RELEASED = "released"
    RESULT = "result"
    TROUBLE = "trouble"


@dataclass(frozen=True, slots=True)
class RecordState:
    """The whole screen. `allowed` are the actions possible now, `primary` the one that comes next."""

    guidance: Guidance
    choices: RunChoices
    status_bar: StatusBar = StatusBar()
    traces: Traces = field(default_factory=Traces)
    readings: LiveReadings = LiveReadings()
    live_estimate: LiveEstimate = LiveEstimate()
    result: Result | None = None
    decision: PendingDecision | None = None
    progress: Progress | None = None
    plan: PlanState = PlanState()
    status_message: Chip = EMPTY_CHIP
    """What became of the last run, or of what was asked for, and what is noted while nothing is recorded."""
    undo: str = ""
    """What can be taken back."""
    cue: Cue | None = None
    allowed: frozenset[Action] = frozenset()
    primary: Action | None = None
    connected: bool = False


class RecordEvents(Protocol):
    """What the Record screen tells its presenter."""

    def tare(self) -> None:
        """Read both gauges from where they stand."""

    def untare(self) -> None:
        """Read them by the calibration again."""

    def arm(self) -> None:
        """Record the next pullback."""

    def stop(self) -> None:
        """End the recording now."""

    def next(self) -> None:
        """Keep the run, and make ready for the next."""

    def repeat(self) -> None:
        """Move the run to the trash and record the same series again."""

    def discard(self) -> None:
        """Move the run to the trash."""

    def undo(self) -> None:
        """Take the last decision back."""

    def set_note(self, note: str) -> None:
        """Remark on the run that is to be decided about."""

    def connect_device(self) -> None:
        """Go where a device is connected."""

    def choose_series(self, code: str) -> None:
        """Series of the next run."""

    def set_form(self, form: RunForm) -> None:
        """Take what was filled in about the next tests."""

    def set_plan(self, text: str) -> bool:
        """Plan anew; False where the text is no plan."""

    def set_plot_width(self, pixels: int) -> None:
        """Width of the plots."""
