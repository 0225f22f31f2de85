"""Uncertainty of f_d that the last runs of a stand reached, and the number of runs that would halve it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.campaign.pooling import pool, run_value
from analysis.campaign.series import RunResult, group_into_series
from analysis.campaign.stand_effects import EffectScope, EffectSummary
from analysis.formatting import format_number
from analysis.laws.stand_parts import PULLBACK_POWERS
from analysis.quantities import BudgetSource
from messages.message import Message, message

_FRICTION = "friction_dynamic"


@dataclass(frozen=True, slots=True)
class ObservedUncertainty:
    """Standard uncertainty of f_d of one run by its parts, as shares of f_d: medians over runs."""

    runs: int  # that have an f_d
    noise: float  # of the readings, and doubt about the law
    between_runs: float | None  # scatter of repeats beyond that; None without repeats
    model: float  # what the models of the runs leave unexplained, alike in all
    shared: float  # of gauges, masses, gravity and clock

    @property
    def standard_uncertainty(self) -> float:
        """Of one run."""
        return self.of_mean(1)

    @property
    def floor(self) -> float:
        """What no number of runs goes below."""
        return math.hypot(self.shared, self.model)

    @property
    def runs_to_halve(self) -> int | None:
        """Runs whose mean has half the uncertainty of one; None where no number suffices."""
        total = self.standard_uncertainty
        if 2.0 * self.floor >= total:
            return None
        return math.ceil((total**2 - self.floor**2) / (0.25 * total**2 - self.floor**2))

    @property
    def message(self) -> Message:
        """The uncertainty of one run, and what more runs do to it."""
        count = self.runs_to_halve
        remedy = message("The mean of {count} runs halves it.", count=count)
        if count is None:
            remedy = message(
                "No number of runs halves it: {floor} % would be left, which all share.",
                floor=format_number(100.0 * self.floor, 2),
            )
        return message(
            "One run gives f_d to {total} %: readings {noise} %, between runs {between}, model {model} %,"
            " gauges and masses {shared} %. {remedy}",
            total=format_number(100.0 * self.standard_uncertainty, 2),
            noise=format_number(100.0 * self.noise, 2),
            between=message("unknown") if self.between_runs is None else _percent(self.between_runs),
            model=format_number(100.0 * self.model, 2),
            shared=format_number(100.0 * self.shared, 2),
            remedy=remedy,
        )

    def of_mean(self, count: int) -> float:
        """Standard uncertainty of the mean of `count` runs, as a share of f_d."""
        own = math.hypot(self.noise, self.between_runs or 0.0)
        return math.hypot(own / math.sqrt(count), self.floor)


def observe_uncertainty(runs: Sequence[RunResult]) -> ObservedUncertainty | None:
    """Uncertainty of f_d in runs of one stand; None where none of them has an f_d."""
    parts = [found for run in runs if (found := _parts(run)) is not None]
    if not parts:
        return None
    noise, model, shared = np.median(np.array(parts), axis=0).tolist()
    return ObservedUncertainty(len(parts), noise, _between_runs(runs), model, shared)


def planned_sizes(effects: Sequence[EffectSummary], pullback_m: float) -> dict[str, float]:
    """Sizes of the stand's effects in a test with this pullback, by the names of their results."""
    sizes = {}
    for effect in effects:
        if effect.scope is EffectScope.STAND:
            over = 1.0 if effect.pullback_m is None else abs(pullback_m) / effect.pullback_m
            for name, pooled in effect.sizes.items():
                sizes[name] = pooled.quantity.value * over ** PULLBACK_POWERS.get(name, 0)
    return sizes


def _parts(run: RunResult) -> tuple[float, float, float] | None:
    """Noise, model and shared errors of f_d, as shares of it."""
    friction = run_value(run, _FRICTION)
    if friction is None or friction.value <= 0.0:
        return None
    others = (share for error, share in friction.common.items() if error.source is not BudgetSource.MODEL)
    parts = friction.repeatable, friction.model, math.hypot(*others)
    noise, model, shared = (part / friction.value for part in parts)
    return noise, model, shared


def _between_runs(runs: Sequence[RunResult]) -> float | None:
    """Median over series of the scatter between their runs, as a share of f_d."""
    series = [
        [value for run in each.runs if (value := run_value(run, _FRICTION)) is not None]
        for each in group_into_series(runs)
    ]
    pooled = pool([some for some in series if some], proportional=True)
    shares = [
        one.between_runs / abs(one.quantity.value)
        for one in pooled
        if one.runs > 1 and one.between_runs is not None and one.quantity.value
    ]
    return float(np.median(shares)) if shares else None


def _percent(share: float) -> str:
    return f"{format_number(100.0 * share, 2)} %"
