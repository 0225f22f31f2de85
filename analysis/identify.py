"""Identification of friction from a record, with its uncertainty and verdict."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import FitProblem, project_to_bounds
from analysis.fitting.search import (
    Fit,
    Search,
    build_problem,
    fit_at_minimum,
    guess_release,
    initial_guess,
    initial_points,
    may_be_friction,
)
from analysis.fitting.stand_search import (
    PROMISE_MIN,
    MissingEffect,
    StandFit,
    StandSearch,
    friction_spread,
    is_clear,
    stand_problem,
)
from analysis.formatting import format_number
from analysis.identification import Events, Identification, MonteCarlo, residual_share
from analysis.laws.catalogue import (
    COMPARED_LAWS,
    FALLBACK_LAWS,
    FIRST_SLIP_LAW,
    WIDEST_LAW,
    law_by_name,
    law_without,
)
from analysis.laws.law import FrictionLaw, IntegratedSolver
from analysis.laws.parameters import Parameter
from analysis.laws.stand_parts import StandEffect, StandModel, StandSolver, compose, extended_point
from analysis.plate.friction import PlateFriction, estimate_plate_friction
from analysis.preparation.disturbance import find_departure
from analysis.preparation.free_decay import TAIL_PERIODS_MIN, FreeDecay, prepare
from analysis.preparation.oscillation import no_decay_error, pullback_warnings
from analysis.quantities import ResultWarning, result_warning
from analysis.record import Record, RecordError
from analysis.results import fitted_quantities, joint_fit
from analysis.results.diagnosis import diagnose
from analysis.results.joint_fit import DecayConstants, JointFit
from analysis.results.mass_check import mass_warnings
from analysis.results.monte_carlo import MonteCarloModel, run_monte_carlo
from analysis.results.plausibility import check_period
from analysis.results.verdict import judge
from analysis.synthetic import Truth, simulate_record
from analysis.uncertainty import UncertaintyBudget, unstated_clock, unstated_gains
from messages.i18n import N_
from messages.message import Message, message

_EVIDENCE_MIN = 10.0
"""Fall of the BIC below which a friction law on an ideal stand is preferred to effects of the stand."""
_NAMED_SHARE = 0.03
"""Of what friction laws leave: what an effect explains to be named where not all is explained. In the study
`benchmarks.study_real_stand` the dominant effect is named less often by 4 % with 0.2, and a wrong one more
often by 0.4 % with 0.01."""
_LEFT_MAX = 0.1
"""Share of what no law explains that effects may leave: with more, others must be at work, and what these
effects explain is theirs."""
_GROSS_SHARE = 0.02
"""Of the swing: what friction laws leave of it where a hand may have ended the free decay."""
_SOUND_SHARE = 0.01  # of the swing: what a law may leave that explains the motion of a real stand
_BEGINNINGS = (0.5, 0.25, 0.12, 0.06)  # parts of the motion that may be free, the longest first
_EXTENSIONS = 3  # steps to the end of it, each foreseen by a fit to all before
Progress = Callable[[float, Message], None]


def identify(
    record: Record, *, model: str = "auto", progress: Progress | None = None, monte_carlo: int | None = None
) -> Identification:
    """Identify friction, stiffness and damping from one pullback test.

    Parameters
    ----------
    model : str
        "auto" (the likeliest of the compared laws; the fallback laws of `analysis.laws.catalogue` are tried
        only where none of these is adequate) or the name of a law.
    progress : callable, optional
        Called with the share done (0 to 1) and what is being done.
    monte_carlo : int, optional
        Check the budget by drawing: 1e5 draws through the linearised fit, and this many full refits.

    Raises
    ------
    RecordError
        The record holds no free decay that could be analysed.
    AnalysisError
        Unknown model.
    """
    try:
        return _identify(record, model, progress, monte_carlo)
    except np.linalg.LinAlgError as error:
        raise RecordError(
            "no law of motion can be fitted to the readings ({fault}). Check that gauge 1 shows the free"
            " decay of a table, and gauge 2 the plate on it.",
            fault=str(error),
        ) from error


def _free_decay_end(record: Record, decay: FreeDecay) -> float | None:
    """Time at which a hand ends the free decay: a law foresees the motion until then, and suddenly fails.

    None where there is no such time: what the laws leave is of a stand that was left alone.
    """
    release_s, last_s = decay.channels.to_record_time(decay.release.time_s), float(record.time_s[-1])
    for share in _BEGINNINGS:
        until_s = release_s + share * (last_s - release_s)
        for _ in range(_EXTENSIONS):
            early = _explained(record, until_s)
            departure = None if early is None else find_departure(record, early, until_s)
            if departure is None or not departure.is_foreseen_before:
                break
            if departure.is_sudden:
                return departure.time_s
            until_s = departure.time_s
    return None


def _explained(record: Record, end_s: float) -> Identification | None:
    """The record until some time as the simplest law explains it; None where it does not."""
    try:
        found = _identify(record.replace(decay_end_s=end_s), COMPARED_LAWS[0].name, None, None)
    except RecordError:
        return None
    model = found.model
    is_sound = model is not None and (model.adequate or (model.residual_share or 1.0) < _SOUND_SHARE)
    return found if is_sound else None


def _share_left(problem: FitProblem, fits: list[Fit]) -> float:
    """Residual of the likeliest law over the largest swing."""
    return residual_share(min(fits, key=lambda fit: fit.bic).rms_m, problem.table.value_m)


def warm_up() -> None:
    """Compile and load everything that an identification needs, before anybody waits for a result.

    Few records need the fallback laws, so that their code is loaded by one evaluation of each.
    """
    record = simulate_record(Truth(rate_hz=500.0, duration_s=8.0))
    identify(record)
    decay = prepare(record)
    problem = build_problem(record, decay)
    start, _ = initial_guess(problem, decay)
    for law in FALLBACK_LAWS:
        _evaluate(problem, law, start)
        model = compose(law, ())
        _evaluate(stand_problem(problem, model), model, extended_point(start))


def _evaluate(problem: FitProblem, law: FrictionLaw, start: Floats) -> None:
    """Compute once what fits and results ask of a law whose motion is integrated."""
    fit = fit_at_minimum(problem, law, problem.minimise(start, law, 1))
    vector, duration_s = law.vector(fit.parameters), float(problem.table.time_s[-1])
    for asked in (law.solver.peak_rates, law.solver.final_relative, law.solver.phases):
        asked(vector, duration_s)
    if isinstance(law.solver, IntegratedSolver | StandSolver):
        law.solver.mean_friction(vector, duration_s)


@dataclass(frozen=True, eq=False, slots=True)
class _Fitted:
    """What was fitted to a record, and which of it was chosen."""

    search: Search
    decay: FreeDecay  # as prepared
    minima: list[Floats]  # of the widest law, from which the laws were fitted
    fits: list[Fit]  # of friction laws on an ideal stand
    stand: StandFit | None
    missing: list[MissingEffect]  # beside the chosen fit
    joint: JointFit
    law_is_given: bool


def _identify(
    record: Record, model: str, progress: Progress | None, monte_carlo: int | None
) -> Identification:
    laws = COMPARED_LAWS if model == "auto" else (law_by_name(model),)
    report = progress or (lambda _share, _what: None)

    report(0.0, message("looking for the release"))
    decay = prepare(record)
    if not decay.slips:
        return _identify_without_slip(record, decay, with_monte_carlo=monte_carlo is not None)
    report(0.1, message("first estimate"))
    problem = build_problem(record, decay)
    start, informed_problem = initial_guess(problem, decay)
    search = Search(problem, informed_problem, decay.period_s, decay.dense_until_s)
    if decay.plateau is not None:
        points = [search.fit_first_slip(point) for point in initial_points(start, decay)]
    else:
        points = guess_release(informed_problem, start, decay.period_s, record.pullback_m)
    plate = estimate_plate_friction(record, decay)
    report(0.3, message("following the motion"))
    minima = search.find_minima(points)

    report(0.6, message("fitting {laws}", laws=[law.name for law in laws]))
    fits = search.fit_all(laws, minima)
    if record.decay_end_s is None and _share_left(problem, fits) > _GROSS_SHARE:
        end_s = _free_decay_end(record, decay)
        if end_s is not None:
            return _identify(record.replace(decay_end_s=end_s), model, progress, monte_carlo)
    fitted = _choose(record, decay, search, minima, fits, start if model == "auto" else None, report)
    report(0.8, message("uncertainty"))
    found = _conclude(record, fitted, plate, monte_carlo, report)
    report(1.0, message("done"))
    return found


def _choose(
    record: Record,
    decay: FreeDecay,
    search: Search,
    minima: list[Floats],
    fits: list[Fit],
    start: Floats | None,
    report: Progress,
) -> _Fitted:
    """Choose a law, or the simplest with effects of the stand, found from `start`; None: the law is given."""
    problem, likeliest = search.problem, min(fits, key=lambda fit: fit.bic)
    stand_search: StandSearch | None = None
    stand: StandFit | None = None
    missing: list[MissingEffect] = []
    if start is not None and may_be_friction(problem, fits):
        stand_search = _stand_search(search, decay, fits)
        missing = _missing_effects(stand_search, decay, likeliest, fits)
        report(0.7, message("looking for effects of the stand"))
        if not _is_adequate(problem, decay, fits):
            stand = _fit_stand(stand_search, decay, fits, start)
        elif any(each.promise > PROMISE_MIN for each in missing):
            stand = stand_search.extend(likeliest)
        if stand is not None and _may_be_other_law(stand, decay):
            widest = next(fit for fit in fits if fit.law is WIDEST_LAW)
            for law in FALLBACK_LAWS:
                report(0.75, message("fitting {laws}", laws=[law.name]))
                fallback = search.explain_by_fallback(law, widest)
                if fallback is not None and _is_adequate(problem, decay, [fallback]):
                    fits.append(fallback)
    if stand_search is not None and stand is not None and _explains_more(stand, decay, fits):
        joint = joint_fit.choose_stand(record, decay, stand.fit, stand.problem, fits)
        missing = _missing_effects(stand_search, decay, stand.fit, [stand.fit])
    else:
        joint = joint_fit.choose_law(record, decay, problem, fits)
        if stand_search is not None and joint.chosen is not likeliest:
            missing = _missing_effects(stand_search, decay, joint.chosen, [joint.chosen])
    return _Fitted(search, decay, minima, fits, stand, missing, joint, law_is_given=start is None)


def _conclude(
    record: Record, fitted: _Fitted, plate: PlateFriction | None, monte_carlo: int | None, report: Progress
) -> Identification:
    """Results with their budget, verdict and warnings."""
    joint, stand, fits = fitted.joint, fitted.stand, fitted.fits
    adequate = joint.selection.adequate
    tied = fitted_quantities.range_of_tied_static_friction(joint)
    slip_end = fitted_quantities.find_slip_end(joint, tied)
    slip_ended = slip_end is not None or (joint.decay.slip_end_s is not None and not adequate)
    decay = joint.decay.with_tail_from(None if slip_end is None else slip_end.upper_limit_s)
    joint = replace(joint, decay=decay)
    effects = joint.chosen.law.effects if isinstance(joint.chosen.law, StandModel) else ()
    has_plain_tail = decay.tail is not None and not any(effect.bends_tail for effect in effects)
    if has_plain_tail:
        constants = joint_fit.constants_from_tail(record, decay)
    else:
        constants = joint_fit.constants_from_joint_fit(joint.chosen, joint.uncertainty)

    budget = UncertaintyBudget()
    joint_fit.add_constants(constants, budget)
    check_period(budget.results["period_s"])
    labels = fitted_quantities.add_fitted_quantities(joint, tied, budget, slip_ended=slip_ended)
    fitted_quantities.add_static_friction_bounds(joint, tied, budget)
    if plate is not None:
        budget.add("friction_dynamic_plate", plate.friction_dynamic, plate.contributions)
    own = budget.results.get("friction_dynamic")
    fitted_friction = joint.chosen.value(Parameter.FRICTION_DYNAMIC) if own is None else own.value
    joint = replace(joint, selection=joint.selection.with_friction(fitted_friction))
    rivals = stand.rivals if stand is not None and joint.chosen is stand.fit else []
    spread, ideal = friction_spread(fitted.missing, rivals), min(fits, key=lambda fit: fit.bic)
    joint, verdict_warnings = judge(joint, plate, budget, ideal, spread, law_is_given=fitted.law_is_given)
    warnings = [
        *verdict_warnings,
        *(warning for warning in decay.warnings if not _is_refuted(warning, joint)),
        *(joint_fit.tail_warnings(decay) if has_plain_tail else []),
        *([] if decay.tail is not None else [_no_tail_warning()]),
        *diagnose(_certain_effects(stand, joint, fits), budget.results),
        *joint_fit.identifiability_warnings(joint.chosen, joint.uncertainty, slip_ended=slip_ended),
        *pullback_warnings(joint.chosen.value(Parameter.PULLBACK), record.pullback_m),
        *([] if adequate else [joint_fit.inadequate_warning(joint.selection)]),
        *([] if adequate or joint.selection.parts else mass_warnings(joint)),
        *(_needless_static(fitted.search, joint.chosen, fitted.minima) if fitted.law_is_given else []),
    ]
    drawn = None
    if monte_carlo is not None:
        drawn = _check_by_monte_carlo(joint, constants, budget, monte_carlo, report)
    delays_s = record.table_gauge.lateness_s, record.relative_gauge.lateness_s
    return Identification(
        "two-mass",
        budget.results,
        labels,
        joint.selection,
        budget.lines + unstated_gains(record, budget.results) + unstated_clock(record, budget.results),
        fitted_quantities.build_events(joint, slip_end),
        warnings,
        joint_fit.named_parameters(joint.chosen, decay),
        joint_fit.fitted_curves(joint.chosen, decay, delays_s),
        joint_fit.friction_objective(joint.problem, joint.chosen, fitted_friction),
        joint_fit.friction_curves(joint.chosen, fitted_friction, decay, delays_s),
        drawn,
        plate,
        budget.correlation(),
        fitted.decay,
    )


def _identify_without_slip(record: Record, decay: FreeDecay, *, with_monte_carlo: bool) -> Identification:
    """Period, damping and a lower bound of f_s: all that a record without slip gives."""
    if decay.tail is None:
        length_s = float(decay.table.time_s[-1]) - decay.release.time_s
        if length_s >= TAIL_PERIODS_MIN * decay.period_s:
            raise no_decay_error(length_s)
        template = N_("the decay lasts {length} s, under two periods. Record until rest.")
        raise RecordError(template, length=format_number(length_s))
    budget = UncertaintyBudget()
    constants = joint_fit.constants_from_tail(record, decay)
    joint_fit.add_constants(constants, budget)
    fitted_quantities.add_no_slip_bound(record, constants, decay, budget)
    if decay.relative is not None:
        seen = message("gauge 2 shows no slip")
    else:
        seen = message("the table swings as one mass")
    if decay.plateau is None:
        seen = message("{seen}, unless it came before the record", seen=seen)
    text = message("{seen}: period and damping are given, and the least f_s that prevents slip.", seen=seen)
    warnings = [*decay.warnings, *joint_fit.tail_warnings(decay), ResultWarning("no-slip", text)]
    if with_monte_carlo:
        text = message(
            "without slip there is no joint fit of friction to draw about: Monte Carlo was left out."
        )
        warnings.append(ResultWarning("nothing-to-draw", text))
    release = decay.channels.to_record_time(decay.release.time_s)
    return Identification(
        "two-mass",
        budget.results,
        budget=budget.lines + unstated_clock(record, budget.results),
        events=Events(release),
        warnings=warnings,
        correlation=budget.correlation(),
    )


def _is_adequate(problem: FitProblem, decay: FreeDecay, fits: list[Fit]) -> bool:
    """Whether the likeliest of `fits` leaves nothing but noise."""
    best = min(fits, key=lambda fit: fit.bic)
    counts = decay.noise_reading_counts
    return joint_fit.assess_model(problem, best, fits, counts, decay.period_s).adequate


def _missing_effects(
    search: StandSearch, decay: FreeDecay, chosen: Fit, fits: list[Fit]
) -> list[MissingEffect]:
    """Effects of the stand that a fit does without which leaves nothing but noise."""
    return search.missing_effects(chosen) if _is_adequate(search.problem, decay, fits) else []


def _stand_search(search: Search, decay: FreeDecay, fits: list[Fit]) -> StandSearch:
    """Search for effects of the stand beside the simplest law."""
    simple = _simplest(fits)
    return StandSearch(search, simple.law, min(fits, key=lambda fit: fit.bic), decay.tail)


def _simplest(fits: list[Fit]) -> Fit:
    """The fit with one coefficient of friction, and a tilt where the record tells it."""
    simple = next(fit for fit in fits if fit.law is FIRST_SLIP_LAW)
    if not simple.determines(Parameter.TILT):
        simple = next(fit for fit in fits if fit.law is COMPARED_LAWS[0])
    return simple


def _fit_stand(search: StandSearch, decay: FreeDecay, fits: list[Fit], start: Floats) -> StandFit:
    """Fit the simplest law with the effects of the stand that the record shows."""
    simple = _simplest(fits)
    starts = [project_to_bounds(point, simple.law) for point in (start, simple.parameters)]
    return search.fit(starts, lambda fit: _is_adequate(search.problem, decay, [fit]))


def _may_be_other_law(stand: StandFit, decay: FreeDecay) -> bool:
    """Whether friction that falls with velocity may explain what `fit` explains by other effects."""
    if not _is_adequate(stand.problem, decay, [stand.fit]):
        return True
    law = stand.fit.law
    return isinstance(law, StandModel) and any(effect.varies_friction for effect in law.effects)


def _explains_more(stand: StandFit, decay: FreeDecay, fits: list[Fit]) -> bool:
    """Whether effects of the stand explain the record, or most of what the friction laws leave.

    What contradicts the stated gains and lag counts: two gauges that differ by 5 % once passed for ideal.
    """
    best = min(fits, key=lambda fit: fit.bic)
    fit = stand.fit
    if not isinstance(fit.law, StandModel) or not fit.law.effects:
        return False
    if fit.bic + fit.departure > best.bic + best.departure - _EVIDENCE_MIN:
        return False
    excess, left = _excess(best, stand.problem), _excess(fit, stand.problem)
    return left < _LEFT_MAX * excess or _is_adequate(stand.problem, decay, [fit])


def _excess(fit: Fit, problem: FitProblem) -> float:
    """Chi-square beyond that of the noise."""
    return fit.chi_square - problem.sample_count


def _certain_effects(stand: StandFit | None, joint: JointFit, fits: list[Fit]) -> tuple[StandEffect, ...]:
    """Effects of the chosen model that can be named: others may stand for something else."""
    if stand is None or joint.chosen is not stand.fit or not isinstance(stand.fit.law, StandModel):
        return ()
    least = 0.0
    if not joint.selection.adequate:
        least = _NAMED_SHARE * _excess(min(fits, key=lambda fit: fit.bic), stand.problem)
    return tuple(
        effect
        for effect in stand.fit.law.effects
        if stand.evidence.get(effect.name, 0.0) >= least and is_clear(stand.fit, effect)
    )


def _needless_static(search: Search, asked: Fit, minima: list[Floats]) -> list[ResultWarning]:
    """Warn where the law that was asked for has an f_s that the record does not need."""
    plain = law_without(asked.law, Parameter.FRICTION_STATIC)
    if plain is None or not asked.determines(Parameter.FRICTION_STATIC):
        return []
    without = search.fit(plain, [*minima, asked.parameters])
    if without.bic > asked.bic:
        return []
    template = N_(
        "the law {plain} explains the record as well (BIC {bic:.1f}, with f_s {bic_with:.1f}): f_s may"
        " be as small as f_d, outside its interval too."
    )
    values = {"plain": plain.name, "bic": without.bic, "bic_with": asked.bic}
    return [result_warning("static-not-needed", template, **values)]


def _is_refuted(warning: ResultWarning, joint: JointFit) -> bool:
    """Whether the fit shows that the record begins with the release and not after it."""
    begins_s = float(joint.decay.table.time_s[0]) - joint.decay.channels.interval_s
    return warning.code == "release-not-recorded" and joint.chosen.value(Parameter.RELEASE) >= begins_s


def _no_tail_warning() -> ResultWarning:
    text = message(
        "the stick tail is shorter than two periods, or no damped oscillation: period and damping come from"
        " the joint fit."
    )
    return ResultWarning("tail-too-short", text)


def _check_by_monte_carlo(
    joint: JointFit, constants: DecayConstants, budget: UncertaintyBudget, refits: int, report: Progress
) -> MonteCarlo:
    def progress(done: int) -> None:
        share = 0.8 + 0.2 * done / refits
        report(share, message("Monte Carlo, {done} of {refits} refits", done=done, refits=refits))

    model = MonteCarloModel(joint, constants)
    return run_monte_carlo(model, budget.results, refits=refits, progress=progress)
