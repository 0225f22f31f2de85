"""Analysing many runs, in the worker's process: by crew and rules of `slipstand analyze --save`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from app.presenters.base import Progress
from app.presenters.batch_text import batch_progress
from app.presenters.worker import ReportProgress
from messages.i18n import N_, translate

if TYPE_CHECKING:
    from app.runs.batch.tasks import AnalysisOutcome

ANALYSING = N_("Analysing {name}, {number} of {all}")


@dataclass(frozen=True, slots=True)
class AnalyseRuns:
    """Identify runs and keep the results in them; what is up to date is left as it is, unless `anew`."""

    paths: tuple[str, ...]
    reanalyse: bool = False


@dataclass(frozen=True, slots=True)
class RunAnalysed(Progress):
    """What became of a run: it was analysed, was up to date, or could not be, for a `fault` in one line."""

    path: str = ""
    is_up_to_date: bool = False
    fault: str = ""


def analyse_runs(task: AnalyseRuns, report: ReportProgress) -> None:
    """Analyse runs; each is reported as `Analysed` when it is done."""
    from app.runs.batch.executors import ExecutorOptions, open_executor
    from app.runs.batch.tasks import AnalysisTask, analyze_runs

    tell = batch_progress(report, ANALYSING, task.paths)
    tell(0.0, "")
    tasks = [AnalysisTask(path, save=True, force=task.reanalyse) for path in task.paths]
    with open_executor(ExecutorOptions(), len(tasks)) as crew:
        for path, outcome in zip(task.paths, analyze_runs(tasks, crew, tell), strict=True):
            report(RunAnalysed("", None, path, outcome.up_to_date, _fault(path, outcome)))


def _fault(path: str, outcome: "AnalysisOutcome") -> str:
    if outcome.document is not None:
        return ""
    name = Path(path).name
    said = translate(outcome.error).replace(outcome.run, name)
    return said if name in said else f"{name}: {said}"
