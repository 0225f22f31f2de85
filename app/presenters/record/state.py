"""What the Record screen shows, as values, and what its view must be able to do."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from app.presenters.history import Polyline
from app.presenters.results import Result, ResultRow
from app.presenters.screen import NO_CHIP, Chip, Progress, Tone


@dataclass(frozen=True, slots=True)
class Header:
    """Always in sight: device, true rate, losses, gauges, disk."""

    device: str = "no device"
    rate: str = ""
    lost: Chip = NO_CHIP
    gauges: tuple[Chip, ...] = ()
    disk: Chip = NO_CHIP
    run: str = ""


class Progression(StrEnum):
    """Where a step of the stepper stands."""

    DONE = "done"
    NOW = "now"
    AHEAD = "ahead"


@dataclass(frozen=True, slots=True)
class Step:
    """One state of the pullback in the stepper."""

    name: str
    progression: Progression = Progression.AHEAD


@dataclass(frozen=True, slots=True)
class Target:
    """How far the table is pulled back, of how far it should be (mm, both positive)."""

    target_mm: float
    now_mm: float
    tolerance_mm: float

    @property
    def full_mm(self) -> float:
        """End of the bar: a little beyond the target, so that too far can be seen."""
        return 1.25 * self.target_mm

    @property
    def reached(self) -> bool:
        """Tell whether it may be held here."""
        return abs(self.now_mm - self.target_mm) <= self.tolerance_mm


@dataclass(frozen=True, slots=True)
class Guidance:
    """What the operator does now."""

    instruction: str
    detail: str = ""
    tone: Tone = Tone.PLAIN
    target: Target | None = None
    steps: tuple[Step, ...] = ()


Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Marks:
    """What is drawn over and under the traces. Times (s) on the axis shown, displacements in mm."""

    before_release: Span | None = None
    release_s: float | None = None
    slip: Span | None = None
    target_mm: float | None = None
    table_range_mm: float | None = None
    relative_range_mm: float | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Traces:
    """Both channels in mm against the shown time axis (s), from `span[0]` to `span[1]`.

    `table_limit_mm` and `relative_limit_mm` are the halves of the vertical axes.
    """

    table: Polyline = field(default_factory=Polyline.empty)
    relative: Polyline = field(default_factory=Polyline.empty)
    span: Span = (-10.0, 0.0)
    time_title: str = "time from now, s"
    table_limit_mm: float = 15.0
    relative_limit_mm: float = 15.0
    marks: Marks = Marks()


@dataclass(frozen=True, slots=True)
class Readings:
    """The newest values, as text in mm."""

    table: str = "–"
    relative: str = "–"


@dataclass(frozen=True, slots=True)
class Running:
    """What is known of the run while its motion dies away: rows as in a result, and what waiting brings."""

    rows: tuple[ResultRow, ...] = ()
    note: str = ""


@dataclass(frozen=True, slots=True)
class RunChoices:
    """What the operator says about the next run."""

    series: str
    all_series: tuple[str, ...]
    series_hint: str = ""
    series_fixed: bool = False
    operator: str = ""
    note: str = ""
    editable: bool = True


class Action(StrEnum):
    """What can be done next."""

    ARM = "arm"
    STOP = "stop"
    NEXT = "next"


@dataclass(frozen=True, slots=True)
class RecordState:
    """The whole screen. `allowed` are the actions possible now, `primary` the one that comes next."""

    guidance: Guidance
    choices: RunChoices
    header: Header = Header()
    traces: Traces = field(default_factory=Traces)
    readings: Readings = Readings()
    running: Running = Running()
    result: Result | None = None
    progress: Progress | None = None
    allowed: frozenset[Action] = frozenset()
    primary: Action | None = None
    connected: bool = False


class RecordEvents(Protocol):
    """What the Record screen tells its presenter."""

    def arm(self) -> None:
        """Record the next pullback."""

    def stop(self) -> None:
        """End the recording now."""

    def next(self) -> None:
        """Leave the result and make ready for the next run."""

    def connect_device(self) -> None:
        """Go where a device is connected."""

    def choose_series(self, code: str) -> None:
        """Series of the next run."""

    def set_operator(self, name: str) -> None:
        """Who records."""

    def set_note(self, note: str) -> None:
        """Remark kept with the next run."""

    def resized(self, pixels: int) -> None:
        """Width of the plots."""
