"""What Record does with files: the plan looked up and kept, runs kept or moved to the trash."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.presenters.record.next_runs import NextRuns
from app.presenters.record.run_decisions import RunDecisions
from app.presenters.record.state import PlanState, RunChoices
from app.presenters.record.tasks import (
    CountCompletedRuns,
    KeepRun,
    LoadPlan,
    MoveToTrash,
    RecordTask,
    RestoreFromTrash,
    SavePlan,
    execute,
)
from app.presenters.worker import CANCELLED, TaskDone, TaskFailed, Worker, WorkerEvent


class FileTasks:
    """The desk and the verdicts, and the worker that does what they ask for.

    Parameters
    ----------
    all_series : tuple of str
    directory : Path
        Where runs go.
    worker : Worker
        Closed by `close`.
    author : str
        Who decides about runs, for their history.
    show : callable
        Takes choices and plan whenever they have changed.
    is_free : callable
        Tells whether a run that came back can be decided about now.
    reopen : callable
        Takes the path of a run that came back and is to be decided about.
    """

    CLOSE_S = 30.0

    def __init__(
        self,
        all_series: tuple[str, ...],
        directory: Path,
        worker: Worker,
        author: str,
        show: Callable[[RunChoices, PlanState], None],
        is_free: Callable[[], bool],
        reopen: Callable[[str], None],
    ) -> None:
        self.desk = NextRuns(all_series, directory, self._submit, show)
        self.verdicts = RunDecisions(self._submit, author)
        self._directory = str(directory)
        self._worker = worker
        self._is_free, self._reopen = is_free, reopen
        self._owed: list[RecordTask] = []

    def poll(self) -> bool:
        """Take in what the worker has said; tell whether that was anything."""
        all_news = self._worker.poll()
        for news in all_news:
            self._hear(news)
        return bool(all_news)

    def count_completed(self) -> None:
        """Look again which runs count as tests done."""
        self._submit(CountCompletedRuns(self._directory))

    def close(self) -> None:
        """End the worker, as soon as what was decided is stored."""
        until_s = time.monotonic() + self.CLOSE_S
        while self._owed and self._worker.is_busy and time.monotonic() < until_s:
            self.poll()
            time.sleep(0.005)
        self._worker.close()

    def _submit(self, task: RecordTask) -> None:
        if isinstance(task, KeepRun | MoveToTrash | RestoreFromTrash | SavePlan):
            self._owed.append(task)
        self._worker.submit(execute, task)

    def _hear(self, news: WorkerEvent) -> None:
        if isinstance(news, TaskDone | TaskFailed) and news.argument in self._owed:
            self._owed.remove(news.argument)
        if isinstance(news, TaskDone):
            self._did(news.argument, news.answer)
        elif isinstance(news, TaskFailed) and news.message != CANCELLED:
            self.verdicts.on_failed(news.argument, news.message)
            if isinstance(news.argument, LoadPlan):  # what was kept cannot be read; the runs can
                self.count_completed()

    def _did(self, task: RecordTask, answer: Any) -> None:
        match task:
            case LoadPlan():
                self.desk.on_plan_loaded(answer)
            case CountCompletedRuns():
                self.desk.count_done(answer)
                self.desk.select_next_series()
            case KeepRun():
                self.verdicts.on_kept(task)
            case MoveToTrash():
                self.verdicts.on_moved_to_trash(task, answer)
            case RestoreFromTrash():
                if self.verdicts.on_restored(answer, is_free=self._is_free()):
                    self._reopen(answer)
        if isinstance(task, KeepRun | MoveToTrash | RestoreFromTrash):
            self.count_completed()
