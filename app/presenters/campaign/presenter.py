"""What the Campaign screen does: a folder of runs gathered, and told as table, figure and sentences."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.campaign import formatting
from app.presenters.campaign.state import CampaignState, Product
from app.presenters.campaign.tasks import (
    CampaignData,
    CampaignTask,
    CollectRuns,
    ExcludeRun,
    SimulateCampaign,
    UndoExclusion,
    WriteProduct,
    execute,
)
from app.presenters.results import sentence
from app.presenters.worker import CANCELLED, TaskDone, TaskFailed, TaskProgress, Worker, WorkerEvent
from messages.i18n import gettext, ngettext


class Navigator(Protocol):
    """Where one comes to from this screen."""

    def show_runs(self, folder: str, series: str) -> None:
        """Show runs of a folder on the Runs screen, those of a series alone unless it is ""."""

    def open_run(self, path: str) -> None:
        """Show a run on Identify."""

    def show_record(self) -> None:
        """Go to Record."""


@dataclass(frozen=True, slots=True)
class _Undo:
    """How a leaving out or taking in is taken back, and how that is called."""

    text: str
    task: UndoExclusion


class CampaignPresenter(Presenter[CampaignState]):
    """Sums up a folder.

    Parameters
    ----------
    worker : Worker
        Its own one; closed by `close`.
    folder : str
        Whose runs are gathered at first.
    all_series : tuple of str
        Series codes of the stand, in the paper's order.
    author : str
        Who leaves runs out.
    ways : Ways
    """

    def __init__(
        self, worker: Worker, folder: str, all_series: tuple[str, ...], author: str, navigator: Navigator
    ) -> None:
        rows = formatting.table_rows(None, all_series)
        super().__init__(CampaignState(folder=folder, columns=formatting.column_titles(), rows=rows))
        self._worker = worker
        self._all_series = all_series
        self._author = author
        self._navigator = navigator
        self._data: CampaignData | None = None
        self._undos: list[_Undo] = []
        self._gathering: CollectRuns | None = None

    # --- what the operator does ---

    def enter(self) -> None:
        """The screen is shown: what was recorded meanwhile belongs into the table."""
        self.refresh()

    def refresh(self) -> None:
        """Gather the folder again."""
        self._gather(save=False)

    def set_author(self, name: str) -> None:
        """Who leaves runs out from now on."""
        self._author = name

    def choose_folder(self, folder: str) -> None:
        """Gather another folder."""
        self._worker.cancel()
        self._undos, self._data, self._gathering = [], None, None
        self._update(
            folder=folder, rows=formatting.table_rows(None, self._all_series), runs=0, series=0,
            contacts=(), effects=(),
            repeatability=(), next_test=None, selected="", selected_runs=(), excluded=(), faults=(),
            warnings=(), unsaved_count=0,
            undo_text="", message=EMPTY_CHIP, progress=None, is_gathered=False,
        )  # fmt: skip
        self.refresh()

    def cancel(self) -> None:
        """Give up what goes on; what is shown stays."""
        self._worker.cancel()

    def select_series(self, label: str) -> None:
        """Show the runs of a row."""
        runs = () if self._data is None else formatting.run_rows(self._data, label)
        self._update(selected=label, selected_runs=runs)

    def open_row(self, label: str) -> None:
        """Show the runs of a row on the Runs screen."""
        row = next((row for row in self.state.rows if row.label == label), None)
        if row is not None and row.runs:
            self._navigator.show_runs(self.state.folder, row.code)

    def open_run(self, path: str) -> None:
        """Show a run on Identify."""
        self._navigator.open_run(path)

    def show_record(self) -> None:
        """Go and record."""
        self._navigator.show_record()

    def exclude_run(self, path: str, reason: str) -> None:
        """A run does not count from now on, for a reason that must be given and is kept in it."""
        if not reason.strip():
            self._set_message(
                Chip(gettext("Say why the run is left out: the reason stands in the table"), Tone.WARN)
            )
            return
        self._exclude(path, reason.strip())

    def include_run(self, path: str) -> None:
        """A run that was left out counts again."""
        self._exclude(path, "")

    def undo(self) -> None:
        """Take back the last leaving out or taking in."""
        if self._undos:
            self._submit(self._undos.pop().task)

    def save_results(self) -> None:
        """Keep new results in their runs."""
        self._gather(save=True)

    def export(self, product: Product, target: str) -> None:
        """Write something of the campaign to a file or folder."""
        if self.state.runs:
            self._submit(WriteProduct(self.state.folder, product, target))

    def simulate_campaign(self, folder: str) -> None:
        """Simulate a whole campaign into a new folder below this one, and show it."""
        self._update(progress=Progress(gettext("Simulating the campaign")))
        self._submit(SimulateCampaign(folder))

    # --- what time brings ---

    def tick(self) -> None:
        """Take in what the worker has said."""
        for news in self._worker.poll():
            self._on_event(news)

    def close(self) -> None:
        """End the worker."""
        self._worker.close()

    # --- inside ---

    def _submit(self, task: CampaignTask) -> None:
        self._worker.submit(execute, task)

    def _gather(self, *, save: bool) -> None:
        if self._gathering is not None:
            return
        self._gathering = CollectRuns(self.state.folder, self._all_series, save)
        if self._data is None:
            self._update(progress=Progress(gettext("Gathering runs")))
        self._submit(self._gathering)

    def _exclude(self, path: str, reason: str) -> None:
        self._submit(ExcludeRun(self.state.folder, self._all_series, path, reason, self._author))

    def _push_undo(self, done: ExcludeRun) -> None:
        back = UndoExclusion(done.folder, done.all_series, done.path, self._author)
        self._undos.append(_Undo(gettext("leaving out") if done.reason else gettext("taking in"), back))

    def _on_event(self, news: WorkerEvent) -> None:
        task = news.argument
        if isinstance(task, CollectRuns | ExcludeRun | UndoExclusion) and task.folder != self.state.folder:
            return  # another folder was chosen meanwhile
        if isinstance(news, TaskProgress):
            self._update(progress=news.progress)
            return
        self._update(progress=None)
        if task == self._gathering:
            self._gathering = None
        if isinstance(news, TaskFailed):
            self._on_failed(news.message)
        else:
            self._on_done(news)

    def _on_failed(self, message: str) -> None:
        if message != CANCELLED:
            self._set_message(Chip(sentence(message), Tone.BAD))

    def _on_done(self, news: TaskDone[Any]) -> None:
        task, answer = news.argument, news.answer
        match task:
            case CollectRuns(save=save):
                self._show(answer)
                if save:
                    self._set_message(Chip(gettext("New results are kept in their runs"), Tone.OK))
            case ExcludeRun():
                self._push_undo(task)
                self._show(answer)
                run = Path(task.path).stem
                words = (
                    gettext("{run} is left out", run=run)
                    if task.reason
                    else gettext("{run} counts again", run=run)
                )
                self._set_message(Chip(words, Tone.OK))
            case UndoExclusion():
                self._show(answer)
            case WriteProduct():
                words = ngettext(
                    "Wrote {first}", "Wrote {count} files: {first} …", len(answer), first=answer[0]
                )
                self._set_message(Chip(words, Tone.OK))
            case SimulateCampaign():
                self.choose_folder(answer)

    def _show(self, found: CampaignData) -> None:
        self._data = found
        chosen = (
            self.state.selected if any(r.label == self.state.selected for r in found.campaign.rows) else ""
        )
        self._update(
            rows=formatting.table_rows(found, self._all_series),
            runs=sum(len(row.runs) for row in found.campaign.rows),
            series=len(found.campaign.rows),
            contacts=formatting.contact_bars(found),
            effects=formatting.effect_rows(found),
            repeatability=formatting.repeatability_rows(found),
            next_test=formatting.next_test(found),
            selected=chosen,
            selected_runs=formatting.run_rows(found, chosen),
            excluded=formatting.excluded_rows(found),
            faults=formatting.failure_texts(found),
            warnings=formatting.warning_texts(found),
            unsaved_count=found.unsaved_count,
            undo_text=self._undos[-1].text if self._undos else "",
            message=EMPTY_CHIP,
            is_gathered=True,
        )

    def _set_message(self, message: Chip) -> None:
        self._update(message=message)
