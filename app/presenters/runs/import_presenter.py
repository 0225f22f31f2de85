"""Presenter of the import dialog: columns and units of a foreign file, with a preview."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.results import sentence
from app.presenters.runs.import_form import METADATA_FIELDS, PER_FILE_FIELDS, ImportForm, TextFormat, validate
from app.presenters.runs.state import Overlay
from app.presenters.runs.tasks import ImportFile, ImportPreview, ImportTask, PreviewImport, SurveyFile
from messages.i18n import N_, gettext, ngettext
from messages.message import Message, message, options_in, replace_options

if TYPE_CHECKING:
    from app.runs.exchange.importing import FilePreview

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".mat", ".xlsx", ".parquet")
_CELL = 16
"""Width of a column of the first rows, in characters."""
_OPTIONS = {
    "--delimiter": ("delimiter", message("Between cells")),
    "--decimal": ("decimal", message("Decimal sign")),
    "--skip": ("skip", message("Lines skipped")),
    "--no-header": ("header", message("Names above")),
    "--segment": ("segment", message("Stretch")),
    "--gain-uncertainty": ("gain_uncertainty", message("Uncertainty of the gain")),
    "--gain": ("gain", message("Gain")),
    "--offset": ("offset", message("Offset")),
    "--unit-name": ("unit_name", message("Unit of the gain")),
    "--unit": ("unit", message("Unit")),
    "--from": ("from_s", message("From")),
    "--until": ("until_s", message("Until")),
}
"""Field and label of each option that a message of the importer may name."""
_LABELS = {name: message("“{label}”", label=label) for name, (_, label) in _OPTIONS.items()}
_NOTHING_DRAWN = Overlay(message=N_("The record is drawn here once the file can be read like this."))


@dataclass(frozen=True, slots=True)
class ImportState:
    """State of the dialog."""

    path: str = ""
    """The current file; empty without one."""
    pending: int = 0
    """Number of files after it."""
    columns: tuple[str, ...] = ()
    column_labels: tuple[str, ...] = ()
    first_rows: str = ""
    is_text: bool = True
    """Whether delimiter and decimal sign apply."""
    form: ImportForm = field(default_factory=ImportForm)
    faults: dict[str, str] = field(default_factory=dict)
    """Faults by name of the field."""
    overlay: Overlay | None = None
    """The record as it would be imported."""
    summary: str = ""
    """Its length and rate."""
    busy: str = ""
    """Work in progress; empty without any."""
    message: Chip = EMPTY_CHIP
    can_import: bool = False
    """Whether the file was read with the current form."""


class ImportPresenter(Presenter[ImportState]):
    """Imports one file after another; results of `submit` come to `on_done` or `on_failed`."""

    def __init__(self, submit: Callable[[ImportTask], None]) -> None:
        super().__init__(ImportState())
        self._submit = submit
        self._folder = ""
        self._files: list[str] = []
        self._pending_task: ImportTask | None = None
        self._surveyed: TextFormat | None = None
        self._previewed: ImportForm | None = None
        self._stale = False

    def open(self, paths: tuple[str, ...], folder: str, operator: str) -> None:
        self._folder = folder
        self._files += paths
        if not self.state.path:
            self._update(form=replace(self.state.form, operator=operator), message=EMPTY_CHIP)
            self._next()
        self._update(pending=len(self._files))

    def set_form(self, form: ImportForm) -> None:
        before, had_faults, path = self.state.form, self.state.faults, self.state.path
        self._update(form=form, faults=validate(form))
        if not path:
            return
        if self.state.faults:
            self._update(can_import=False, message=_correction_chip())
        elif had_faults and self._pending_task is None and _reads_alike(form, self._previewed):
            self._update(can_import=not self.state.busy, message=EMPTY_CHIP)
        elif had_faults or not _reads_alike(form, before):
            self._update(can_import=False, message=EMPTY_CHIP)
            self._request(
                PreviewImport(path, form) if form.text_format == self._surveyed else self._survey_task()
            )

    def import_file(self) -> None:
        if self.state.can_import and not self.state.busy:
            self._update(busy=gettext("Importing"), message=EMPTY_CHIP, can_import=False)
            self._submit(ImportFile(self.state.path, self.state.form, self._folder))

    def skip_file(self) -> None:
        self._next()

    def close(self) -> None:
        self._files.clear()
        self._next()

    def on_done(self, task: ImportTask, answer: Any) -> None:
        if isinstance(task, ImportFile):
            self._update(busy="")
            self._next()
            self._update(message=Chip(gettext("Imported {name}", name=Path(answer).stem), Tone.OK))
        elif self._is_current(task):
            if isinstance(task, SurveyFile):
                self._show_columns(answer)
            else:
                self._show_preview(answer, task.form)

    def on_failed(self, task: ImportTask, fault: Message) -> None:
        words = sentence(replace_options(fault, _LABELS))
        faults = dict.fromkeys(_named_field(fault), words)
        if isinstance(task, ImportFile):
            self._update(busy="", faults=faults, message=Chip(words, Tone.BAD), can_import=True)
        elif self._is_current(task):
            self._surveyed = self._surveyed if isinstance(task, PreviewImport) else None
            self._previewed = None
            self._update(
                busy="", overlay=_NOTHING_DRAWN, summary="", faults=faults, message=Chip(words, Tone.BAD),
                can_import=False,
            )  # fmt: skip

    def _next(self) -> None:
        path = self._files.pop(0) if self._files else ""
        form = replace(
            self.state.form,
            text_format=TextFormat(skip=self.state.form.text_format.skip),
            **dict.fromkeys(PER_FILE_FIELDS, ""),
        )
        self._pending_task = self._surveyed = self._previewed = None
        self._stale = False
        self._update(
            path=path, pending=len(self._files), columns=(), column_labels=(), first_rows="", overlay=None,
            summary="",
            busy="", can_import=False, form=form, faults=validate(form), message=EMPTY_CHIP,
        )  # fmt: skip
        if path:
            self._request(self._survey_task())

    def _survey_task(self) -> SurveyFile:
        return SurveyFile(self.state.path, self.state.form.text_format)

    def _request(self, task: ImportTask) -> None:
        """Submit one task at a time; a request during a task repeats the survey after it."""
        if self._pending_task is not None:
            self._stale = True
            return
        self._pending_task = task
        self._update(busy=gettext("Reading {name}", name=Path(self.state.path).name))
        self._submit(task)

    def _is_current(self, task: ImportTask) -> bool:
        """Whether the result of a task is still wanted; if not, request it again."""
        if task != self._pending_task:
            return False
        self._pending_task = None
        if self._stale:
            self._stale = False
            self._update(busy="")
            if not self.state.faults:
                self._request(self._survey_task())
            return False
        return True

    def _show_columns(self, found: "FilePreview") -> None:
        """Offer the columns; keep those that were chosen if the file has them."""
        form, offered = self.state.form, ("", *found.columns)
        if (
            not form.time
            or form.time not in offered
            or form.table not in offered
            or form.second not in offered
        ):
            form = replace(
                form, time=found.time, table=found.table, second=found.second, measures=found.measures,
                time_unit=found.time_unit or form.time_unit, unit=found.unit or form.unit,
            )  # fmt: skip
        options = found.options
        header = "yes" if options.header else "no"
        text_format = TextFormat(
            options.delimiter or "", options.decimal or "", form.text_format.skip, header
        )
        self._surveyed = text_format
        self._update(
            busy="", columns=found.columns, column_labels=found.titles, first_rows=_format_rows(found),
            is_text=bool(found.rows),
            form=replace(form, text_format=text_format),
        )  # fmt: skip
        if not self.state.faults:
            self._request(PreviewImport(self.state.path, self.state.form))

    def _show_preview(self, preview: ImportPreview, drawn: ImportForm) -> None:
        self._previewed = drawn
        is_right = not self.state.faults
        self._update(
            busy="", overlay=preview.overlay, summary=preview.summary, can_import=is_right,
            message=EMPTY_CHIP if is_right else _correction_chip(),
        )  # fmt: skip


def pending_text(state: ImportState) -> str:
    """Number of files after the current one."""
    return ngettext("{count} more file", "{count} more files", state.pending) if state.pending else ""


def _format_rows(found: "FilePreview") -> str:
    """First rows as a table; long cells are cut."""
    lines = [found.titles, *found.rows] if found.options.header else list(found.rows)
    return "\n".join("  ".join(_cell(cell) for cell in cells).rstrip() for cells in lines)


def _cell(text: str) -> str:
    return f"{text if len(text) <= _CELL else text[: _CELL - 1] + '…':<{_CELL}}"


def _correction_chip() -> Chip:
    return Chip(gettext("Correct what is marked"), Tone.BAD)


def _named_field(fault: Message) -> tuple[str, ...]:
    """Name of the field that a message names, if it names exactly one."""
    named = {_OPTIONS[name][0] for name in options_in(fault) if name in _OPTIONS}
    if "field" in fault.values:
        named.add(str(fault.values["field"]))
    return tuple(named) if len(named) == 1 else ()


def _reads_alike(one: ImportForm, other: ImportForm | None) -> bool:
    """Whether both forms read a file the same way."""
    if other is None:
        return False
    about = dict.fromkeys(METADATA_FIELDS, "")
    return replace(one, **about) == replace(other, **about)  # type: ignore[arg-type]  # all of them are texts
