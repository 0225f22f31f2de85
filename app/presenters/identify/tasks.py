"""Tasks of the Identify screen, executed in the worker process."""

import numpy as np

from analysis.catalogue import displacement_unit
from analysis.classical_estimates import estimate_classically
from app.presenters.analysed_run import AnalysisTask
from app.presenters.analysis_task import cached_analysis
from app.presenters.identify.result_tables import classical_rows
from app.presenters.identify.state import ClassicalRow, Floats, ManualFit, PlotLine, Span

_MAX_SIMULATED_SAMPLES = 40_000
"""A longer span is simulated at every n-th sample: the handle must follow the mouse."""


def simulate_friction(task: AnalysisTask, friction: float, span: Span) -> ManualFit:
    """Simulate a run with another f_d, decimated for a span. Raises RunError, AnalysisError, ValueError."""
    analysis = cached_analysis(task)
    curves, record = analysis.identification.curves_by_friction, analysis.record
    if curves is None:
        raise ValueError(f"{task.path}: no friction was found in it that could be varied")
    rows = _drawn_rows(record.time_s, span)
    time_s = record.time_s[rows]
    shown = curves(friction, time_s)
    pairs = [(record.table_displacement_m[rows], shown.table_displacement_m)]
    if record.relative_displacement_m is not None and shown.relative_displacement_m is not None:
        pairs.append((record.relative_displacement_m[rows], shown.relative_displacement_m))
    time_s = time_s - span.origin_s
    scale = displacement_unit().scale
    every = max(1, len(time_s) // (2 * span.pixels))
    return ManualFit(
        friction,
        tuple(PlotLine(time_s[::every], scale * simulated[::every]) for _, simulated in pairs),
        tuple(_envelope(time_s, 1e6 * (read - simulated), span.pixels) for read, simulated in pairs),
    )


def estimate_classical(task: AnalysisTask) -> tuple[ClassicalRow, ...]:
    """Estimate parameters by the methods of the paper. Raises RunError, AnalysisError."""
    analysis = cached_analysis(task)
    estimates = estimate_classically(analysis.record, analysis.identification)
    return classical_rows(analysis.identification.results, estimates)


def _drawn_rows(time_s: Floats, span: Span) -> slice:
    """Samples of a span and one beyond each end; at least two."""
    start, end = np.searchsorted(time_s, np.array([span.start_s, span.end_s]) + span.origin_s)
    first = min(max(int(start) - 1, 0), len(time_s) - 2)
    last = max(int(end) + 1, first + 2)
    return slice(first, last, max(1, (last - first) // _MAX_SIMULATED_SAMPLES))


def _envelope(time_s: Floats, values: Floats, pixels: int) -> PlotLine:
    """Minimum and maximum of each two pixels."""
    if len(time_s) <= pixels:
        return PlotLine(time_s, values)
    firsts = np.linspace(0, len(time_s), pixels // 2, endpoint=False).astype(np.intp)
    low, high = np.fmin.reduceat(values, firsts), np.fmax.reduceat(values, firsts)
    return PlotLine(np.repeat(time_s[firsts], 2), np.column_stack((low, high)).ravel())
