"""One run with its identification, as plain values that travel from the analysis process to the screens."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.identification import Events, ModelVerdict
from analysis.quantities import Caution, Quantity

FloatArray = NDArray[np.float64]
NO_EVENTS = Events()


@dataclass(frozen=True, eq=False, slots=True)
class Channel:
    """What one gauge read and what it should have read (m), NaN where absent; no `fit` without a model."""

    record_m: FloatArray
    fit_m: FloatArray | None = None

    @property
    def residual_m(self) -> FloatArray | None:
        """Record minus fit."""
        return None if self.fit_m is None else self.record_m - self.fit_m


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
    """

    path: Path
    time_s: FloatArray
    table: Channel
    relative: Channel | None
    results: dict[str, Quantity] = field(default_factory=dict)
    labels: dict[str, str | bool] = field(default_factory=dict)
    model: ModelVerdict | None = None
    events: Events = NO_EVENTS
    cautions: tuple[Caution, ...] = ()
    ended: str = ""
