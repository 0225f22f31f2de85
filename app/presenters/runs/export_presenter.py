"""Presenter of the export dialog: format, content and target, with a preview."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, TaskFailure, Tone
from app.presenters.recent import RecentItems
from app.presenters.results import sentence
from app.presenters.runs.state import BatchOutcome
from app.presenters.worker import LazyModule, Worker
from messages.i18n import N_, gettext, ngettext
from messages.message import message, replace_options

if TYPE_CHECKING:
    from app.presenters.runs import tasks
else:
    tasks = LazyModule("app.presenters.runs.tasks")

FORMATS = {
    "csv": N_("CSV, for anything"),
    "xlsx": N_("Excel (.xlsx)"),
    "json": N_("JSON, as `analyze --json`"),
    "parquet": N_("Parquet, for pandas and Arrow"),
    "mat": N_("MATLAB (.mat)"),
    "uff58": N_("Universal file 58, for modal analysis"),
    "latex": N_("LaTeX table"),
    "ro-crate": N_("RO-Crate, to publish"),
}
CONTENTS = {
    "both": N_("Samples and coefficients"),
    "samples": N_("Samples"),
    "coefficients": N_("Coefficients, one table of all runs"),
}
_SUFFIXES = {"uff58": ".uff", "latex": ".tex", "ro-crate": ".zip"}
_LABELS = {"-o": message("place")}
_CONTENTS_OF = {"uff58": ("samples",), "latex": ("coefficients",), "ro-crate": ("coefficients",)}
"""Contents of the formats that do not support all."""


@dataclass(frozen=True, slots=True)
class ExportState:
    """State of the dialog. The format offers `contents`; `output` is a file, or a folder if `is_folder`."""

    runs: tuple[str, ...] = ()
    format: str = "csv"
    contents: tuple[str, ...] = tuple(CONTENTS)
    content: str = "both"
    output: str = ""
    is_folder: bool = False
    replace: bool = False
    preview: str = ""
    progress: Progress | None = None
    message: Chip = EMPTY_CHIP
    details: tuple[str, ...] = ()
    written_to: str = ""
    """Folder of the files of the last export; empty before."""


class ExportPresenter(Presenter[ExportState]):
    """Exports runs by `worker`, which the Runs screen polls and closes."""

    def __init__(self, worker: Worker, recent: RecentItems | None = None) -> None:
        super().__init__(ExportState())
        self._worker = worker
        self._recent = recent or RecentItems()
        self._folder = Path()
        self._is_output_typed = False

    def open(self, runs: tuple[str, ...], folder: str) -> None:
        """Export `runs`, to the folder of the last export, else to `folder`."""
        self._folder = Path(self._recent.export_folder or folder)
        self._is_output_typed = False
        self._update(runs=runs, message=EMPTY_CHIP, details=(), progress=None, written_to="")
        self._propose()

    def set_format(self, name: str) -> None:
        """Choose one of `FORMATS`; contents that it does not support are not offered."""
        contents = _CONTENTS_OF.get(name, tuple(CONTENTS))
        content = self.state.content if self.state.content in contents else contents[0]
        self._update(format=name, contents=contents, content=content, message=EMPTY_CHIP)
        self._propose()

    def set_content(self, name: str) -> None:
        self._update(content=name, message=EMPTY_CHIP)
        self._propose()

    def set_output(self, path: str) -> None:
        """Set the target; one that the operator typed is kept when other choices change."""
        self._is_output_typed = True
        self._update(output=path)

    def set_replace(self, allowed: bool) -> None:
        self._update(replace=allowed)

    def export(self) -> None:
        state = self.state
        if not state.output.strip():
            missing = N_("Choose the folder to write") if state.is_folder else N_("Choose the file to write")
            self._update(message=Chip(gettext(missing), Tone.BAD))
        elif state.progress is None:
            self._update(
                progress=Progress(gettext("Exporting")), message=EMPTY_CHIP, details=(), written_to=""
            )
            self._worker.submit(
                tasks.export_files,
                state.runs,
                str(Path(state.output.strip()).expanduser()),
                {"format": state.format, "content": state.content, "replace": state.replace},
                done=self._on_done,
                failed=self._on_failed,
                progress=lambda progress: self._update(progress=progress),
            )

    def _on_preview(self, asked: ExportState, preview: str) -> None:
        state = self.state
        if (asked.runs, asked.format, asked.content) == (state.runs, state.format, state.content):
            self._update(preview=preview)

    def _on_done(self, outcome: BatchOutcome) -> None:
        files = tuple(dict.fromkeys(outcome.done))
        if files:
            self._recent.set_export_target(self.state.output)
        text = gettext("Wrote {files}", files=_files(files)) if files else gettext("Nothing was written")
        if outcome.faults:
            failed, all_runs = len(outcome.faults), len(self.state.runs)
            text += gettext("; {failed} of {all} runs could not be exported", failed=failed, all=all_runs)
        tone = Tone.BAD if outcome.faults else Tone.OK
        folder = str(Path(files[0]).parent) if files else ""
        self._update(progress=None, message=Chip(text, tone), details=outcome.faults, written_to=folder)

    def _on_failed(self, failure: TaskFailure) -> None:
        words = sentence(replace_options(failure.message, _LABELS))
        self._update(progress=None, message=Chip(words, Tone.BAD))

    def _propose(self) -> None:
        """Propose a target, and request a preview."""
        state = self.state
        if not state.runs:
            return
        is_table = state.content == "coefficients"
        is_folder = not is_table and len(state.runs) > 1
        if not self._is_output_typed or is_folder != state.is_folder:
            suffix = _SUFFIXES.get(state.format, f".{state.format}")
            stem = "coefficients" if is_table and len(state.runs) > 1 else Path(state.runs[0]).stem
            name = "exported" if is_folder else stem + suffix
            self._is_output_typed = False
            self._update(output=str(self._folder / name))
        self._update(is_folder=is_folder, preview="")
        self._worker.submit(
            tasks.preview_export,
            state.runs[0],
            {"format": state.format, "content": state.content},
            done=partial(self._on_preview, state),
            failed=self._on_failed,
        )


def _files(files: tuple[str, ...]) -> str:
    if len(files) == 1:
        return files[0]
    folder = Path(files[0]).parent
    return ngettext("{count} file to {folder}", "{count} files to {folder}", len(files), folder=folder)
