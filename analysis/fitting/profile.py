"""Intervals from the shape of chi-square itself, for parameters about which it is not a parabola."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.least_squares import covariance
from analysis.fitting.problem import FitProblem
from analysis.fitting.search import Fit
from analysis.laws.law import FrictionLaw

CHI_SQUARE_RISE_95 = 3.841458820694124
"""Rise of chi-square at the ends of a 95 % interval."""
_QUADRATIC = 0.15
"""Relative deviation from that rise up to which a parabola is good enough."""
_DISTANCES = (0.1, 0.25, 0.5, 0.8, 1.2, 1.7, 2.4, 3.2)
"""Where chi-square is looked at, in units of the reach of a parabola."""
_HOPELESS = 14.0
"""Rise from which on a density of exp(-rise / 2) adds nothing to the interval."""
_FINE = 2001
_STEPS = 8


@dataclass(frozen=True, slots=True)
class ProfileInterval:
    """Distribution of a parameter about which chi-square is no parabola.

    Attributes
    ----------
    below, above : float
        From the fitted value to the ends of the shortest 95 % interval.
    deviation : float
        Standard deviation.
    """

    below: float
    above: float
    deviation: float


@dataclass(frozen=True, eq=False, slots=True)
class Profile:
    """Chi-square along one parameter, the others refined; those with prior knowledge stay as fitted.

    Attributes
    ----------
    problem : Problem
    parameters : (16,) float64
        The fit.
    follow : (16,) float64
        How the others follow a step of one in the parameter, by a parabola.
    deviation : float
        Standard uncertainty of the parameter by the noise, the known parameters being as fitted.
    white : float
        Its variance over that by white noise as stated.
    """

    problem: FitProblem
    law: FrictionLaw
    parameter: int
    parameters: Floats
    follow: Floats
    deviation: float
    white: float

    @classmethod
    def from_fit(cls, problem: FitProblem, fit: Fit, parameter: int, white: float) -> Self:
        """Profile about a fit, the noise's variance being `white` times that stated."""
        still = np.where(np.isinf(problem.prior_deviation), np.inf, 0.0)
        fixed = replace(problem, prior_mean=fit.parameters, prior_deviation=still)
        unknown = np.isinf(problem.prior_deviation[fit.free])
        columns, _ = covariance(fit.normal_matrix[np.ix_(unknown, unknown)])
        own = int(np.flatnonzero(fit.free[unknown] == parameter)[0])
        follow = np.zeros(len(fit.parameters))
        follow[fit.free[unknown]] = columns[own] / columns[own, own]
        deviation = float(np.sqrt(white * columns[own, own]))
        return cls(fixed, fit.law, parameter, fit.parameters, follow, deviation, white)

    def interval(self) -> ProfileInterval | None:
        """Distribution by the profile; None where a parabola will do."""
        if all(
            abs(self._rise(side, follow=True) / CHI_SQUARE_RISE_95 - 1.0) < _QUADRATIC for side in (-1.0, 1.0)
        ):
            return None
        below, above = self._side(-1.0), self._side(1.0)
        shares, rises = zip(*below[::-1], (0.0, 0.0), *above, strict=True)
        reach = float(np.sqrt(CHI_SQUARE_RISE_95)) * self.deviation
        return distribution(reach * np.array(shares), np.array(rises))

    def _side(self, side: float) -> list[tuple[float, float]]:
        """Rises on one side of the fit, until there is no hope of less."""
        found = []
        for distance in _DISTANCES:
            rise = self._lowest_rise(side * distance)
            found.append((side * distance, rise))
            if rise > _HOPELESS and distance > 1.0:
                break
        return found

    def _lowest_rise(self, share: float) -> float:
        rise = self._rise(share, follow=True)
        return rise if rise <= CHI_SQUARE_RISE_95 else min(rise, self._rise(share, follow=False))

    def _rise(self, share: float, *, follow: bool) -> float:
        """Rise of chi-square with the parameter held off its value, in units of the true noise.

        `share` is the distance in units of that at which a parabola rises enough.
        """
        shift = share * float(np.sqrt(CHI_SQUARE_RISE_95)) * self.deviation
        start = self.parameters.copy()
        start += shift * self.follow if follow else 0.0
        start[self.parameter] = self.parameters[self.parameter] + shift
        there = self.problem.minimise(start, self.law, _STEPS, fixed=self.parameter)
        if there.parameters[self.parameter] != start[self.parameter]:  # the law does not allow that value
            return np.inf
        free = self.problem.free_parameters(self.law)
        return (there.cost - self.problem.quadratic_model(self.parameters, self.law, free).cost) / self.white


def distribution(shifts: Floats, rises: Floats) -> ProfileInterval:
    """Distribution of a parameter whose chi-square rises by `rises` (n,) at `shifts` (n,), both sides of 0.

    Its density is exp(-rise / 2), the root of the rise a polygon.
    """
    grid = np.linspace(shifts[0], shifts[-1], _FINE)
    rise = np.interp(grid, shifts, np.sqrt(np.maximum(np.minimum(rises, 1e4) - rises.min(), 0.0))) ** 2
    density = np.exp(-0.5 * rise) / np.exp(-0.5 * rise).sum()
    likeliest = np.argsort(rise, kind="stable")
    kept = likeliest[: int(np.searchsorted(np.cumsum(density[likeliest]), 0.95)) + 1]
    mean = float(grid @ density)
    deviation = float(np.sqrt((grid - mean) ** 2 @ density))
    return ProfileInterval(max(0.0, -float(grid[kept].min())), max(0.0, float(grid[kept].max())), deviation)
