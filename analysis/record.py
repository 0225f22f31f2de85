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
    """What is known of one gauge beyond its readings; None means "not stated".

    Attributes
    ----------
    gain_relative : float or None
        Relative standard uncertainty of the gain (1).
    nonlinearity_m : float
        Largest deviation from the calibration line (m); taken as a rectangular half-width.
    delay_s, delay_s_uncertainty : float
        Known lateness of this channel (s, positive: its samples are older than their time stamp)
        and its standard uncertainty (s).
    range_m : float or None
        Readings beyond +-range_m are clipped (m).
    """

    gain_relative: float | None = None
    nonlinearity_m: float = 0.0
    delay_s: float = 0.0
    delay_s_uncertainty: float = 0.0
    range_m: float | None = None


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
    """One pullback test, ready for analysis.

    Attributes
    ----------
    time_s : (n,) float64
        Strictly increasing, not necessarily even, seconds on the device's or nominal clock.
    table_displacement_m : (n,) float64
        Gauge 1, table against base (m); NaN where absent.
    relative_displacement_m : (n,) float64 or None
        Gauge 2, plate against table (m); NaN where absent; None without a second gauge.
    masses : StandMasses
    pullback_m : float or None
        Nominal pullback of the series (m), where one is known.
    table_overload, relative_overload : (n,) bool or None
        True where the device flagged the channel as overloaded: such samples are not fitted.
    clock_scale, clock_scale_uncertainty : float
        True seconds for one second of `time_s`, and its standard uncertainty.
    table_gauge, relative_gauge : GaugeUncertainty
    gauge_2_measures_plate : bool
        True when gauge 2 measures the plate against the base instead of against the table.
    """

    time_s: NDArray[np.float64]
    table_displacement_m: NDArray[np.float64]
    relative_displacement_m: NDArray[np.float64] | None
    masses: StandMasses
    pullback_m: float | None = None
    table_overload: NDArray[np.bool_] | None = None
    relative_overload: NDArray[np.bool_] | None = None
    clock_scale: float = 1.0
    clock_scale_uncertainty: float = 0.0
    table_gauge: GaugeUncertainty = GaugeUncertainty()
    relative_gauge: GaugeUncertainty = GaugeUncertainty()
    gauge_2_measures_plate: bool = False

    def replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`."""
        return replace(self, **changes)
