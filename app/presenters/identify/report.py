"""Presenter of the report of the shown run: a PDF file, or pages for a printer."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, TaskFailure, Tone
from app.presenters.recent import RecentItems
from app.presenters.results import sentence
from app.presenters.worker import LazyModule, Worker
from messages.i18n import gettext

if TYPE_CHECKING:
    from app.presenters.identify import report_tasks
else:
    report_tasks = LazyModule("app.presenters.identify.report_tasks")


@dataclass(frozen=True, slots=True)
class ReportState:
    run: str = ""
    """Path of the run; empty while none is shown."""
    is_busy: bool = False
    message: Chip = EMPTY_CHIP
    written_to: str = ""
    """Folder of the written report; empty before."""


class ReportPresenter(Presenter[ReportState]):
    """Writes and prints reports of runs by `worker`, which `close` closes."""

    def __init__(self, worker: Worker, recent: RecentItems | None = None) -> None:
        super().__init__(ReportState())
        self._worker = worker
        self._recent = recent or RecentItems()

    def set_run(self, path: str) -> None:
        """Choose the run, or none; what is being written is given up."""
        if self.state.is_busy:
            self._worker.cancel()
        self._set_state(ReportState(path))

    @property
    def proposed_target(self) -> str:
        """File that is proposed for the report: in the folder of the last export, else beside the run."""
        run = Path(self.state.run)
        return str(Path(self._recent.export_folder or run.parent) / f"{run.stem}.pdf")

    def write(self, target: str) -> None:
        self._begin(gettext("Writing {file}", file=Path(target).name))
        self._worker.submit(
            report_tasks.write_run_report,
            self.state.run,
            target,
            done=self._on_written,
            failed=self._on_failed,
        )

    def render(self, print_pages: Callable[[list[bytes]], None]) -> None:
        """Typeset the report, then call `print_pages` with its pages as PNG images."""
        self._begin(gettext("Typesetting the report"))
        self._worker.submit(
            report_tasks.render_run_report,
            self.state.run,
            done=partial(self._on_rendered, print_pages),
            failed=self._on_failed,
        )

    def tick(self) -> None:
        self._worker.poll()

    def close(self) -> None:
        self._worker.close()

    def _begin(self, text: str) -> None:
        self._update(is_busy=True, message=Chip(text), written_to="")

    def _on_written(self, target: str) -> None:
        self._recent.set_export_target(target)
        text = gettext("Wrote {files}", files=target)
        self._update(is_busy=False, message=Chip(text, Tone.OK), written_to=str(Path(target).parent))

    def _on_rendered(self, print_pages: Callable[[list[bytes]], None], pages: list[bytes]) -> None:
        self._update(is_busy=False, message=EMPTY_CHIP)
        print_pages(pages)

    def _on_failed(self, failure: TaskFailure) -> None:
        if not failure.is_cancelled:
            self._update(is_busy=False, message=Chip(sentence(failure.message), Tone.BAD))
