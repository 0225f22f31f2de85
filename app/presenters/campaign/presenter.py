"""Presenter of the Campaign screen: collects and summarises the runs of a folder."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.campaign import formatting
from app.presenters.campaign.state import CampaignState, Product
from app.presenters.campaign.tasks import (
    EXECUTE,
    CampaignData,
    CampaignTask,
    CollectRuns,
    ExcludeRun,
    SimulateCampaign,
    UndoExclusion,
    WriteProduct,
)
from app.presenters.events import TaskDone, TaskFailed, TaskProgress, WorkerEvent
from app.presenters.navigator import Navigator
from app.presenters.results import sentence
from app.presenters.worker import EventWorker
from messages.i18n import gettext, ngettext


@dataclass(frozen=True, slots=True)
class _Undo:
    """Task that undoes an exclusion or inclusion, and its description."""

    text: str
    task: UndoExclusion


class CampaignPresenter(Presenter[CampaignState]):
    """Campaign of a folder: `author` is recorded with each exclusion, `close` ends the worker."""

    def __init__(
        self, worker: EventWorker, folder: str, all_series: tuple[str, ...], author: str, navigator: Navigator
    ) -> None:
        rows = formatting.table_rows(None, all_series)
        super().__init__(CampaignState(folder=folder, columns=formatting.column_titles(), rows=rows))
        self._worker = worker
        self._all_series = all_series
        self._author = author
        self.navigator = navigator
        self._data: CampaignData | None = None
        self._undos: list[_Undo] = []
        self._collecting: CollectRuns | None = None

    def enter(self) -> None:
        self.refresh()

    def refresh(self) -> None:
        self._collect(save=False)

    def set_author(self, name: str) -> None:
        self._author = name

    def choose_folder(self, folder: str) -> None:
        self._worker.cancel()
        self._undos, self._data, self._collecting = [], None, None
        self._update(
            folder=folder, rows=formatting.table_rows(None, self._all_series), runs=0, series=0,
            contacts=(), effects=(),
            repeatability=(), next_test=None, selected="", selected_runs=(), excluded=(), faults=(),
            warnings=(), unsaved_count=0,
            undo_text="", message=EMPTY_CHIP, progress=None, is_gathered=False,
        )  # fmt: skip
        self.refresh()

    def cancel(self) -> None:
        self._worker.cancel()

    def select_series(self, label: str) -> None:
        """Select a row, and list its runs."""
        runs = () if self._data is None else formatting.run_rows(self._data, label)
        self._update(selected=label, selected_runs=runs)

    def open_row(self, label: str) -> None:
        row = next((row for row in self.state.rows if row.label == label), None)
        if row is not None and row.runs:
            self.navigator.show_runs(self.state.folder, row.code)

    def exclude_run(self, path: str, reason: str) -> None:
        """Exclude a run; the reason is required, and recorded in the run."""
        if not reason.strip():
            self._set_message(
                Chip(gettext("Say why the run is left out: the reason stands in the table"), Tone.WARN)
            )
            return
        self._exclude(path, reason.strip())

    def include_run(self, path: str) -> None:
        self._exclude(path, "")

    def undo(self) -> None:
        if self._undos:
            self._submit(self._undos.pop().task)

    def save_results(self) -> None:
        self._collect(save=True)

    def export(self, product: Product, target: str) -> None:
        if self.state.runs:
            self._submit(WriteProduct(self.state.folder, product, target))

    def simulate_campaign(self, folder: str) -> None:
        """Simulate a campaign into a new folder below `folder`, and show it."""
        self._update(progress=Progress(gettext("Simulating the campaign")))
        self._submit(SimulateCampaign(folder))

    def tick(self) -> None:
        for event in self._worker.poll():
            self._on_event(event)

    def close(self) -> None:
        self._worker.close()

    def _submit(self, task: CampaignTask) -> None:
        self._worker.submit(EXECUTE, task)

    def _collect(self, *, save: bool) -> None:
        if self._collecting is not None:
            return
        self._collecting = CollectRuns(self.state.folder, self._all_series, save)
        if self._data is None:
            self._update(progress=Progress(gettext("Gathering runs")))
        self._submit(self._collecting)

    def _exclude(self, path: str, reason: str) -> None:
        self._submit(ExcludeRun(self.state.folder, self._all_series, path, reason, self._author))

    def _push_undo(self, done: ExcludeRun) -> None:
        back = UndoExclusion(done.folder, done.all_series, done.path, self._author)
        self._undos.append(_Undo(gettext("leaving out") if done.reason else gettext("taking in"), back))

    def _on_event(self, event: WorkerEvent) -> None:
        task = event.argument
        if isinstance(task, CollectRuns | ExcludeRun | UndoExclusion) and task.folder != self.state.folder:
            return  # another folder was chosen meanwhile
        if isinstance(event, TaskProgress):
            self._update(progress=event.progress)
            return
        self._update(progress=None)
        if task == self._collecting:
            self._collecting = None
        if isinstance(event, TaskFailed):
            self._on_failed(event)
        else:
            self._on_done(event)

    def _on_failed(self, event: TaskFailed) -> None:
        if not event.is_cancelled:
            self._set_message(Chip(sentence(event.message), Tone.BAD))

    def _on_done(self, event: TaskDone[Any]) -> None:
        task, answer = event.argument, event.answer
        match task:
            case CollectRuns(save=save):
                self._show(answer)
                if save:
                    self._set_message(Chip(gettext("New results are kept in their runs"), Tone.OK))
            case ExcludeRun():
                self._push_undo(task)
                self._show(answer)
                run = Path(task.path).stem
                text = (
                    gettext("{run} is left out", run=run)
                    if task.reason
                    else gettext("{run} counts again", run=run)
                )
                self._set_message(Chip(text, Tone.OK))
            case UndoExclusion():
                self._show(answer)
            case WriteProduct():
                text = ngettext(
                    "Wrote {first}", "Wrote {count} files: {first} …", len(answer), first=answer[0]
                )
                self._set_message(Chip(text, Tone.OK))
            case SimulateCampaign():
                self.choose_folder(answer)

    def _show(self, data: CampaignData) -> None:
        self._data = data
        chosen = (
            self.state.selected if any(r.label == self.state.selected for r in data.campaign.rows) else ""
        )
        self._update(
            rows=formatting.table_rows(data, self._all_series),
            runs=sum(len(row.runs) for row in data.campaign.rows),
            series=len(data.campaign.rows),
            contacts=formatting.contact_bars(data),
            effects=formatting.effect_rows(data),
            repeatability=formatting.repeatability_rows(data),
            next_test=formatting.next_test(data),
            selected=chosen,
            selected_runs=formatting.run_rows(data, chosen),
            excluded=formatting.excluded_rows(data),
            faults=formatting.failure_texts(data),
            warnings=formatting.warning_texts(data),
            unsaved_count=data.unsaved_count,
            undo_text=self._undos[-1].text if self._undos else "",
            message=EMPTY_CHIP,
            is_gathered=True,
        )

    def _set_message(self, message: Chip) -> None:
        self._update(message=message)
