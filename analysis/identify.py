"""The whole way from a record to friction with its uncertainty and verdict."""

from collections.abc import Callable

from analysis.arrays import Floats
from analysis.fitting.initial_guess import build_problem, guess_release, initial_guess, initial_points
from analysis.fitting.problem import FitProblem
from analysis.fitting.search import Fit, Search, may_be_friction
from analysis.formatting import format_number
from analysis.identification import Events, Identification, ModelSelection, MonteCarlo
from analysis.laws.catalogue import COMPARED_LAWS, FALLBACK_LAWS, WIDEST_LAW, law_by_name, law_without
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.preparation.free_decay import FreeDecay, fit_tail, prepare
from analysis.preparation.plausibility import check_friction, pullback_warnings
from analysis.quantities import ResultWarning
from analysis.record import Record, RecordError
from analysis.results.curves import fitted_curves, friction_curves, friction_objective, named_parameters
from analysis.results.decay_constants import (
    DecayConstants,
    add_constants,
    constants_from_joint_fit,
    constants_from_tail,
)
from analysis.results.events import SlipEnd, build_events, find_slip_end
from analysis.results.fitted_quantities import add_fitted_quantities, joint_fit_uncertainty
from analysis.results.mass_check import mass_warnings
from analysis.results.monte_carlo import MonteCarloModel, run_monte_carlo
from analysis.results.static_bounds import add_no_slip_bound, add_static_friction_bounds
from analysis.results.verdict import (
    assess_model,
    identifiability_warnings,
    identifiable_fits,
    inadequate_warning,
    tail_warnings,
)
from analysis.synthetic import Truth, simulate_record
from analysis.uncertainty import ParameterUncertainty, UncertaintyBudget, unstated_gains
from messages.message import message

Progress = Callable[[float, str], None]


def identify(
    record: Record,
    *,
    model: str = "auto",
    progress: Progress | None = None,
    monte_carlo: int | None = None,
) -> Identification:
    """Identify friction, stiffness and damping from one pullback test.

    Parameters
    ----------
    record : Record
    model : str
        "auto" (the likeliest law is chosen; Stribeck friction is tried only where none of the others is
        adequate) or one of `Model`'s values.
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
    models = _models(model)
    report = progress or (lambda _share, _what: None)
    report(0.0, "looking for the release")
    decay = prepare(record)
    if not decay.slips:
        return _without_slip(record, decay, drawn=monte_carlo is not None)
    problem = build_problem(record, decay)
    search, widest = _searched(record, decay, problem, report)
    report(0.6, "fitting " + ", ".join(law.name for law in models))
    fits = _fits(search, models, widest)
    if model == "auto" and _wants_other_friction(problem, decay, fits):
        for law in FALLBACK_LAWS:
            report(0.7, f"fitting {law.name}")
            fits.append(search.fit_fallback(law, fits[len(COMPARED_LAWS) - 1]))
    result = _result(record, decay, problem, fits, monte_carlo, report)
    if model != "auto":
        result.warnings.extend(_needless_static(search, fits[0], widest))
    report(1.0, "done")
    return result


def _searched(
    record: Record, decay: FreeDecay, problem: FitProblem, report: Progress
) -> tuple[Search, list[Floats]]:
    """Minima of the widest law without Stribeck friction."""
    report(0.1, "first estimate")
    start, guided = initial_guess(problem, decay)
    search = Search(problem, guided, decay.period_s, decay.dense_until_s)
    if decay.plateau is not None:
        points = [search.fit_first_slip(point) for point in initial_points(start, decay)]
    else:
        points = guess_release(guided, start, decay.period_s, record.pullback_m)
    report(0.3, "following the motion")
    return search, search.find_minima(points)


def _fits(search: Search, models: tuple[FrictionLaw, ...], widest: list[Floats]) -> list[Fit]:
    if models[0] in FALLBACK_LAWS:
        return [search.fit_fallback(models[0], search.fit(WIDEST_LAW, widest))]
    return search.fit_all(models, widest)


def _wants_other_friction(problem: FitProblem, decay: FreeDecay, fits: list[Fit]) -> bool:
    """Whether no law of `fits` explains the record, and another friction may be why."""
    return not _judge(problem, decay, fits, fits).adequate and may_be_friction(problem, fits)


def _needless_static(search: Search, asked: Fit, starts: list[Floats]) -> list[ResultWarning]:
    """Say so where the law that was asked for has an f_s that the record does not need."""
    plain = law_without(asked.law, Parameter.FRICTION_STATIC)
    if plain is None or not asked.determines(Parameter.FRICTION_STATIC):
        return []
    without = search.fit(plain, [*starts, asked.parameters])
    if without.bic > asked.bic:
        return []
    text = message(
        "the law {plain} explains the record as well (BIC {bic:.1f}, with f_s {bic_2:.1f}): f_s may"
        " be as small as f_d, outside its interval too.",
        plain=plain.name,
        bic=without.bic,
        bic_2=asked.bic,
    )
    return [ResultWarning("static-not-needed", text)]


def _judge(problem: FitProblem, decay: FreeDecay, candidates: list[Fit], fits: list[Fit]) -> ModelSelection:
    chosen = min(candidates, key=lambda fit: fit.bic)
    return assess_model(problem, chosen, fits, decay.noise_reading_counts, decay.period_s)


def _models(name: str) -> tuple[FrictionLaw, ...]:
    if name == "auto":
        return COMPARED_LAWS
    return (law_by_name(name),)


def _without_slip(record: Record, decay: FreeDecay, *, drawn: bool) -> Identification:
    """Period, damping and a lower bound of f_s are all that a record without slip gives."""
    if decay.tail is None:
        raise RecordError(
            f"the decay lasts {format_number(decay.table.time_s[-1] - decay.release.time_s)} s, under two"
            f" periods."
            " Record until rest."
        )
    budget = UncertaintyBudget()
    constants = constants_from_tail(record, decay)
    decay.warnings.extend(tail_warnings(decay))
    add_constants(constants, budget)
    add_no_slip_bound(record, constants, decay, budget)
    seen = "gauge 2 shows no slip" if decay.relative is not None else "the table swings as one mass"
    if decay.plateau is None:
        seen += ", unless it came before the record"
    text = message("{seen}: period and damping are given, and the least f_s that prevents slip.", seen=seen)
    warnings = [*decay.warnings, ResultWarning("no-slip", text)]
    if drawn:
        text = message(
            "without slip there is no joint fit of friction to draw about: Monte Carlo was left out."
        )
        warnings.append(ResultWarning("nothing-to-draw", text))
    release = decay.channels.to_record_time(decay.release.time_s)
    return Identification(
        "two-mass", budget.results, budget=budget.lines, events=Events(release), warnings=warnings
    )


def _result(
    record: Record,
    decay: FreeDecay,
    problem: FitProblem,
    fits: list[Fit],
    refits: int | None,
    report: Progress,
) -> Identification:
    report(0.8, "uncertainty")
    candidates = identifiable_fits(fits)
    chosen = min(candidates, key=lambda fit: fit.bic)
    check_friction(chosen.value(Parameter.FRICTION_DYNAMIC))
    fitted = joint_fit_uncertainty(record, decay, problem, chosen, candidates)
    judged = _judge(problem, decay, candidates, fits)
    slip_end = find_slip_end(problem, decay, chosen, candidates, adequate=judged.adequate)
    ended = slip_end is not None or (decay.slip_end_s is not None and not judged.adequate)
    decay, constants = _constants(record, decay, slip_end, chosen, fitted)
    budget = UncertaintyBudget()
    add_constants(constants, budget)
    labels = add_fitted_quantities(
        record, decay, problem, chosen, fitted, budget, ended=ended, profiled=_profiled(chosen, judged)
    )
    add_static_friction_bounds(problem, decay, chosen, candidates, fitted, budget)
    warnings = [
        *(warning for warning in decay.warnings if not _refuted(warning, decay, chosen)),
        *identifiability_warnings(chosen, fitted, ended=ended),
        *pullback_warnings(chosen.value(Parameter.PULLBACK), record.pullback_m),
        *_inadequate(record, decay, chosen, judged),
    ]
    delays_s = record.table_gauge.delay_s, record.relative_gauge.delay_s
    return Identification(
        "two-mass",
        budget.results,
        labels,
        judged,
        budget.lines + unstated_gains(record),
        build_events(decay, chosen, slip_end),
        warnings,
        named_parameters(chosen.parameters, decay),
        fitted_curves(chosen, decay, delays_s),
        friction_objective(problem, chosen),
        friction_curves(chosen, decay, delays_s),
        _drawn(
            MonteCarloModel(record, problem, chosen, fitted, decay.tail, constants), budget, refits, report
        ),
    )


def _inadequate(record: Record, decay: FreeDecay, chosen: Fit, judged: ModelSelection) -> list[ResultWarning]:
    """What is to be said of a law that does not explain the record, none of one that does."""
    if judged.adequate:
        return []
    return [inadequate_warning(judged), *mass_warnings(record, decay, chosen)]


def _profiled(chosen: Fit, judged: ModelSelection) -> bool:
    """Whether intervals are worth following chi-square: with Stribeck friction that takes seconds."""
    return judged.adequate or chosen.law.solver.is_closed_form


def _refuted(warning: ResultWarning, decay: FreeDecay, chosen: Fit) -> bool:
    """Whether the fit shows that the record begins with the release and not after it."""
    begins_s = float(decay.table.time_s[0]) - decay.channels.interval_s
    return warning.code == "release-not-recorded" and chosen.value(Parameter.RELEASE) >= begins_s


def _drawn(
    drawing: MonteCarloModel, budget: UncertaintyBudget, refits: int | None, report: Progress
) -> MonteCarlo | None:
    if refits is None:
        return None

    def progress(done: int) -> None:
        report(0.8 + 0.2 * done / refits, f"Monte Carlo, {done} of {refits} refits")

    return run_monte_carlo(drawing, budget.results, refits=refits, progress=progress)


def _constants(
    record: Record, decay: FreeDecay, slip_end: SlipEnd | None, chosen: Fit, fitted: ParameterUncertainty
) -> tuple[FreeDecay, DecayConstants]:
    """Period and damping from the stick tail once slip has surely ended, or from the joint fit."""
    decay = fit_tail(decay, None if slip_end is None else slip_end.upper_limit_s)
    if decay.tail is not None:
        decay.warnings.extend(tail_warnings(decay))
        return decay, constants_from_tail(record, decay)
    text = message("the stick tail is shorter than two periods: period and damping come from the joint fit.")
    decay.warnings.append(ResultWarning("tail-too-short", text))
    return decay, constants_from_joint_fit(chosen, fitted)


def warm_up() -> None:
    """Identify a simulated record."""
    identify(simulate_record(Truth(rate_hz=500.0, duration_s=8.0)))
