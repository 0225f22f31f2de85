"""The import dialog: which column of a foreign file is what, with a preview, file after file."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Tone
from app.presenters.results import sentence
from app.presenters.runs.import_form import METADATA_FIELDS, PER_FILE_FIELDS, ImportForm, TextFormat, validate
from app.presenters.runs.import_tasks import (
    ImportFile,
    ImportPreview,
    ImportTask,
    PreviewImport,
    SurveyFile,
)
from app.presenters.runs.state import Overlay
from messages.i18n import N_, gettext, ngettext

if TYPE_CHECKING:
    from app.runs.exchange.preview import FilePreview

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".mat", ".xlsx", ".parquet")
_CELL = 16
_OPTIONS = {
    "--delimiter": ("delimiter", N_("Between cells")),
    "--decimal": ("decimal", N_("Decimal sign")),
    "--skip": ("skip", N_("Lines skipped")),
    "--no-header": ("header", N_("Names above")),
    "--segment": ("segment", N_("Stretch")),
    "--gain-uncertainty": ("gain_uncertainty", N_("Uncertainty of the gain")),
    "--gain": ("gain", N_("Gain")),
    "--offset": ("offset", N_("Offset")),
    "--unit-name": ("unit_name", N_("Unit of the gain")),
    "--unit": ("unit", N_("Unit")),
    "--from": ("from_s", N_("From")),
    "--until": ("until_s", N_("Until")),
}
"""Options of the command line that messages name, by the names of the fields and their titles."""
_SERIES = re.compile(r"series '")
_NOTHING_DRAWN = Overlay(message=N_("The record is drawn here once the file can be read like this."))
_OPTION = re.compile("|".join(sorted(_OPTIONS, key=len, reverse=True)))


@dataclass(frozen=True, slots=True)
class ImportState:
    """The dialog.

    Attributes
    ----------
    path : str
        The file; empty when there is none.
    waiting : int
        Files that come after it.
    columns, titles : tuple of str
        Columns of the file, and how they are called.
    head : str
        Its first lines.
    is_text : bool
        It is read line by line, so that delimiter and decimal sign matter.
    form : ImportForm
    faults : dict of str to str
        What is wrong with what was filled in, by the name of the field.
    overlay : Overlay, optional
        How the record would look.
    words : str
        The same in a line.
    busy : str
        What goes on.
    message : Chip
        What is wrong, or was done.
    can_import : bool
        The file as filled in has been read.
    """

    path: str = ""
    pending: int = 0
    columns: tuple[str, ...] = ()
    column_labels: tuple[str, ...] = ()
    first_rows: str = ""
    is_text: bool = True
    form: ImportForm = field(default_factory=ImportForm)
    faults: dict[str, str] = field(default_factory=dict)
    overlay: Overlay | None = None
    summary: str = ""
    busy: str = ""
    message: Chip = EMPTY_CHIP
    can_import: bool = False


class ImportEvents(Protocol):
    """What the dialog tells its presenter."""

    def set_form(self, form: ImportForm) -> None:
        """Take what was filled in."""

    def import_file(self) -> None:
        """Make a run of the file, and go on with the next."""

    def skip_file(self) -> None:
        """Leave this file out."""


class ImportPresenter(Presenter[ImportState]):
    """Imports files.

    Parameters
    ----------
    submit : callable
        Gives a task to the worker of the Runs screen, which hands the answers to `done` and `failed`.
    """

    def __init__(self, submit: Callable[[ImportTask], None]) -> None:
        super().__init__(ImportState())
        self._submit = submit
        self._folder = ""
        self._files: list[str] = []
        self._asked: ImportTask | None = None
        self._looked: TextFormat | None = None
        self._drawn: ImportForm | None = None
        self._stale = False

    def open(self, paths: tuple[str, ...], folder: str, operator: str) -> None:
        """These files are to become runs of a folder, after those that wait already."""
        self._folder = folder
        self._files += paths
        if not self.state.path:
            self._update(form=replace(self.state.form, operator=operator), message=EMPTY_CHIP)
            self._next()
        self._update(pending=len(self._files))

    def set_form(self, form: ImportForm) -> None:
        """Take what was filled in, and show what becomes of it; what cannot be is said at its field."""
        before, had_faults, path = self.state.form, self.state.faults, self.state.path
        self._update(form=form, faults=validate(form))
        if not path:
            return
        if self.state.faults:
            self._update(can_import=False, message=_marked())
        elif had_faults and self._asked is None and _read_alike(form, self._drawn):
            self._update(can_import=not self.state.busy, message=EMPTY_CHIP)
        elif had_faults or not _read_alike(form, before):
            self._update(can_import=False, message=EMPTY_CHIP)
            self._ask(PreviewImport(path, form) if form.text_format == self._looked else self._look())

    def import_file(self) -> None:
        """Make a run of the file, and go on with the next."""
        if self.state.can_import and not self.state.busy:
            self._update(busy=gettext("Importing"), message=EMPTY_CHIP, can_import=False)
            self._submit(ImportFile(self.state.path, self.state.form, self._folder))

    def skip_file(self) -> None:
        """Leave this file out."""
        self._next()

    def close(self) -> None:
        """Leave all files out."""
        self._files.clear()
        self._next()

    # --- what the worker says ---

    def on_done(self, task: ImportTask, answer: Any) -> None:
        """A task is done; what is asked for no more is left aside."""
        if isinstance(task, ImportFile):
            self._update(busy="")
            self._next()
            self._update(message=Chip(gettext("Imported {name}", name=Path(answer).stem), Tone.OK))
        elif self._answered(task):
            if isinstance(task, SurveyFile):
                self._show_columns(answer)
            else:
                self._show_preview(answer, task.form)

    def on_failed(self, task: ImportTask, message: str) -> None:
        """A task could not be done."""
        words = _OPTION.sub(lambda option: f"“{gettext(_OPTIONS[option[0]][1])}”", sentence(message))
        faults = dict.fromkeys(_fields_meant(message), words)
        if isinstance(task, ImportFile):
            self._update(busy="", faults=faults, message=Chip(words, Tone.BAD), can_import=True)
        elif self._answered(task):
            self._looked = self._looked if isinstance(task, PreviewImport) else None
            self._drawn = None
            self._update(
                busy="", overlay=_NOTHING_DRAWN, summary="", faults=faults, message=Chip(words, Tone.BAD),
                can_import=False,
            )  # fmt: skip

    # --- inside ---

    def _next(self) -> None:
        path = self._files.pop(0) if self._files else ""
        form = replace(
            self.state.form,
            text_format=TextFormat(skip=self.state.form.text_format.skip),
            **dict.fromkeys(PER_FILE_FIELDS, ""),
        )
        self._asked = self._looked = self._drawn = None
        self._stale = False
        self._update(
            path=path, pending=len(self._files), columns=(), column_labels=(), first_rows="", overlay=None,
            summary="",
            busy="", can_import=False, form=form, faults=validate(form), message=EMPTY_CHIP,
        )  # fmt: skip
        if path:
            self._ask(self._look())

    def _look(self) -> SurveyFile:
        return SurveyFile(self.state.path, self.state.form.text_format)

    def _ask(self, task: ImportTask) -> None:
        """Submit one look at a time: while one is under way, only the latest wish waits."""
        if self._asked is not None:
            self._stale = True
            return
        self._asked = task
        self._update(busy=gettext("Reading {name}", name=Path(self.state.path).name))
        self._submit(task)

    def _answered(self, task: ImportTask) -> bool:
        """Whether the answer to a task is still wanted; if not, ask anew."""
        if task != self._asked:
            return False
        self._asked = None
        if self._stale:
            self._stale = False
            self._update(busy="")
            if not self.state.faults:
                self._ask(self._look())
            return False
        return True

    def _show_columns(self, found: "FilePreview") -> None:
        """Offer the columns; those that were chosen before stay where the file has them too."""
        form, there = self.state.form, ("", *found.columns)
        if not form.time or form.time not in there or form.table not in there or form.second not in there:
            form = replace(
                form, time=found.time, table=found.table, second=found.second, measures=found.measures,
                time_unit=found.time_unit or form.time_unit, unit=found.unit or form.unit,
            )  # fmt: skip
        told = found.options
        header = "yes" if told.header else "no"
        reading = TextFormat(told.delimiter or "", told.decimal or "", form.text_format.skip, header)
        self._looked = reading
        self._update(
            busy="", columns=found.columns, column_labels=found.titles, first_rows=_head(found),
            is_text=bool(found.rows),
            form=replace(form, text_format=reading),
        )  # fmt: skip
        if not self.state.faults:
            self._ask(PreviewImport(self.state.path, self.state.form))

    def _show_preview(self, preview: ImportPreview, drawn: ImportForm) -> None:
        self._drawn = drawn
        is_right = not self.state.faults
        self._update(
            busy="", overlay=preview.overlay, summary=preview.summary, can_import=is_right,
            message=EMPTY_CHIP if is_right else _marked(),
        )  # fmt: skip


def pending_text(state: ImportState) -> str:
    """How many files come after this one."""
    return ngettext("{count} more file", "{count} more files", state.pending) if state.pending else ""


def _head(found: "FilePreview") -> str:
    """The first lines as a table; long cells are cut."""
    lines = [found.titles, *found.rows] if found.options.header else list(found.rows)
    return "\n".join("  ".join(_cell(cell) for cell in cells).rstrip() for cells in lines)


def _cell(text: str) -> str:
    return f"{text if len(text) <= _CELL else text[: _CELL - 1] + '…':<{_CELL}}"


def _marked() -> Chip:
    return Chip(gettext("Correct what is marked"), Tone.BAD)


def _fields_meant(message: str) -> tuple[str, ...]:
    """The field that a message is about, if it names one alone."""
    named = {_OPTIONS[option][0] for option in _OPTION.findall(message)}
    if _SERIES.match(message):
        named.add("series")
    return tuple(named) if len(named) == 1 else ()


def _read_alike(one: ImportForm, other: ImportForm | None) -> bool:
    """Whether a file is read the same way by both."""
    if other is None:
        return False
    about = dict.fromkeys(METADATA_FIELDS, "")
    return replace(one, **about) == replace(other, **about)  # type: ignore[arg-type]  # all of them are texts
