"""State of the Identify screen."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum

import numpy as np
from numpy.typing import NDArray

from analysis.plate.trends import FrictionTrend
from app.presenters.analysed_run import AnalysisKind, Objective
from app.presenters.base import EMPTY_CHIP, Chip, Progress
from app.presenters.results import Result, ResultRow
from messages.i18n import N_

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ReadingUnit:
    """Unit of drawn values, and decimals of a value that is read off."""

    symbol: str
    decimals: int


@dataclass(frozen=True, eq=False, slots=True)
class ChannelCurves:
    """One gauge: record, simulation and residual in the units of `Curves`, each (n,); NaN where absent."""

    record: Floats
    simulation: Floats | None = None
    residual: Floats | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Curves:
    """A run for drawing."""

    time_s: Floats  # (n,) float64: from the release; without one, from the start of the record
    time_label: str
    channels: tuple[ChannelCurves, ...]
    """Of the table, then of gauge 2 if there is one."""
    unit: ReadingUnit
    residual_unit: ReadingUnit
    no_relative_reason: str = ""
    slips: tuple[tuple[float, float], ...] = ()
    """Start and end of each slip, in the times of `time_s`."""
    noise: float | None = None
    """Standard deviation of the noise of the gauges, as residuals. The band is ± 2 standard deviations."""
    fitted: tuple[float, float] = (-math.inf, math.inf)
    """From the release to the end of the free decay, in the times of `time_s`."""

    @property
    def fit_ends_early(self) -> bool:
        """Whether later readings were not fitted, because they were disturbed."""
        return self.fitted[1] < float(self.time_s[-1])


class PlotTab(StrEnum):
    """Tabs of plots; the value is the title."""

    DISPLACEMENT = N_("Displacement")
    VELOCITY = N_("Velocity")
    ACCELERATION = N_("Acceleration")
    RELATIVE = N_("Relative acceleration")
    PHASE = N_("Phase plane")
    FRICTION = N_("Friction by slip")


@dataclass(frozen=True, eq=False, slots=True)
class PlottedQuantity:
    """A plotted line that cursors read; times (n,) rise, values (n,) are NaN where missing."""

    symbol: str  # as rich text
    unit: str
    decimals: int  # of values that are read off
    time_s: Floats
    values: Floats


Motion = Mapping[PlotTab, tuple[PlottedQuantity, ...]]
"""Lines of the fitted motion by tab; on the phase plane each displacement is followed by its velocity."""


@dataclass(frozen=True, eq=False, slots=True)
class PlotLine:
    """Points of a line, (n,) each, decimated for drawing; times as in `Curves`."""

    time_s: Floats
    values: Floats


@dataclass(frozen=True, eq=False, slots=True)
class ManualFit:
    """Simulation with f_d set by hand: lines of the table, then of gauge 2 if there is one."""

    friction: float
    simulations: tuple[PlotLine, ...]
    residuals_um: tuple[PlotLine, ...]


@dataclass(frozen=True, eq=False, slots=True)
class SlipPlot:
    """Friction of slips against one covariate."""

    title: str  # slope, as rich text
    axis: str
    trend: FrictionTrend
    scale: float  # units of the axis in one SI unit of the trend


@dataclass(frozen=True, eq=False, slots=True)
class SlipPlots:
    plots: tuple[SlipPlot, ...]  # against sliding velocity, position and time
    statement: str


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
    values: tuple[tuple[float, ...], ...] = ()  # a row each for A and B; NaN beside a line
    cells: tuple[tuple[str, ...], ...] = ()
    """A row each for A, B and B − A: name, time, and the values with their units."""
    period: str = ""  # distance in periods, or its reciprocal

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
    """One fitted model, as text: its friction law, and the effects of the stand in words."""

    name: str  # by which it is chosen
    law: str
    friction: str
    ratio: str
    """Residual rms over noise rms."""
    status: Chip
    effects: str = ""
    is_shown: bool = False


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
    no_scan_reason: str = ""
    """Why f_d cannot be varied."""
    tab: PlotTab = PlotTab.DISPLACEMENT
    motion: Motion | None = None
    slip_plots: SlipPlots | None = None
    scan: Objective | None = None
    """Residual against f_d, all other parameters as fitted."""
    manual_fit: ManualFit | None = None
    manual_fit_text: str = ""
    cursors: Cursors | None = None
    alternative_kind: AnalysisKind | None = None
    """The other kind of analysis that is possible."""
    progress: Progress | None = None
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Span:
    """Drawn part of a run: times as in `Curves`, and width in pixels."""

    start_s: float
    end_s: float
    pixels: int
    origin_s: float
    """Time of the record that is drawn as 0."""
