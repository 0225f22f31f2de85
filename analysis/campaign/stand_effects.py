"""Effects of the stand over several runs: which are the stand's and which of single runs, and their sizes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.special import betaincinv

from analysis.campaign.pooling import PooledQuantity, RunValue, pool, run_value
from analysis.campaign.series import RunResult, run_names
from analysis.catalogue import MILLIMETRE, Place, definition
from analysis.formatting import format_number
from analysis.laws.stand_parts import CORNER_NAMES, EFFECTS, PULLBACK_POWERS, StandEffect
from analysis.results.diagnosis import SENTENCES, diagnosis, main_result, result_names
from messages.message import Message, joined, message

_CHANCE = 0.05  # share of runs in which a wrong effect is named at most (docs/validation.md)
_SCATTER_MAX = 1.0 / 3.0  # of the size, between runs: with more, not even the sign of the next is sure
_SCATTER_MAX_OF = {"second_mode_frequency_hz": 0.1, "base_frequency_hz": 0.2}
"""The same of frequencies: modes that differ by more are others; that of a base is known less well."""
_SIGMAS = 6.2
"""Standard uncertainties of a size that no run fails to show: the BIC falls by 30, where 10 suffice for an
effect to stay, if chi-square falls by 38, a parameter costing the logarithm of some 4,000 readings."""


class EffectScope(StrEnum):
    """What an effect belongs to; the value is its name in JSON."""

    STAND = "stand"  # most runs show it, with sizes that agree
    CONTACT = "contact"  # the same of the runs of one contact, for an effect of friction
    RUNS = "runs"  # few runs show it, or their sizes differ
    OPEN = "open"  # too few runs to tell


@dataclass(frozen=True, eq=False, slots=True)
class EffectSummary:
    """One effect of the stand over several runs."""

    name: str  # as in the warnings of an analysis
    contact: str  # whose runs these are, for an effect of friction; "" for the others
    scope: EffectScope
    runs: tuple[str, ...]  # that show it
    run_count: int  # runs that show it, or would if they had it
    share_95: tuple[float, float]  # interval of the share of runs that have it (Clopper and Pearson)
    deviating: tuple[str, ...]
    """Unless `scope` is RUNS: runs that would show the effect and do not, or show another size."""
    sizes: dict[str, PooledQuantity]  # by name of the result, over the runs that do not deviate
    pullback_m: float | None  # at which `sizes` hold; None where they do not depend on it
    message: Message


def summarize_effects(runs: Sequence[RunResult]) -> tuple[EffectSummary, ...]:
    """Summarize the effects that `runs` show, those of the stand first. Runs may be of several series.

    An effect is the stand's where more than half of the runs that could show it do, with sizes that agree:
    the scatter between runs is at most a third of the size. Effects of friction are judged by contact.
    """
    found = []
    for effect in filter(lambda effect: SENTENCES[effect.name], EFFECTS):
        for contact in dict.fromkeys(_contact(run, effect) for run in runs):
            own = [run for run in runs if _contact(run, effect) == contact]
            if any(_is_named(run, effect) for run in own):
                found.append(_summary(effect, contact, own))
    return tuple(sorted(found, key=lambda summary: list(EffectScope).index(summary.scope)))


def _contact(run: RunResult, effect: StandEffect) -> str:
    return run.series.contact if effect.varies_friction else ""


def _is_named(run: RunResult, effect: StandEffect) -> bool:
    return any(warning.code == effect.name for warning in run.warnings)


@dataclass(frozen=True, eq=False, slots=True)
class _Shown:
    """Sizes of an effect in one run that shows it, and the run's pullback (m)."""

    run: RunResult
    sizes: dict[str, RunValue]
    pullback_m: float

    def at(self, name: str, pullback_m: float) -> RunValue:
        """A size at another pullback."""
        size, factor = self.sizes[name], (pullback_m / self.pullback_m) ** PULLBACK_POWERS.get(name, 0)
        return replace(
            size,
            value=factor * size.value,
            repeatable=factor * size.repeatable,
            common={error: factor * deviation for error, deviation in size.common.items()},
            half_widths=(factor * size.half_widths[0], factor * size.half_widths[1]),
        )


def _summary(effect: StandEffect, contact: str, runs: Sequence[RunResult]) -> EffectSummary:
    shown = [one for run in runs if (one := _shown(run, effect)) is not None]
    reference_m = max(one.pullback_m for one in shown)
    sizes, far = _pooled_sizes(effect, shown, reference_m)
    told = main_result(effect, {name: one.quantity.value for name, one in sizes.items()})
    visibility, having = _visibility(shown, told, reference_m), {one.run.name for one in shown}
    power = PULLBACK_POWERS.get(told, 0)
    without = {
        run.name
        for run in runs
        if run.name not in having and _would_show(run, visibility, power, reference_m)
    }
    kept, count = len(shown) - len(far), len(shown) + len(without)
    share = _share_95(kept, count)
    scope = EffectScope.CONTACT if effect.varies_friction else EffectScope.STAND
    if 2 * kept <= count or not all(_agree(name, sizes[name]) for name in _decisive(effect, told)):
        scope = EffectScope.RUNS
    elif share[0] < _CHANCE:
        scope = EffectScope.OPEN
    deviating = [run for run in runs if run.name in without | far and scope is not EffectScope.RUNS]
    pullback_m = reference_m if power and scope is not EffectScope.RUNS else None
    text = _sentence(effect, scope, shown, sizes, told)
    text = message(
        "{shown} of {count} runs{which}: {diagnosis}",
        shown=len(shown),
        count=count,
        which=_which(contact, pullback_m, shown if scope is EffectScope.RUNS else []),
        diagnosis=text,
    )
    if scope is EffectScope.OPEN:
        text = joined([text, message("More runs will tell whether it is the stand's.")])
    elif deviating:
        text = joined([text, message("Not so in {runs}.", runs=run_names(deviating))])
    names = tuple(one.run.name for one in shown), tuple(run.name for run in deviating)
    return EffectSummary(
        effect.name, contact, scope, names[0], count, share, names[1], sizes, pullback_m, text
    )


def _shown(run: RunResult, effect: StandEffect) -> _Shown | None:
    """Sizes of an effect in a run; None where it does not show it, or its model explains too little."""
    in_model = run.effects is not None and effect.name in run.effects and run.adequate is True
    pullback = run.results.get("pullback_m")
    if pullback is None or not (in_model or _is_named(run, effect)):
        return None
    sizes = {name: run_value(run, name) for name in result_names(effect)}
    known = {name: size for name, size in sizes.items() if size is not None}
    return _Shown(run, known, abs(pullback.value)) if len(known) == len(sizes) else None


def _pooled_sizes(
    effect: StandEffect, shown: Sequence[_Shown], pullback_m: float
) -> tuple[dict[str, PooledQuantity], set[str]]:
    """Sizes of an effect at a pullback, pooled without the runs that are far from the others; their names."""
    names = result_names(effect)

    def pooled(without: set[str]) -> dict[str, PooledQuantity]:
        values = {
            name: [one.at(name, pullback_m) for one in shown if one.run.name not in without] for name in names
        }
        return {name: pool([some], proportional=True)[0] for name, some in values.items()}

    sizes = pooled(set())
    told = main_result(effect, {name: one.quantity.value for name, one in sizes.items()})
    far = {run for name in _decisive(effect, told) for run in sizes[name].outliers}
    return (pooled(far), far) if 0 < len(far) < len(shown) else (sizes, set())


def _decisive(effect: StandEffect, told: str) -> list[str]:
    """Names of the sizes that must agree for an effect to be the same in all runs."""
    return [name for name in result_names(effect) if name == told or name in _SCATTER_MAX_OF]


def _agree(name: str, pooled: PooledQuantity) -> bool:
    limit = _SCATTER_MAX_OF.get(name, _SCATTER_MAX)
    return (pooled.between_runs or 0.0) <= limit * abs(pooled.quantity.value)


def _visibility(shown: Sequence[_Shown], name: str, pullback_m: float) -> float:
    """Median of size over uncertainty, times noise over pullback: what a run shows of it for its noise."""
    of_square = 0.5 if name in CORNER_NAMES.values() else 1.0  # relative uncertainty of the other form
    ratios = [
        of_square * abs(size.value) / size.repeatable * _noise_share(one.run, one.pullback_m)
        for one in shown
        for size in [one.sizes[name]]
    ]
    powers = [(pullback_m / one.pullback_m) ** PULLBACK_POWERS.get(name, 0) for one in shown]
    return float(np.median(np.array(ratios) * powers))


def _would_show(run: RunResult, visibility: float, power: int, reference_m: float) -> bool:
    """Tell whether a run would show an effect of this visibility if it had it."""
    pullback = run.results.get("pullback_m")
    if run.effects is None or run.adequate is not True or pullback is None or pullback.value == 0.0:
        return False
    visible = visibility * (abs(pullback.value) / reference_m) ** power
    return visible >= _SIGMAS * _noise_share(run, abs(pullback.value))


def _noise_share(run: RunResult, pullback_m: float) -> float:
    return (run.noise_m or 0.0) / pullback_m


def _share_95(count: int, runs: int) -> tuple[float, float]:
    """Interval of Clopper and Pearson of a share of which `count` of `runs` were seen."""
    low = float(betaincinv(count, runs - count + 1, 0.025)) if count else 0.0
    high = float(betaincinv(count + 1, runs - count, 0.975)) if count < runs else 1.0
    return low, high


def _sentence(
    effect: StandEffect,
    scope: EffectScope,
    shown: Sequence[_Shown],
    sizes: dict[str, PooledQuantity],
    told: str,
) -> Message:
    """The diagnosis with pooled sizes, or with ranges where they differ."""
    texts: dict[str, str | Message] = {
        name: str(definition(name).format(pooled.quantity, Place.WINDOW)) for name, pooled in sizes.items()
    }
    if scope is EffectScope.RUNS and len(shown) > 1:
        texts = {name: _range_text(name, [one.sizes[name].value for one in shown]) for name in sizes}
    return diagnosis(effect, texts, told)


def _range_text(name: str, values: Sequence[float]) -> Message:
    """`8.1 to 31 ms`."""
    unit = definition(name).unit_at(Place.WINDOW)
    low, high = (format_number(unit.scale * end) for end in (min(values), max(values)))
    return message("{low} to {high}", low=low, high=f"{high} {unit.symbol}".rstrip())


def _which(contact: str, pullback_m: float | None, named: Sequence[_Shown]) -> Message:
    """Of which runs, and at what pullback, a size is told."""
    parts = []
    if contact:
        parts.append(message(" of contact {contact}", contact=contact))
    if named:
        parts.append(message(" ({runs})", runs=run_names([one.run for one in named])))
    if pullback_m is not None:
        parts.append(message(", at a pullback of {pullback}", pullback=MILLIMETRE.text(pullback_m, 1)))
    return joined(parts, "")
