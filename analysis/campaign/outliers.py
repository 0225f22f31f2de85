"""Runs that are too far from the other runs of their series to be chance."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from analysis.arrays import Floats
from analysis.campaign.between_runs import RepeatedValues
from analysis.campaign.scatter import estimate_scatter

_CHANCE = 0.01
"""That any run of a quantity is named though none is out of place."""
_DOUBT = 0.003
"""Chance up to which a suspect stands out of its own series too. Where series scatter by factors of 3, one is
named wrongly in one of six sets of 12 x 3; one 20 standard deviations off is found in 96 %."""
_TIE = 1e-6


def find_outliers(repeats: RepeatedValues) -> NDArray[np.bool_]:
    """Tell which values (n,) lie too far from the mean of the others of their series.

    The farthest is held against Student's distribution for all series' scatter without it (externally
    studentised residual), by Bonferroni over all runs; where it is out, the search goes on without it.
    What was found so is then held against the scatter of its own series without it, as far as it differs
    from that of the others (`scatters`). Of two runs that differ, nobody can tell which is wrong: both are
    named.
    """
    suspects = _suspects(repeats)
    far = np.zeros(len(suspects), dtype=bool)
    for place in np.flatnonzero(suspects).tolist():
        far[place] = _own_series_chance(repeats, suspects, place) < _DOUBT
    return far


def _suspects(repeats: RepeatedValues) -> NDArray[np.bool_]:
    """Values that lie too far if all series scatter alike."""
    far = np.zeros(len(repeats.values), dtype=bool)
    while True:
        places = np.flatnonzero(~far)
        some = repeats.select(~far)
        distances = _distances(some)
        farthest = int(np.argmax(distances))
        mine = some.series == some.series[farthest]
        ties = np.flatnonzero((distances >= (1.0 - _TIE) * distances[farthest]) & mine)
        if distances[farthest] == 0.0 or not _is_outlier(some, farthest, len(repeats.values)):
            return far
        far[places[ties if len(ties) == int(mine.sum()) else farthest]] = True


def _own_series_chance(repeats: RepeatedValues, suspects: NDArray[np.bool_], place: int) -> float:
    """Chance of a value so far from its mates, by the scatter that these and the other series show."""
    mates = (repeats.series == repeats.series[place]) & ~suspects
    if not mates.any():  # two runs that differ: each is held against the other
        mates = (repeats.series == repeats.series[place]) & (np.arange(len(suspects)) != place)
    kept = ~suspects | mates
    rest = repeats.select(kept)
    number = int(rest.series[np.flatnonzero(mates[kept])[0]])
    scatter = estimate_scatter([rest])[0][number]
    if scatter.degrees_of_freedom == 0.0:
        return 1.0
    weights = repeats.weights(scatter.between)
    mean = float(np.average(repeats.values[mates], weights=weights[mates]))
    spread = max(scatter.factor, _stated_fraction(repeats, weights, place))
    deviation = math.sqrt(spread * (1.0 / weights[place] + 1.0 / float(weights[mates].sum())))
    distance = abs(float(repeats.values[place]) - mean) / deviation
    return 2.0 * float(stdtr(scatter.degrees_of_freedom, -distance))


def _stated_fraction(repeats: RepeatedValues, weights: Floats, place: int) -> float:
    """What the run's stated variance is of the one that its weight stands for: scatter is no less."""
    return float(repeats.variances[place] * weights[place])


def _distances(repeats: RepeatedValues) -> Floats:
    """Distance of each value from its series' mean over its standard deviation; 0 where it is alone."""
    between = repeats.between_run_deviation()
    weights = repeats.weights(between)
    left = 1.0 / weights - 1.0 / np.bincount(repeats.series, weights)[repeats.series]
    alone = np.bincount(repeats.series)[repeats.series] == 1
    deviations = np.abs(repeats.values - repeats.means(between)[repeats.series])
    return np.where(alone, 0.0, deviations / np.sqrt(np.where(alone, 1.0, left)))


def _is_outlier(repeats: RepeatedValues, place: int, count: int) -> bool:
    """Hold one value against the mean of the others of its series, and the scatter of all others."""
    others = np.arange(len(repeats.values)) != place
    rest = repeats.select(others)
    degrees = rest.degrees_of_freedom
    if degrees == 0:
        return False
    between = rest.between_run_deviation()
    mates = others & (repeats.series == repeats.series[place])
    weights = repeats.weights(between)
    mean = float(np.average(repeats.values[mates], weights=weights[mates]))
    deviation = math.sqrt(1.0 / weights[place] + 1.0 / float(weights[mates].sum()))
    distance = abs(float(repeats.values[place]) - mean) / deviation
    return 2.0 * float(stdtr(degrees, -distance)) < _CHANCE / count
