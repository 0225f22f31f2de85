"""Queue of analyses of the Runs screen, executed by a worker of their own."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.presenters.base import Progress, TaskFailure, batch_progress, run_count_text
from app.presenters.runs.state import ANALYSING, RunAnalysed
from app.presenters.worker import LazyModule, Worker
from messages.i18n import gettext, ngettext

if TYPE_CHECKING:
    from app.presenters.runs import tasks
else:
    tasks = LazyModule("app.presenters.runs.tasks")


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
        parts = [gettext("Analysed {runs}", runs=run_count_text(self.analysed))]
        if count:
            parts.append(ngettext("{count} was up to date", "{count} were up to date", count))
        if self.cancelled:
            parts.append(gettext("then given up"))
        return ", ".join(parts)


@dataclass(frozen=True, eq=False, slots=True)
class _Batch:
    paths: tuple[str, ...]
    reanalyse: bool


class AnalysisQueue:
    """Submits analyses to `worker`; `on_ended` gets their summary once all are done, or were cancelled."""

    def __init__(self, worker: Worker, on_ended: Callable[[AnalysisSummary], object]) -> None:
        self._worker = worker
        self._on_ended = on_ended
        self._pending: list[_Batch] = []
        self._summary = AnalysisSummary()
        self.progress: Progress | None = None

    def submit(self, paths: tuple[str, ...], *, reanalyse: bool) -> None:
        """Submit runs, apart from those that are queued already."""
        same = [batch for batch in self._pending if batch.reanalyse or not reanalyse]
        waiting = {path for batch in same for path in batch.paths}
        batch = _Batch(tuple(path for path in paths if path not in waiting), reanalyse)
        if not batch.paths:
            return
        if not self._pending:
            self._summary = AnalysisSummary()
            batch_progress(self._on_progress, ANALYSING, batch.paths)(0.0, "")
        self._pending.append(batch)
        self._worker.submit(
            tasks.analyse_runs,
            batch.paths,
            reanalyse,
            done=lambda _: self._end(batch),
            failed=partial(self._on_failed, batch),
            progress=self._on_progress,
        )

    def cancel(self) -> None:
        self._worker.poll()
        if not self._pending:
            return
        self._summary.cancelled = True
        self._pending.clear()
        self._worker.cancel()
        self._end()

    def _on_progress(self, progress: Progress | RunAnalysed) -> None:
        if isinstance(progress, RunAnalysed):
            self._summary.add(progress)
        else:
            self.progress = progress

    def _on_failed(self, batch: _Batch, failure: TaskFailure) -> None:
        if batch in self._pending:  # not after `cancel`
            name = f"{Path(batch.paths[0]).name}: " if len(batch.paths) == 1 else ""
            self._summary.faults.append(f"{name}{failure.message}")
            self._end(batch)

    def _end(self, batch: _Batch | None = None) -> None:
        if batch is not None:
            self._pending.remove(batch)
        if not self._pending:
            self.progress = None
            self._on_ended(self._summary)
