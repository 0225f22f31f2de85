"""Presenter of the import dialog: columns and units of a foreign file, with a preview."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.formatting import with_unit
from app.presenters.base import EMPTY_CHIP, Chip, Presenter, Progress, TaskFailure, Tone
from app.presenters.results import sentence
from app.presenters.runs.import_form import (
    CARRIED_LINE_FIELDS,
    ENCODINGS,
    LINE_FIELDS,
    OPTION_FIELDS,
    OPTION_LABELS,
    PER_FILE_FIELDS,
    Form,
    make_form,
    reads_alike,
    validate,
)
from app.presenters.runs.state import ImportOutcome, ImportPreview, Overlay, SizeQuestion
from app.presenters.worker import LazyModule, Worker
from messages.i18n import N_, gettext, ngettext
from messages.message import Message, options_in, replace_options

if TYPE_CHECKING:
    from app.presenters.runs import tasks
    from app.runs.exchange.recognition import FilePreview, FileSurvey
else:
    tasks = LazyModule("app.presenters.runs.tasks")

_CELL = 28
"""Largest width of a column of the first rows, in characters: a date with its time of day."""
_TAB = "→\t"  # where cells are long, a tab alone is not seen
_NOTHING_DRAWN = Overlay(message=N_("The record is drawn here once the file can be read like this."))


@dataclass(frozen=True, slots=True)
class ImportState:
    """State of the dialog."""

    path: str = ""  # the current file; empty without one. `pending` others wait.
    pending: int = 0
    columns: tuple[str, ...] = ()
    column_labels: tuple[str, ...] = ()
    first_lines: str = ""
    """Of a text as they are, whether columns are found in it or not; of another file its first rows."""
    encoding: str = ""
    """In which a text is read; empty of another file."""
    is_text: bool = True
    """Whether delimiter, decimal sign and encoding apply."""
    taken_over: str = ""
    """Says that the settings are those of the file before."""
    form: Form = field(default_factory=make_form)
    faults: dict[str, str] = field(default_factory=dict)
    overlay: Overlay | None = None
    """The record as it would be imported; `summary` has its length and rate."""
    summary: str = ""
    question: SizeQuestion | None = None
    """What is to be answered before the import, by `answer`."""
    busy: str = ""
    """Work in progress."""
    message: Chip = EMPTY_CHIP
    results: str = ""
    """A line a file of what "Import all" has done; empty before."""
    can_import: bool = False
    """Whether the file was read with the current form."""


@dataclass(frozen=True, slots=True)
class _Reading:
    """A file that is being read: for its columns and first lines, or as it would be imported."""

    path: str
    form: Form
    is_survey: bool


@dataclass(frozen=True, slots=True)
class _Settings:
    """How a file was to be read, and its columns: a file with the same columns is read alike."""

    name: str
    form: Form
    columns: "FilePreview"


class ImportPresenter(Presenter[ImportState]):
    """Imports one file after another by `worker`, which the Runs screen polls and closes.

    A file begins with the settings of the one before if its columns and units are the same, else with none.
    """

    def __init__(self, worker: Worker, on_imported: Callable[[str], object]) -> None:
        super().__init__(ImportState())
        self._worker = worker
        self._on_imported = on_imported
        self._folder = ""
        self._files: list[str] = []
        self._reading: _Reading | None = None
        self._is_stale = False
        self._operator = ""
        self._before: _Settings | None = None
        self._columns: FilePreview | None = None
        """Of the current file; None until it has been looked into, and where none are found."""
        self._is_new = False
        """Whether the current file has not been looked into."""
        self._surveyed: Form | None = None
        self._previewed: Form | None = None

    def open(self, paths: tuple[str, ...], folder: str, operator: str) -> None:
        self._folder = folder
        self._files += paths
        if not self.state.path:
            self._operator = operator
            self.skip_file()
        self._update(pending=len(self._files))

    def set_form(self, form: Form) -> None:
        before, had_faults = self.state.form, self.state.faults
        self._update(form=form, faults=validate(form))
        if not self.state.path:
            return
        if self.state.faults:
            self._update(can_import=False, message=_correction_chip())
        elif had_faults and self._reading is None and reads_alike(form, self._previewed):
            self._update(can_import=not (self.state.busy or self.state.question), message=EMPTY_CHIP)
        elif had_faults or not reads_alike(form, before):
            self._update(can_import=False, question=None, message=EMPTY_CHIP)
            self._read(is_survey=_line_texts(form) != self._surveyed)

    def answer(self, *, is_right: bool) -> None:
        """Answer the question about the size: it is right, or the unit is the one that is proposed."""
        question = self.state.question
        if question is not None:
            choice = {"any_size": "yes"} if is_right else {"unit": question.unit}
            self.set_form({**self.state.form, **choice})

    def import_file(self) -> None:
        state = self.state
        if state.can_import and not state.busy:
            self._update(busy=gettext("Importing"), message=EMPTY_CHIP, can_import=False)
            self._worker.submit(
                tasks.import_file,
                state.path,
                state.form,
                self._folder,
                done=self._on_done,
                failed=self._on_failed,
                progress=self._on_progress,
            )

    def import_all(self) -> None:
        """Import this file and those that wait with the same columns and conditions."""
        state = self.state
        if state.can_import and not state.busy:
            self._update(busy=gettext("Importing"), message=EMPTY_CHIP, can_import=False)
            self._worker.submit(
                tasks.import_files,
                (state.path, *self._files),
                state.form,
                self._folder,
                done=self._on_all_done,
                failed=self._on_failed,
                progress=self._on_progress,
            )

    def close(self) -> None:
        self._files.clear()
        self.skip_file()
        self._before = None

    def skip_file(self) -> None:
        if self._columns is not None:
            self._before = _Settings(Path(self.state.path).name, self.state.form, self._columns)
        path = self._files.pop(0) if self._files else ""
        form = make_form(operator=self._operator)
        if self._before is not None:  # of a file like it the columns may not be found without these
            form = {**form, **{name: self._before.form[name] for name in CARRIED_LINE_FIELDS}}
        self._reading = self._columns = self._surveyed = self._previewed = None
        self._is_stale, self._is_new = False, True
        overlay = _NOTHING_DRAWN if path else Overlay()
        self._set_state(ImportState(path=path, pending=len(self._files), form=form, overlay=overlay))
        if path:
            self._read(is_survey=True)

    def _read(self, *, is_survey: bool) -> None:
        """Read the file by the form, once at a time; a request meanwhile repeats the survey after it."""
        if self._reading is not None:
            self._is_stale = True
            return
        reading = self._reading = _Reading(self.state.path, self.state.form, is_survey)
        self._update(busy=gettext("Reading {name}", name=Path(reading.path).name))
        self._worker.submit(
            tasks.survey_file if is_survey else tasks.preview_import,
            reading.path,
            reading.form,
            done=lambda answer: self._on_read(reading, answer),
            failed=lambda failure: self._on_reading_failed(reading, failure),
            progress=lambda progress: self._on_reading_progress(reading, progress),
        )

    def _on_done(self, run: str) -> None:
        self._on_imported(run)
        self.skip_file()
        self._update(message=Chip(gettext("Imported {name}", name=Path(run).stem), Tone.OK))

    def _on_all_done(self, outcome: ImportOutcome) -> None:
        for run in outcome.runs:
            self._on_imported(run)
        self._files.clear()
        self.skip_file()
        text = ngettext("Imported {count} file", "Imported {count} files", len(outcome.runs))
        tone = Tone.WARN if outcome.faults else Tone.OK
        self._update(message=Chip(text, tone), results="\n".join([*outcome.rows, *outcome.faults]))

    def _on_progress(self, progress: Progress) -> None:
        share = with_unit(f"{100.0 * (progress.fraction or 0.0):.0f}", "%")
        self._update(busy=f"{progress.text}, {share}")

    def _on_reading_progress(self, reading: _Reading, progress: Progress) -> None:
        if reading is self._reading:
            self._on_progress(progress)

    def _on_failed(self, failure: TaskFailure) -> None:
        self._update(busy="", can_import=True)
        self._show_fault(failure.message)

    def _on_read(self, reading: _Reading, answer: Any) -> None:
        if self._ends(reading):
            if reading.is_survey:
                self._on_surveyed(answer)
            else:
                self._show_preview(answer, reading.form)

    def _on_reading_failed(self, reading: _Reading, failure: TaskFailure) -> None:
        if self._ends(reading):
            self._surveyed = None if reading.is_survey else self._surveyed
            self._show_unreadable(failure.message)

    def _ends(self, reading: _Reading) -> bool:
        """Whether the result of a reading is still wanted; if not, read again."""
        if reading is not self._reading:
            return False
        self._reading = None
        if not self._is_stale:
            return True
        self._is_stale = False
        self._update(busy="")
        if not self.state.faults:
            self._read(is_survey=True)
        return False

    def _show_unreadable(self, fault: Message) -> None:
        self._previewed = None
        self._update(busy="", overlay=_NOTHING_DRAWN, summary="", question=None, can_import=False)
        self._show_fault(fault)

    def _show_fault(self, fault: Message) -> None:
        words = sentence(replace_options(fault, OPTION_LABELS))
        self._update(faults=dict.fromkeys(_named_fields(fault), words), message=Chip(words, Tone.BAD))

    def _on_surveyed(self, survey: "FileSurvey") -> None:
        found = survey.preview
        if self._is_new and not self._begin_like_before(found):
            return
        self._is_new, self._columns = False, found
        lines = survey.lines if found is None or survey.lines else _format_rows(found)
        self._update(
            busy="",
            first_lines="\n".join(line.replace("\t", _TAB) for line in lines),
            is_text=bool(survey.encoding) or found is None,
            encoding=gettext(ENCODINGS.get(survey.encoding, survey.encoding)) if survey.encoding else "",
        )
        if found is not None:
            self._show_columns(found)
        else:
            self._surveyed = None
            self._update(columns=(), column_labels=())
            self._show_unreadable(survey.fault)

    def _begin_like_before(self, found: "FilePreview | None") -> bool:
        """Take over the settings of the file before if the columns are the same.

        False where the file is looked into anew, since what was said of the lines of that file does not hold.
        """
        before, form = self._before, self.state.form
        if before is None:
            return True
        if found is not None and found.has_layout_of(before.columns):
            form = {**before.form, **dict.fromkeys(PER_FILE_FIELDS, "")}
            template = N_("Columns and units are those of {name}: its settings are taken over")
            self._update(form=form, faults=validate(form), taken_over=gettext(template, name=before.name))
            return True
        self._before = None
        if not any(form[name] for name in CARRIED_LINE_FIELDS):
            return True
        self._update(form={**form, **dict.fromkeys(CARRIED_LINE_FIELDS, "")})
        self._read(is_survey=True)
        return False

    def _show_columns(self, found: "FilePreview") -> None:
        """Offer the columns; keep those that were chosen if the file has them."""
        form, options = dict(self.state.form), found.options
        is_known = {form["time"], form["table"], form["second"], form["date"]} <= {"", *found.columns}
        if not is_known or not form["table"]:
            form |= {name: getattr(found, name) for name in ("time", "table", "second", "date", "measures")}
            form["time_unit"] = found.time_unit or form["time_unit"]
            form["unit"] = found.unit or form["unit"]
        form["delimiter"], form["decimal"] = options.delimiter or "", options.decimal or ""
        form["header"] = "yes" if options.header else "no"
        self._surveyed = _line_texts(form)
        self._update(columns=found.columns, column_labels=found.titles, form=form)
        if not self.state.faults:
            self._read(is_survey=False)

    def _show_preview(self, preview: ImportPreview, form: Form) -> None:
        self._previewed = form
        is_valid = not self.state.faults
        self._update(
            busy="", overlay=preview.overlay, summary=preview.summary, question=preview.question,
            can_import=is_valid and preview.question is None,
            message=EMPTY_CHIP if is_valid else _correction_chip(),
        )  # fmt: skip


def _format_rows(found: "FilePreview") -> list[str]:
    """First rows as a table; long cells are cut."""
    lines = [found.titles, *found.rows] if found.options.header else list(found.rows)
    cut = [[cell if len(cell) <= _CELL else cell[: _CELL - 1] + "…" for cell in cells] for cells in lines]
    widths = [max(map(len, column)) for column in zip_longest(*cut, fillvalue="")]
    rows = (zip(cells, widths, strict=False) for cells in cut)
    return ["  ".join(f"{cell:<{width}}" for cell, width in row).rstrip() for row in rows]


def _correction_chip() -> Chip:
    return Chip(gettext("Correct what is marked"), Tone.BAD)


def _line_texts(form: Form) -> Form:
    return {name: form[name] for name in LINE_FIELDS}


def _named_fields(fault: Message) -> set[str]:
    """Name of the field that a message names, if it names exactly one."""
    named = {OPTION_FIELDS[option] for option in options_in(fault) if option in OPTION_FIELDS}
    if "field" in fault.values:
        named.add(str(fault.values["field"]))
    return named if len(named) == 1 else set()
