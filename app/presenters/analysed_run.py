"""One run with its identification, as plain values that travel from the analysis process to the screens."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.identification import Events, ModelSelection
from analysis.quantities import BudgetLine, Quantity, ResultWarning

Floats = NDArray[np.float64]
NO_EVENTS = Events()
AnalysisKind = Literal["two-mass", "one-mass"]
"""How many masses an analysis takes to have moved."""


@dataclass(frozen=True, eq=False, slots=True)
class Channel:
    """What one gauge read and what it should have read (m), NaN where absent; no `fit` without a model."""

    record_m: Floats
    fit_m: Floats | None = None

    @property
    def residual_m(self) -> Floats | None:
        return None if self.fit_m is None else self.record_m - self.fit_m


@dataclass(frozen=True, eq=False, slots=True)
class Kinematics:
    """Velocities and accelerations of the fitted motion, (n,) each at times in the base of the record."""

    time_s: Floats
    table_m: Floats
    relative_m: Floats
    table_m_per_s: Floats
    plate_m_per_s: Floats
    table_m_per_s2: Floats
    plate_m_per_s2: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Objective:
    """What a fit would leave over with other values of f_d, all else as fitted."""

    friction: Floats
    """Rising."""
    residual_m: Floats
    """Root mean square of what is left over, relative to the noise of each gauge."""
    fitted: float
    interval_95: tuple[float, float]

    def residual_at(self, friction: float) -> float:
        """Between the values that were worked out, a straight line."""
        return float(np.interp(friction, self.friction, self.residual_m))


@dataclass(frozen=True, eq=False, slots=True)
class AnalysedRun:
    """A stored run and what was found in it."""

    path: Path
    time_s: Floats
    """In the base of the record, as are `events`."""
    table: Channel
    relative: Channel | None
    """None without a second gauge."""
    results: dict[str, Quantity] = field(default_factory=dict)
    labels: dict[str, str | bool] = field(default_factory=dict)
    model: ModelSelection | None = None
    events: Events = NO_EVENTS
    cautions: tuple[ResultWarning, ...] = ()
    """results/labels/model/events/cautions: As in `analysis.identification.Identification`."""
    ended: str = ""
    """Why the recording ended, as stored."""
    budget: tuple[BudgetLine, ...] = ()
    """What the standard uncertainties consist of."""
    kinematics: Kinematics | None = None
    """None where no law without a running-in velocity was fitted."""
    objective: Objective | None = None
    """None where no f_d was found."""
    kind: AnalysisKind = "two-mass"
    slips: tuple[tuple[float, float], ...] = ()
    note: str = ""
    """As stored with the run."""
