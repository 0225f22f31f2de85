"""What the worker does to a run: read it, identify it, and hand back plain arrays. Runs in its process."""

from pathlib import Path

from app.presenters.analysed import AnalysedRun, Channel
from app.presenters.results import sentence
from app.presenters.screen import Progress
from app.presenters.worker import Report


def analyse_run(path: str, report: Report) -> AnalysedRun:
    """Read and identify a run.

    Raises
    ------
    RunError
        It cannot be read.
    AnalysisError
        Nothing can be identified in it.
    """
    from app.runs.analysing import AnalysisRequest, analyze_run
    from app.runs.examiner import standing_examiner

    analysis = analyze_run(
        Path(path),
        AnalysisRequest(classical=False),
        progress=lambda share, what: report(Progress(sentence(what), share)),
        examiner=standing_examiner(),
    )
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
    )


def warm_up(_nothing: None, _report: Report) -> None:
    """Identify a simulated record, so that all code is loaded, and compiled on a first start, beforehand.

    What examines run files is started meanwhile.
    """
    import numpy as np

    from analysis.identify import identify
    from analysis.motion.two_mass import TwoMassParameters
    from analysis.record import Record, StandMasses
    from app.runs.examiner import standing_examiner

    standing_examiner()
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
