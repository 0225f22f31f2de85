"""What the Identify screen shows, as values."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.presenters.analysed_run import AnalysisKind
from app.presenters.base import EMPTY_CHIP, Chip, Progress
from app.presenters.identify.cursors import Cursor, Cursors
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
    """A run as it is drawn.

    Attributes
    ----------
    time_s : (n,) float64
        From release; from the start of the record where no release was found.
    time_title : str
    table : ChannelCurves
    relative : ChannelCurves or None
    no_relative : str
        Why there is no second gauge, where there is none.
    slips : tuple of (float, float)
        Spans of sliding on `time_s`.
    noise_um : float or None
        Standard deviation of the gauges' noise; the band drawn is twice as high, both ways.
    """

    time_s: Floats
    time_label: str
    table: ChannelCurves
    relative: ChannelCurves | None = None
    no_relative_reason: str = ""
    slips: tuple[tuple[float, float], ...] = ()
    noise_um: float | None = None


class PlotTab(StrEnum):
    """What the left side shows; the value is the title of the tab."""

    DISPLACEMENT = N_("Displacement")
    VELOCITY = N_("Velocity")
    ACCELERATION = N_("Acceleration")
    RELATIVE = N_("Relative acceleration")
    PHASE = N_("Phase plane")


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """Velocities and accelerations of the fitted motion; times as in `Curves`.

    Attributes
    ----------
    time_s : (n,) float64
    table_mm, relative_mm, table_mm_per_s, plate_mm_per_s, relative_mm_per_s : (n,) float64
    table_m_per_s2, plate_m_per_s2, relative_m_per_s2 : (n,) float64
    """

    time_s: Floats
    table_mm: Floats
    relative_mm: Floats
    table_mm_per_s: Floats
    plate_mm_per_s: Floats
    relative_mm_per_s: Floats
    table_m_per_s2: Floats
    plate_m_per_s2: Floats
    relative_m_per_s2: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Scan:
    """What is left over (µm) against f_d, all else as fitted; the handle can be drawn along `friction`."""

    friction: Floats
    residual_um: Floats
    fitted: float
    interval_95: tuple[float, float]


@dataclass(frozen=True, eq=False, slots=True)
class PlotLine:
    """Points of a line, (n,) each, with times as in `Curves`."""

    time_s: Floats
    value: Floats


@dataclass(frozen=True, eq=False, slots=True)
class ManualFit:
    """The simulation with f_d set by hand, as finely as it is drawn, and that in words.

    `simulations_mm` and `residuals_um` are those of the table, and of the second gauge if there is one.
    """

    friction: float
    description: str
    simulations_mm: tuple[PlotLine, ...]
    residuals_um: tuple[PlotLine, ...]


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One source of the standard uncertainty of f_d; `share` of the largest one, 0 to 1."""

    source: str
    value: str
    share: float


@dataclass(frozen=True, slots=True)
class ModelRow:
    """One friction law that was tried, as text.

    Attributes
    ----------
    name, friction : str
    ratio : str
        Residual over noise.
    verdict : Chip
    shown : bool
        Whether its curves and results are those on the screen.
    """

    name: str
    friction: str
    ratio: str
    status: Chip
    is_shown: bool = False


@dataclass(frozen=True, slots=True)
class ClassicalRow:
    """A classical figure beside the fitted one, as text."""

    symbol: str
    name: str
    classical: str
    fitted: str
    hint: str = ""


@dataclass(frozen=True, slots=True)
class IdentifyState:
    """The whole screen. With neither curves nor progress nor failure it is empty and says how to fill it.

    Attributes
    ----------
    gaps : Chip
        How much of the record is missing.
    no_scan : str
        Why there is no f_d to vary, where there is none.
    other_kind : Kind or None
        As what else the run can be analysed.
    """

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
    tab: PlotTab = PlotTab.DISPLACEMENT
    motion: Motion | None = None
    scan: Scan | None = None
    manual_fit: ManualFit | None = None
    cursors: Cursors | None = None
    alternative_kind: AnalysisKind | None = None
    progress: Progress | None = None
    failure: str = ""


class IdentifyEvents(Protocol):
    """What the Identify screen tells its presenter."""

    def cancel(self) -> None:
        """Give up the analysis that is going on."""

    def set_tab(self, side: PlotTab) -> None:
        """Show displacements, velocities, accelerations or the phase plane."""

    def set_visible_span(self, start_s: float, end_s: float, pixels: int) -> None:
        """The curves are drawn from here to there (as in `Curves`), so wide."""

    def set_friction(self, friction: float) -> None:
        """The handle was drawn to this f_d."""

    def poll(self) -> bool:
        """Take in what has been simulated; tells whether more is awaited."""

    def reset_friction(self) -> None:
        """Take the handle back to the fitted f_d."""

    def select_model(self, name: str) -> None:
        """Show curves and results of one of the laws that were tried."""

    def analyse_as_alternative(self) -> None:
        """Analyse as one mass what was analysed as two, or the other way round."""

    def toggle_cursors(self, span: tuple[float, float] | None = None) -> None:
        """Show two cursors within the times that are in sight, or of the whole run; or take them away."""

    def move_cursor(self, cursor: Cursor, at_s: float) -> None:
        """A cursor was drawn to this time."""

    def step_cursor(self, readings: int) -> None:
        """Move the cursor that was moved last by so many readings."""

    def activate_cursor(self, cursor: Cursor) -> None:
        """The keys move this cursor from now on."""
