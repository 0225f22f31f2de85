"""What the worker does to a run: read it, identify it, and hand back plain arrays. Runs in its process."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from app.presenters.analysed import AnalysedRun, Channel, Kinematics, Objective, Saving
from app.presenters.results import FRICTION, sentence
from app.presenters.screen import Progress
from app.presenters.worker import Report

if TYPE_CHECKING:
    from analysis.identification import Identification
    from analysis.record import Record
    from app.runs.analysing import Analysis, AnalysisRequest

_SCANNED = 161
_SCAN_DEVIATIONS, _SCAN_SHARE = 12.0, 0.04
"""The scan of f_d reaches so many standard uncertainties, and at least this share of f_d, both ways."""
_PER_PERIOD = 60
_BEFORE_RELEASE_S = 0.2


@dataclass(frozen=True, slots=True)
class WithFriction:
    """Ask for the fitted motion of a run with another f_d."""

    path: str
    friction: float


@dataclass(frozen=True, eq=False, slots=True)
class Hand:
    """The record's simulation with an f_d that was set by hand.

    Attributes
    ----------
    table_m, relative_m : (n,) float64
        At the times of the `AnalysedRun`; `relative_m` is None without a second gauge.
    """

    friction: float
    table_m: np.ndarray
    relative_m: np.ndarray | None


class _Last:
    """The analysis that this process did last: a handle that is dragged asks for it many times a second."""

    path = ""
    analysis: "Analysis | None" = None


def analyse_run(path: str, report: Report) -> AnalysedRun:
    """Read and identify a run.

    Raises
    ------
    RunError
        It cannot be read.
    AnalysisError
        Nothing can be identified in it.
    """
    analysis = _analyse(path, report)
    found, record, run = analysis.identification, analysis.record, analysis.run
    fit = None if found.curves is None else found.curves(record.time_s)
    relative = record.relative_displacement_m
    return AnalysedRun(
        path=Path(path),
        time_s=record.time_s,
        table=Channel(record.table_displacement_m, None if fit is None else fit.table_displacement_m),
        relative=(
            None
            if relative is None
            else Channel(relative, None if fit is None else fit.relative_displacement_m)
        ),
        results=found.results,
        labels=found.labels,
        model=found.model,
        events=found.events,
        cautions=tuple(found.cautions),
        ended=run.ending.ended if run.ending else "",
        budget=tuple(found.budget),
        kinematics=_kinematics(found, record),
        objective=_objective(found),
        note=run.metadata.note,
        saving=_saving(analysis),
    )


def with_friction(asked: WithFriction, report: Report) -> Hand:
    """Simulate a run with another f_d, all else as fitted. Raises RunError, AnalysisError."""
    analysis = _Last.analysis
    if analysis is None or _Last.path != asked.path:
        analysis = _analyse(asked.path, report)
    curves = analysis.identification.curves_by_friction
    if curves is None:
        raise ValueError(f"{asked.path}: no friction was found in it that could be varied")
    shown = curves(asked.friction, analysis.record.time_s)
    return Hand(asked.friction, shown.table_displacement_m, shown.relative_displacement_m)


def warm_up(_nothing: None, _report: Report) -> None:
    """Identify a simulated record, so that all code is loaded, and compiled on a first start, beforehand."""
    from analysis.identify import identify
    from analysis.motion.two_mass import TwoMassParameters
    from analysis.record import Record, StandMasses

    parameters = TwoMassParameters.from_free_decay(
        period_s=0.32,
        damping_n1_per_s=0.12,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )
    time_s = np.arange(0.0, 9.0, 2e-3)
    table_m, relative_m = parameters.simulate(8.0).sample_displacements(np.maximum(time_s - 1.0, 0.0))
    noise_m = np.random.default_rng(0).normal(scale=2e-5, size=(2, len(time_s)))
    identify(Record(time_s, table_m + noise_m[0], relative_m + noise_m[1], StandMasses(131.6, 22.4)))


def _analyse(path: str, report: Report) -> "Analysis":
    from app.runs.analysing import analyze_run

    _Last.analysis = analyze_run(
        Path(path),
        _request(),
        progress=lambda share, what: report(Progress(sentence(what), share)),
    )
    _Last.path = path
    return _Last.analysis


def _request() -> "AnalysisRequest":
    from app.runs.analysing import AnalysisRequest

    return AnalysisRequest(classical=False)


def _saving(analysis: "Analysis") -> Saving:
    from app.runs.analyses import inputs_hash

    return Saving(analysis.document, inputs_hash(analysis.record), msgspec.to_builtins(_request()))


def _objective(found: "Identification") -> Objective | None:
    friction = found.results.get(FRICTION.key)
    if found.objective is None or found.model is None or friction is None:
        return None
    reach = max(_SCAN_DEVIATIONS * friction.standard_uncertainty, _SCAN_SHARE * friction.value)
    scanned = np.linspace(max(friction.value - reach, 1e-4), friction.value + reach, _SCANNED)
    scanned = np.sort(np.append(scanned, friction.value))
    costs = found.objective(scanned)
    best = found.objective(np.array([found.parameters[FRICTION.key]]))[0]
    residual_m = found.model.residual_rms_m * np.sqrt(costs / best)
    return Objective(scanned, residual_m, friction.value, friction.interval_95)


def _kinematics(found: "Identification", record: "Record") -> Kinematics | None:
    from analysis.motion.two_mass import TwoMassParameters

    if "release_s" not in found.parameters or "stribeck_velocity_m_per_s" in found.results:
        return None
    of_motion = {name: value for name, value in found.parameters.items() if name != "release_s"}
    release_s = found.parameters["release_s"]
    duration_s = float(record.time_s[-1]) - release_s
    period_s = found.results["period_s"].value if "period_s" in found.results else 0.3
    count = round((duration_s + _BEFORE_RELEASE_S) / period_s * _PER_PERIOD) + 2
    motion = TwoMassParameters(**of_motion).simulate(duration_s)
    shown = motion.sample(np.linspace(-_BEFORE_RELEASE_S, duration_s, count))
    return Kinematics(
        time_s=shown.time_s + release_s,
        table_m=shown.table_displacement_m,
        relative_m=shown.relative_displacement_m,
        table_m_per_s=shown.table_velocity_m_per_s,
        plate_m_per_s=shown.plate_velocity_m_per_s,
        table_m_per_s2=shown.table_acceleration_m_per_s2,
        plate_m_per_s2=shown.plate_acceleration_m_per_s2,
    )
