"""Check that the stated masses agree with the motion.

While the plate slides, the table swings alone, with c/m1 instead of c/(m1 + m2). So the record determines the
ratio of the masses. Where no law explains a record, a wrong ratio may be the cause. The ratio is estimated
from the first slips and must then explain the whole record.
"""

from dataclasses import replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import covariance
from analysis.fitting.search import Fit, Search, build_problem, fit_at_minimum, initial_guess
from analysis.formatting import format_number
from analysis.laws.catalogue import COMPARED_LAWS, WIDEST_LAW
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay
from analysis.quantities import ResultWarning, result_warning
from analysis.record import Record, RecordError
from analysis.results.joint_fit import JointFit
from messages.message import message

_LEAST, _MOST, _STEP = 0.2, 5.0, 1.26  # table masses tried, over the one given
_ALIKE = 0.05  # relative deviation of the ratio of the masses up to which they may be each other's
_WINDOW_PERIODS = 1.5  # the first slips determine the ratio of the masses best
_TOLERANCE = 1e-2
_LOOSE = 0.5  # relative standard deviation with which the table mass is free
_SHARE = 0.01  # a relative difference of the table mass below this gets no warning
_SIGMAS = 5.0  # a table mass is contradicted by a difference of so many standard uncertainties
_BETTER = 0.1  # the excess of chi-square must shrink to this share


def mass_warnings(joint: JointFit) -> list[ResultWarning]:
    """Warn where another table mass explains most of what the best law leaves unexplained."""
    record, decay = joint.record, joint.decay
    if decay.plateau is None or decay.relative is None:
        return []
    given = record.masses.table_mass_kg
    try:
        search, points = _search(record, decay, _best_factor(record, decay))
        fits = search.fit_all(COMPARED_LAWS, search.find_minima(points))
    except RecordError:  # nor with other masses
        return []
    best = min(fits, key=lambda fit: fit.bic)
    mass = best.value(Parameter.TABLE_MASS)
    loose = search.problem.with_prior(Parameter.TABLE_MASS, mass, _LOOSE * mass)
    best = fit_at_minimum(loose, best.law, loose.minimise(best.parameters, best.law))
    deviation = _deviation(best)
    excess = [fit.chi_square - search.problem.sample_count for fit in (joint.chosen, best)]
    found = best.value(Parameter.TABLE_MASS)
    if excess[1] > _BETTER * excess[0] or abs(found - given) < max(_SHARE * given, _SIGMAS * deviation):
        return []
    plate = record.masses.plate_mass_kg
    swapped = abs(found * given / plate**2 - 1.0) < _ALIKE and abs(plate / given - 1.0) > _ALIKE
    return [
        result_warning(
            "masses-contradict-motion",
            "a table of {found} kg under the plate of {plate} kg would explain this motion, one of {given} kg"
            " does not. Check both masses{swapped}: friction and stiffness depend on them.",
            found=format_number(found, 4),
            plate=format_number(plate, 4),
            given=format_number(given, 4),
            swapped=message(", they look swapped") if swapped else "",
        )
    ]


def _deviation(fit: Fit) -> float:
    """Standard uncertainty (kg) of a free table mass; infinite where the motion does not determine it."""
    if not fit.determines(Parameter.TABLE_MASS):
        return float("inf")
    variance, _ = covariance(fit.normal_matrix)
    at = int(np.flatnonzero(fit.free == Parameter.TABLE_MASS)[0])
    return float(np.sqrt(variance[at, at]))


def _best_factor(record: Record, decay: FreeDecay) -> float:
    """Share of the given table mass at which the first slips are explained best."""
    from scipy.optimize import minimize_scalar  # late: slow to import, and seldom needed

    def misfit(logarithm: float) -> float:
        search, (point,) = _search(record, decay, float(np.exp(logarithm)))
        end_s = float(point[Parameter.RELEASE]) + _WINDOW_PERIODS * decay.period_s
        window = search.window(end_s)
        return fit_at_minimum(window, WIDEST_LAW, window.minimise(point, WIDEST_LAW)).chi_square

    # As far as the table mass at which both masses would be swapped.
    most = max(_MOST, _STEP * (record.masses.plate_mass_kg / record.masses.table_mass_kg) ** 2)
    count = 1 + round(np.log(most / _LEAST) / np.log(_STEP))
    logarithms = np.log(np.geomspace(_LEAST, most, count))
    at = min(max(int(np.argmin([misfit(x) for x in logarithms])), 1), len(logarithms) - 2)
    bounds = float(logarithms[at - 1]), float(logarithms[at + 1])
    found = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": _TOLERANCE})
    return float(np.exp(found.x))


def _search(record: Record, decay: FreeDecay, factor: float) -> tuple[Search, list[Floats]]:
    """Search with another table mass, and the point fitted to its first slip."""
    masses = replace(record.masses, table_mass_kg=factor * record.masses.table_mass_kg)
    problem = build_problem(record.replace(masses=masses), decay)
    start, guided = initial_guess(problem, decay)
    search = Search(problem, guided, decay.period_s, decay.dense_until_s)
    return search, [search.fit_first_slip(start)]
