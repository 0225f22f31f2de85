"""What the Identify screen shows, as values."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.presenters.results import Result, ResultRow
from app.presenters.screen import Progress

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class ChannelCurves:
    """One gauge: record and simulation (mm), residual (µm), each (n,); NaN where absent."""

    record_mm: FloatArray
    simulation_mm: FloatArray | None = None
    residual_um: FloatArray | None = None


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

    time_s: FloatArray
    time_title: str
    table: ChannelCurves
    relative: ChannelCurves | None = None
    slip: tuple[float, float] | None = None
    noise_um: float | None = None


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
    progress: Progress | None = None
    failure: str = ""


class IdentifyEvents(Protocol):
    """What the Identify screen tells its presenter."""

    def cancel(self) -> None:
        """Give up the analysis that is going on."""
