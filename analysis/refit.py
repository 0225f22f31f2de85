"""Fit a law to a record again from parameters that are near: no search, and no choice among laws.

For a slider that holds one parameter while the others follow, and for any other caller that knows
roughly where the minimum is::

    again = Refitter(record)
    chosen = identification.model
    found = again.refit(
        identification.parameters, model=chosen.name, parts=chosen.parts, hold="friction_dynamic"
    )
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.fitting.search import build_problem, fit_at_minimum
from analysis.fitting.stand_search import stand_problem
from analysis.identification import Curves
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.laws.stand_parts import StandModel, model_law
from analysis.preparation.free_decay import prepare
from analysis.record import AnalysisError, Record
from analysis.results.joint_fit import (
    PARAMETER_NAMES,
    SIGNED_PARAMETERS,
    fitted_curves,
    law_places,
    named_parameters,
)
from messages.i18n import N_


@dataclass(frozen=True, eq=False, slots=True)
class Refit:
    """What a refit found."""

    parameters: dict[str, float]  # by the names of `Identification.parameters`
    chi_square: float  # of the readings
    rms_m: float
    curves: Callable[[Floats], Curves]  # fitted readings at given record times (n,)
    steps: int  # evaluations that it took


class Refitter:
    """A record made ready to be fitted again and again.

    Raises RecordError if the record holds no free decay.
    """

    def __init__(self, record: Record) -> None:
        self._decay = prepare(record)
        self._problem = build_problem(record, self._decay)
        self._delays_s = record.table_gauge.lateness_s, record.relative_gauge.lateness_s

    def refit(
        self,
        start: Mapping[str, float],
        *,
        model: str,
        parts: Iterable[str] = (),
        hold: str | None = None,
        steps_max: int = 12,
    ) -> Refit:
        """Refine `start` in at most `steps_max` evaluations.

        `start` is near a minimum, for there may be many: `Identification.parameters`. `parts` are the effects
        of the stand that the model holds, `hold` names a parameter that stays as it is.
        """
        law = model_law(model, parts)
        problem = stand_problem(self._problem, law) if isinstance(law, StandModel) else self._problem
        held = None if hold is None else self._held(hold, law)
        point = _zeroed(problem, self._point(start, law, problem.prior_mean.copy()), law)
        minimum = problem.minimise(point, law, steps_max, fixed=held)
        fit = fit_at_minimum(problem, law, minimum)
        curves = fitted_curves(fit, self._decay, self._delays_s)
        named = named_parameters(fit, self._decay)
        return Refit(named, fit.chi_square, fit.rms_m, curves, minimum.steps)

    def _point(self, start: Mapping[str, float], law: FrictionLaw, point: Floats) -> Floats:
        names = PARAMETER_NAMES | law_places(law)
        missing = [name for name in (*names.values(), "release_s") if name not in start]
        if missing:
            template = N_("the start of a refit lacks {missing}: hand over Identification.parameters.")
            raise AnalysisError(template, missing=", ".join(missing))
        for place, name in names.items():
            point[place] = start[name] * (self._decay.sign if place in SIGNED_PARAMETERS else 1)
        point[Parameter.RELEASE] = self._decay.channels.from_record_time(start["release_s"])
        return point

    def _held(self, name: str, law: FrictionLaw) -> Parameter:
        free = self._problem.free_parameters(law)
        places = {PARAMETER_NAMES[place]: place for place in PARAMETER_NAMES if place in free}
        if name not in places:
            raise AnalysisError(
                "{name!r} cannot be held. Choose one of {places}.", name=name, places=", ".join(places)
            )
        return places[name]


def _zeroed(problem: FitProblem, point: Floats, law: FrictionLaw) -> Floats:
    """The point with both gauges' zeros at their best, which the start does not tell."""
    moved = project_to_bounds(point, law)
    first, second = problem.residuals(moved, law)
    moved[Parameter.TABLE_OFFSET] += first.mean()
    if len(second):
        moved[Parameter.RELATIVE_OFFSET] += second.mean()
    return moved
