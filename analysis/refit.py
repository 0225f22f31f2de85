"""Fit a law to a record again from parameters that are near: no search, and no choice among laws.

For a slider that holds one parameter while the others follow, and for everything else that knows about
where the minimum is::

    again = Refitter(record)
    found = again.refit(identification.parameters, model=identification.model.name, hold="friction_dynamic")
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.findings.screens import NAMES, SIGNED, curves_of, named_parameters
from analysis.fitting.models import STRIBECK_VELOCITY_M_PER_S, Model, Place
from analysis.fitting.problem import Problem, allowed
from analysis.fitting.start import problem_of
from analysis.friction import Fit, finished
from analysis.identification import Curves
from analysis.readings.preparation import prepare
from analysis.record import AnalysisError, Record

_VELOCITY = "stribeck_velocity_m_per_s"


@dataclass(frozen=True, eq=False, slots=True)
class Refit:
    """What a refit found.

    Attributes
    ----------
    parameters : dict of float
        By the names of `Identification.parameters`.
    chi_square, rms_m : float
        Of the readings.
    curves : callable
        Fitted readings at given record times (n,).
    steps : int
        Evaluations that it took.
    """

    parameters: dict[str, float]
    chi_square: float
    rms_m: float
    curves: Callable[[Floats], Curves]
    steps: int


class Refitter:
    """A record made ready to be fitted again and again.

    Raises
    ------
    RecordError
        The record holds no free decay.
    """

    def __init__(self, record: Record) -> None:
        self._decay = prepare(record)
        self._problem = problem_of(record, self._decay)
        self._delays_s = record.table_gauge.delay_s, record.relative_gauge.delay_s

    def refit(
        self, start: Mapping[str, float], *, model: str, hold: str | None = None, steps_max: int = 12
    ) -> Refit:
        """Refine `start`.

        Parameters
        ----------
        start : mapping of float
            `Identification.parameters`, or such; near a minimum, for there may be many.
        model : str
            One of `Model`'s values.
        hold : str, optional
            Name of a parameter that stays as it is in `start`, such as "friction_dynamic".
        steps_max : int
            Most evaluations.

        Raises
        ------
        AnalysisError
            An unknown model, a start without one of its parameters, or a parameter that cannot be held.
        """
        law, point = _law(model), self._point(start)
        held = None if hold is None else self._held(hold, law)
        minimum = self._problem.minimise(_zeroed(self._problem, point, law), law, steps_max, held=held)
        fit = finished(self._problem, law, minimum)
        named = named_parameters(fit.parameters, self._decay)
        if law is Model.STRIBECK_TILT:
            named[_VELOCITY] = fit.value(Place.STRIBECK_VELOCITY)
        return Refit(named, fit.chi_square, fit.rms_m, self._curves(fit), minimum.steps)

    def _curves(self, fit: Fit) -> Callable[[Floats], Curves]:
        return curves_of(fit, self._decay, self._delays_s)

    def _point(self, start: Mapping[str, float]) -> Floats:
        missing = [name for name in (*NAMES.values(), "release_s") if name not in start]
        if missing:
            raise AnalysisError(
                f"the start of a refit lacks {', '.join(missing)}: hand over Identification.parameters."
            )
        point = self._problem.prior_mean.copy()
        for place, name in NAMES.items():
            point[place] = start[name] * (self._decay.sign if place in SIGNED else 1)
        point[Place.STRIBECK_VELOCITY] = start.get(_VELOCITY, STRIBECK_VELOCITY_M_PER_S)
        point[Place.RELEASE] = self._decay.channels.from_record_time(np.array(start["release_s"]))
        return point

    def _held(self, name: str, law: Model) -> Place:
        free = self._problem.free(law)
        places = {NAMES[place]: place for place in NAMES if place in free}
        if name not in places:
            raise AnalysisError(f"{name!r} cannot be held. Choose one of {', '.join(places)}.")
        return places[name]


def _law(name: str) -> Model:
    try:
        return Model(name)
    except ValueError:
        allowed_names = ", ".join(model.value for model in Model)
        raise AnalysisError(f"model {name!r} is unknown. Choose one of {allowed_names}.") from None


def _zeroed(problem: Problem, point: Floats, law: Model) -> Floats:
    """The point with both gauges' zeros at their best, which the start does not tell."""
    moved = allowed(point, law)
    first, second = problem.residuals(moved, law)
    moved[Place.TABLE_OFFSET] += first.mean()
    if len(second):
        moved[Place.RELATIVE_OFFSET] += second.mean()
    return moved
