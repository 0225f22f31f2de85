"""State of the Identify screen, and its tasks."""

from dataclasses import dataclass
from enum import Enum, StrEnum

import numpy as np
from numpy.typing import NDArray

from app.presenters.analysed_run import AUTO_MODEL, AnalysisKind, AnalysisTask
from app.presenters.base import EMPTY_CHIP, Chip, Progress
from app.presenters.results import Result, ResultRow
from messages.i18n import N_

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class ChannelCurves:
    """One gauge: record and simulation (mm), residual (µm), each (n,); NaN where absent."""

    record_mm: Floats
    simulation_mm: Floats | None = None
    residual_um: Floats | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Curves:
    """A run for drawing.

    Attributes
    ----------
    no_relative : str
        Why there is no second gauge; empty if there is one.
    """

    time_s: Floats
    """(n,) float64: from the release; without one, from the start of the record."""
    time_label: str
    table: ChannelCurves
    relative: ChannelCurves | None = None
    no_relative_reason: str = ""
    slips: tuple[tuple[float, float], ...] = ()
    """Start and end of each slip, in the times of `time_s`."""
    noise_um: float | None = None
    """Standard deviation of the noise of the gauges. The drawn band is ± 2 standard deviations."""


class PlotTab(StrEnum):
    """Tabs of plots; the value is the title."""

    DISPLACEMENT = N_("Displacement")
    VELOCITY = N_("Velocity")
    ACCELERATION = N_("Acceleration")
    RELATIVE = N_("Relative acceleration")
    PHASE = N_("Phase plane")


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """Velocities and accelerations of the fitted motion; times as in `Curves`."""

    time_s: Floats
    """(n,) float64."""
    table_mm: Floats
    """(n,) float64."""
    relative_mm: Floats
    table_mm_per_s: Floats
    plate_mm_per_s: Floats
    relative_mm_per_s: Floats
    table_m_per_s2: Floats
    """(n,) float64."""
    plate_m_per_s2: Floats
    relative_m_per_s2: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Scan:
    """Residual rms (µm) against f_d, all other parameters as fitted. The handle moves along `friction`."""

    friction: Floats
    residual_um: Floats
    fitted: float
    interval_95: tuple[float, float]


@dataclass(frozen=True, eq=False, slots=True)
class PlotLine:
    """Points of a line, (n,) each; times as in `Curves`."""

    time_s: Floats
    value: Floats


@dataclass(frozen=True, eq=False, slots=True)
class ManualFit:
    """Simulation with f_d set by hand, decimated for drawing.

    `simulations_mm` and `residuals_um` hold the table, then gauge 2 if there is one.
    """

    friction: float
    description: str
    simulations_mm: tuple[PlotLine, ...]
    residuals_um: tuple[PlotLine, ...]


class Cursor(Enum):
    """The two cursors; the value is the name."""

    A = "A"
    B = "B"


@dataclass(frozen=True, slots=True)
class Cursors:
    """Times of the cursors (s), the one that the keys move, and the values there, as text."""

    a_s: float
    b_s: float
    active: Cursor = Cursor.B
    symbols: tuple[str, ...] = ()
    """Symbols of the values on the current tab, as rich text."""
    values: tuple[tuple[float, ...], ...] = ()
    """A row each for A and B; NaN beside a line."""
    cells: tuple[tuple[str, ...], ...] = ()
    """A row each for A, B and B − A: name, time, and the values with their units."""
    period: str = ""
    """Distance in periods, or its reciprocal."""

    def at(self, cursor: Cursor) -> float:
        return self.a_s if cursor is Cursor.A else self.b_s


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One contribution to the standard uncertainty of f_d; `share` of the largest one, 0 to 1."""

    source: str
    value: str
    share: float


@dataclass(frozen=True, slots=True)
class ModelRow:
    """One fitted friction law, as text."""

    name: str
    friction: str
    ratio: str
    """Residual rms over noise rms."""
    status: Chip
    is_shown: bool = False
    """Whether its curves and results are shown."""


@dataclass(frozen=True, slots=True)
class ClassicalRow:
    """A classical estimate beside the fitted value, as text."""

    symbol: str
    name: str
    classical: str
    fitted: str
    hint: str = ""


@dataclass(frozen=True, slots=True)
class IdentifyState:
    """State of the screen. It is empty without curves, progress and failure."""

    title: str = ""
    curves: Curves | None = None
    result: Result | None = None
    rows: tuple[ResultRow, ...] = ()
    models: tuple[ModelRow, ...] = ()
    model_note: Chip = EMPTY_CHIP
    classical: tuple[ClassicalRow, ...] = ()
    budget: tuple[BudgetRow, ...] = ()
    missing_data: Chip = EMPTY_CHIP
    """Share of missing samples."""
    no_scan_reason: str = ""
    """Why f_d cannot be varied."""
    tab: PlotTab = PlotTab.DISPLACEMENT
    motion: Motion | None = None
    scan: Scan | None = None
    manual_fit: ManualFit | None = None
    cursors: Cursors | None = None
    alternative_kind: AnalysisKind | None = None
    """The other kind of analysis that is possible."""
    progress: Progress | None = None
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Span:
    """Visible part of a run: times of the record, and width in pixels."""

    start_s: float
    end_s: float
    pixels: int


@dataclass(frozen=True, slots=True)
class SimulateFriction:
    """Simulate a run with another f_d, decimated for a span."""

    path: str
    friction: float
    span: Span
    model: str = AUTO_MODEL


@dataclass(frozen=True, slots=True)
class EstimateClassical:
    """Estimate the parameters of a run by the methods of the paper."""

    path: str
    model: str = AUTO_MODEL


@dataclass(frozen=True, eq=False, slots=True)
class DecimatedLine:
    """A line decimated to a few points a pixel, (n,) each; times of the record."""

    time_s: Floats
    value_m: Floats


@dataclass(frozen=True, eq=False, slots=True)
class ManualSimulation:
    """Simulation with an f_d set by hand, and its residual."""

    friction: float
    simulations: tuple[DecimatedLine, ...]
    """Table, then relative displacement if there is a second gauge."""
    residuals: tuple[DecimatedLine, ...]


@dataclass(frozen=True, slots=True)
class ClassicalFigures:
    """Estimates by the methods of the paper; None if a record does not allow one."""

    period_s: float | None
    log_decrement: float | None
    log_decrement_uncertainty: float | None
    cycles: int
    frictions_of_residual: tuple[float, ...]
    friction_of_paper: float | None


IdentifyTask = SimulateFriction | EstimateClassical | AnalysisTask
