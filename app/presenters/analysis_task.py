"""Tasks of the window's analysis process: identify a run, and recover unfinished runs."""

from pathlib import Path

import numpy as np

from analysis.identification import Identification
from analysis.identify import warm_up as identify_once
from analysis.laws.stand_parts import model_law, simulate_fit
from analysis.motion.two_mass import Motion
from analysis.plate.trends import FrictionBySlip, friction_by_slip
from analysis.record import Record
from app.acquisition.journal.recovery import Recovery, RecoveryState, recover_folder
from app.presenters.analysed_run import AnalysedRun, AnalysisTask, Channel, Kinematics, Objective
from app.presenters.base import Progress, ReportProgress
from app.presenters.recovery import RecoveryReport
from app.presenters.results import FRICTION, sentence
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import Analysis, analyze_run
from app.runs.paths import journal_folders
from messages.i18n import gettext, translate

_SCANNED = 161
_SCAN_DEVIATIONS, _SCAN_SHARE = 12.0, 0.04
"""The scan of f_d reaches so many standard uncertainties, and at least this share of f_d, both ways."""
_PER_PERIOD = 60
_BEFORE_RELEASE_S = 0.2


_analyses: dict[AnalysisTask, Analysis] = {}
"""Analyses of the last run: a handle that is dragged asks for one many times a second."""


def analyse_run(path: str, report: ReportProgress) -> AnalysedRun:
    """Read and identify a run. Raises RunError, AnalysisError."""
    _analyses.clear()  # the file may have changed
    return run_analysis(AnalysisTask(path), report)


def run_analysis(task: AnalysisTask, report: ReportProgress) -> AnalysedRun:
    """Identify a run. Raises RunError, AnalysisError."""
    analysis = cached_analysis(task, report)
    found, record, run = analysis.identification, analysis.record, analysis.run
    table, relative = _channels(found, record)
    motion = _motion(found, record)
    return AnalysedRun(
        path=Path(task.path),
        time_s=record.time_s,
        table=table,
        relative=relative,
        unit=run.metadata.unit,
        results=found.results,
        labels=found.labels,
        model=found.model,
        events=found.events,
        warnings=tuple(found.warnings),
        ended=run.end.ended if run.end else "",
        budget=tuple(found.budget),
        kinematics=None if motion is None else _kinematics(motion, found),
        objective=_objective(found),
        kind=task.kind,
        slips=() if motion is None else _slips(motion, found.parameters["release_s"]),
        note=run.metadata.note,
        friction_by_slip=_friction_by_slip(found, record),
    )


def cached_analysis(task: AnalysisTask, report: ReportProgress = lambda _progress: None) -> Analysis:
    """Analysis of a run, from the cache if it is there. Raises RunError, AnalysisError."""
    if any(analysed.path != task.path for analysed in _analyses):
        _analyses.clear()
    if task not in _analyses:
        request = AnalysisRequest(model=task.model, kind=task.kind, classical=False)
        _analyses[task] = analyze_run(
            Path(task.path), request, progress=lambda share, what: report(Progress(sentence(what), share))
        )
    return _analyses[task]


def warm_up() -> None:
    """Identify a simulated record, so that all code is loaded, and compiled on a first start."""
    identify_once()


def recover_runs(folder: str, report: ReportProgress) -> RecoveryReport:
    """Finish the runs of a folder that a crash has left unfinished, with journals in fallback folders."""
    found: list[Recovery] = []
    for place in journal_folders(Path(folder)):
        found += recover_folder(
            place,
            lambda journal, share: report(Progress(gettext("Recovering {name}", name=journal.stem), share)),
            original_folder=Path(folder),
        )
    return RecoveryReport(
        runs=tuple(one.run for one in found if one.run),
        replaced_files=tuple(one.kept for one in found if one.kept),
        errors=tuple(translate(one.message) for one in found if one.state is RecoveryState.FAILED),
    )


def _channels(found: Identification, record: Record) -> tuple[Channel, Channel | None]:
    """Record and fit of both gauges; of the table alone for one mass, from its first turning point on."""
    fit = None if found.curves is None else found.curves(record.time_s)
    table_m = None if fit is None else fit.table_displacement_m
    if found.kind == "one-mass":
        if table_m is not None:
            table_m = np.where(record.time_s < found.parameters["turning_s"], np.nan, table_m)
        return Channel(record.table_displacement_m, table_m), None
    table = Channel(record.table_displacement_m, table_m)
    if record.relative_displacement_m is None:
        return table, None
    relative_m = None if fit is None else fit.relative_displacement_m
    return table, Channel(record.relative_displacement_m, relative_m)


def _friction_by_slip(found: Identification, record: Record) -> FrictionBySlip | None:
    if found.plate is None:
        return None
    release_s = found.events.release_s
    return friction_by_slip(found.plate, float(record.time_s[0]) if release_s is None else release_s)


def _objective(found: Identification) -> Objective | None:
    friction = found.results.get(FRICTION.name)
    if found.objective is None or found.model is None or friction is None:
        return None
    reach = max(_SCAN_DEVIATIONS * friction.standard_uncertainty, _SCAN_SHARE * friction.value)
    scanned = np.linspace(max(friction.value - reach, 1e-4), friction.value + reach, _SCANNED)
    scanned = np.sort(np.append(scanned, friction.value))
    costs = found.objective(scanned)
    residual_m = found.model.residual_rms_m * np.sqrt(costs / costs.min())
    return Objective(scanned, residual_m, friction.value, friction.interval_95)


def _motion(found: Identification, record: Record) -> Motion | None:
    """Fitted motion of both masses; None for one mass, or without slip."""
    if found.model is None or FRICTION.name not in found.parameters:
        return None
    duration_s = float(record.time_s[-1]) - found.parameters["release_s"]
    return simulate_fit(model_law(found.model.name, found.model.parts), found.parameters, duration_s)


def _kinematics(motion: Motion, found: Identification) -> Kinematics:
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


def _slips(motion: Motion, release_s: float) -> tuple[tuple[float, float], ...]:
    """Spans of sliding; slips without a stick between them are one span."""
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
