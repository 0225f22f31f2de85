"""Presenter of the Runs screen: lists, filters and sorts runs, and works on the selected ones."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.events import TaskDone, TaskFailed, TaskProgress, WorkerEvent
from app.presenters.results import sentence
from app.presenters.runs.analysis_queue import AnalysisQueue, AnalysisSummary
from app.presenters.runs.export_presenter import ExportPresenter
from app.presenters.runs.import_presenter import ImportPresenter
from app.presenters.runs.state import Column, Overlay, RunFilter, RunsState
from app.presenters.runs.table import RunList
from app.presenters.runs.tasks import (
    EXECUTE,
    BatchOutcome,
    CopyRuns,
    EditRuns,
    ExportRuns,
    ImportFile,
    ImportTask,
    ListRuns,
    LoadOverlay,
    PreviewExport,
    PreviewImport,
    RestoreRuns,
    RunsTask,
    SurveyFile,
    TrashRuns,
    UndoEdits,
)
from app.presenters.runs.undo import UndoStack, change_text, outcome_chip, parse_field, undo_action
from app.presenters.worker import EventWorker
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.runs.summary import RunSummary

RUN_SUFFIX = ".h5"


class RunsPresenter(Presenter[RunsState]):
    """Runs of a folder: `author` is recorded with each edit, `close` ends both workers."""

    def __init__(
        self,
        worker: EventWorker,
        analysis_worker: EventWorker,
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
        self._analyses = AnalysisQueue(analysis_worker)
        self._progress: Progress | None = None
        self._is_listing = False

    def enter(self) -> None:
        self.refresh()

    def refresh(self) -> None:
        if not self._is_listing:
            self._is_listing = True
            self._submit(ListRuns(self.state.folder))

    def set_author(self, name: str) -> None:
        self._author = name

    def choose_folder(self, folder: str) -> None:
        self._undos.clear()
        self._update(
            folder=folder, rows=(), total=0, is_listed=False, selected=(), metadata=None, overlay=None,
            undo_text="",
            message=EMPTY_CHIP, details=(),
        )  # fmt: skip
        self.refresh()

    def set_filter(self, run_filter: RunFilter) -> None:
        self._update(filter=run_filter)
        self._show_rows()

    def sort_by(self, column: Column) -> None:
        """Sort by a column; a second time in the opposite order."""
        again = column is self.state.sorted_by
        self._update(sorted_by=column, descending=not self.state.descending if again else False)
        self._show_rows()

    def select(self, paths: tuple[str, ...]) -> None:
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
        if self.state.selected:
            self._open_run(self.state.selected[0])

    def edit(self, field: str, text: str) -> None:
        """Set a field in all selected runs; an invalid text changes nothing."""
        before = self.state.metadata
        paths = self._readable()
        if before is None or not paths or (text == getattr(before, field) and field not in before.mixed):
            return
        try:
            value = parse_field(field, text, self.state.all_series)
        except ValueError as error:
            self._set_message(Chip(str(error), Tone.BAD))
            self._update(metadata=None)
            self._update(metadata=before)  # restores the old text in the view
            return
        self._submit(EditRuns(paths, field, value, self._author))

    def undo(self) -> None:
        task = self._undos.pop()
        if task is not None:
            self._submit(task)

    def trash(self) -> None:
        """Move the selected runs to the trash; nothing is deleted."""
        if self.state.selected:
            self._submit(TrashRuns(self.state.selected))

    def analyse(self, *, reanalyse: bool = False) -> None:
        """Analyse the selected runs and save the results; `reanalyse` includes up-to-date ones."""
        self._set_message(EMPTY_CHIP)
        self._analyses.submit(self._readable(), reanalyse=reanalyse)
        self._show_progress()

    def open_export(self) -> bool:
        """Prepare the export dialog for the selected runs; False if none can be exported."""
        runs = self._readable()
        if runs:
            self.export_dialog.open(runs, self.state.folder)
        return bool(runs)

    def cancel(self) -> None:
        if self._analyses.progress is None:
            self._worker.cancel()
        else:
            self._on_analyses_ended(self._analyses.cancel())

    def add_files(self, paths: tuple[str, ...]) -> bool:
        """Copy run files into the folder, queue others for import; True if there are any to import."""
        runs = tuple(path for path in paths if path.lower().endswith(RUN_SUFFIX))
        if runs:
            self._submit(CopyRuns(runs, self.state.folder))
        others = tuple(path for path in paths if path not in runs)
        if others:
            self.import_dialog.open(others, self.state.folder, self._author)
        return bool(others)

    def tick(self) -> None:
        for event in self._worker.poll():
            self._on_event(event)
        summary = self._analyses.poll()
        if summary is None:
            self._show_progress()
        else:
            self._on_analyses_ended(summary)

    def close(self) -> None:
        self._worker.close()
        self._analyses.close()

    def _submit(self, task: RunsTask) -> None:
        self._worker.submit(EXECUTE, task)

    def _on_event(self, event: WorkerEvent) -> None:
        if isinstance(event, TaskProgress):
            self._on_progress(event.argument, event.progress)
        elif isinstance(event, TaskFailed):
            self._on_failed(event)
        else:
            self._on_done(event)

    def _on_progress(self, task: RunsTask, progress: Progress) -> None:
        if isinstance(task, ExportRuns):
            self.export_dialog.on_progress(progress)
        elif not isinstance(task, LoadOverlay | ImportTask):
            self._progress = progress

    def _on_failed(self, event: TaskFailed) -> None:
        task, message = event.argument, event.message
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
        if not event.is_cancelled:
            self._set_message(Chip(sentence(message), Tone.BAD))

    def _on_done(self, event: TaskDone[Any]) -> None:
        task, answer = event.argument, event.answer
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
        """Filter and sort again; runs that are still shown stay selected."""
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

    def _on_analyses_ended(self, summary: AnalysisSummary) -> None:
        self._show_progress()
        self._show_outcome(summary.done, tuple(summary.faults), summary.text())
        self.refresh()

    def _show_progress(self) -> None:
        self._update(progress=self._analyses.progress or self._progress)

    def _show_outcome(self, done: tuple[str, ...], faults: tuple[str, ...], words: str) -> None:
        self._set_message(outcome_chip(words, done, faults), faults)

    def _set_message(self, message: Chip, details: tuple[str, ...] = ()) -> None:
        self._update(message=message, details=details, undo_text=self._undos.text)
