"""Calibration of a gauge: curve through counts and displacements, gain, zero, and their uncertainties."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.polynomial import Polynomial
from scipy.special import stdtrit

from analysis.arrays import Floats
from analysis.calibration.points import POLYNOMIAL_DEGREES, CalibrationError, CalibrationPoints
from analysis.formatting import format_number
from analysis.quantities import BudgetLine, BudgetSource, Quantity, ResultWarning, result_warning
from messages.i18n import N_
from messages.message import message

_REACH = 0.5  # a polynomial is extrapolated to its zero by this share of the span of readings at most


@dataclass(frozen=True, eq=False, slots=True)
class CalibrationCurve:
    """A polynomial displacement(count), fitted by least squares."""

    polynomial: Polynomial  # m of count
    covariance: Floats  # (p, p) float64: of the coefficients in the polynomial's window, for a scatter of 1 m
    scatter_m: float  # standard deviation of the points about the curve (m)
    degrees_of_freedom: int

    @property
    def ends(self) -> Floats:
        """Smallest and largest count fitted, (2,)."""
        return np.asarray(self.polynomial.domain, dtype=np.float64)

    def standard_uncertainty(self, counts: Floats) -> Floats:
        """Standard uncertainty of the curve at `counts` (k,), in units of the scatter, (k,)."""
        rows = self._rows(counts)
        variance: Floats = np.einsum("ij,jk,ik->i", rows, self.covariance, rows)
        return np.sqrt(variance)

    def chord_standard_uncertainty(self) -> float:
        """Standard uncertainty of the difference between both ends, in units of the scatter."""
        low, high = self._rows(self.ends)
        return float(np.sqrt((high - low) @ self.covariance @ (high - low)))

    def zero_count(self) -> float:
        """Count at displacement 0. Raises CalibrationError where a polynomial does not reach it."""
        if self.polynomial.degree() == 1:
            return float(np.real(self.polynomial.roots()[0]))
        low, high = self.ends
        reach = _REACH * (high - low)
        roots = self.polynomial.roots()
        real = np.real(roots[np.abs(np.imag(roots)) <= 1e-9 * (high - low)])
        near = real[(real >= low - reach) & (real <= high + reach)]
        if not len(near):
            raise CalibrationError(
                "the dial's zero is too far from its readings for a polynomial of degree"
                " {degree}. Set the dial to 0 where the table rests and begin again, or use"
                " degree 1",
                degree=self.polynomial.degree(),
            )
        zero = float(near[np.argmin(np.abs(near - np.clip(near, low, high)))])
        low, high = min(low, zero), max(high, zero)
        slopes = self.polynomial.deriv()(np.linspace(low, high, 201))
        if slopes.min() * slopes.max() <= 0.0:
            raise CalibrationError(
                "the polynomial of degree {degree} turns back between counts {low} and {high}."
                " Use a lower degree, or take more readings",
                degree=self.polynomial.degree(),
                low=format_number(low, 7),
                high=format_number(high, 7),
            )
        return zero

    def _rows(self, counts: Floats) -> Floats:
        offset, scale = self.polynomial.mapparms()
        return np.vander(offset + scale * counts, len(self.polynomial.coef), increasing=True)


def fit_curve(counts: Floats, displacement_m: Floats, degree: int) -> CalibrationCurve:
    """Fit displacements (n,) over counts (n,) by least squares; counts have no error.

    For a straight line this is the method of JCGM 100, H.3.

    Raises CalibrationError for too few points, or counts that are alike.
    """
    if len(counts) < degree + 2:
        raise CalibrationError(
            "{count} steps are too few for degree {degree}. Take at least {least}, better twice that",
            count=len(counts),
            degree=degree,
            least=degree + 2,
        )
    domain = np.array([counts.min(), counts.max()])
    frame = Polynomial(np.zeros(degree + 1), domain=domain)
    offset, scale = frame.mapparms()
    rows = np.vander(offset + scale * counts, degree + 1, increasing=True)
    coefficients, _, rank, _ = np.linalg.lstsq(rows, displacement_m, rcond=None)
    if rank <= degree:
        raise CalibrationError(
            "the counts are too much alike for degree {degree}. Move the table further, or use"
            " a lower degree",
            degree=degree,
        )
    left = displacement_m - rows @ coefficients
    freedom = len(counts) - degree - 1
    return CalibrationCurve(
        Polynomial(coefficients, domain=domain),
        np.linalg.inv(rows.T @ rows),
        float(np.sqrt(left @ left / freedom)),
        freedom,
    )


@dataclass(frozen=True, slots=True)
class GaugeCharacteristics:
    """Performance characteristics of a gauge (m); None where the readings do not determine them."""

    nonlinearity_m: float
    """Largest deviation from the curve at any step on the way up or down, averaged over the rounds. It
    includes the hysteresis."""
    hysteresis_m: float | None  # largest difference between up and down at one step, mean over the rounds
    repeatability_m: float | None  # pooled standard deviation of a step in one direction between rounds
    zero_drift_m: float | None  # difference between the last and the first reading at the lowest step


def gauge_characteristics(readings: CalibrationPoints, residual_m: Floats) -> GaugeCharacteristics:
    """Characteristics from the residuals (n,), dial reading minus curve (m)."""
    steps = readings.steps()
    cells = [
        (step, way, residual_m[(steps == step) & (readings.direction == way)])
        for step in np.unique(steps)
        for way in (1, -1)
    ]
    means = {(step, way): float(cell.mean()) for step, way, cell in cells if len(cell)}
    loops = [
        abs(mean - means[step, -1]) for (step, way), mean in means.items() if way == 1 and (step, -1) in means
    ]
    repeated = [cell for _, _, cell in cells if len(cell) > 1]
    freedom = sum(len(cell) - 1 for cell in repeated)
    squares = sum(float(np.sum((cell - cell.mean()) ** 2)) for cell in repeated)
    lowest = residual_m[steps == 0]
    return GaugeCharacteristics(
        max(abs(mean) for mean in means.values()),
        max(loops, default=None),
        math.sqrt(squares / freedom) if freedom else None,
        float(lowest[0] - lowest[-1]) if len(lowest) > 1 else None,
    )


def step_means(readings: CalibrationPoints) -> tuple[Floats, Floats]:
    """Mean counts and mean displacement (m) of each step; up and down have equal weight."""
    steps = readings.steps()
    means = []
    for step in np.unique(steps):
        ways = [(steps == step) & (readings.direction == way) for way in (1, -1)]
        both = [(readings.counts[at].mean(), readings.dial_m[at].mean()) for at in ways if at.any()]
        means.append(np.mean(both, axis=0))
    counts, dial_m = np.array(means).T
    return counts, dial_m


_DOUBTFUL: Final = 8.0  # median absolute residuals: 5 standard deviations, no chance in a calibration
_SQRT12: Final = math.sqrt(12.0)
_NORMAL_95: Final = 1.959963984540054  # half of a normal 95 % interval in standard uncertainties


@dataclass(frozen=True, slots=True)
class DialGauge:
    """Dial gauge that measures the displacements."""

    resolution_m: float = 1e-5  # to which it is read (m); the reading error is rectangular, ± half of it
    standard_uncertainty_m: float | None = None  # reproducible error by its certificate (m)

    def __post_init__(self) -> None:
        for name, value in (
            ("resolution", self.resolution_m),
            ("standard uncertainty", self.standard_uncertainty_m),
        ):
            if value is not None and not 0.0 <= value < math.inf:
                raise CalibrationError(
                    "dial {name} {value:g} m must be a finite number, 0 or above",
                    name=message(name),
                    value=value,
                )

    @property
    def reading_uncertainty_m(self) -> float:
        """Standard uncertainty of reading it once (JCGM 100, 4.3.7)."""
        return self.resolution_m / _SQRT12


@dataclass(frozen=True, eq=False, slots=True)
class Calibration:
    """displacement = x + polynomial[0] x^2 + polynomial[1] x^3, with x = gain (count - zero)."""

    gain_m_per_count: Quantity  # the 95 % intervals count the degrees of freedom (JCGM 100, G.4)
    zero_count: Quantity
    polynomial: tuple[float, ...]  # 1/m, 1/m^2; empty for a line
    zero_standard_uncertainty_m: float  # of the displacement at `zero_count`
    displacement_standard_uncertainty_m: float
    """Largest combined one of a displacement within the readings (m), without sources that are not stated."""
    characteristics: GaugeCharacteristics
    scatter_m: float  # standard deviation of the steps about the curve (m)
    points: CalibrationPoints
    residual_m: Floats  # (n,) float64: dial reading minus curve (m)
    budget: tuple[BudgetLine, ...]  # of `gain_m_per_count` (relative), `zero` and `displacement` (m)
    warnings: tuple[ResultWarning, ...]

    @property
    def gain_relative_standard_uncertainty(self) -> float:
        """Of the span of displacements between the first and last step."""
        return self.gain_m_per_count.standard_uncertainty / abs(self.gain_m_per_count.value)

    @property
    def gain_relative_normal_uncertainty(self) -> float:
        """Standard uncertainty of the normal distribution with the same 95 % interval.

        For uses of the gain without its degrees of freedom.
        """
        low, high = self.gain_m_per_count.interval_95
        return 0.5 * (high - low) / _NORMAL_95 / abs(self.gain_m_per_count.value)

    def displacement_m(self, counts: Floats) -> Floats:
        linear = self.gain_m_per_count.value * (counts - self.zero_count.value)
        return linear * np.polynomial.polynomial.polyval(linear, (1.0, *self.polynomial))


def calibrate(points: CalibrationPoints, dial: DialGauge | None = None, degree: int = 1) -> Calibration:
    """Fit a line (degree 1) or polynomial (2, 3) to readings, with uncertainties by JCGM 100.

    The curve is fitted to the means of the steps: readings at one step share the errors of gauge and dial
    gauge there, and repeats do not reduce them. Certificate errors of the dial gauge are independent at both
    ends of its travel.

    Raises CalibrationError for too few steps, a degree that is not offered, or a polynomial that does not
    suit the readings.
    """
    if degree not in POLYNOMIAL_DEGREES:
        raise CalibrationError("degree {degree} is not offered. Use 1 for a line, 2 or 3", degree=degree)
    dial = dial or DialGauge()
    curve = fit_curve(*step_means(points), degree)
    zero = curve.zero_count()
    residual = points.dial_m - curve.polynomial(points.counts)
    characteristics = gauge_characteristics(points, residual)
    gain, bends = _about(curve, zero)
    shares = _contributions(curve, zero, dial, characteristics)
    freedom = curve.degrees_of_freedom
    return Calibration(
        _quantity(gain, abs(gain), shares["gain_m_per_count"], freedom, "m/count"),
        _quantity(zero, 1.0 / abs(gain), shares["zero"], freedom, "count"),
        bends,
        _combined(shares["zero"]),
        _combined(shares["displacement"]),
        characteristics,
        curve.scatter_m,
        points,
        residual,
        tuple(BudgetLine(source, name, size) for name, of in shares.items() for source, size in of.items()),
        tuple(_warnings(points, residual, dial, characteristics)),
    )


def _about(curve: CalibrationCurve, zero: float) -> tuple[float, tuple[float, ...]]:
    """Gain at the zero (m/count), and the coefficients of higher powers of gain (count - zero)."""
    slopes, factor = curve.polynomial, 1.0
    taylor = []
    for order in range(1, curve.polynomial.degree() + 1):
        slopes, factor = slopes.deriv(), factor * order
        taylor.append(float(slopes(zero)) / factor)
    gain = taylor[0]
    return gain, tuple(term / gain**power for power, term in enumerate(taylor[1:], start=2))


def _contributions(
    curve: CalibrationCurve, zero: float, dial: DialGauge, characteristics: GaugeCharacteristics
) -> dict[str, dict[BudgetSource, float]]:
    """Each source's standard uncertainty of gain (relative), zero and displacement (m)."""
    # Few steps may lie on a line by chance; the resolution of the dial is the lower limit.
    scatter_m = max(curve.scatter_m, dial.reading_uncertainty_m)
    span_m = float(abs(np.diff(curve.polynomial(curve.ends))[0]))
    certificate_m = math.nan if dial.standard_uncertainty_m is None else dial.standard_uncertainty_m
    drift_m = abs(characteristics.zero_drift_m or 0.0) / _SQRT12
    at = np.linspace(curve.ends[0], curve.ends[1], 21)
    at_zero = float(curve.standard_uncertainty(np.array([zero]))[0])
    return {
        "gain_m_per_count": {
            BudgetSource.READINGS: scatter_m * curve.chord_standard_uncertainty() / span_m,
            BudgetSource.DIAL_GAUGE: math.sqrt(2.0) * certificate_m / span_m,
        },
        "zero": {
            BudgetSource.READINGS: scatter_m * at_zero,
            BudgetSource.DIAL_GAUGE: certificate_m,
            BudgetSource.ZERO_DRIFT: drift_m,
        },
        "displacement": {
            BudgetSource.READINGS: scatter_m * float(curve.standard_uncertainty(at).max()),
            BudgetSource.DIAL_GAUGE: certificate_m,
            BudgetSource.ZERO_DRIFT: drift_m,
            BudgetSource.NONLINEARITY: characteristics.nonlinearity_m / math.sqrt(3.0),
            BudgetSource.REPEATABILITY: characteristics.repeatability_m or 0.0,
        },
    }


def _combined(shares: dict[BudgetSource, float]) -> float:
    return math.hypot(*(value for value in shares.values() if not math.isnan(value)))


def _quantity(
    value: float, scale: float, shares: dict[BudgetSource, float], freedom: int, unit: str
) -> Quantity:
    """Quantity with the interval of the effective degrees of freedom (JCGM 100, G.2b).

    Of the sources (in units of 1 / `scale`) the readings alone have few degrees of freedom.
    """
    combined = _combined(shares)
    share = shares[BudgetSource.READINGS] / combined if combined else 0.0
    effective = freedom / share**4 if share > 1e-3 else math.inf
    half = float(stdtrit(min(effective, 1e6), 0.975)) * scale * combined
    return Quantity(value, scale * combined, (value - half, value + half), unit)


def _warnings(
    readings: CalibrationPoints, residual_m: Floats, dial: DialGauge, characteristics: GaugeCharacteristics
) -> Iterator[ResultWarning]:
    usual_m = max(float(np.median(np.abs(residual_m))), dial.reading_uncertainty_m)
    for place in np.flatnonzero(np.abs(residual_m) > _DOUBTFUL * usual_m):
        yield result_warning(
            "reading-doubtful",
            "reading {place}, {dial_m:.4g} mm, is {residual_m:+.3f} mm off the curve. Check it for a"
            " misread turn of the dial",
            place=place + 1,
            dial_m=readings.dial_m[place] * 1e3,
            residual_m=residual_m[place] * 1e3,
        )
    if dial.standard_uncertainty_m is None:
        template = N_("the dial gauge's own uncertainty is not stated and not counted.")
        yield result_warning("dial-uncertainty-not-stated", template)
    if characteristics.hysteresis_m is None:
        template = N_("hysteresis cannot be determined without readings up and down.")
        yield result_warning("one-way-only", template)
    if characteristics.repeatability_m is None:
        yield result_warning("one-round-only", "repeatability cannot be determined from one round.")
