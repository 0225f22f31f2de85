"""Queue of analyses of the Runs screen, executed by a worker of their own."""

from dataclasses import dataclass, field
from pathlib import Path

from app.presenters.base import Progress, batch_progress, run_count_text
from app.presenters.events import TaskFailed, TaskProgress, WorkerEvent
from app.presenters.runs.tasks import ANALYSE_RUNS, ANALYSING, AnalyseRuns, RunAnalysed
from app.presenters.worker import EventWorker
from messages.i18n import gettext, ngettext


@dataclass(slots=True)
class AnalysisSummary:
    """Outcome of the analyses so far."""

    analysed: list[str] = field(default_factory=list)
    up_to_date: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    cancelled: bool = False

    @property
    def done(self) -> tuple[str, ...]:
        return (*self.analysed, *self.up_to_date)

    def add(self, run: RunAnalysed) -> None:
        if run.fault:
            self.faults.append(run.fault)
        else:
            (self.up_to_date if run.is_up_to_date else self.analysed).append(run.path)

    def text(self) -> str:
        count = len(self.up_to_date)
        if count and not self.analysed and not self.cancelled:
            return ngettext(
                "{runs} was up to date. Shift+R analyses it anew",
                "{runs} were up to date. Shift+R analyses them anew",
                count,
                runs=run_count_text(self.up_to_date),
            )
        said = [gettext("Analysed {runs}", runs=run_count_text(self.analysed))]
        if count:
            said.append(ngettext("{count} was up to date", "{count} were up to date", count))
        if self.cancelled:
            said.append(gettext("then given up"))
        return ", ".join(said)


class AnalysisQueue:
    """Submits analyses to a worker of their own, and collects their outcome until all are done."""

    def __init__(self, worker: EventWorker) -> None:
        self._worker = worker
        self._pending: list[AnalyseRuns] = []
        self._summary = AnalysisSummary()
        self.progress: Progress | None = None

    def submit(self, paths: tuple[str, ...], *, reanalyse: bool) -> None:
        """Submit runs, apart from those that are queued already."""
        waiting = {path for task in self._pending if task.reanalyse or not reanalyse for path in task.paths}
        new = tuple(path for path in paths if path not in waiting)
        if not new:
            return
        if not self._pending:
            self._summary = AnalysisSummary()
            batch_progress(self._set_progress, ANALYSING, new)(0.0, "")
        task = AnalyseRuns(new, reanalyse)
        self._pending.append(task)
        self._worker.submit(ANALYSE_RUNS, task)

    def poll(self) -> AnalysisSummary | None:
        """Process the events of the worker; the summary once all analyses are done, else None."""
        ended = [self._on_event(event) for event in self._worker.poll() if event.argument in self._pending]
        return self._ended() if any(ended) and not self._pending else None

    def cancel(self) -> AnalysisSummary:
        self.poll()
        self._summary.cancelled = bool(self._pending)
        self._pending.clear()
        self._worker.cancel()
        self._worker.poll()  # discards the event of the cancellation
        return self._ended()

    def close(self) -> None:
        self._worker.close()

    def _on_event(self, event: WorkerEvent) -> bool:
        if isinstance(event, TaskProgress):
            if isinstance(event.progress, RunAnalysed):
                self._summary.add(event.progress)
            else:
                self._set_progress(event.progress)
            return False
        self._pending.remove(event.argument)
        if isinstance(event, TaskFailed):
            first = Path(event.argument.paths[0]).name
            self._summary.faults.append(f"{first}: {event.message}" if _is_one(event) else str(event.message))
        return True

    def _set_progress(self, progress: Progress) -> None:
        self.progress = progress

    def _ended(self) -> AnalysisSummary:
        self.progress = None
        return self._summary


def _is_one(event: TaskFailed) -> bool:
    return len(event.argument.paths) == 1
