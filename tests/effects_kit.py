"""Results of runs that show effects of the stand, for the tests of campaigns."""

import math
from dataclasses import replace

from analysis.campaign.series import RunResult
from analysis.catalogue import definition
from analysis.laws.stand_parts import effects_by_name
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from analysis.results.diagnosis import diagnose, result_names
from tests.campaign_kit import friction_run

NOISE_M = 20e-6


def effect_run(
    name: str,
    shown: dict[str, tuple[float, ...]],
    *,
    series: str = "1FFM0",
    pullback_m: float = 0.012,
    share: float = 0.02,
    **fields: object,
) -> RunResult:
    """A run whose model holds the effects `shown`, each with the values of its results.

    `share` is the relative standard uncertainty of each size, half of it by the gain of gauge 1.
    """
    plain = friction_run(name, series, 0.1)
    results = dict(plain.results) | {"pullback_m": Quantity.normal(pullback_m, 1e-6, "m")}
    budget = list(plain.budget)
    effects = tuple(effects_by_name(shown))
    for effect in effects:
        for result, value in zip(result_names(effect), shown[effect.name], strict=True):
            deviation = share * abs(value)
            results[result] = Quantity.normal(value, deviation, definition(result).unit)
            own, common = math.sqrt(0.75) * deviation, 0.5 * deviation
            budget.append(BudgetLine(BudgetSource.NOISE, result, own))
            budget.append(BudgetLine(BudgetSource.GAUGE_1_GAIN, result, common))
    made = replace(
        plain,
        results=results,
        budget=tuple(budget),
        effects=tuple(shown),
        noise_m=NOISE_M,
        warnings=tuple(diagnose(effects, results)),
    )
    return replace(made, **fields)


def mode(frequency_hz: float = 8.2, mass_share: float = 0.019) -> dict[str, tuple[float, ...]]:
    """A second mode."""
    return {"second-mode": (mass_share, frequency_hz, 0.01)}
