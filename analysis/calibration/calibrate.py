"""From readings to a calibration: gain, zero, curve, their uncertainties, and how good the gauge is."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtrit

from analysis.arrays import Floats
from analysis.calibration.curve import CalibrationCurve, fit_curve
from analysis.calibration.merits import GaugeCharacteristics, gauge_characteristics, step_means
from analysis.calibration.points import POLYNOMIAL_DEGREES, CalibrationError, CalibrationPoints
from analysis.quantities import BudgetLine, Quantity, ResultWarning

_DOUBTFUL: Final = 8.0
"""A reading so many times further off than is usual (median absolute residual) is doubted."""
_SQRT12: Final = math.sqrt(12.0)
_NORMAL_95: Final = 1.959963984540054
"""Half of a 95 % interval in standard uncertainties of a normal distribution."""


@dataclass(frozen=True, slots=True)
class DialGauge:
    """What the displacements are measured with.

    Attributes
    ----------
    resolution_m : float
        To which it is read (m); the reading errs evenly within half of it to each side.
    standard_uncertainty_m : float, optional
        Of its certificate (m): what is off in a like manner whenever it stands at a place. None: not stated.
    """

    resolution_m: float = 1e-5
    standard_uncertainty_m: float | None = None

    def __post_init__(self) -> None:
        for name, value in (
            ("resolution", self.resolution_m),
            ("standard uncertainty", self.standard_uncertainty_m),
        ):
            if value is not None and not 0.0 <= value < math.inf:
                raise CalibrationError(f"dial {name} {value:g} m must be a finite number, 0 or above")

    @property
    def reading_uncertainty_m(self) -> float:
        """Standard uncertainty of reading it once (JCGM 100, 4.3.7)."""
        return self.resolution_m / _SQRT12


@dataclass(frozen=True, eq=False, slots=True)
class Calibration:
    """displacement = x + polynomial[0] x^2 + polynomial[1] x^3, with x = gain (count - zero).

    Attributes
    ----------
    gain_m_per_count, zero_count : Quantity
        The 95 % intervals count the degrees of freedom (JCGM 100, G.4).
    polynomial : tuple of float
        1/m, 1/m^2; empty for a line.
    zero_standard_uncertainty_m : float
        Of the displacement at `zero_count`.
    displacement_standard_uncertainty_m : float
        Combined, of a displacement anywhere within the readings, the largest (m); without what is not
        stated of the dial gauge.
    merits : Merits
    scatter_m : float
        Standard deviation of the steps about the curve (m).
    readings : Readings
    residual_m : (n,) float64
        Dial reading minus curve (m).
    budget : tuple of BudgetLine
        Of `gain_m_per_count` (relative), `zero` and `displacement` (m).
    cautions : tuple of Caution
    """

    gain_m_per_count: Quantity
    zero_count: Quantity
    polynomial: tuple[float, ...]
    zero_standard_uncertainty_m: float
    displacement_standard_uncertainty_m: float
    characteristics: GaugeCharacteristics
    scatter_m: float
    points: CalibrationPoints
    residual_m: Floats
    budget: tuple[BudgetLine, ...]
    warnings: tuple[ResultWarning, ...]

    @property
    def gain_relative_standard_uncertainty(self) -> float:
        """Of the span of displacements between the first and last step."""
        return self.gain_m_per_count.standard_uncertainty / abs(self.gain_m_per_count.value)

    @property
    def gain_relative_normal_uncertainty(self) -> float:
        """Standard uncertainty of the normal distribution that has the same 95 % interval.

        For whoever takes the gain on without its degrees of freedom.
        """
        low, high = self.gain_m_per_count.interval_95
        return 0.5 * (high - low) / _NORMAL_95 / abs(self.gain_m_per_count.value)

    def displacement_m(self, counts: Floats) -> Floats:
        """Displacements (k,) that counts (k,) stand for (m)."""
        linear = self.gain_m_per_count.value * (counts - self.zero_count.value)
        return linear * np.polynomial.polynomial.polyval(linear, (1.0, *self.polynomial))


def calibrate(points: CalibrationPoints, dial: DialGauge | None = None, degree: int = 1) -> Calibration:
    """Fit a line (degree 1) or polynomial (2, 3) to readings, with uncertainties by JCGM 100.

    The curve goes through the means of the steps, since readings at one step share what the gauge and the
    dial gauge are off there: repeating a step does not make the curve surer of it. What the certificate
    of the dial gauge leaves open is taken as independent at both ends of its travel.

    Raises
    ------
    CalibrationError
        Too few steps, a degree that is not offered, or a polynomial that does not suit the readings.
    """
    if degree not in POLYNOMIAL_DEGREES:
        raise CalibrationError(f"degree {degree} is not offered. Use 1 for a line, 2 or 3")
    dial = dial or DialGauge()
    curve = fit_curve(*step_means(points), degree)
    zero = curve.zero_count()
    residual = points.dial_m - curve.polynomial(points.counts)
    merits = gauge_characteristics(points, residual)
    gain, bends = _about(curve, zero)
    ledger = _budget(curve, zero, dial, merits)
    relative, zero_m, whole = (
        _combined(ledger, name) for name in ("gain_m_per_count", "zero", "displacement")
    )
    return Calibration(
        _quantity(
            gain,
            abs(gain) * relative,
            _share(ledger, "gain_m_per_count"),
            curve.degrees_of_freedom,
            "m/count",
        ),
        _quantity(zero, zero_m / abs(gain), _share(ledger, "zero"), curve.degrees_of_freedom, "count"),
        bends,
        zero_m,
        whole,
        merits,
        curve.scatter_m,
        points,
        residual,
        ledger,
        tuple(_warnings(points, residual, dial, merits)),
    )


def _about(curve: CalibrationCurve, zero: float) -> tuple[float, tuple[float, ...]]:
    """Gain at the zero (m/count), and the bends in powers of gain (count - zero)."""
    slopes, factor = curve.polynomial, 1.0
    taylor = []
    for order in range(1, curve.polynomial.degree() + 1):
        slopes, factor = slopes.deriv(), factor * order
        taylor.append(float(slopes(zero)) / factor)
    gain = taylor[0]
    return gain, tuple(term / gain**power for power, term in enumerate(taylor[1:], start=2))


def _budget(
    curve: CalibrationCurve, zero: float, dial: DialGauge, merits: GaugeCharacteristics
) -> tuple[BudgetLine, ...]:
    """Each source's standard uncertainty of gain (relative), zero and displacement (m)."""
    # Few steps can lie on a line by luck; they were read no better than the dial can be.
    scatter_m = max(curve.scatter_m, dial.reading_uncertainty_m)
    span_m = float(abs(np.diff(curve.polynomial(curve.ends))[0]))
    certificate_m = math.nan if dial.standard_uncertainty_m is None else dial.standard_uncertainty_m
    drift_m = abs(merits.zero_drift_m or 0.0) / _SQRT12
    at = np.linspace(curve.ends[0], curve.ends[1], 21)
    return (
        BudgetLine("readings", "gain_m_per_count", scatter_m * curve.chord_standard_uncertainty() / span_m),
        BudgetLine("dial gauge", "gain_m_per_count", math.sqrt(2.0) * certificate_m / span_m),
        BudgetLine("readings", "zero", scatter_m * float(curve.standard_uncertainty(np.array([zero]))[0])),
        BudgetLine("dial gauge", "zero", certificate_m),
        BudgetLine("zero drift", "zero", drift_m),
        BudgetLine("readings", "displacement", scatter_m * float(curve.standard_uncertainty(at).max())),
        BudgetLine("dial gauge", "displacement", certificate_m),
        BudgetLine("zero drift", "displacement", drift_m),
        BudgetLine("non-linearity and hysteresis", "displacement", merits.nonlinearity_m / math.sqrt(3.0)),
        BudgetLine("repeatability", "displacement", merits.repeatability_m or 0.0),
    )


def _combined(ledger: tuple[BudgetLine, ...], name: str) -> float:
    lines = [line.standard_uncertainty for line in ledger if line.contribution_to == name]
    return math.sqrt(sum(value * value for value in lines if not math.isnan(value)))


def _share(ledger: tuple[BudgetLine, ...], name: str) -> float:
    """Share of the readings, which alone have few degrees of freedom, in a standard uncertainty."""
    whole = _combined(ledger, name)
    readings = _combined(tuple(line for line in ledger if line.source == "readings"), name)
    return readings / whole if whole else 0.0


def _quantity(value: float, uncertainty: float, share: float, freedom: int, unit: str) -> Quantity:
    """Quantity whose interval is as wide as the effective degrees of freedom ask (JCGM 100, G.2b)."""
    effective = freedom / share**4 if share > 1e-3 else math.inf
    half = float(stdtrit(min(effective, 1e6), 0.975)) * uncertainty
    return Quantity(value, uncertainty, (value - half, value + half), unit)


def _warnings(
    readings: CalibrationPoints, residual_m: Floats, dial: DialGauge, merits: GaugeCharacteristics
) -> list[ResultWarning]:
    usual_m = max(float(np.median(np.abs(residual_m))), dial.reading_uncertainty_m)
    cautions = [
        ResultWarning(
            "reading-doubtful",
            f"reading {place + 1}, {readings.dial_m[place] * 1e3:.4g} mm, is"
            f" {residual_m[place] * 1e3:+.3f} mm off the curve. Check it for a misread turn of the dial",
        )
        for place in np.flatnonzero(np.abs(residual_m) > _DOUBTFUL * usual_m)
    ]
    if dial.standard_uncertainty_m is None:
        cautions.append(
            ResultWarning(
                "dial-uncertainty-not-stated",
                "the dial gauge's own uncertainty is not stated and not counted.",
            )
        )
    if merits.hysteresis_m is None:
        cautions.append(
            ResultWarning("one-way-only", "hysteresis cannot be told without readings up and down.")
        )
    if merits.repeatability_m is None:
        cautions.append(ResultWarning("one-round-only", "repeatability cannot be told from one round."))
    return cautions
