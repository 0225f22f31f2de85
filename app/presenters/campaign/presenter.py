"""Presenter of the Campaign screen: collects and summarises the runs of a folder."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, TaskFailure, Tone
from app.presenters.campaign.state import (
    CampaignScope,
    CampaignState,
    CampaignSummary,
    Product,
    column_titles,
    row_without_runs,
)
from app.presenters.navigator import Navigator
from app.presenters.recent import RecentItems
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from config.schema import Stand
from messages.i18n import gettext, ngettext

if TYPE_CHECKING:
    from app.presenters.campaign import products, tasks
else:
    products = LazyModule("app.presenters.campaign.products")
    tasks = LazyModule("app.presenters.campaign.tasks")


class CampaignPresenter(Presenter[CampaignState]):
    """Campaign of a folder: `author` is recorded with each exclusion, `close` ends the worker."""

    def __init__(
        self,
        worker: Worker,
        folder: str,
        all_series: tuple[str, ...],
        author: str,
        navigator: Navigator,
        recent: RecentItems | None = None,
    ) -> None:
        self._worker = worker
        self.recent = recent or RecentItems()
        self._recordings = folder
        self._all_series = all_series
        self._author = author
        self.navigator = navigator
        self._undos: list[tuple[str, str]] = []
        """Description of each exclusion or inclusion, and path of the run."""
        self._is_collecting = False
        self._counts_simulated = False
        super().__init__(self._empty_state(folder))

    def enter(self) -> None:
        self.refresh()

    def refresh(self) -> None:
        self._collect(save=False)

    def on_stand(self, stand: Stand) -> None:
        self._all_series = stand.all_series
        self._set_state(self._empty_state(self.state.folder))  # gathered anew when the screen is shown

    def set_author(self, name: str) -> None:
        self._author = name

    def set_count_simulated(self, counted: bool) -> None:
        """Count simulated runs beside others, or not."""
        if counted is not self._counts_simulated:
            self._counts_simulated = counted
            if self.state.is_gathered:
                self._worker.cancel()
                self._is_collecting = False
                self.refresh()

    @property
    def recent_folders(self) -> tuple[str, ...]:
        """Folders that were gathered last, and that of the recordings."""
        return self.recent.folders_with(self._recordings)

    def choose_folder(self, folder: str) -> None:
        self.recent.add_folder(folder)
        self._worker.cancel()
        self._undos, self._is_collecting = [], False
        self._set_state(self._empty_state(folder))
        self.refresh()

    def cancel(self) -> None:
        self._worker.cancel()

    def select_series(self, label: str) -> None:
        """Select a row, and list its runs."""
        self._update(selected=label)

    def open_row(self, label: str) -> None:
        row = next((row for row in self.state.summary.rows if row.label == label), None)
        if row is not None and row.runs:
            self.navigator.show_runs(self.state.folder, row.code)

    def exclude_run(self, path: str, reason: str) -> None:
        """Exclude a run; the reason is required, and recorded in the run."""
        if reason.strip():
            self._exclude(path, reason.strip())
        else:
            text = gettext("Say why the run is left out: the reason stands in the table")
            self._set_message(Chip(text, Tone.WARN))

    def include_run(self, path: str) -> None:
        self._exclude(path, "")

    def undo(self) -> None:
        if self._undos:
            _, path = self._undos.pop()
            arguments = (self._scope(), path, self._author)
            self._submit(tasks.undo_exclusion, *arguments, done=self._on_summary)

    def save_results(self) -> None:
        self._collect(save=True)

    def export(self, product: Product, target: str) -> None:
        if self.state.summary.run_count:
            self.recent.set_export_target(target)
            self._submit(products.write_product, self._scope(), product, target, done=self._on_written)

    def simulate_campaign(self) -> None:
        """Simulate a campaign into a new folder below that of the runs, and show it."""
        self._update(progress=Progress(gettext("Simulating the campaign")))
        self._submit(tasks.simulate, self.state.folder, done=self.choose_folder)

    def tick(self) -> None:
        self._worker.poll()

    def close(self) -> None:
        self._worker.close()

    def _scope(self) -> CampaignScope:
        return CampaignScope(self.state.folder, self._all_series, self._counts_simulated)

    def _empty_state(self, folder: str) -> CampaignState:
        rows = tuple(map(row_without_runs, self._all_series))
        return CampaignState(folder, CampaignSummary(rows), column_titles())

    def _submit(self, task: Any, *arguments: Any, done: Callable[[Any], None]) -> None:
        """Submit a task; what comes of it is ignored if another folder was chosen meanwhile."""
        folder = self.state.folder

        def if_shown(callback: Callable[[Any], None], value: Any) -> None:
            if self.state.folder == folder:
                callback(value)

        def on_done(answer: Any) -> None:
            self._update(progress=None)
            done(answer)

        self._worker.submit(
            task,
            *arguments,
            done=partial(if_shown, on_done),
            failed=partial(if_shown, self._on_failed),
            progress=partial(if_shown, lambda progress: self._update(progress=progress)),
        )

    def _collect(self, *, save: bool) -> None:
        if self._is_collecting:
            return
        self._is_collecting = True
        if not self.state.is_gathered:
            self._update(progress=Progress(gettext("Gathering runs")))
        done = partial(self._on_collected, save)
        self._submit(tasks.collect, self._scope(), save, done=done)

    def _exclude(self, path: str, reason: str) -> None:
        arguments = (self._scope(), path, reason, self._author)
        self._submit(tasks.exclude_run, *arguments, done=partial(self._on_excluded, path, reason))

    def _on_failed(self, failure: TaskFailure) -> None:
        self._is_collecting = False
        self._update(progress=None)
        if not failure.is_cancelled:
            self._set_message(Chip(sentence(failure.message), Tone.BAD))

    def _on_collected(self, saved: bool, summary: CampaignSummary) -> None:
        self._is_collecting = False
        self._on_summary(summary)
        if saved:
            self._set_message(Chip(gettext("New results are kept in their runs"), Tone.OK))

    def _on_excluded(self, path: str, reason: str, summary: CampaignSummary) -> None:
        self._undos.append((gettext("leaving out") if reason else gettext("taking in"), path))
        self._on_summary(summary)
        name = Path(path).stem
        text = gettext("{run} is left out", run=name) if reason else gettext("{run} counts again", run=name)
        self._set_message(Chip(text, Tone.OK))

    def _on_written(self, files: tuple[str, ...]) -> None:
        text = ngettext("Wrote {first}", "Wrote {count} files: {first} …", len(files), first=files[0])
        self._set_message(Chip(text, Tone.OK), written_to=str(Path(files[0]).parent))

    def _set_message(self, message: Chip, *, written_to: str = "") -> None:
        self._update(message=message, written_to=written_to)

    def _on_summary(self, summary: CampaignSummary) -> None:
        has_selected = any(row.label == self.state.selected and row.runs for row in summary.rows)
        self._update(
            summary=summary,
            selected=self.state.selected if has_selected else "",
            undo_text=self._undos[-1][0] if self._undos else "",
            message=EMPTY_CHIP,
            written_to="",
            is_gathered=True,
        )
