"""One quantity of one run, its uncertainty divided between what repeats make smaller and what they share."""

import math
from dataclasses import dataclass

from analysis.campaign.runs import RunResult
from analysis.quantities import BudgetLine
from analysis.uncertainty import COVERAGE_FACTOR_95, LEVELLING

_OWN = ("noise", "law may be ")
"""How the sources begin that each run has for itself."""
_UNEXPLAINED = "not broken down"
_SMALLEST = 1e-9
"""Relative uncertainty under which numbers decide, not readings."""
_LARGEST = 1e100
"""What is farther from 0 has no square, and is no measured number."""


@dataclass(frozen=True, eq=False, slots=True)
class RunValue:
    """A quantity as one run found it.

    Attributes
    ----------
    run : str
    value : float
    repeatable : float
        Standard uncertainty that is this run's own; above 0.
    common : dict of float
        Standard uncertainty by source and identity of what is shared: readings with the same key err alike.
    reach : (float, float)
        Ends of the 95 % interval, below and above the value.
    unit : str
    """

    run: str
    value: float
    repeatable: float
    common: dict[str, float]
    half_widths: tuple[float, float]
    unit: str


def run_value(run: RunResult, name: str) -> RunValue | None:
    """Take one quantity from a run; None where the run does not have it, or not as a number.

    A quantity without a budget counts as shared between all runs, which no repeat makes smaller.
    """
    quantity = run.results.get(name)
    if quantity is None or not abs(quantity.value) < _LARGEST:
        return None
    lines = [line for line in run.budget if line.contribution_to == name]
    stated = quantity.standard_uncertainty if quantity.standard_uncertainty < _LARGEST else 0.0
    if not lines and stated:
        lines = [BudgetLine(_UNEXPLAINED, name, stated)]
    common, own = _split_budget(run, lines)
    low, high = quantity.interval_95
    reach = quantity.value - low, high - quantity.value
    own = max(own, _own_by_interval(sum(reach) / 2.0 / COVERAGE_FACTOR_95, stated, common))
    smallest = max(_SMALLEST * abs(quantity.value), 1.0 / _LARGEST)
    return RunValue(run.name, quantity.value, max(own, smallest), common, reach, quantity.unit)


def run_ratio(run: RunResult, above: str, below: str) -> RunValue | None:
    """Take the quotient of two quantities of a run; what both share cancels as far as it is the same."""
    top, bottom = run_value(run, above), run_value(run, below)
    if top is None or bottom is None or top.value == 0.0 or bottom.value == 0.0:
        return None
    value = top.value / bottom.value
    own = abs(value) * math.hypot(top.repeatable / top.value, bottom.repeatable / bottom.value)
    if not max(abs(value), own) < _LARGEST:
        return None
    common = {
        key: abs(value)
        * abs(top.common.get(key, 0.0) / top.value - bottom.common.get(key, 0.0) / bottom.value)
        for key in top.common | bottom.common
    }
    reach = COVERAGE_FACTOR_95 * math.hypot(own, *common.values())
    return RunValue(run.name, value, own, common, (reach, reach), "1")


def is_fully_stated(run: RunResult, name: str) -> bool:
    """Tell whether every source that matters for a quantity has an uncertainty."""
    return not any(
        line.contribution_to == name and math.isnan(line.standard_uncertainty) for line in run.budget
    )


def _split_budget(run: RunResult, lines: list[BudgetLine]) -> tuple[dict[str, float], float]:
    common: dict[str, float] = {}
    own = 0.0
    for line in lines:
        if not line.standard_uncertainty < _LARGEST:
            continue
        if line.source.startswith(_OWN):
            own = math.hypot(own, line.standard_uncertainty)
        else:
            key = f"{line.source} of {_shared_by(run, line.source)}"
            common[key] = math.hypot(common.get(key, 0.0), line.standard_uncertainty)
    return common, own


def _shared_by(run: RunResult, source: str) -> str:
    """Identity of what errs: the calibration, the stand, or the plane of one series."""
    if source.startswith(("gauge ", "lag ")):
        return run.calibration_id
    return run.series.label if source == LEVELLING else run.stand_id


def _own_by_interval(deviation: float, stated: float, common: dict[str, float]) -> float:
    """The run's own part where its interval is wider than a normal one; 0 where it is not."""
    if not deviation < _LARGEST or deviation <= stated * (1.0 + 1e-9):
        return 0.0
    return math.sqrt(max(0.0, deviation**2 - sum(share**2 for share in common.values())))
