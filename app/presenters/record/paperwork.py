"""What Record does with files: the plan looked up and kept, runs kept or moved to the trash."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.presenters.record.desk import Desk
from app.presenters.record.state import PlanShown, RunChoices
from app.presenters.record.tasks import BringBack, CountDone, KeepRun, LookUp, PutAside, RecordTask, do
from app.presenters.record.verdicts import Verdicts
from app.presenters.worker import GIVEN_UP, Done, Failure, News, Worker


class Paperwork:
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
    """

    def __init__(
        self,
        all_series: tuple[str, ...],
        directory: Path,
        worker: Worker,
        author: str,
        show: Callable[[RunChoices, PlanShown], None],
    ) -> None:
        self.desk = Desk(all_series, directory, self._submit, show)
        self.verdicts = Verdicts(self._submit, author)
        self._directory = str(directory)
        self._worker = worker

    def poll(self) -> bool:
        """Take in what the worker has said; tell whether that was anything."""
        all_news = self._worker.poll()
        for news in all_news:
            self._hear(news)
        return bool(all_news)

    def count(self) -> None:
        """Look again which runs count as tests done."""
        self._submit(CountDone(self._directory))

    def close(self) -> None:
        """End the worker."""
        self._worker.close()

    def _submit(self, task: RecordTask) -> None:
        self._worker.submit(do, task)

    def _hear(self, news: News) -> None:
        if isinstance(news, Done):
            self._did(news.argument, news.answer)
        elif isinstance(news, Failure) and news.message != GIVEN_UP:
            self.verdicts.failed(news.message)
            if isinstance(news.argument, LookUp):  # what was kept cannot be read; the runs can
                self.count()

    def _did(self, task: RecordTask, answer: Any) -> None:
        match task:
            case LookUp():
                self.desk.found(answer)
            case CountDone():
                self.desk.count_done(answer)
                self.desk.advance()
            case KeepRun():
                self.verdicts.kept(task)
            case PutAside():
                self.verdicts.was_put_aside(task, answer)
            case BringBack():
                self.verdicts.brought_back(task, answer)
        if isinstance(task, KeepRun | PutAside):
            self.count()
