"""A test before it is made: from the stand's settings and a calibration to what it will show, as JSON."""

from collections.abc import Sequence
from typing import Any

import msgspec

from analysis.campaign.observed import ObservedUncertainty, observe_uncertainty, planned_sizes
from analysis.campaign.stand_effects import EffectSummary, summarize_effects
from analysis.motion.two_mass import TwoMassParameters
from analysis.plan import PlannedTest, expected_budget, plan, smallest_pullback_m
from analysis.uncertainty_reduction import reduction_options, uncertainty_parts
from app.runs.analysis_input import gauge_uncertainty
from app.runs.analysis_json import budget_documents, warning_documents
from app.runs.campaign.documents import effect_documents
from app.runs.campaign.last_runs import LastRuns
from config.schema import Gauges, Stand

Document = dict[str, Any]


def build_planned_test(
    parameters: TwoMassParameters, stand: Stand, gauges: Gauges, **facts: Any
) -> PlannedTest:
    """A test on a stand with these gauges; `facts` are fields of `PlannedTest`. Raises AnalysisError."""
    return PlannedTest(
        parameters=parameters,
        table_mass_uncertainty_kg=stand.table_mass_standard_uncertainty_kg,
        plate_mass_uncertainty_kg=stand.plate_mass_standard_uncertainty_kg,
        gravity_uncertainty_m_per_s2=stand.gravity_standard_uncertainty_m_per_s2,
        table_gauge=gauge_uncertainty(gauges.table),
        relative_gauge=gauge_uncertainty(gauges.relative),
        gauge_2_measures_plate=gauges.relative.measures == "plate",
        **facts,
    )


def with_effects(
    test: PlannedTest, effects: Sequence[EffectSummary], observed: ObservedUncertainty | None
) -> PlannedTest:
    """The test on a stand that shows `effects` in its runs, with the uncertainty that these reached."""
    return test.replace(
        effects=planned_sizes(effects, test.parameters.pullback_m),
        effects_pullback_m=test.parameters.pullback_m,
        model_spread=observed.model if observed else 0.0,
    )


def plan_document(test: PlannedTest, last: LastRuns | None = None) -> Document:
    """JSON of what a test will show, and of what would halve the uncertainty of f_d. Raises AnalysisError.

    Effects that the stand shows in its last runs are planned with.
    """
    of_last: Document | None = None
    if last is not None and last.results:
        test, of_last = _with_last_runs(test, last)
    return {**_document(test), "last_runs": of_last}


def _with_last_runs(test: PlannedTest, last: LastRuns) -> tuple[PlannedTest, Document]:
    """The test with the stand's effects in it, and what the last runs say."""
    effects = summarize_effects(last.results)
    observed = observe_uncertainty(last.results)
    changed = with_effects(test, effects, observed)
    ideal = expected_budget(test).results.get("friction_dynamic")
    described = None
    if observed is not None:
        described = msgspec.to_builtins(observed) | {
            "standard_uncertainty": observed.standard_uncertainty,
            "runs_to_halve": observed.runs_to_halve,
            "message": str(observed.message),
        }
    return changed, {
        "folder": str(last.folder),
        "runs": [result.name for result in last.results],
        "effects_of_stand": effect_documents(effects),
        "planned_with": [effect.name for effect in changed.stand_effects],
        "model_spread": changed.model_spread,
        "ideal_standard_uncertainty": None if ideal is None else ideal.standard_uncertainty,
        "friction_dynamic": described,
    }


def _document(test: PlannedTest) -> Document:
    found, parts = plan(test), uncertainty_parts(test)
    motion = found.motion
    return {
        "law": found.law.name,
        "rate_hz": test.rate_hz,
        "duration_s": test.duration_s,
        "noise_m": test.noise_m,
        "parameters": msgspec.to_builtins(test.parameters),
        "period_s": test.period_s,
        "smallest_pullback_m": smallest_pullback_m(test.parameters),
        "residual_displacement_m": motion.residual_displacement_m,
        "slip_end_s": motion.slip_end_s,
        "phases": len(motion.phase_starts_s),
        "rest_s": found.rest_s,
        "table_velocity_max_m_per_s": motion.table_velocity_max_m_per_s,
        "plate_velocity_max_m_per_s": motion.plate_velocity_max_m_per_s,
        "table_acceleration_max_m_per_s2": motion.table_acceleration_max_m_per_s2,
        "plate_acceleration_max_m_per_s2": motion.plate_acceleration_max_m_per_s2,
        "msk64_degree": found.msk64_degree,
        "gauges": {
            name: {**msgspec.to_builtins(use), "share": use.share, "fits": use.fits()}
            for name, use in (("table", found.table_use), ("relative", found.relative_use))
        },
        "tests_without_recentring": found.tests_without_recentring,
        "results": {name: msgspec.to_builtins(value) for name, value in found.results.items()},
        "noise_part": parts.noise if parts else None,
        "stated_part": parts.stated if parts else None,
        "budget": budget_documents(found.budget),
        "halved_by": [
            {
                "means": way.measure.value,
                "value": way.value,
                "standard_uncertainty": way.standard_uncertainty,
                "message": str(way.message),
            }
            for way in reduction_options(test)
        ],
        "warnings": warning_documents(found.warnings),
    }
