"""The analyses that were asked for on the Runs screen: done by a worker of their own, beside all else."""

from dataclasses import dataclass, field
from pathlib import Path

from app.presenters.base import Progress
from app.presenters.batch_text import batch_progress, run_count_text
from app.presenters.runs.analysis_tasks import ANALYSING, AnalyseRuns, RunAnalysed, analyse_runs
from app.presenters.worker import TaskFailed, TaskProgress, Worker, WorkerEvent
from messages.i18n import gettext, ngettext


@dataclass(slots=True)
class AnalysisSummary:
    """What became of the runs so far."""

    analysed: list[str] = field(default_factory=list)
    up_to_date: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    cancelled: bool = False

    @property
    def done(self) -> tuple[str, ...]:
        """Runs whose result is kept in them."""
        return (*self.analysed, *self.up_to_date)

    def add(self, came: RunAnalysed) -> None:
        """Add what became of a run."""
        if came.fault:
            self.faults.append(came.fault)
        else:
            (self.up_to_date if came.is_up_to_date else self.analysed).append(came.path)

    def text(self) -> str:
        """What was done, in a sentence."""
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
    """Asks the worker, and keeps account until nothing is left to do.

    Parameters
    ----------
    worker : Worker
        Its own one, so that the table, previews and edits wait for no analysis. Closed by `close`.
    """

    def __init__(self, worker: Worker) -> None:
        self._worker = worker
        self._pending: list[AnalyseRuns] = []
        self._summary = AnalysisSummary()
        self.progress: Progress | None = None

    def submit(self, paths: tuple[str, ...], *, anew: bool) -> None:
        """Have runs analysed, those aside that wait for it already."""
        waiting = {path for task in self._pending if task.reanalyse or not anew for path in task.paths}
        new = tuple(path for path in paths if path not in waiting)
        if not new:
            return
        if not self._pending:
            self._summary = AnalysisSummary()
            batch_progress(self._take_progress, ANALYSING, new)(0.0, "")
        task = AnalyseRuns(new, anew)
        self._pending.append(task)
        self._worker.submit(analyse_runs, task)

    def poll(self) -> AnalysisSummary | None:
        """Take in what has come; the account once all is done, else None."""
        ended = [self._on_event(news) for news in self._worker.poll() if news.argument in self._pending]
        return self._ended() if any(ended) and not self._pending else None

    def cancel(self) -> AnalysisSummary:
        """Give up what is not done."""
        self.poll()
        self._summary.cancelled = bool(self._pending)
        self._pending.clear()
        self._worker.cancel()
        self._worker.poll()  # that it was given up
        return self._ended()

    def close(self) -> None:
        """End the worker."""
        self._worker.close()

    def _on_event(self, news: WorkerEvent) -> bool:
        """Take in what has come; tell whether that ends a task."""
        if isinstance(news, TaskProgress):
            if isinstance(news.progress, RunAnalysed):
                self._summary.add(news.progress)
            else:
                self._take_progress(news.progress)
            return False
        self._pending.remove(news.argument)
        if isinstance(news, TaskFailed):
            first = Path(news.argument.paths[0]).name
            self._summary.faults.append(f"{first}: {news.message}" if _is_one(news) else news.message)
        return True

    def _take_progress(self, progress: Progress) -> None:
        self.progress = progress

    def _ended(self) -> AnalysisSummary:
        self.progress = None
        return self._summary


def _is_one(news: TaskFailed) -> bool:
    return len(news.argument.paths) == 1
