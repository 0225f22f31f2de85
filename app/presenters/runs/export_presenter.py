"""What becomes of the selected runs for other programs: format, content, place, and how it will look."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, Tone
from app.presenters.results import sentence
from app.presenters.runs.tasks import BatchOutcome, ExportPreview, ExportRuns, PreviewExport
from messages.i18n import N_, gettext, ngettext

FORMATS = {
    "csv": N_("CSV, for anything"),
    "xlsx": N_("Excel (.xlsx)"),
    "json": N_("JSON, as `analyze --json`"),
    "parquet": N_("Parquet, for pandas and Arrow"),
    "mat": N_("MATLAB (.mat)"),
    "uff58": N_("Universal file 58, for modal analysis"),
    "latex": N_("LaTeX table"),
}
CONTENTS = {
    "both": N_("Samples and coefficients"),
    "samples": N_("Samples"),
    "coefficients": N_("Coefficients, one table of all runs"),
}
_SUFFIXES = {"uff58": ".uff", "latex": ".tex"}
_ONLY_SAMPLES, _ONLY_COEFFICIENTS = {"uff58"}, {"latex"}


@dataclass(frozen=True, slots=True)
class ExportState:
    """The dialog. `contents` are those that the format can hold; `output` is a file or, as told, a folder."""

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


class ExportEvents(Protocol):
    """What the dialog tells its presenter."""

    def set_format(self, name: str) -> None:
        """One of `FORMATS`."""

    def set_content(self, name: str) -> None:
        """One of the contents of the format."""

    def set_output(self, path: str) -> None:
        """Where it goes."""

    def set_replace(self, allowed: bool) -> None:
        """Whether files that are there already may be replaced."""

    def export(self) -> None:
        """Do it."""


class ExportPresenter(Presenter[ExportState]):
    """Exports runs.

    Parameters
    ----------
    submit : callable
        Gives a task to the worker of the Runs screen, which hands the answers to `show_preview` and `done`.
    """

    def __init__(self, submit: Callable[[PreviewExport | ExportRuns], None]) -> None:
        super().__init__(ExportState())
        self._submit = submit
        self._folder = Path()
        self._is_own_place = False

    def open(self, runs: tuple[str, ...], folder: str) -> None:
        """These runs of a folder are to be exported; choices of the last time stay."""
        self._folder = Path(folder)
        self._is_own_place = False
        self._update(runs=runs, message=EMPTY_CHIP, details=(), progress=None)
        self._propose()

    def set_format(self, name: str) -> None:
        """One of `FORMATS`; what it cannot hold is not offered."""
        contents = tuple(
            content
            for content in CONTENTS
            if not (name in _ONLY_SAMPLES and content != "samples")
            and not (name in _ONLY_COEFFICIENTS and content != "coefficients")
        )
        content = self.state.content if self.state.content in contents else contents[0]
        self._update(format=name, contents=contents, content=content, message=EMPTY_CHIP)
        self._propose()

    def set_content(self, name: str) -> None:
        """One of the contents of the format."""
        self._update(content=name, message=EMPTY_CHIP)
        self._propose()

    def set_output(self, path: str) -> None:
        """Where it goes; a place of the operator's own is not proposed anew."""
        self._is_own_place = True
        self._update(output=path)

    def set_replace(self, allowed: bool) -> None:
        """Whether files that are there already may be replaced."""
        self._update(replace=allowed)

    def export(self) -> None:
        """Do it, or say what is missing."""
        state = self.state
        if not state.output.strip():
            missing = (
                gettext("Choose the folder to write")
                if state.is_folder
                else gettext("Choose the file to write")
            )
            self._update(message=Chip(missing, Tone.BAD))
        elif state.progress is None:
            output = str(Path(state.output.strip()).expanduser())
            self._update(progress=Progress(gettext("Exporting")), message=EMPTY_CHIP, details=())
            self._submit(ExportRuns(state.runs, output, state.format, state.content, state.replace))

    # --- what the worker says ---

    def on_progress(self, progress: Progress) -> None:
        """It goes on."""
        self._update(progress=progress)

    def on_preview(self, task: PreviewExport, preview: ExportPreview) -> None:
        """Show how it will look, unless something else was chosen meanwhile."""
        if task == self._preview_task():
            self._update(preview=preview.text)

    def on_done(self, outcome: BatchOutcome) -> None:
        """Say what was written, and what could not be."""
        files = dict.fromkeys(outcome.done)
        said = (
            gettext("Wrote {files}", files=_files(list(files))) if files else gettext("Nothing was written")
        )
        if outcome.faults:
            failed, all_runs = len(outcome.faults), len(self.state.runs)
            said += gettext("; {failed} of {all} runs could not be exported", failed=failed, all=all_runs)
        tone = Tone.BAD if outcome.faults else Tone.OK
        self._update(progress=None, message=Chip(said, tone), details=outcome.faults)

    def on_failed(self, message: str) -> None:
        """Nothing could be written."""
        told = (
            sentence(message)
            .replace("--force", gettext("Replace existing files"))
            .replace("-o", gettext("place"))
        )
        self._update(progress=None, message=Chip(told, Tone.BAD))

    def _propose(self) -> None:
        """Offer a place for what was chosen, and ask how it will look."""
        state = self.state
        if not state.runs:
            return
        is_table = state.content == "coefficients"
        is_folder = not is_table and len(state.runs) > 1
        if not self._is_own_place or is_folder != state.is_folder:
            suffix = _SUFFIXES.get(state.format, f".{state.format}")
            stem = "coefficients" if is_table and len(state.runs) > 1 else Path(state.runs[0]).stem
            name = "exported" if is_folder else stem + suffix
            self._is_own_place = False
            self._update(output=str(self._folder / name))
        self._update(is_folder=is_folder, preview="")
        self._submit(self._preview_task())

    def _preview_task(self) -> PreviewExport:
        return PreviewExport(self.state.runs[0], self.state.format, self.state.content)


def _files(files: list[str]) -> str:
    return (
        files[0]
        if len(files) == 1
        else ngettext(
            "{count} file to {folder}", "{count} files to {folder}", len(files), folder=Path(files[0]).parent
        )
    )
