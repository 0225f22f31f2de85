"""What the Runs screen does: the library listed, filtered and sorted, and work on the selected runs."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.results import sentence
from app.presenters.runs.analysis_queue import AnalysisQueue, AnalysisSummary
from app.presenters.runs.export_presenter import ExportPresenter
from app.presenters.runs.import_presenter import ImportPresenter
from app.presenters.runs.import_tasks import ImportFile, ImportTask, PreviewImport, SurveyFile
from app.presenters.runs.run_list import RunList
from app.presenters.runs.state import Column, Overlay, RunFilter, RunsState
from app.presenters.runs.tasks import (
    BatchOutcome,
    CopyRuns,
    EditRuns,
    ExportRuns,
    ListRuns,
    LoadOverlay,
    PreviewExport,
    RestoreRuns,
    RunsTask,
    TrashRuns,
    UndoEdits,
    execute,
)
from app.presenters.runs.undo import UndoStack, change_text, outcome_chip, parse_field, undo_action
from app.presenters.worker import CANCELLED, TaskDone, TaskFailed, TaskProgress, Worker, WorkerEvent
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.runs.summary import RunSummary

RUN_SUFFIX = ".h5"


class RunsPresenter(Presenter[RunsState]):
    """The library.

    Parameters
    ----------
    worker : Worker
        Its own one: a long analysis elsewhere does not keep the table waiting. Closed by `close`.
    analyst : Worker
        Does the analyses, which everything else does not wait for; closed as well.
    folder : str
        Whose runs are shown at first.
    all_series : tuple of str
        Series codes of the stand.
    author : str
        Who edits.
    open_run : callable
        Shows a run on Identify.
    """

    def __init__(
        self,
        worker: Worker,
        analyst: Worker,
        folder: str,
        all_series: tuple[str, ...],
        author: str,
        open_run: Callable[[str], None],
    ) -> None:
        super().__init__(RunsState(folder=folder, all_series=all_series))
        self.export_dialog = ExportPresenter(self._submit)
        self.import_dialog = ImportPresenter(self._submit)
        self._worker = worker
        self._author = author
        self._open_run = open_run
        self._library = RunList()
        self._undos = UndoStack()
        self._analyses = AnalysisQueue(analyst)
        self._progress: Progress | None = None
        self._is_listing = False

    # --- what the operator does ---

    def enter(self) -> None:
        """The screen is shown: what was recorded meanwhile belongs into the table."""
        self.refresh()

    def refresh(self) -> None:
        """Look into the folder again."""
        if not self._is_listing:
            self._is_listing = True
            self._submit(ListRuns(self.state.folder))

    def set_author(self, name: str) -> None:
        """Who edits from now on."""
        self._author = name

    def choose_folder(self, folder: str) -> None:
        """Show the runs of another folder."""
        self._undos.clear()
        self._update(
            folder=folder, rows=(), total=0, is_listed=False, selected=(), metadata=None, overlay=None,
            undo_text="",
            message=EMPTY_CHIP, details=(),
        )  # fmt: skip
        self.refresh()

    def set_filter(self, wanted: RunFilter) -> None:
        """Show only these runs."""
        self._update(filter=wanted)
        self._show_rows()

    def sort_by(self, column: Column) -> None:
        """Sort by a column; by the same again, the other way round."""
        again = column is self.state.sorted_by
        self._update(sorted_by=column, descending=not self.state.descending if again else False)
        self._show_rows()

    def select(self, paths: tuple[str, ...]) -> None:
        """These runs are selected: preview them, and show what can be edited of them."""
        if paths == self.state.selected:
            return
        self._update(selected=paths, metadata=self._library.metadata(paths))
        readable = self._library.readable(paths)
        if readable:
            self._submit(LoadOverlay(readable))
        else:
            words = self._library.fault(paths[0]) if paths else ""
            self._update(overlay=Overlay(message=sentence(words)) if paths else None)

    def open_selected(self) -> None:
        """Show the first selected run on Identify."""
        if self.state.selected:
            self._open_run(self.state.selected[0])

    def edit(self, field: str, text: str) -> None:
        """Give a field a new value in all selected runs; what cannot be is said and leaves all as it was."""
        before = self.state.metadata
        paths = self._readable()
        if before is None or not paths or (text == getattr(before, field) and field not in before.mixed):
            return
        try:
            value = parse_field(field, text, self.state.all_series)
        except ValueError as error:
            self._set_message(Chip(str(error), Tone.BAD))
            self._update(metadata=None)
            self._update(metadata=before)  # writes the old text back into the field
            return
        self._submit(EditRuns(paths, field, value, self._author))

    def undo(self) -> None:
        """Take back the last edit, or bring back what was put into the trash."""
        task = self._undos.pop()
        if task is not None:
            self._submit(task)

    def trash(self) -> None:
        """Put the selected runs aside; nothing is ever deleted."""
        if self.state.selected:
            self._submit(TrashRuns(self.state.selected))

    def analyse(self, *, anew: bool = False) -> None:
        """Identify the selected runs and keep the results in them; what is up to date only when `anew`."""
        self._set_message(EMPTY_CHIP)
        self._analyses.submit(self._readable(), anew=anew)
        self._show_progress()

    def open_export(self) -> bool:
        """Make the export dialog ready for the selected runs; False where none can be exported."""
        runs = self._readable()
        if runs:
            self.export_dialog.open(runs, self.state.folder)
        return bool(runs)

    def cancel(self) -> None:
        """Give up the work whose progress is shown; what is done stays."""
        if self._analyses.progress is None:
            self._worker.cancel()
        else:
            self._on_analyses_ended(self._analyses.cancel())

    def add_files(self, paths: tuple[str, ...]) -> bool:
        """Run files are copied into the folder; True where others wait to be imported."""
        runs = tuple(path for path in paths if path.lower().endswith(RUN_SUFFIX))
        if runs:
            self._submit(CopyRuns(runs, self.state.folder))
        others = tuple(path for path in paths if path not in runs)
        if others:
            self.import_dialog.open(others, self.state.folder, self._author)
        return bool(others)

    # --- what time brings ---

    def tick(self) -> None:
        """Take in what the workers have said."""
        for news in self._worker.poll():
            self._on_event(news)
        account = self._analyses.poll()
        if account is None:
            self._show_progress()
        else:
            self._on_analyses_ended(account)

    def close(self) -> None:
        """End the workers."""
        self._worker.close()
        self._analyses.close()

    # --- inside ---

    def _submit(self, task: RunsTask) -> None:
        self._worker.submit(execute, task)

    def _on_event(self, news: WorkerEvent) -> None:
        if isinstance(news, TaskProgress):
            self._on_progress(news.argument, news.progress)
        elif isinstance(news, TaskFailed):
            self._on_failed(news.argument, news.message)
        else:
            self._on_done(news)

    def _on_progress(self, task: RunsTask, progress: Progress) -> None:
        if isinstance(task, ExportRuns):
            self.export_dialog.on_progress(progress)
        elif not isinstance(task, LoadOverlay | ImportTask):
            self._progress = progress

    def _on_failed(self, task: RunsTask, message: str) -> None:
        if isinstance(task, ListRuns):
            self._is_listing = False
            self._update(is_listed=True)
        if isinstance(task, ExportRuns | PreviewExport):
            self.export_dialog.on_failed(message)
            return
        if isinstance(task, ImportTask):
            self.import_dialog.on_failed(task, message)
            return
        self._progress = None
        if message != CANCELLED:
            self._set_message(Chip(sentence(message), Tone.BAD))

    def _on_done(self, news: TaskDone[Any]) -> None:
        task, answer = news.argument, news.answer
        if not isinstance(task, ExportRuns | PreviewExport | ImportTask):
            self._progress = None
        match task:
            case ListRuns():
                self._set_runs(answer)
            case LoadOverlay(paths):
                if paths == self._readable():
                    self._update(overlay=answer)
            case EditRuns() | UndoEdits() | TrashRuns() | RestoreRuns() | CopyRuns():
                self._undos.push(undo_action(task, answer, self._author))
                self._on_runs_changed(answer, change_text(task, answer))
            case ExportRuns():
                self.export_dialog.on_done(answer)
            case PreviewExport():
                self.export_dialog.on_preview(task, answer)
            case ImportFile():
                self._on_runs_changed(
                    BatchOutcome((answer,)), gettext("Imported {name}", name=Path(answer).stem)
                )
                self.import_dialog.on_done(task, answer)
            case SurveyFile() | PreviewImport():
                self.import_dialog.on_done(task, answer)

    def _set_runs(self, runs: "tuple[RunSummary, ...]") -> None:
        self._is_listing = False
        self._library.set_runs(runs)
        self._update(is_listed=True, total=len(runs))
        self._show_rows()

    def _show_rows(self) -> None:
        """Show what is wanted of what is known; what is selected stays so as far as it is still there."""
        state = self.state
        rows = self._library.rows(state.filter, state.sorted_by, descending=state.descending)
        shown = {row.path for row in rows}
        selected = tuple(path for path in state.selected if path in shown)
        self._update(rows=rows, metadata=self._library.metadata(selected))
        self.select(selected)

    def _readable(self) -> tuple[str, ...]:
        return self._library.readable(self.state.selected)

    def _on_runs_changed(self, outcome: BatchOutcome, words: str) -> None:
        self._show_outcome(outcome.done, outcome.faults, words)
        self.refresh()

    def _on_analyses_ended(self, account: AnalysisSummary) -> None:
        self._show_progress()
        self._show_outcome(account.done, tuple(account.faults), account.text())
        self.refresh()

    def _show_progress(self) -> None:
        """Analyses are what one waits for; how far other work is shows without them."""
        self._update(progress=self._analyses.progress or self._progress)

    def _show_outcome(self, done: tuple[str, ...], faults: tuple[str, ...], words: str) -> None:
        """Say what came of the work, and of each run that it failed for."""
        self._set_message(outcome_chip(words, done, faults), faults)

    def _set_message(self, message: Chip, details: tuple[str, ...] = ()) -> None:
        self._update(message=message, details=details, undo_text=self._undos.text)
