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
        """Record minus fit."""
        return None if self.fit_m is None else self.record_m - self.fit_m


@dataclass(frozen=True, eq=False, slots=True)
class Kinematics:
    """Velocities and accelerations of the fitted motion, (n,) each at times in the base of the record.

    Attributes
    ----------
    time_s, table_m, relative_m, table_m_per_s, plate_m_per_s, table_m_per_s2, plate_m_per_s2 : (n,) float64
    """

    time_s: Floats
    table_m: Floats
    relative_m: Floats
    table_m_per_s: Floats
    plate_m_per_s: Floats
    table_m_per_s2: Floats
    plate_m_per_s2: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Objective:
    """What a fit would leave over with other values of f_d, all else as fitted.

    Attributes
    ----------
    friction : (n,) float64
        Rising.
    residual_m : (n,) float64
        Root mean square of what is left over, relative to the noise of each gauge.
    fitted : float
    interval_95 : (float, float)
    """

    friction: Floats
    residual_m: Floats
    fitted: float
    interval_95: tuple[float, float]

    def residual_at(self, friction: float) -> float:
        """Between the values that were worked out, a straight line."""
        return float(np.interp(friction, self.friction, self.residual_m))


@dataclass(frozen=True, eq=False, slots=True)
class AnalysedRun:
    """A stored run and what was found in it.

    Attributes
    ----------
    path : Path
    time_s : (n,) float64
        In the base of the record, as are `events`.
    table : Channel
    relative : Channel or None
        None without a second gauge.
    results, labels, model, events, cautions
        As in `analysis.identification.Identification`.
    ended : str
        Why the recording ended, as stored.
    budget : tuple of BudgetLine
        What the standard uncertainties consist of.
    kinematics : Kinematics or None
        None where no law without a running-in velocity was fitted.
    objective : Objective or None
        None where no f_d was found.
    note : str
        As stored with the run.
    """

    path: Path
    time_s: Floats
    table: Channel
    relative: Channel | None
    results: dict[str, Quantity] = field(default_factory=dict)
    labels: dict[str, str | bool] = field(default_factory=dict)
    model: ModelSelection | None = None
    events: Events = NO_EVENTS
    cautions: tuple[ResultWarning, ...] = ()
    ended: str = ""
    budget: tuple[BudgetLine, ...] = ()
    kinematics: Kinematics | None = None
    objective: Objective | None = None
    kind: AnalysisKind = "two-mass"
    slips: tuple[tuple[float, float], ...] = ()
    note: str = ""
