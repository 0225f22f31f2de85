"""What the worker does while a run is shown: simulate it with another f_d, work out the classical figures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.presenters.analysis_task import AUTO_MODEL, AnalysisTask, cached_analysis
from app.presenters.base import Progress
from app.presenters.worker import ReportProgress

Floats = NDArray[np.float64]
_MAX_SIMULATED_SAMPLES = 40_000
"""Readings of which the simulation is worked out; of more, some are left out evenly."""


@dataclass(frozen=True, slots=True)
class Span:
    """What of a run is drawn: times in the base of the record, and the width in pixels."""

    start_s: float
    end_s: float
    pixels: int


@dataclass(frozen=True, slots=True)
class SimulateFriction:
    """Ask for the fitted motion of a run with another f_d, as finely as it is drawn."""

    path: str
    friction: float
    span: Span
    model: str = AUTO_MODEL


@dataclass(frozen=True, slots=True)
class EstimateClassical:
    """Ask for the paper's own figures of a run."""

    path: str
    model: str = AUTO_MODEL


@dataclass(frozen=True, eq=False, slots=True)
class DecimatedLine:
    """A line with a few points a pixel, (n,) each; times in the base of the record."""

    time_s: Floats
    value_m: Floats


@dataclass(frozen=True, eq=False, slots=True)
class ManualSimulation:
    """The record's simulation with an f_d that was set by hand, and what it leaves over.

    Attributes
    ----------
    friction : float
    simulations, residuals : tuple of DrawnLine
        Of the table, and of the relative displacement if there is a second gauge.
    """

    friction: float
    simulations: tuple[DecimatedLine, ...]
    residuals: tuple[DecimatedLine, ...]


@dataclass(frozen=True, slots=True)
class ClassicalFigures:
    """The paper's own figures, as in `analysis.classical_estimates`; None where the record lacks them."""

    period_s: float | None
    log_decrement: float | None
    log_decrement_uncertainty: float | None
    cycles: int
    frictions_of_residual: tuple[float, ...]
    friction_of_paper: float | None


def simulate_friction(asked: SimulateFriction, report: ReportProgress) -> ManualSimulation:
    """Simulate a run with another f_d, all else as fitted. Raises RunError, AnalysisError, ValueError."""
    analysis = cached_analysis(AnalysisTask(asked.path, asked.model), report)
    curves, record = analysis.identification.curves_by_friction, analysis.record
    if curves is None:
        raise ValueError(f"{asked.path}: no friction was found in it that could be varied")
    rows = _drawn_rows(record.time_s, asked.span)
    time_s = record.time_s[rows]
    shown = curves(asked.friction, time_s)
    pairs = [(record.table_displacement_m[rows], shown.table_displacement_m)]
    if record.relative_displacement_m is not None and shown.relative_displacement_m is not None:
        pairs.append((record.relative_displacement_m[rows], shown.relative_displacement_m))
    every = max(1, len(time_s) // (2 * asked.span.pixels))
    return ManualSimulation(
        asked.friction,
        tuple(DecimatedLine(time_s[::every], simulated[::every]) for _, simulated in pairs),
        tuple(_envelope(time_s, read - simulated, asked.span.pixels) for read, simulated in pairs),
    )


def estimate_classical(asked: EstimateClassical, report: ReportProgress) -> ClassicalFigures:
    """Work out the paper's own figures of an analysed run. Raises RunError, AnalysisError."""
    from analysis.classical_estimates import estimate_classically

    analysis = cached_analysis(AnalysisTask(asked.path, asked.model), report)
    report(Progress("Classical figures"))
    found = estimate_classically(analysis.record, analysis.identification)
    return ClassicalFigures(
        found.period_s,
        found.log_decrement,
        found.log_decrement_uncertainty,
        found.cycles,
        found.friction_candidates,
        found.friction_by_paper_method,
    )


def _drawn_rows(time_s: Floats, span: Span) -> slice:
    """Rows within a span and one beyond it at each end; two at least."""
    first = min(max(int(np.searchsorted(time_s, span.start_s)) - 1, 0), len(time_s) - 2)
    last = max(int(np.searchsorted(time_s, span.end_s)) + 1, first + 2)
    return slice(first, last, max(1, (last - first) // _MAX_SIMULATED_SAMPLES))


def _envelope(time_s: Floats, value_m: Floats, pixels: int) -> DecimatedLine:
    """Lowest and highest value of each two pixels, so that no extreme is lost."""
    if len(time_s) <= pixels:
        return DecimatedLine(time_s, value_m)
    firsts = np.linspace(0, len(time_s), pixels // 2, endpoint=False).astype(np.intp)
    low, high = np.fmin.reduceat(value_m, firsts), np.fmax.reduceat(value_m, firsts)
    return DecimatedLine(np.repeat(time_s[firsts], 2), np.column_stack((low, high)).ravel())
