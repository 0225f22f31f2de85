"""Presenter of the Runs screen: lists, filters and sorts runs, and works on the selected ones."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, TaskFailure, Tone, run_count_text
from app.presenters.recent import RecentItems
from app.presenters.results import sentence
from app.presenters.runs import changes
from app.presenters.runs.analysis_queue import AnalysisQueue
from app.presenters.runs.changes import Change
from app.presenters.runs.export_presenter import ExportPresenter
from app.presenters.runs.import_presenter import ImportPresenter
from app.presenters.runs.state import (
    BatchOutcome,
    Column,
    MetadataForm,
    Overlay,
    RunFilter,
    RunsState,
    Span,
    Trace,
)
from app.presenters.runs.table import RunList
from app.presenters.worker import LazyModule, Worker
from app.runs.summary import RunSummary
from config.schema import Stand
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.presenters.runs import tasks
else:
    tasks = LazyModule("app.presenters.runs.tasks")

RUN_SUFFIX = ".h5"


class RunsPresenter(Presenter[RunsState]):
    """Runs of a folder: `author` is recorded with each edit, `close` ends both workers."""

    def __init__(
        self,
        worker: Worker,
        analysis_worker: Worker,
        folder: str,
        all_series: tuple[str, ...],
        author: str,
        open_run: Callable[[str], None],
        recent: RecentItems | None = None,
    ) -> None:
        super().__init__(RunsState(folder=folder, all_series=all_series))
        self.recent = recent or RecentItems()
        self._recordings = folder
        self.export_dialog = ExportPresenter(worker, self.recent)
        self.import_dialog = ImportPresenter(worker, self._on_imported)
        self._worker = worker
        self._analysis_worker = analysis_worker
        self._author = author
        self._open_run = open_run
        self._library = RunList()
        self._undos: list[Change] = []
        self._analyses = AnalysisQueue(analysis_worker, self._on_runs_changed)
        self._progress: Progress | None = None
        self._is_listing = False
        self._coarse: Overlay | None = None
        """The overlay as it was before the user zoomed in."""
        self._part: tuple[tuple[str, ...], Span, int] | None = None
        self._next_part: tuple[Span, int] | None = None

    def enter(self) -> None:
        self.refresh()

    def refresh(self) -> None:
        if not self._is_listing:
            self._is_listing = True
            place = self.state.folder, self.state.in_trash
            self._worker.submit(
                tasks.list_folder,
                *place,
                done=partial(self._on_listed, place),
                failed=self._on_listing_failed,
                progress=self._set_progress,
            )

    def on_stand(self, stand: Stand) -> None:
        self._update(all_series=stand.all_series)

    def set_author(self, name: str) -> None:
        self._author = name

    @property
    def recent_folders(self) -> tuple[str, ...]:
        """Folders that were shown last, and that of the recordings."""
        return self.recent.folders_with(self._recordings)

    def choose_folder(self, folder: str) -> None:
        self.recent.add_folder(folder)
        self._undos.clear()
        self._show_place(folder=folder, in_trash=False, undo_text="")

    def show_trash(self, shown: bool) -> None:
        """Show the runs in the trash of the folder, or those of the folder again."""
        if shown is not self.state.in_trash:
            self._show_place(in_trash=shown)

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
        self._coarse = None
        self._update(selected=paths, metadata=self._metadata(paths))
        readable = self._library.readable(paths)
        if readable:
            self._worker.submit(
                tasks.load_overlay, readable, done=partial(self._on_overlay, readable), failed=self._on_failed
            )
        else:
            words = self._library.fault(paths[0]) if paths else ""
            self._update(overlay=Overlay(message=sentence(words)) if paths else None)

    def zoom_overlay(self, span: Span, pixels: int) -> None:
        """Read the part in view of runs that were decimated; while one is read, only the newest waits."""
        if self._coarse is None or not any(trace.is_decimated for trace in self._coarse.traces):
            return
        if self._part is not None:
            self._next_part = span, pixels
            return
        part = self._part = (self._readable(), span, pixels)
        self._worker.submit(
            tasks.load_part,
            *part,
            done=partial(self._on_part, part),
            failed=lambda _failure: self._on_part(part, ()),
        )

    def open_selected(self) -> None:
        if self.state.selected:
            self._open_run(self.state.selected[0])

    def edit(self, field: str, text: str) -> None:
        """Set a field in all selected runs; an invalid text changes nothing."""
        before = self.state.metadata
        paths = self._editable()
        if before is None or not paths or (text == before.texts[field] and field not in before.mixed):
            return
        try:
            value = changes.parse_field(field, text, self.state.all_series)
        except ValueError as error:
            self._set_message(Chip(str(error), Tone.BAD))
            self._update(metadata=None)
            self._update(metadata=before)  # restores the old text in the view
            return
        self._submit(changes.edit(paths, field, value, self._author))

    def undo(self) -> None:
        if self._undos:
            self._submit(self._undos.pop())

    def trash(self) -> None:
        """Move the selected runs to the trash; nothing is deleted."""
        if self.state.selected and not self.state.in_trash:
            self._submit(changes.trash(self.state.selected))

    def restore(self) -> None:
        """Move the selected runs from the trash back to their folder."""
        if self.state.selected and self.state.in_trash:
            self._submit(changes.restore(self.state.selected))

    def empty_trash(self) -> None:
        """Delete all runs in the trash for ever: the view has asked."""
        if self.state.in_trash:
            self._undos.clear()
            self._submit(changes.delete(self._library.paths()))

    def analyse(self, *, reanalyse: bool = False) -> None:
        """Analyse the selected runs and save the results; `reanalyse` includes up-to-date ones."""
        self._set_message(EMPTY_CHIP)
        self._analyses.submit(self._editable(), reanalyse=reanalyse)
        self._show_progress()

    def open_export(self) -> bool:
        """Prepare the export dialog for the selected runs; False if none can be exported."""
        runs = self._editable()
        if runs:
            self.export_dialog.open(runs, self.state.folder)
        return bool(runs)

    def cancel(self) -> None:
        if self._analyses.progress is None:
            self._worker.cancel()
        else:
            self._analyses.cancel()

    def add_files(self, paths: tuple[str, ...]) -> bool:
        """Copy run files into the folder, queue others for import; True if there are any to import."""
        runs = tuple(path for path in paths if path.lower().endswith(RUN_SUFFIX))
        if runs:
            self._submit(changes.copy(runs, self.state.folder))
        others = tuple(path for path in paths if path not in runs)
        if others:
            self.recent.set_import_file(others[0])
            self.import_dialog.open(others, self.state.folder, self._author)
        return bool(others)

    def tick(self) -> None:
        self._worker.poll()
        self._analysis_worker.poll()
        self._show_progress()

    def close(self) -> None:
        self._worker.close()
        self._analysis_worker.close()

    def _submit(self, change: Change) -> None:
        self._worker.submit(
            tasks.change_runs,
            change.paths,
            change.function,
            change.arguments,
            change.progress,
            done=partial(self._on_changed, change),
            failed=self._on_failed,
            progress=self._set_progress,
        )

    def _set_progress(self, progress: Progress | None) -> None:
        self._progress = progress

    def _on_failed(self, failure: TaskFailure) -> None:
        self._progress = None
        if not failure.is_cancelled:
            self._set_message(Chip(sentence(failure.message), Tone.BAD))

    def _on_listed(self, place: tuple[str, bool], runs: tuple[RunSummary, ...]) -> None:
        self._is_listing = False
        self._progress = None
        if place != (self.state.folder, self.state.in_trash):
            self.refresh()
            return
        self._library.set_runs(runs)
        self._update(is_listed=True, total=len(runs))
        self._show_rows()

    def _on_listing_failed(self, failure: TaskFailure) -> None:
        self._is_listing = False
        self._update(is_listed=True)
        self._on_failed(failure)

    def _on_overlay(self, paths: tuple[str, ...], overlay: Overlay) -> None:
        self._progress = None
        if paths == self._readable():
            self._coarse, self._next_part = overlay, None
            self._update(overlay=overlay)

    def _on_part(self, part: tuple[tuple[str, ...], Span, int], traces: tuple[Trace, ...]) -> None:
        self._part = None
        if self._coarse is not None and part[0] == self._readable():
            self._update(overlay=self._coarse.with_parts(traces))
        following, self._next_part = self._next_part, None
        if following is not None:
            self.zoom_overlay(*following)

    def _on_changed(self, change: Change, outcome: BatchOutcome) -> None:
        self._progress = None
        if outcome.done and change.undo is not None:
            self._undos.append(change.undo(outcome.done))
        self._on_runs_changed(outcome, change.text(run_count_text(outcome.done)))

    def _on_imported(self, path: str) -> None:
        self._on_runs_changed(BatchOutcome((path,)), gettext("Imported {name}", name=Path(path).stem))

    def _show_rows(self) -> None:
        """Filter and sort again; runs that are still shown stay selected."""
        state = self.state
        rows = self._library.rows(state.filter, state.sorted_by, descending=state.descending)
        shown = {row.path for row in rows}
        selected = tuple(path for path in state.selected if path in shown)
        self._update(rows=rows, metadata=self._metadata(selected))
        self.select(selected)

    def _show_place(self, **place: Any) -> None:
        """Show another folder, or its trash; nothing is known of it yet."""
        self._update(
            rows=(), total=0, is_listed=False, selected=(), metadata=None, overlay=None,
            message=EMPTY_CHIP, details=(), **place,
        )  # fmt: skip
        self.refresh()

    def _metadata(self, paths: tuple[str, ...]) -> MetadataForm | None:
        """Metadata to edit; none in the trash."""
        return None if self.state.in_trash else self._library.metadata(paths)

    def _readable(self) -> tuple[str, ...]:
        return self._library.readable(self.state.selected)

    def _editable(self) -> tuple[str, ...]:
        """Selected runs that can be read and are not in the trash."""
        return () if self.state.in_trash else self._readable()

    def _on_runs_changed(self, outcome: BatchOutcome, text: str) -> None:
        chip = changes.outcome_chip(text, outcome.done, outcome.faults)
        self._set_message(chip, outcome.faults)
        self._show_progress()
        self.refresh()

    def _show_progress(self) -> None:
        self._update(progress=self._analyses.progress or self._progress)

    def _set_message(self, message: Chip, details: tuple[str, ...] = ()) -> None:
        undo_text = self._undos[-1].undone_text if self._undos else ""
        self._update(message=message, details=details, undo_text=undo_text)
