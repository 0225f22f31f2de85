"""What an analysis takes: one pullback test as arrays, with what is known about the stand and gauges."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from messages.message import MessageError


class AnalysisError(MessageError):
    """Root of the analysis errors. The message names the value, the fault and the remedy."""


class RecordError(AnalysisError, ValueError):
    """A record that cannot be analysed as it stands."""


@dataclass(frozen=True, slots=True)
class GaugeUncertainty:
    """What is known of one gauge beyond its readings; None means "not stated"."""

    gain_relative: float | None = None  # relative standard uncertainty of the gain (1)
    nonlinearity_m: float = 0.0
    """Largest deviation from the calibration line (m); taken as a rectangular half-width."""
    delay_s: float = 0.0
    """Known lateness of this channel (s, positive: its samples are older than their time stamp) and its
    standard uncertainty (s)."""
    delay_s_uncertainty: float = 0.0
    range_m: float | None = None  # readings beyond +-range_m are clipped (m)


@dataclass(frozen=True, slots=True)
class StandMasses:
    """Masses and gravity with their standard uncertainties (SI)."""

    table_mass_kg: float
    plate_mass_kg: float
    table_mass_uncertainty_kg: float = 0.0
    plate_mass_uncertainty_kg: float = 0.0
    gravity_m_per_s2: float = 9.81
    gravity_uncertainty_m_per_s2: float = 0.0


@dataclass(frozen=True, eq=False)
class Record:
    """One pullback test, ready for analysis."""

    time_s: NDArray[np.float64]
    """(n,) float64: strictly increasing, not necessarily even, seconds on the device's or nominal clock."""
    table_displacement_m: NDArray[np.float64]
    """(n,) float64: gauge 1, table against base (m); NaN where absent."""
    relative_displacement_m: NDArray[np.float64] | None
    """(n,) float64 or None: gauge 2, plate against table (m); NaN where absent; None without a second
    gauge."""
    masses: StandMasses
    pullback_m: float | None = None  # nominal pullback of the series (m), where one is known
    table_overload: NDArray[np.bool_] | None = None
    """(n,) bool or None: true where the device flagged the channel as overloaded: such samples are not
    fitted."""
    relative_overload: NDArray[np.bool_] | None = None
    clock_scale: float = 1.0  # true seconds for one second of `time_s`
    clock_scale_uncertainty: float = 0.0
    table_gauge: GaugeUncertainty = GaugeUncertainty()
    relative_gauge: GaugeUncertainty = GaugeUncertainty()
    gauge_2_measures_plate: bool = False
    """True when gauge 2 measures the plate against the base instead of against the table."""

    def replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`."""
        return replace(self, **changes)
