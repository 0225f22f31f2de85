"""What an analysis takes: one pullback test as arrays, with what is known about the stand and gauges."""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.quantities import ResultWarning, result_warning
from messages.i18n import N_
from messages.message import MessageError, joined, message


class AnalysisError(MessageError):
    """Root of the analysis errors. The message names the value, the fault and the remedy."""


class RecordError(AnalysisError, ValueError):
    """A record that cannot be analysed as it stands."""


_BESSEL_CORNERS = (1.0, 1.36165, 1.75567, 2.11392, 2.42741, 2.70340, 2.95172, 3.17962)
"""-3 dB frequencies (rad/s) of the Bessel filters of order 1 to 8 whose delay is 1 s; scipy.signal.bessel."""


@dataclass(frozen=True, slots=True)
class GaugeFilter:
    """Low-pass filter between a gauge and its readings."""

    kind: Literal["rc", "butterworth", "bessel", "sinc"]
    """`rc`: `order` equal stages; `sinc`: `order` moving averages, each over the same window."""
    order: int
    corner_hz: float  # frequency at which the amplitude has fallen by 3 dB
    corner_relative_uncertainty: float = 0.0

    @property
    def delay_s(self) -> float:
        """Group delay at low frequency (s)."""
        order, corner = self.order, 2.0 * np.pi * self.corner_hz
        match self.kind:
            case "rc":
                return float(order * np.sqrt(2.0 ** (1.0 / order) - 1.0) / corner)
            case "butterworth":
                return float(1.0 / np.sin(0.5 * np.pi / order) / corner)
            case "bessel":
                return _BESSEL_CORNERS[order - 1] / corner
        return float(0.5 * order * _sinc_corner(order) / self.corner_hz)


def _sinc_corner(order: int) -> float:
    """Frequency times window at which sinc^order has fallen by 3 dB, by Newton's method."""
    share = 2.0 ** (-0.5 / order)
    x = np.sqrt(6.0 * (1.0 - share))  # of sin(x) / x = 1 - x^2 / 6
    for _ in range(6):
        x -= (np.sin(x) / x - share) / ((np.cos(x) - np.sin(x) / x) / x)
    return float(x / np.pi)


GAIN_NOT_STATED = 0.003
"""Relative standard uncertainty of a gain for which none is stated: of a calibration by a dial gauge, as in
config/gauges.toml."""


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
    filter: GaugeFilter | None = None  # None where none is stated; its delay comes on top of `delay_s`

    @property
    def lateness_s(self) -> float:
        """Stated delay and that of the filter (s)."""
        return self.delay_s + (self.filter.delay_s if self.filter else 0.0)

    @property
    def lateness_s_uncertainty(self) -> float:
        """Standard uncertainty of the lateness (s)."""
        known = self.filter
        share_s = known.corner_relative_uncertainty * known.delay_s if known else 0.0
        return float(np.hypot(self.delay_s_uncertainty, share_s))

    def nonlinearity_at(
        self, reading_m: NDArray[np.float64], centre_m: float, reach_m: float
    ) -> NDArray[np.float64]:
        """Deviation from the calibration line at readings (n,), by one standard uncertainty of it (m).

        The largest deviation is stated, its shape is not. It is taken as the cubic whose best line is zero
        (T3 of Chebyshev) over the range of the gauge, for which a calibration holds; over `reach_m` on both
        sides of `centre_m` where no range is stated.
        """
        if self.range_m is None:
            share = (reading_m - centre_m) / max(reach_m, 1e-300)
        else:
            share = reading_m / self.range_m
        return np.asarray(self.nonlinearity_m / np.sqrt(3.0) * (4.0 * share**3 - 3.0 * share))


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
    clock_is_timed: bool = True
    """False where nothing is known of the clock's error, and `clock_scale_uncertainty` is 0 for that."""
    table_gauge: GaugeUncertainty = GaugeUncertainty()
    relative_gauge: GaugeUncertainty = GaugeUncertainty()
    gauge_2_measures_plate: bool = False
    """True when gauge 2 measures the plate against the base instead of against the table."""
    release: int | None = None
    """Which release is analysed, from 1 in order of time; None: the one with the longest decay."""
    decay_end_s: float | None = None
    """Time in the base of `time_s` until which the motion is free; None: as long as the readings show it."""

    @classmethod
    def from_arrays(
        cls,
        time_s: ArrayLike,
        table_displacement_m: ArrayLike,
        relative_displacement_m: ArrayLike | None = None,
        *,
        table_mass_kg: float,
        plate_mass_kg: float,
        gain_uncertainties: tuple[float | None, float | None] = (None, None),
        clock_uncertainty: float | None = None,
    ) -> Self:
        """Record of arrays of equal length (n,); NaN stands for an absent reading.

        `gain_uncertainties` are the relative standard uncertainties of both gauges' gains, and
        `clock_uncertainty` is that of the rate of the clock; None is "not stated", which an identification
        warns of. Masses count as exact unless `replace(masses=StandMasses(...))` states their uncertainties.
        All other fields are set by `replace`, too. Raises RecordError.
        """
        channels = {"time_s": time_s, "table_displacement_m": table_displacement_m}
        if relative_displacement_m is not None:
            channels["relative_displacement_m"] = relative_displacement_m
        arrays = {name: _float_array(name, values) for name, values in channels.items()}
        for name, array in arrays.items():
            if len(array) != len(arrays["time_s"]):
                raise RecordError(
                    "{name} has {values} values for {times} of time_s. Give one for each time",
                    name=name,
                    values=len(array),
                    times=len(arrays["time_s"]),
                )
        for name, mass in (("table_mass_kg", table_mass_kg), ("plate_mass_kg", plate_mass_kg)):
            if not 0.0 < mass < float("inf"):
                template = "{name} is {mass!r}: give a positive number of kilograms"
                raise RecordError(template, name=name, mass=mass)
        return cls(
            arrays["time_s"],
            arrays["table_displacement_m"],
            arrays.get("relative_displacement_m"),
            StandMasses(float(table_mass_kg), float(plate_mass_kg)),
            clock_scale_uncertainty=clock_uncertainty or 0.0,
            clock_is_timed=clock_uncertainty is not None,
            table_gauge=GaugeUncertainty(gain_relative=gain_uncertainties[0]),
            relative_gauge=GaugeUncertainty(gain_relative=gain_uncertainties[1]),
        )

    def replace(self, **changes: Any) -> Self:
        """Return a copy with `changes`."""
        return replace(self, **changes)

    def between(self, first_s: float, last_s: float) -> Self:
        """Return the samples of a span, both ends included. Raises RecordError where there are none."""
        kept = (self.time_s >= first_s) & (self.time_s <= last_s)
        if not kept.any():
            template = N_(
                "the record spans {start_s:.6g} to {end_s:.6g} s, of which nothing is left {part}. Choose"
                " another part."
            )
            part = message("from {first_s:g} to {last_s:g} s", first_s=first_s, last_s=last_s)
            if math.isinf(first_s):
                part = message("until {last_s:g} s", last_s=last_s)
            elif math.isinf(last_s):
                part = message("from {first_s:g} s", first_s=first_s)
            raise RecordError(template, start_s=self.time_s[0], end_s=self.time_s[-1], part=part)
        columns = {
            field.name: column[kept]
            for field in fields(self)
            if isinstance(column := getattr(self, field.name), np.ndarray)
        }
        return self.replace(**columns)


def _float_array(name: str, values: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordError("{name} is no array of numbers ({fault})", name=name, fault=str(error)) from error
    if array.ndim != 1:
        template = "{name} has {axes} axes. Give one channel as an array with one axis"
        raise RecordError(template, name=name, axes=array.ndim)
    return array


def unstated_gain_warnings(table: GaugeUncertainty, relative: GaugeUncertainty | None) -> list[ResultWarning]:
    """Warn of gauges whose gain has no stated uncertainty; `relative` is None without gauge 2."""
    gauges = {1: table} if relative is None else {1: table, 2: relative}
    unstated = [number for number, gauge in gauges.items() if gauge.gain_relative is None]
    if not unstated:
        return []
    names = joined([message("gauge {gauge}", gauge=number) for number in unstated], " and ")
    template = N_("the gain of {gauges} has no stated uncertainty, so that its part is missing.")
    return [result_warning("gain-not-stated", template, gauges=names)]
