"""Tasks of the Identify screen, executed in the worker process."""

import numpy as np

from analysis.classical_estimates import estimate_classically
from app.presenters.analysed_run import AnalysisTask
from app.presenters.analysis_task import cached_analysis
from app.presenters.base import Progress, ReportProgress
from app.presenters.identify.state import (
    ClassicalFigures,
    DecimatedLine,
    EstimateClassical,
    Floats,
    ManualSimulation,
    SimulateFriction,
    Span,
)

_MAX_SIMULATED_SAMPLES = 40_000
"""A longer span is simulated at every n-th sample: the handle must follow the mouse."""


def simulate_friction(task: SimulateFriction, report: ReportProgress) -> ManualSimulation:
    """Simulate a run with another f_d. Raises RunError, AnalysisError, ValueError."""
    analysis = cached_analysis(AnalysisTask(task.path, task.model), report)
    curves, record = analysis.identification.curves_by_friction, analysis.record
    if curves is None:
        raise ValueError(f"{task.path}: no friction was found in it that could be varied")
    rows = _drawn_rows(record.time_s, task.span)
    time_s = record.time_s[rows]
    shown = curves(task.friction, time_s)
    pairs = [(record.table_displacement_m[rows], shown.table_displacement_m)]
    if record.relative_displacement_m is not None and shown.relative_displacement_m is not None:
        pairs.append((record.relative_displacement_m[rows], shown.relative_displacement_m))
    every = max(1, len(time_s) // (2 * task.span.pixels))
    return ManualSimulation(
        task.friction,
        tuple(DecimatedLine(time_s[::every], simulated[::every]) for _, simulated in pairs),
        tuple(_envelope(time_s, read - simulated, task.span.pixels) for read, simulated in pairs),
    )


def estimate_classical(task: EstimateClassical, report: ReportProgress) -> ClassicalFigures:
    """Estimate parameters by the methods of the paper. Raises RunError, AnalysisError."""
    analysis = cached_analysis(AnalysisTask(task.path, task.model), report)
    report(Progress("Classical figures"))
    estimates = estimate_classically(analysis.record, analysis.identification)
    return ClassicalFigures(
        estimates.period_s,
        estimates.log_decrement,
        estimates.log_decrement_uncertainty,
        estimates.cycles,
        estimates.friction_candidates,
        estimates.friction_by_paper_method,
    )


def _drawn_rows(time_s: Floats, span: Span) -> slice:
    """Samples of a span and one beyond each end; at least two."""
    first = min(max(int(np.searchsorted(time_s, span.start_s)) - 1, 0), len(time_s) - 2)
    last = max(int(np.searchsorted(time_s, span.end_s)) + 1, first + 2)
    return slice(first, last, max(1, (last - first) // _MAX_SIMULATED_SAMPLES))


def _envelope(time_s: Floats, value_m: Floats, pixels: int) -> DecimatedLine:
    """Minimum and maximum of each two pixels."""
    if len(time_s) <= pixels:
        return DecimatedLine(time_s, value_m)
    firsts = np.linspace(0, len(time_s), pixels // 2, endpoint=False).astype(np.intp)
    low, high = np.fmin.reduceat(value_m, firsts), np.fmax.reduceat(value_m, firsts)
    return DecimatedLine(np.repeat(time_s[firsts], 2), np.column_stack((low, high)).ravel())
