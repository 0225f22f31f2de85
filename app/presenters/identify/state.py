"""What the Identify screen shows, as values."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.presenters.results import Result, ResultRow
from app.presenters.screen import Progress

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
    slip : (float, float) or None
        Span of sliding on `time_s`.
    noise_um : float or None
        Standard deviation of the gauges' noise; the band drawn is twice as high, both ways.
    """

    time_s: Floats
    time_title: str
    table: ChannelCurves
    relative: ChannelCurves | None = None
    slip: tuple[float, float] | None = None
    noise_um: float | None = None


class Side(StrEnum):
    """What the left side shows; the value is the title of the tab."""

    DISPLACEMENT = "Displacements"
    VELOCITY = "Velocities"
    ACCELERATION = "Accelerations"
    PHASE = "Phase plane"


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
class HandSet:
    """The simulation with f_d set by hand: curves (mm), what they leave over (µm), and that in words."""

    friction: float
    residual_um: float
    words: str
    table: ChannelCurves
    relative: ChannelCurves | None


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One source of the standard uncertainty of f_d; `share` of the largest one, 0 to 1."""

    source: str
    value: str
    share: float


@dataclass(frozen=True, slots=True)
class ModelRow:
    """One friction law that was tried, as text."""

    name: str
    friction: str
    residual: str
    bic: str
    chosen: bool = False


@dataclass(frozen=True, slots=True)
class IdentifyState:
    """The whole screen. With neither curves nor progress nor failure it is empty and says how to fill it."""

    title: str = ""
    curves: Curves | None = None
    result: Result | None = None
    rows: tuple[ResultRow, ...] = ()
    models: tuple[ModelRow, ...] = ()
    budget: tuple[BudgetRow, ...] = ()
    side: Side = Side.DISPLACEMENT
    motion: Motion | None = None
    scan: Scan | None = None
    hand: HandSet | None = None
    progress: Progress | None = None
    failure: str = ""


class IdentifyEvents(Protocol):
    """What the Identify screen tells its presenter."""

    def cancel(self) -> None:
        """Give up the analysis that is going on."""

    def show_side(self, side: Side) -> None:
        """Show displacements, velocities, accelerations or the phase plane."""

    def set_friction(self, friction: float) -> None:
        """The handle was drawn to this f_d."""

    def fit_again(self) -> None:
        """Take the handle back to the fitted f_d."""
