"""A test before it is made: from the stand's settings and a calibration to what it will show, as JSON."""

from typing import Any

import msgspec

from analysis.motion.two_mass import TwoMassParameters
from analysis.plan import PlannedTest, plan, smallest_pullback_m
from analysis.uncertainty_reduction import reduction_options, uncertainty_parts
from app.runs.analysis_input import gauge_uncertainty
from app.runs.analysis_json import budget_documents, warning_documents
from config.schema import Gauges, Stand

Document = dict[str, Any]


def build_planned_test(
    parameters: TwoMassParameters, stand: Stand, gauges: Gauges, **facts: float
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


def plan_document(test: PlannedTest) -> Document:
    """JSON of what a test will show, and of what would halve the uncertainty of f_d. Raises AnalysisError."""
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
