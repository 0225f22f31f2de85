"""The line or low polynomial through counts and displacements, with its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from analysis.arrays import Floats
from analysis.calibration.points import CalibrationError
from analysis.formatting import format_number

_REACH = 0.5
"""A polynomial is asked for its zero no further beyond the readings than this share of their span."""


@dataclass(frozen=True, eq=False, slots=True)
class CalibrationCurve:
    """A polynomial displacement(count), fitted by least squares.

    Attributes
    ----------
    polynomial : Polynomial
        m of count.
    covariance : (p, p) float64
        Of the coefficients in the polynomial's own window, for a scatter of 1 m.
    scatter_m : float
        Standard deviation of the points about the curve, with `freedom` degrees of freedom (m).
    freedom : int
    """

    polynomial: Polynomial
    covariance: Floats
    scatter_m: float
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
                f"the dial's zero is too far from its readings for a polynomial of degree"
                f" {self.polynomial.degree()}. Set the dial to 0 where the table rests and begin again,"
                " or use degree 1"
            )
        zero = float(near[np.argmin(np.abs(near - np.clip(near, low, high)))])
        self._check_one_to_one(min(low, zero), max(high, zero))
        return zero

    def _check_one_to_one(self, low: float, high: float) -> None:
        slopes = self.polynomial.deriv()(np.linspace(low, high, 201))
        if slopes.min() * slopes.max() <= 0.0:
            raise CalibrationError(
                f"the polynomial of degree {self.polynomial.degree()} turns back between counts"
                f" {format_number(low, 7)} and {format_number(high, 7)}. Use a lower degree, or take more readings"
            )

    def _rows(self, counts: Floats) -> Floats:
        offset, scale = self.polynomial.mapparms()
        return np.vander(offset + scale * counts, len(self.polynomial.coef), increasing=True)


def fit_curve(counts: Floats, displacement_m: Floats, degree: int) -> CalibrationCurve:
    """Least squares of displacements (n,) over counts (n,), which are taken for exact.

    For a straight line this is the method of JCGM 100, H.3.

    Raises
    ------
    CalibrationError
        There are not more points than coefficients and one, or their counts are alike.
    """
    if len(counts) < degree + 2:
        raise CalibrationError(
            f"{len(counts)} steps are too few for degree {degree}. Take at least {degree + 2},"
            " better twice that"
        )
    domain = np.array([counts.min(), counts.max()])
    frame = Polynomial(np.zeros(degree + 1), domain=domain)
    offset, scale = frame.mapparms()
    rows = np.vander(offset + scale * counts, degree + 1, increasing=True)
    coefficients, _, rank, _ = np.linalg.lstsq(rows, displacement_m, rcond=None)
    if rank <= degree:
        raise CalibrationError(
            f"the counts are too much alike for degree {degree}. Move the table further,"
            " or use a lower degree"
        )
    left = displacement_m - rows @ coefficients
    freedom = len(counts) - degree - 1
    return CalibrationCurve(
        Polynomial(coefficients, domain=domain),
        np.linalg.inv(rows.T @ rows),
        float(np.sqrt(left @ left / freedom)),
        freedom,
    )
