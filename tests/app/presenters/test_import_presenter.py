"""The import dialog as values: columns offered, one look at a time, file after file, faults in its words."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.presenters.runs.import_tasks import (
    GAIN,
    ImportFile,
    ImportForm,
    ImportPreview,
    ImportTask,
    LookAtFile,
    PreviewImport,
    Reading,
    do,
)
from app.presenters.runs.importing import ImportPresenter, waiting_words
from app.presenters.runs.state import Overlay
from app.presenters.screen import Tone
from app.runs.errors import ImportFileError
from app.runs.foreign_survey import Survey, Told
from app.runs.reader import open_run

FOUND = Survey(
    ("t", "u1", "u2"), ("t", "u1", "u2"), (("0", "1", "2"),), Told(";", ",", 0, True), "t", "u1", "u2",
    "plate", "ms", "mm",
)  # fmt: skip
PREVIEW = ImportPreview(Overlay(), "3 samples")


class Desk:
    def __init__(self, *files: str) -> None:
        self.asked: list[ImportTask] = []
        self.presenter = ImportPresenter(self.asked.append)
        self.presenter.open(files or ("/a.csv",), "/runs", "Anna")

    @property
    def form(self) -> ImportForm:
        return self.presenter.state.form

    def answer(self, answer: object) -> None:
        self.presenter.done(self.asked[-1], answer)

    def make_ready(self) -> None:
        self.answer(FOUND)
        self.answer(PREVIEW)


def test_columns_are_offered_and_the_record_is_previewed() -> None:
    desk = Desk()
    assert desk.asked == [LookAtFile("/a.csv")]
    desk.answer(FOUND)
    form = desk.form
    assert (form.time, form.table, form.second, form.measures) == ("t", "u1", "u2", "plate")
    assert (form.time_unit, form.unit, form.operator) == ("ms", "mm", "Anna")
    assert form.reading == Reading(";", ",", "", "yes")
    assert desk.asked[-1] == PreviewImport("/a.csv", form)
    assert not desk.presenter.state.can_import
    desk.answer(PREVIEW)
    state = desk.presenter.state
    assert state.can_import
    assert (state.words, state.busy) == ("3 samples", "")
    assert [line.split() for line in state.head.splitlines()] == [["t", "u1", "u2"], ["0", "1", "2"]]


def test_one_look_at_a_time_and_only_the_latest_counts() -> None:
    desk = Desk()
    desk.make_ready()
    for table in ("u2", "t", "u1"):
        desk.presenter.fill(replace(desk.form, table=table, time="t"))
    asked = len(desk.asked)
    assert desk.asked[-1].form.table == "u2"  # type: ignore[union-attr]
    desk.answer(PREVIEW)
    assert not desk.presenter.state.can_import, "that was not the latest"
    assert len(desk.asked) == asked + 1
    desk.answer(FOUND)
    assert desk.asked[-1].form.table == "u1"  # type: ignore[union-attr]


def test_what_is_said_about_the_test_reads_nothing_anew() -> None:
    desk = Desk()
    desk.make_ready()
    asked = len(desk.asked)
    desk.presenter.fill(replace(desk.form, note="wet", series="1FFM0"))
    assert len(desk.asked) == asked
    assert desk.presenter.state.can_import


def test_files_come_one_after_another_with_the_same_columns() -> None:
    desk = Desk("/a.csv", "/b.csv", "/c.csv")
    assert waiting_words(desk.presenter.state) == "2 more files"
    desk.make_ready()
    desk.presenter.fill(replace(desk.form, second="", note="first"))
    desk.answer(PREVIEW)
    desk.presenter.import_file()
    assert desk.asked[-1] == ImportFile("/a.csv", desk.form, "/runs")
    desk.presenter.import_file()
    assert desk.asked.count(desk.asked[-1]) == 1, "once is enough"
    desk.answer("/runs/a.h5")
    state = desk.presenter.state
    assert (state.path, state.waiting, state.message.text) == ("/b.csv", 1, "Imported a")
    desk.answer(FOUND)
    assert (desk.form.second, desk.form.note) == ("", ""), "columns stay, the note does not"
    desk.presenter.skip_file()
    assert desk.presenter.state.path == "/c.csv"
    desk.presenter.close()
    assert desk.presenter.state.path == ""


def test_faults_name_the_fields_of_the_dialog() -> None:
    desk = Desk()
    desk.presenter.failed(desk.asked[-1], "no columns. Check --skip, --delimiter and --decimal")
    message = desk.presenter.state.message
    assert message.text == "No columns. Check “Lines skipped”, “Between cells” and “Decimal sign”"
    assert message.tone is Tone.BAD
    assert not desk.presenter.state.can_import
    desk.presenter.fill(replace(desk.form, reading=Reading(skip="3")))
    assert desk.asked[-1] == LookAtFile("/a.csv", Reading(skip="3"))


def test_a_run_that_cannot_be_stored_can_be_tried_again() -> None:
    desk = Desk()
    desk.make_ready()
    desk.presenter.import_file()
    desk.presenter.failed(desk.asked[-1], "series '9X' is not one of this stand")
    assert desk.presenter.state.can_import
    assert desk.presenter.state.message.tone is Tone.BAD


# --- the work itself ---

LINES = "t (ms);u1 (mm);u2 (mm)\n" + "".join(f"{n};{12 - n},5;{n},25\n" for n in range(10))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "logger.csv"
    made.write_text(LINES, encoding="utf-8")
    return made


def filled(path: Path, **changes: str) -> ImportForm:
    desk = Desk(str(path))
    desk.answer(do(LookAtFile(str(path))))
    return replace(desk.form, **changes)  # type: ignore[arg-type]


def test_a_file_becomes_a_run_as_it_was_previewed(path: Path) -> None:
    form = filled(path, series="1FFM0", plate_mass_kg="23,5", note="from the logger")
    preview = do(PreviewImport(str(path), form))
    assert preview.words == "10 samples, 0.009\u202fs, 1000\u202fHz"
    (trace,) = preview.overlay.traces
    assert trace.table == pytest.approx(12.5 - np.arange(10))
    assert trace.relative == pytest.approx(np.arange(10) + 0.25 - trace.table), "plate against table"
    folder = str(path.parent)
    stored = [do(ImportFile(str(path), form, folder)) for _ in range(2)]
    assert [Path(run).name for run in stored] == ["logger.h5", "logger-2.h5"]
    run = open_run(stored[0], trusted=True)
    assert run.table_reading == pytest.approx((12.5 - np.arange(10)) * 1e-3)
    assert (run.metadata.series, run.metadata.plate_mass_kg) == ("1FFM0", 23.5)
    assert (run.metadata.operator, run.metadata.note) == ("Anna", "from the logger")


def test_a_gain_and_a_part_are_taken(path: Path) -> None:
    form = filled(path, unit=GAIN, gain="2", offset="0.5", unit_name="V", from_s="0.002", until_s="0.004")
    preview = do(PreviewImport(str(path), form))
    assert preview.overlay.unit == "V"
    assert preview.overlay.traces[0].table == pytest.approx(2.0 * (12.5 - np.arange(2, 5)) + 0.5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"from_s": "x"}, "From 'x' is no number"),
        ({"segment": "1.5"}, "Stretch '1.5' is no whole number"),
        ({"plate_mass_kg": "-3"}, "Plate mass '-3' is not above 0"),
        ({"table": "nothing"}, "has no column 'nothing'"),
    ],
)
def test_what_cannot_be_is_said(path: Path, changes: dict[str, str], said: str) -> None:
    with pytest.raises(ImportFileError, match=said):
        do(ImportFile(str(path), filled(path, **changes), str(path.parent)))
