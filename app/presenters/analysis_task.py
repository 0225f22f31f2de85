"""What the worker does to a run: read it, identify it, and hand back plain arrays. Runs in its process."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from app.presenters.analysed_run import AnalysedRun, AnalysisKind, Channel, Kinematics, Objective
from app.presenters.base import Progress, ReportProgress
from app.presenters.results import FRICTION, sentence

if TYPE_CHECKING:
    from analysis.identification import Identification
    from analysis.motion.two_mass import Motion
    from analysis.record import Record
    from app.runs.analyze import Analysis, AnalysisRequest

AUTO_MODEL = "auto"
_SCANNED = 161
_SCAN_DEVIATIONS, _SCAN_SHARE = 12.0, 0.04
"""The scan of f_d reaches so many standard uncertainties, and at least this share of f_d, both ways."""
_PER_PERIOD = 60
_BEFORE_RELEASE_S = 0.2


@dataclass(frozen=True, slots=True)
class AnalysisTask:
    """Ask for the identification of a run: with one friction law instead of the likeliest, or as one mass."""

    path: str
    model: str = AUTO_MODEL
    kind: AnalysisKind = "two-mass"


class _AnalysisCache:
    """The analyses of the last run: a handle that is dragged asks for one many times a second."""

    path: ClassVar = ""
    analyses: ClassVar[dict[AnalysisTask, Any]] = {}


def analyse_run(path: str, report: ReportProgress) -> AnalysedRun:
    """Read and identify a run.

    Raises
    ------
    RunError
        It cannot be read.
    AnalysisError
        Nothing can be identified in it.
    """
    _AnalysisCache.path = ""  # the file may have changed
    return run_analysis(AnalysisTask(path), report)


def run_analysis(asked: AnalysisTask, report: ReportProgress) -> AnalysedRun:
    """Identify a run as asked. Raises RunError, AnalysisError."""
    analysis = cached_analysis(asked, report)
    found, record, run = analysis.identification, analysis.record, analysis.run
    table, relative = _channels(found, record)
    motion = _motion(found, record)
    return AnalysedRun(
        path=Path(asked.path),
        time_s=record.time_s,
        table=table,
        relative=relative,
        results=found.results,
        labels=found.labels,
        model=found.model,
        events=found.events,
        cautions=tuple(found.warnings),
        ended=run.end.ended if run.end else "",
        budget=tuple(found.budget),
        kinematics=None if motion is None else _kinematics(motion, found),
        objective=_objective(found),
        kind=asked.kind,
        slips=() if motion is None else _slips(motion, found.parameters["release_s"]),
        note=run.metadata.note,
    )


def cached_analysis(asked: AnalysisTask, report: ReportProgress) -> "Analysis":
    """The analysis that was asked for, done now unless it was done before. Raises RunError, AnalysisError."""
    from app.runs.analyze import analyze_run

    if _AnalysisCache.path != asked.path:
        _AnalysisCache.path, _AnalysisCache.analyses = asked.path, {}
    if asked not in _AnalysisCache.analyses:
        _AnalysisCache.analyses[asked] = analyze_run(
            Path(asked.path),
            _request(asked),
            progress=lambda share, what: report(Progress(sentence(what), share)),
        )
    analysis: Analysis = _AnalysisCache.analyses[asked]
    return analysis


def _request(asked: AnalysisTask) -> "AnalysisRequest":
    from app.runs.analyze import AnalysisRequest

    return AnalysisRequest(model=asked.model, kind=asked.kind, classical=False)


def warm_up(_nothing: None, _report: ReportProgress) -> None:
    """Identify a simulated record, so that all code is loaded, and compiled on a first start, beforehand."""
    from analysis.identify import warm_up as identify_once

    identify_once()


def _channels(found: "Identification", record: "Record") -> tuple[Channel, Channel | None]:
    """Both gauges with what they should have read; of one mass the first alone, from its first turning on."""
    fit = None if found.curves is None else found.curves(record.time_s)
    table_m = None if fit is None else fit.table_displacement_m
    if found.kind == "one-mass":
        if table_m is not None:
            table_m = np.where(record.time_s < found.parameters["turning_s"], np.nan, table_m)
        return Channel(record.table_displacement_m, table_m), None
    table = Channel(record.table_displacement_m, table_m)
    if record.relative_displacement_m is None:
        return table, None
    return table, Channel(
        record.relative_displacement_m, None if fit is None else fit.relative_displacement_m
    )


def _objective(found: "Identification") -> Objective | None:
    friction = found.results.get(FRICTION.name)
    if found.objective is None or found.model is None or friction is None:
        return None
    reach = max(_SCAN_DEVIATIONS * friction.standard_uncertainty, _SCAN_SHARE * friction.value)
    scanned = np.linspace(max(friction.value - reach, 1e-4), friction.value + reach, _SCANNED)
    scanned = np.sort(np.append(scanned, friction.value))
    costs = found.objective(scanned)
    best = found.objective(np.array([found.parameters[FRICTION.name]]))[0]
    residual_m = found.model.residual_rms_m * np.sqrt(costs / best)
    return Objective(scanned, residual_m, friction.value, friction.interval_95)


def _motion(found: "Identification", record: "Record") -> "Motion | None":
    """The fitted motion of both masses; None for one mass, without slip, or for an integrated law."""
    from analysis.laws.catalogue import law_with_own_parameters
    from analysis.motion.two_mass import TwoMassParameters

    if FRICTION.name not in found.parameters:
        return None
    if not law_with_own_parameters(found.results).solver.is_closed_form:
        return None
    of_motion = {name: value for name, value in found.parameters.items() if name != "release_s"}
    return TwoMassParameters(**of_motion).simulate(float(record.time_s[-1]) - found.parameters["release_s"])


def _kinematics(motion: "Motion", found: "Identification") -> Kinematics:
    period_s = found.results["period_s"].value if "period_s" in found.results else 0.3
    count = round((motion.duration_s + _BEFORE_RELEASE_S) / period_s * _PER_PERIOD) + 2
    shown = motion.sample(np.linspace(-_BEFORE_RELEASE_S, motion.duration_s, count))
    return Kinematics(
        time_s=shown.time_s + found.parameters["release_s"],
        table_m=shown.table_displacement_m,
        relative_m=shown.relative_displacement_m,
        table_m_per_s=shown.table_velocity_m_per_s,
        plate_m_per_s=shown.plate_velocity_m_per_s,
        table_m_per_s2=shown.table_acceleration_m_per_s2,
        plate_m_per_s2=shown.plate_acceleration_m_per_s2,
    )


def _slips(motion: "Motion", release_s: float) -> tuple[tuple[float, float], ...]:
    """Spans of sliding, one for slips that follow one another without a stick."""
    ends_s = np.append(motion.phase_starts_s[1:], motion.duration_s)
    spans: list[tuple[float, float]] = []
    for sign, start_s, end_s in zip(motion.phase_signs, motion.phase_starts_s, ends_s, strict=True):
        if not sign:
            continue
        if spans and spans[-1][1] == release_s + start_s:
            spans[-1] = spans[-1][0], release_s + end_s
        else:
            spans.append((release_s + start_s, release_s + end_s))
    return tuple((float(start_s), float(end_s)) for start_s, end_s in spans)
