"""An identified run as plain values, which the analysis process sends to the screens."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.identification import Events, ModelSelection
from analysis.plate.trends import FrictionBySlip
from analysis.quantities import BudgetLine, Quantity, ResultWarning

Floats = NDArray[np.float64]
NO_EVENTS = Events()
AnalysisKind = Literal["two-mass", "one-mass"]

AUTO_MODEL = "auto"


@dataclass(frozen=True, slots=True)
class AnalysisTask:
    """Request to identify a run: by the best friction law or a given one, as two masses or one."""

    path: str
    model: str = AUTO_MODEL
    kind: AnalysisKind = "two-mass"


@dataclass(frozen=True, eq=False, slots=True)
class Channel:
    """Record of one gauge and its fit (m), NaN where absent; no fit without a model."""

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
    """Residual for other values of f_d, with all other parameters as fitted."""

    friction: Floats  # rising
    residual_m: Floats  # root mean square of the residual, relative to the noise of each gauge
    fitted: float
    interval_95: tuple[float, float]

    def residual_at(self, friction: float) -> float:
        return float(np.interp(friction, self.friction, self.residual_m))


@dataclass(frozen=True, eq=False, slots=True)
class AnalysedRun:
    path: Path
    time_s: Floats
    """In the base of the record, as are `events`."""
    table: Channel
    relative: Channel | None
    """None without a second gauge."""
    unit: str = "m"  # of the readings, of which names say metres
    results: dict[str, Quantity] = field(default_factory=dict)
    labels: dict[str, str | bool] = field(default_factory=dict)
    model: ModelSelection | None = None
    events: Events = NO_EVENTS
    warnings: tuple[ResultWarning, ...] = ()
    ended: str = ""
    """Why the recording ended, as stored."""
    budget: tuple[BudgetLine, ...] = ()
    kinematics: Kinematics | None = None
    """None where no law without a running-in velocity was fitted."""
    objective: Objective | None = None  # None where no f_d was found
    kind: AnalysisKind = "two-mass"
    slips: tuple[tuple[float, float], ...] = ()
    note: str = ""
    friction_by_slip: FrictionBySlip | None = None  # None without friction from the plate alone
