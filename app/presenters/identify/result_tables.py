"""Rows of the results column: models, classical estimates, budget and notes."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from analysis.catalogue import Place, QuantityDefinition, definition
from analysis.formatting import uncertainty_decimals, with_unit
from analysis.identification import Degree, FittedModel, ModelSelection
from analysis.quantities import BudgetLine, Quantity
from analysis.verdict_text import effect_title
from app.presenters import number_text, results
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.identify.state import BudgetRow, ClassicalRow, ModelRow
from messages.i18n import gettext, translate

if TYPE_CHECKING:
    from analysis.classical_estimates import ClassicalEstimates

_AS_LIKELY, _RULED_OUT = 2.0, 10.0
"""Differences of BIC after Kass and Raftery (1995): below 2 not worth mentioning, above 10 very strong."""
_NO_BETTER = 1.001  # ratio of residuals up to which the record does not distinguish two laws
_RESIDUALS_SHOWN = 4
_PAPER_DECIMALS = 3


def model_rows(first: AnalysedRun, run: AnalysedRun) -> tuple[ModelRow, ...]:
    """Every fitted law, the likeliest first; laws that the first analysis ruled out early are as in `run`."""
    model, shown = first.model, run.model
    if model is None or shown is None or run.kind != "two-mass":
        return ()
    anew = {tried.full_name: tried for tried in shown.tried}
    all_tried = [anew.get(tried.full_name, tried) for tried in model.tried]
    best = min((tried.bic for tried in all_tried), default=0.0)
    return tuple(
        ModelRow(
            name=tried.full_name,
            law=tried.name,
            friction=number_text.format_fixed(tried.friction_dynamic, 5),
            ratio=_ratio(tried.residual_rms_m, model.noise_rms_m),
            status=_judged(tried, tried.bic - best, model),
            effects=_effects(tried),
            is_shown=tried.full_name == shown.full_name,
        )
        for tried in sorted(all_tried, key=lambda tried: tried.bic)
    )


def classical_rows(fitted: Mapping[str, Quantity], found: "ClassicalEstimates") -> tuple[ClassicalRow, ...]:
    """Classical estimates beside the fitted values."""
    damping = found.log_decrement and found.period_s and found.log_decrement / found.period_s
    by_turning_points = gettext("from turning points of the tail")
    rows = [
        _check(fitted, "period_s", found.period_s, by_turning_points),
        _check(fitted, "log_decrement", found.log_decrement, by_turning_points),
        _check(fitted, "damping_n1_per_s", damping, gettext("log decrement over T, both classical")),
    ]
    if results.FRICTION.name in fitted:
        rows += [_paper_friction(fitted, found), _residual_friction(fitted, found)]
    return tuple(row for row in rows if row is not None)


def budget_rows(run: AnalysedRun) -> tuple[BudgetRow, ...]:
    """Sources of the uncertainty of what the run was made for, largest first; then those not stated."""
    shown = definition(results.headline_key(run))
    lines = [line for line in run.budget if line.contribution_to == shown.name]
    stated = [line for line in lines if math.isfinite(line.standard_uncertainty)]
    not_stated = [line for line in lines if line not in stated]
    stated = [line for line in stated if line.standard_uncertainty > 0.0]
    stated.sort(key=lambda line: -line.standard_uncertainty)
    rows = [
        BudgetRow(
            translate(line.source.label),
            _contribution(line, stated[0], shown),
            line.standard_uncertainty / stated[0].standard_uncertainty,
        )
        for line in stated
    ]
    absent = gettext("not stated")
    rows += [BudgetRow(translate(line.source.label), absent, 0.0) for line in not_stated]
    return tuple(rows)


def _contribution(line: BudgetLine, largest: BudgetLine, row: QuantityDefinition) -> str:
    """Write a contribution in the unit of its quantity, to the last digit of the largest one."""
    unit = row.unit_at(Place.WINDOW)
    decimals = uncertainty_decimals(largest.standard_uncertainty * unit.scale)
    last_digit = 10.0**-decimals
    size = line.standard_uncertainty * unit.scale
    text = number_text.format_fixed(max(size, last_digit), decimals)
    return with_unit(f"< {text}" if size < 0.5 * last_digit else text, unit.symbol)


def missing_data(run: AnalysedRun) -> Chip:
    """Share of missing samples; empty if none are missing."""
    share = float(np.isnan(run.table.record_m).mean())
    if share == 0.0:
        return EMPTY_CHIP
    absent = with_unit(number_text.format_fixed(100.0 * share, 1 if share > 1e-3 else 3), "%")
    text = gettext("{share} of the readings are missing: the curves are broken there.", share=absent)
    return Chip(text, Tone.WARN)


def no_scan_reason(run: AnalysedRun) -> str:
    """Why f_d cannot be varied."""
    if run.objective is not None:
        return ""
    if run.kind == "one-mass":
        return gettext("One mass swings freely: there is no sliding, and so no f<sub>d</sub> to vary.")
    if results.FRICTION.name not in run.results:
        return gettext(
            "Nothing slipped, so that there is no f<sub>d</sub> to vary."
            " Found are T, n<sub>1</sub> and what f<sub>s</sub> is at least."
        )
    return gettext("This law has no f<sub>d</sub> that could be varied alone.")


def _effects(tried: FittedModel) -> str:
    titles = [translate(effect_title(name)) for name in tried.parts]
    return gettext("with {effects}", effects=", ".join(titles)) if titles else ""


def _judged(tried: FittedModel, above_best: float, model: ModelSelection) -> Chip:
    """Whether the selected law fits, and how likely the others are."""
    if tried.full_name == model.full_name:
        if model.degree is Degree.FRICTION:
            return Chip(gettext("does not fit, f_d holds"), Tone.WARN)
        return Chip(gettext("fits"), Tone.OK) if model.adequate else Chip(gettext("does not fit"), Tone.BAD)
    if not math.isfinite(above_best):
        return Chip("–")
    hint = gettext("BIC {above} above the likeliest", above=f"{above_best:.1f}")
    if above_best <= _AS_LIKELY:
        return Chip(gettext("as likely"), hint=hint)
    if tried.residual_rms_m <= _NO_BETTER * model.residual_rms_m:
        hint = gettext("It leaves as much over with more parameters. ") + hint
        return Chip(gettext("not needed"), hint=hint)
    return Chip(gettext("less likely") if above_best <= _RULED_OUT else gettext("ruled out"), hint=hint)


def _ratio(residual_m: float, noise_m: float) -> str:
    if not noise_m > 0.0:
        return "–"
    ratio = residual_m / noise_m
    return number_text.format_fixed(ratio, 2 if ratio < 10.0 else 0)


def _check(fitted: Mapping[str, Quantity], key: str, value: float | None, hint: str) -> ClassicalRow | None:
    """A row, if both figures are there; the classical one to the last digit that is shown of the fitted."""
    if value is None or key not in fitted:
        return None
    shown = definition(key)
    row = results.make_row(shown, fitted[key])
    decimals = len(row.value.partition(".")[2])
    classical = number_text.format_fixed(value * shown.unit_at(Place.WINDOW).scale, decimals)
    return ClassicalRow(
        row.symbol, row.name, with_unit(classical, row.unit), with_unit(row.value, row.unit), hint
    )


def _paper_friction(fitted: Mapping[str, Quantity], found: "ClassicalEstimates") -> ClassicalRow | None:
    """f_d by the procedure of the paper, to the resolution of its steps."""
    if found.friction_by_paper_method is None:
        return None
    return ClassicalRow(
        results.FRICTION.symbol.html,
        gettext("by the paper's method"),
        number_text.format_fixed(found.friction_by_paper_method, _PAPER_DECIMALS),
        number_text.format_fixed(fitted[results.FRICTION.name].value, _PAPER_DECIMALS),
        gettext("f_d lowered step by step until the paper's simulation coincides best"),
    )


def _residual_friction(fitted: Mapping[str, Quantity], found: "ClassicalEstimates") -> ClassicalRow | None:
    """Values of f_d that the residual displacement allows."""
    if "residual_displacement_m" not in fitted:
        return None
    friction = fitted[results.FRICTION.name].value
    nearest = sorted(found.friction_candidates, key=lambda value: abs(value - friction))[:_RESIDUALS_SHOWN]
    values = ", ".join(number_text.format_fixed(value, 4) for value in sorted(nearest))
    more = len(found.friction_candidates) - len(nearest)
    return ClassicalRow(
        results.FRICTION.symbol.html,
        gettext("from u<sub>s</sub> alone"),
        (gettext("{values} and {more} more", values=values, more=more) if more else values)
        or gettext("none"),
        number_text.format_fixed(friction, 4),
        gettext("Every f_d from 0.03 to 0.3 whose residual displacement is the measured one"),
    )
