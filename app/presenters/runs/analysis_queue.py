"""Queue of analyses of the Runs screen, executed by a worker of their own."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.presenters.base import Progress, TaskFailure, batch_progress, run_count_text
from app.presenters.runs.state import ANALYSING, BatchOutcome, RunAnalysed
from app.presenters.worker import LazyModule, Worker
from messages.i18n import gettext, ngettext, translate

if TYPE_CHECKING:
    from app.presenters.runs import tasks
else:
    tasks = LazyModule("app.presenters.runs.tasks")


@dataclass(frozen=True, eq=False, slots=True)
class _Batch:
    paths: tuple[str, ...]
    reanalyse: bool


class AnalysisQueue:
    """Submits analyses to `worker`; `on_ended` gets outcome and text once all are done, or were cancelled."""

    def __init__(self, worker: Worker, on_ended: Callable[[BatchOutcome, str], object]) -> None:
        self._worker = worker
        self._on_ended = on_ended
        self._pending: list[_Batch] = []
        self._analysed: list[str] = []
        self._up_to_date: list[str] = []
        self._faults: list[str] = []
        self.progress: Progress | None = None

    def submit(self, paths: tuple[str, ...], *, reanalyse: bool) -> None:
        """Submit runs, apart from those that are queued already."""
        same = [batch for batch in self._pending if batch.reanalyse or not reanalyse]
        waiting = {path for batch in same for path in batch.paths}
        batch = _Batch(tuple(path for path in paths if path not in waiting), reanalyse)
        if not batch.paths:
            return
        if not self._pending:
            self._analysed, self._up_to_date, self._faults = [], [], []
            batch_progress(self._on_progress, ANALYSING, batch.paths)(0.0, "")
        self._pending.append(batch)
        self._worker.submit(
            tasks.analyse_runs,
            batch.paths,
            reanalyse,
            done=lambda _: self._on_done(batch),
            failed=partial(self._on_failed, batch),
            progress=self._on_progress,
        )

    def cancel(self) -> None:
        self._worker.poll()
        if not self._pending:
            return
        self._pending.clear()
        self._worker.cancel()
        self._end(is_cancelled=True)

    def _on_progress(self, progress: Progress | RunAnalysed) -> None:
        if isinstance(progress, Progress):
            self.progress = progress
        elif progress.fault:
            self._faults.append(progress.fault)
        else:
            (self._up_to_date if progress.is_up_to_date else self._analysed).append(progress.path)

    def _on_done(self, batch: _Batch) -> None:
        self._pending.remove(batch)
        if not self._pending:
            self._end()

    def _on_failed(self, batch: _Batch, failure: TaskFailure) -> None:
        if batch in self._pending:  # not after `cancel`
            name = f"{Path(batch.paths[0]).name}: " if len(batch.paths) == 1 else ""
            self._faults.append(f"{name}{translate(failure.message)}")
            self._on_done(batch)

    def _end(self, *, is_cancelled: bool = False) -> None:
        self.progress = None
        done = (*self._analysed, *self._up_to_date)
        self._on_ended(BatchOutcome(done, tuple(self._faults)), self._text(is_cancelled=is_cancelled))

    def _text(self, *, is_cancelled: bool) -> str:
        count = len(self._up_to_date)
        if count and not self._analysed and not is_cancelled:
            return ngettext(
                "{runs} was up to date. Shift+R analyses it anew",
                "{runs} were up to date. Shift+R analyses them anew",
                count,
                runs=run_count_text(self._up_to_date),
            )
        parts = [gettext("Analysed {runs}", runs=run_count_text(self._analysed))]
        if count:
            parts.append(ngettext("{count} was up to date", "{count} were up to date", count))
        if is_cancelled:
            parts.append(gettext("then given up"))
        return ", ".join(parts)
