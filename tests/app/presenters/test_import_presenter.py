"""The import presenter: columns, previews, several files and faults."""

from pathlib import Path

import numpy as np
import pytest
from stage import Call, FakeWorker

from app.cli.commands import SlipstandGroup
from app.presenters.base import TaskFailure, Tone
from app.presenters.runs.import_form import FIELDS, GAIN, Form, make_form, validate
from app.presenters.runs.import_presenter import ImportPresenter
from app.presenters.runs.state import ImportOutcome, ImportPreview, Overlay
from app.presenters.runs.tasks import import_file, import_files, import_plan, preview_import, survey_file
from app.runs.errors import ImportFileError, RunError
from app.runs.exchange.recognition import FilePreview, FileSurvey, ParseOptions
from app.runs.reader import open_run
from messages.message import Message, message, option

COLUMNS = FilePreview(
    ("t", "u1", "u2"), ("t", "u1", "u2"), (("0", "1", "2"),), ParseOptions(";", ",", 0, True), "t", "u1",
    "u2",
    "plate", "ms", "mm", units=("ms", "mm", "mm"), numbers=(0, 1, 2),
)  # fmt: skip
FOUND = FileSurvey(("made by a logger", "t;u1;u2", "0;1;2"), "cp1251", COLUMNS)
PREVIEW = ImportPreview(Overlay(), "3 samples")


class Desk:
    def __init__(self, *files: str) -> None:
        self.worker = FakeWorker()
        self.imported: list[str] = []
        self.presenter = ImportPresenter(self.worker, self.imported.append)  # type: ignore[arg-type]
        self.presenter.open(files or ("/a.csv",), "/runs", "Anna")

    @property
    def form(self) -> Form:
        return self.presenter.state.form

    @property
    def asked(self) -> list[Call]:
        return self.worker.calls

    @property
    def last(self) -> tuple[str, str, Form]:
        name, (path, form, *_) = self.asked[-1].name, self.asked[-1].arguments
        return name, path, form

    def set_form(self, **texts: str) -> None:
        self.presenter.set_form({**self.form, **texts})

    def answer(self, answer: object) -> None:
        self.asked[-1].done(answer)

    def fail(self, fault: Message) -> None:
        self.asked[-1].failed(TaskFailure(fault))

    def make_ready(self) -> None:
        self.answer(FOUND)
        self.answer(PREVIEW)


def test_columns_are_offered_and_the_record_is_previewed() -> None:
    desk = Desk()
    assert desk.last == ("survey_file", "/a.csv", make_form(operator="Anna"))
    desk.answer(FOUND)
    form = desk.form
    assert form == make_form(
        time="t", table="u1", second="u2", measures="plate", time_unit="ms", unit="mm", operator="Anna",
        delimiter=";", decimal=",", header="yes",
    )  # fmt: skip
    assert desk.last == ("preview_import", "/a.csv", form)
    assert not desk.presenter.state.can_import
    desk.answer(PREVIEW)
    state = desk.presenter.state
    assert state.can_import
    assert (state.summary, state.busy) == ("3 samples", "")
    assert state.first_lines.splitlines() == ["made by a logger", "t;u1;u2", "0;1;2"]
    assert state.encoding == "Windows-1251 (Cyrillic)"


def test_one_look_at_a_time_and_only_the_latest_counts() -> None:
    desk = Desk()
    desk.make_ready()
    for table in ("u2", "t", "u1"):
        desk.set_form(table=table, time="t")
    asked = len(desk.asked)
    assert desk.last[2]["table"] == "u2"
    desk.answer(PREVIEW)
    assert not desk.presenter.state.can_import, "that was not the latest"
    assert len(desk.asked) == asked + 1
    desk.answer(FOUND)
    assert desk.last[2]["table"] == "u1"


def test_all_files_are_imported_alike() -> None:
    desk = Desk("/a.csv", "/b.csv", "/c.csv")
    desk.make_ready()
    desk.presenter.import_all()
    assert desk.asked[-1].name == "import_files"
    assert desk.asked[-1].arguments[0] == ("/a.csv", "/b.csv", "/c.csv")
    desk.answer(ImportOutcome(("/runs/a.h5", "/runs/c.h5"), ("a 1 s", "c 2 s"), ("b.csv: no numbers",)))
    state = desk.presenter.state
    assert desk.imported == ["/runs/a.h5", "/runs/c.h5"]
    assert (state.path, state.pending, state.can_import) == ("", 0, False)
    assert (state.message.text, state.message.tone) == ("Imported 2 files", Tone.WARN)
    assert state.results.splitlines() == ["a 1 s", "c 2 s", "b.csv: no numbers"]


def test_what_is_said_about_the_test_reads_nothing_anew() -> None:
    desk = Desk()
    desk.make_ready()
    asked = len(desk.asked)
    desk.set_form(note="wet", series="1FFM0")
    assert len(desk.asked) == asked
    assert desk.presenter.state.can_import


def test_files_come_one_after_another_with_the_same_columns() -> None:
    desk = Desk("/a.csv", "/b.csv", "/c.csv")
    assert desk.presenter.state.pending == 2
    desk.make_ready()
    desk.set_form(second="", note="first")
    desk.answer(PREVIEW)
    desk.presenter.import_file()
    assert desk.last == ("import_file", "/a.csv", desk.form)
    asked = len(desk.asked)
    desk.presenter.import_file()
    assert len(desk.asked) == asked, "once is enough"
    desk.answer("/runs/a.h5")
    assert desk.imported == ["/runs/a.h5"]
    state = desk.presenter.state
    assert (state.path, state.pending, state.message.text) == ("/b.csv", 1, "Imported a")
    desk.answer(FOUND)
    assert (desk.form["second"], desk.form["note"]) == ("", ""), "columns stay, the note does not"
    desk.presenter.skip_file()
    assert desk.presenter.state.path == "/c.csv"
    desk.presenter.close()
    assert desk.presenter.state.path == ""


def test_faults_name_the_fields_of_the_dialog() -> None:
    desk = Desk()
    names = {name: option(f"--{name}") for name in ("skip", "delimiter", "decimal")}
    template = "no columns. Check {skip}, {delimiter} and {decimal}"
    desk.fail(message(template, **names))
    shown = desk.presenter.state.message
    assert shown.text == "No columns. Check “Lines skipped”, “Between cells” and “Decimal sign”"
    assert shown.tone is Tone.BAD
    assert not desk.presenter.state.can_import
    desk.set_form(skip="3")
    assert desk.last == ("survey_file", "/a.csv", desk.form)


def test_a_run_that_cannot_be_stored_can_be_tried_again() -> None:
    desk = Desk()
    desk.make_ready()
    desk.presenter.import_file()
    desk.fail(message("series '9X' is not one of this stand", field="series"))
    assert desk.presenter.state.can_import
    assert desk.presenter.state.message.tone is Tone.BAD


# --- the work itself ---

LINES = "t (ms);u1 (mm);u2 (mm)\n" + "".join(f"{n};{60 - n},5;{n},25\n" for n in range(60))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "logger.csv"
    made.write_text(LINES, encoding="utf-8")
    return made


def no_report(_progress: object) -> None:
    pass


def filled(path: Path, **changes: str) -> Form:
    """Form as the dialog has it after a look into the file; its sizes are taken as they are."""
    desk = Desk(str(path))
    desk.answer(survey_file(str(path), make_form(), no_report))
    return {**desk.form, "any_size": "yes", **changes}


def test_a_file_becomes_a_run_as_it_was_previewed(path: Path) -> None:
    form = filled(path, series="1FFM0", plate_mass_kg="23,5", note="from the logger")
    preview = preview_import(str(path), form, no_report)
    assert preview.summary == "60 samples, 0.059\u202fs, 1000\u202fHz, date not known"
    (trace,) = preview.overlay.traces
    assert trace.table == pytest.approx(60.5 - np.arange(60))
    assert trace.relative == pytest.approx(np.arange(60) + 0.25 - trace.table), "plate against table"
    folder = str(path.parent)
    stored = [import_file(str(path), form, folder, lambda _: None) for _ in range(2)]
    assert [Path(run).name for run in stored] == ["logger.h5", "logger-2.h5"]
    run = open_run(stored[0], trusted=True)
    assert run.table_reading == pytest.approx((60.5 - np.arange(60)) * 1e-3)
    assert (run.metadata.series, run.metadata.plate_mass_kg) == ("1FFM0", 23.5)
    assert (run.metadata.operator, run.metadata.note) == ("Anna", "from the logger")


def test_files_alike_become_runs_with_a_line_each(path: Path) -> None:
    second, bad = path.with_name("second.csv"), path.with_name("bad.csv")
    second.write_text(LINES, encoding="utf-8")
    bad.write_text("t (ms);x\n0;1\n1;2\n", encoding="utf-8")
    paths = tuple(map(str, (path, bad, second)))
    shares: list[float] = []
    outcome = import_files(
        paths,
        filled(path, name="first"),
        str(path.parent),
        lambda progress: shares.append(progress.fraction or 0.0),
    )
    assert [Path(run).name for run in outcome.runs] == ["first.h5", "second.h5"]
    assert "0.059\u202fs   1000\u202fHz" in outcome.rows[1]
    assert "no release found" in outcome.rows[1]
    assert "bad.csv" in outcome.faults[0]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_files_without_names_above_are_imported_alike(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.csv", "b.csv")]
    for path, sign in zip(paths, ",;", strict=True):
        path.write_text("".join(f"{row}{sign}{row / 8}\n" for row in range(60)), encoding="utf-8")
    outcome = import_files(tuple(map(str, paths)), filled(paths[0]), str(tmp_path), lambda _: None)
    assert outcome.faults == ()
    named = filled(paths[0], header="yes")
    assert (
        "Add “Names above”" in import_files((str(paths[0]),), named, str(tmp_path), lambda _: None).faults[0]
    )
    assert "“Unit” states another" in preview_import(str(paths[0]), filled(paths[0]), no_report).summary
    assert [len(open_run(run, trusted=True)) for run in outcome.runs] == [60, 60]


def test_a_gain_and_a_part_are_taken(path: Path) -> None:
    form = filled(path, unit=GAIN, gain="2", offset="0.5", unit_name="V", from_s="0.002", until_s="0.055")
    preview = preview_import(str(path), form, no_report)
    assert preview.overlay.unit == "V"
    assert preview.overlay.traces[0].table == pytest.approx(2.0 * (60.5 - np.arange(2, 56)) + 0.5)


def test_all_that_the_command_line_can_is_in_the_form() -> None:
    entry = next(entry for entry in SlipstandGroup.entries if entry.name == "import")
    options = {parameter.name for parameter in entry.load().params}
    elsewhere = {"files", "output", "force", "as_json"}  # the dialog's own file, a free name in the folder
    renamed = {
        "relative": "second", "plate": "second", "no_header": "header", "plate_mass": "plate_mass_kg",
        "table_mass": "table_mass_kg", "temperature": "temperature_c", "humidity": "humidity_percent",
        "surface": "surface_preparation", "run_in": "run_in_number", "condition": "other",
    }  # fmt: skip
    assert {renamed.get(str(name), name) for name in options - elsewhere} <= FIELDS.keys()


def test_the_facts_of_a_test_are_stored_as_by_the_command_line(path: Path) -> None:
    form = filled(
        path, gain_uncertainty="0,003", temperature_c="21,5", humidity_percent="45", plate_id=" P1 ",
        contact_id="C2", surface_preparation="ethanol", run_in_number="7", other="lab = B2; wetted=no",
        table_mass_kg="130", name="old test",
    )  # fmt: skip
    assert validate(form) == {}
    stored = import_file(str(path), form, str(path.parent), lambda _: None)
    assert Path(stored).name == "old test.h5"
    metadata = open_run(stored, trusted=True).metadata
    assert metadata.gauges.table.gain_relative_standard_uncertainty == 0.003
    conditions = metadata.conditions
    assert (conditions.temperature_c, conditions.humidity_percent) == (21.5, 45.0)
    assert (conditions.plate_id, conditions.contact_id) == ("P1", "C2")
    assert (conditions.surface_preparation, conditions.run_in_number) == ("ethanol", 7)
    assert conditions.other == {"lab": "B2", "wetted": "no"}
    assert metadata.table_mass_kg == 130.0


LATE = "5,0 is not after the first second. Write a later one"
WHOLE = "is no whole number, 0 or above. Write one, or leave it empty"
POSITIVE = "is no number above 0. Write one in kg, or leave it empty"


def test_what_is_left_empty_is_not_stated(path: Path) -> None:
    request = import_plan(filled(path))
    assert (request.gain, request.gain_uncertainty, request.from_s, request.segment) == (
        None,
        None,
        None,
        None,
    )
    assert import_plan(filled(path, unit=GAIN)).gain == 1.0


@pytest.mark.parametrize(
    ("changes", "field", "said"),
    [
        ({"from_s": "x"}, "from_s", "x is no number. Write one, or leave it empty"),
        ({"from_s": "5", "until_s": "5,0"}, "until_s", LATE),
        ({"segment": "1.5"}, "segment", f"1.5 {WHOLE}"),
        ({"plate_mass_kg": "-3"}, "plate_mass_kg", f"-3 {POSITIVE}"),
        ({"skip": "-1"}, "skip", f"-1 {WHOLE}"),
        (
            {"gain_uncertainty": "-1"}, "gain_uncertainty",
            "-1 is no number, 0 or above. Write a share of the gain: 0.003 is 0.3 %",
        ),
        (
            {"unit": GAIN, "gain": "0"}, "gain",
            "0 is no number other than 0. A negative one turns the gauge",
        ),
        ({"temperature_c": "200"}, "temperature_c", "200 cannot be. Give -40 to 80, or leave it out"),
        ({"run_in_number": "two"}, "run_in_number", "'two' is not a number. Give digits, or leave it out"),
        ({"other": "wet"}, "other", "wet is no condition. Write name=text, and ; between them"),
        (
            {"other": "a b=1"}, "other",
            "condition 'a b' is not a usable name. Use letters, digits and underscores",
        ),
        ({"name": "../x"}, "name", "../x is no name of a file. Leave out / and \\"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said_at_its_field(changes: dict[str, str], field: str, said: str) -> None:
    assert validate(make_form(**changes)) == {field: said}


def test_without_a_gain_what_belongs_to_it_does_not_matter() -> None:
    assert validate(make_form(unit="mm", gain="x", offset="y")) == {}


def test_a_fault_reads_nothing_and_leaves_the_preview_as_it_is() -> None:
    desk = Desk()
    desk.make_ready()
    asked, drawn = len(desk.asked), desk.presenter.state.overlay
    before = desk.form
    desk.set_form(from_s="x", skip="y")
    state = desk.presenter.state
    assert (set(state.faults), state.can_import) == ({"from_s", "skip"}, False)
    assert (len(desk.asked), state.overlay, state.summary) == (asked, drawn, "3 samples")
    desk.presenter.import_file()
    assert len(desk.asked) == asked
    desk.presenter.set_form(before)
    assert len(desk.asked) == asked, "it is drawn already"
    assert (desk.presenter.state.faults, desk.presenter.state.can_import) == ({}, True)


def test_a_fault_typed_while_the_file_is_read_keeps_it_from_being_imported() -> None:
    desk = Desk()
    desk.answer(FOUND)
    desk.set_form(temperature_c="warm")
    desk.answer(PREVIEW)
    assert not desk.presenter.state.can_import
    assert (desk.presenter.state.summary, desk.presenter.state.busy) == ("3 samples", "")
    other = Desk()
    other.set_form(skip="x")
    other.answer(FOUND)
    assert other.presenter.state.busy == ""
    other.set_form(skip="2")
    assert other.last == ("survey_file", "/a.csv", other.form)


def test_a_fault_of_the_file_is_said_at_the_field_that_it_names() -> None:
    desk = Desk()
    desk.make_ready()
    desk.set_form(segment="9")
    fault = message("time goes back. Pick one stretch with {option} N", option=option("--segment"))
    desk.fail(message("a.csv: {fault}", fault=fault))
    assert set(desk.presenter.state.faults) == {"segment"}
    assert "“Stretch”" in desk.presenter.state.faults["segment"]
    desk.set_form(segment="")
    assert desk.presenter.state.faults == {}
    desk.answer(PREVIEW)
    desk.presenter.import_file()
    desk.fail(message("series '9X' is not one of this stand", field="series"))
    assert set(desk.presenter.state.faults) == {"series"}
    assert desk.presenter.state.overlay is not None


def test_what_belongs_to_one_file_does_not_go_on_to_the_next() -> None:
    desk = Desk("/a.csv", "/b.csv")
    desk.make_ready()
    desk.set_form(name="x", run_in_number="3", note="wet", plate_id="P1")
    desk.presenter.import_file()
    desk.answer("/runs/x.h5")
    desk.answer(FOUND)
    form = desk.form
    assert [form[name] for name in ("name", "run_in_number", "note", "plate_id")] == ["", "", "", "P1"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"table": "nothing"}, "has no column 'nothing'"),
        ({"table": ""}, "has no column ''"),
        ({"series": "9X"}, "series '9X' is not one of this stand"),
    ],
)
def test_what_the_file_or_the_stand_lacks_is_said(path: Path, changes: dict[str, str], said: str) -> None:
    with pytest.raises((RunError, ImportFileError, ValueError), match=said):
        import_file(str(path), filled(path, **changes), str(path.parent), lambda _: None)
