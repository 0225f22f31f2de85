"""Files as loggers write them, imported by the presenter of the dialog with its tasks carried out at once."""

import datetime
from pathlib import Path

import numpy as np
import pytest
from stage import FakeWorker

from app.presenters.base import Progress, TaskFailure
from app.presenters.runs import tasks
from app.presenters.runs.import_form import Form
from app.presenters.runs.import_presenter import ImportPresenter, ImportState
from app.runs.errors import RunError
from app.runs.reader import open_run

RATE_HZ, ROWS = 100, 300
TIME_S = np.arange(ROWS) / RATE_HZ
SINCE_S = np.maximum(TIME_S - 1.0, 0.0)
TABLE_MM = 12.0 * np.exp(-0.5 * SINCE_S) * np.cos(19.0 * SINCE_S)


class Desk:
    """The dialog without its window."""

    def __init__(self, *files: Path) -> None:
        self.folder = files[0].parent / "runs"
        self.folder.mkdir(exist_ok=True)
        self.worker = FakeWorker()
        self.presenter = ImportPresenter(self.worker, lambda _run: None)  # type: ignore[arg-type]
        self.presenter.open(tuple(map(str, files)), str(self.folder), "Anna")
        self.work()

    @property
    def state(self) -> ImportState:
        return self.presenter.state

    @property
    def form(self) -> Form:
        return self.state.form

    def set_form(self, **texts: str) -> None:
        self.presenter.set_form({**self.form, **texts})
        self.work()

    def answer(self, *, is_right: bool) -> None:
        self.presenter.answer(is_right=is_right)
        self.work()

    def next_file(self) -> None:
        self.presenter.import_file()
        self.work()

    def work(self) -> None:
        """Carry out what is submitted."""
        while self.worker.calls:
            call = self.worker.calls.pop(0)
            try:
                answer = getattr(tasks, call.name)(*call.arguments, call.progress)
            except RunError as error:
                call.failed(TaskFailure(error.message))
            else:
                call.done(answer)

    def stored(self, name: str) -> np.ndarray:
        return np.asarray(open_run(self.folder / name, trusted=True).table_reading)


def written(
    path: Path, header: str = "t;u1 [mm]", scale: float = 1.0, above: str = "", encoding: str = "utf-8"
) -> Path:
    """A test of 12 mm in the unit that `scale` makes of millimetres."""
    rows = "".join(f"{t:.2f};{scale * u:.6f}\n" for t, u in zip(TIME_S, TABLE_MM, strict=True))
    path.write_bytes(f"{above}{header}\n{rows}".encode(encoding))
    return path


def test_a_file_with_the_same_columns_is_read_alike_and_that_is_told(tmp_path: Path) -> None:
    desk = Desk(*(written(tmp_path / name) for name in ("a.csv", "b.csv")))
    desk.set_form(from_s="0.5", series="1FFM0", missing="OVL", note="wet", plate_id="P1")
    assert desk.state.taken_over == ""
    desk.next_file()
    assert desk.state.path.endswith("b.csv")
    assert [desk.form[name] for name in ("from_s", "series", "missing", "note", "plate_id")] == [
        "0.5", "1FFM0", "OVL", "", "P1"
    ]  # fmt: skip
    assert desk.state.taken_over == ("Columns and units are those of a.csv: its settings are taken over")
    assert desk.state.can_import


@pytest.mark.parametrize(
    ("header", "scale"), [("t;u1 [µm]", 1e3), ("t;weg [mm]", 1.0), ("Zeit;u1 [mm]", 1.0)]
)
def test_a_file_with_other_columns_or_units_begins_clean(tmp_path: Path, header: str, scale: float) -> None:
    first = written(tmp_path / "a.csv", above="made by a logger\n")
    desk = Desk(first, written(tmp_path / "b.csv", header, scale))
    desk.set_form(skip="1", from_s="0.5", series="1FFM0", plate_id="P1", quantity="displacement")
    desk.next_file()
    time, table = header.split(";")
    assert (desk.form["time"], desk.form["table"]) == (time, table)
    assert desk.form["unit"] == ("um" if scale > 1.0 else "mm")
    assert [desk.form[name] for name in ("skip", "from_s", "series", "plate_id")] == [""] * 4
    assert desk.form["operator"] == "Anna"
    assert desk.state.taken_over == ""
    desk.next_file()
    assert np.abs(desk.stored("b.h5") - 1e-3 * TABLE_MM).max() < 1e-8


def test_lines_that_must_be_skipped_are_skipped_in_the_next_file_too(tmp_path: Path) -> None:
    above = "a;b\n1;2\n3;4\n\n"
    desk = Desk(*(written(tmp_path / name, above=above) for name in ("a.csv", "b.csv")))
    assert desk.state.columns == ("a", "b")
    desk.set_form(skip="4")
    assert desk.state.columns == ("t", "u1 [mm]")
    desk.set_form(time="t", table="u1 [mm]")
    desk.next_file()
    assert (desk.form["skip"], desk.state.columns) == ("4", ("t", "u1 [mm]"))
    assert "a.csv" in desk.state.taken_over


def test_all_files_are_imported_alike_only_with_the_same_columns_and_units(tmp_path: Path) -> None:
    """A file in micrometres was read in millimetres, since the first one was in these."""
    files = [written(tmp_path / "a.csv"), written(tmp_path / "b.csv", "t;u1 [µm]", 1e3)]
    desk = Desk(*files, written(tmp_path / "c.csv"))
    desk.presenter.import_all()
    desk.work()
    assert [path.name for path in sorted(desk.folder.glob("*.h5"))] == ["a.h5", "c.h5"]
    assert "b.csv: Its columns or units are not those of a.csv. Import it by itself" in desk.state.results


@pytest.mark.parametrize("text", ["a;b\nc;d\ne;f\n", "no table at all\nbut two lines\n", "t;u1\n"])
def test_lines_are_shown_also_where_no_columns_are_found(tmp_path: Path, text: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(text, encoding="utf-8")
    desk = Desk(path)
    assert desk.state.first_lines.splitlines() == text.splitlines()
    assert (desk.state.columns, desk.state.can_import) == ((), False)
    assert "odd.csv" in desk.state.message.text
    assert desk.state.is_text


def test_what_cannot_be_shown_of_a_line_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "odd.csv"
    path.write_bytes(b"t;u1\x1b[31m\x07\n" + b"x" * 1000 + b"\n")
    lines = Desk(path).state.first_lines.splitlines()
    assert lines[0] == "t;u1\ufffd[31m\ufffd"
    assert len(lines[1]) == 400


@pytest.mark.parametrize(
    ("encoding", "title"),
    [
        ("utf-16", "UTF-16 LE"),
        ("utf-16-be", "UTF-16 BE"),
        ("cp1251", "Windows-1251 (Cyrillic)"),
        ("cp866", "CP866 (Cyrillic, DOS)"),
    ],
)
def test_an_encoding_is_found_out_and_shown(tmp_path: Path, encoding: str, title: str) -> None:
    desk = Desk(written(tmp_path / "a.csv", "Время, с;Стол, мм", encoding=encoding))
    assert desk.state.encoding == title
    assert desk.state.first_lines.startswith("Время, с;Стол, мм\n0.00;")
    assert (desk.form["time"], desk.form["table"], desk.form["unit"]) == ("Время, с", "Стол, мм", "mm")
    assert desk.state.can_import


def test_an_encoding_that_was_found_out_wrongly_is_changed_by_hand(tmp_path: Path) -> None:
    header = "Idő [s];Út [mm]"
    desk = Desk(*(written(tmp_path / name, header, encoding="cp1250") for name in ("a.csv", "b.csv")))
    assert desk.state.columns != tuple(header.split(";"))
    desk.set_form(encoding="cp1250")
    assert desk.state.columns == tuple(header.split(";"))
    assert desk.state.encoding == "Windows-1250 (Central European)"
    desk.set_form(time="Idő [s]", table="Út [mm]")
    desk.next_file()
    assert (desk.form["encoding"], desk.form["table"]) == ("cp1250", "Út [mm]")


def test_displacements_in_another_unit_are_asked_about(tmp_path: Path) -> None:
    desk = Desk(written(tmp_path / "a.csv", "t;u1"))
    question = desk.state.question
    assert question is not None
    assert question.text == "Gauge 1 moves by 23.02 m, more than its range of 33 mm. Is the file in mm?"
    assert (question.unit, desk.state.can_import) == ("mm", False)
    desk.presenter.import_file()
    assert not desk.worker.calls
    desk.answer(is_right=False)
    assert (desk.form["unit"], desk.state.question, desk.state.can_import) == ("mm", None, True)
    desk.next_file()
    assert np.abs(desk.stored("a.h5") - 1e-3 * TABLE_MM).max() < 1e-8


@pytest.mark.parametrize(
    ("header", "scale", "unit", "said"),
    [
        ("t;u1 [µm]", 1.0, "mm", "Gauge 1 moves by 23.02 µm only. Is the file in mm?"),
        ("t;u1 [mm]", 1e-3, "m", "Gauge 1 moves by 23.02 µm only. Is the file in m?"),
        (
            "t;u1 [mm]",
            1e3,
            "um",
            "Gauge 1 moves by 23.02 m, more than its range of 33 mm. Is the file in µm?",
        ),
        ("t;u1", 1e3, "um", "Gauge 1 moves by 23020 m, more than its range of 33 mm. Is the file in µm?"),
        ("t;u1 [mm]", 3.0, "", "Gauge 1 moves by 69.06 mm, more than its range of 33 mm. Is that right?"),
    ],
)
def test_sizes_that_are_unlikely_and_the_unit_that_is_likely(
    tmp_path: Path, header: str, scale: float, unit: str, said: str
) -> None:
    desk = Desk(written(tmp_path / "a.csv", header, scale))
    assert desk.state.question is not None
    assert (desk.state.question.text, desk.state.question.unit) == (said, unit)
    desk.answer(is_right=True)
    assert (desk.state.question, desk.state.can_import) == (None, True)
    before = desk.form
    desk.next_file()
    assert "a.h5" in str(next(desk.folder.glob("*.h5")))
    assert before["any_size"] == "yes"


def test_another_answer_in_the_fields_takes_the_question_back(tmp_path: Path) -> None:
    desk = Desk(written(tmp_path / "a.csv", "t;u1"))
    desk.set_form(unit="mm")
    assert desk.state.question is None
    desk.set_form(unit="m")
    assert desk.state.question is not None
    desk.set_form(quantity="acceleration", unit="m")
    assert (desk.state.question, desk.state.can_import) == (None, True)


def test_rest_and_a_plate_that_never_slips_are_no_question(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.005, (ROWS, 2))
    path = tmp_path / "a.csv"
    for table in (TABLE_MM, 0.0 * TABLE_MM):
        rows = zip(TIME_S, table + noise[:, 0], noise[:, 1], strict=True)
        path.write_text("t;u1 [mm];rel [mm]\n" + "".join(f"{t:.2f};{u:.4f};{r:.4f}\n" for t, u, r in rows))
        assert Desk(path).state.question is None


def test_empty_last_columns_are_none(tmp_path: Path) -> None:
    rows = "".join(f"{t:.2f};{u:.4f};;;\n" for t, u in zip(TIME_S, TABLE_MM, strict=True))
    for header in ("t;u1 [mm];;;", "t;u1 [mm]"):
        path = tmp_path / "a.csv"
        path.write_text(f"{header}\n{rows}")
        desk = Desk(path)
        assert desk.state.columns == ("t", "u1 [mm]")
        assert desk.state.can_import


def test_empty_columns_of_a_workbook_are_none(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book, path = openpyxl.Workbook(), tmp_path / "a.xlsx"
    book.active.append(["t", None, "u1 [mm]", None])
    for t, u in zip(TIME_S, TABLE_MM, strict=True):
        book.active.append([t, None, u])
    book.active["XFD300"] = "end"
    book.save(path)
    book.close()
    desk = Desk(path)
    assert desk.state.columns == ("t", "u1 [mm]")
    assert desk.state.can_import
    assert desk.state.first_lines.splitlines()[0].split() == ["t", "u1", "[mm]"]


def test_a_row_of_units_is_taken(tmp_path: Path) -> None:
    desk = Desk(written(tmp_path / "a.csv", "t;u1\n[ms];[µm]", 1e3))
    assert (desk.form["time_unit"], desk.form["unit"]) == ("ms", "um")
    assert desk.state.summary.startswith("300 samples, 0.003\u202fs")
    assert desk.state.can_import


def test_date_times_are_times(tmp_path: Path) -> None:
    begun = datetime.datetime(2025, 11, 23, 23, 59, 58).astimezone()
    stamps = [begun + datetime.timedelta(seconds=float(t)) for t in TIME_S]
    lines = [f"{at:%d.%m.%Y};{at:%H:%M:%S},{at.microsecond // 1000:03d}" for at in stamps]
    path = tmp_path / "a.csv"
    rows = "".join(f"{line};{u:.4f}\n" for line, u in zip(lines, TABLE_MM, strict=True))
    path.write_text(f"Datum;Zeit;Weg [mm]\n{rows}", encoding="utf-8")
    desk = Desk(path)
    assert [desk.form[name] for name in ("date", "time", "table")] == ["Datum", "Zeit", "Weg [mm]"]
    assert "begun 2025-11-23 23:59:58" in desk.state.summary
    assert desk.state.summary.startswith("300 samples, 2.990\u202fs, 100\u202fHz")


@pytest.mark.parametrize("header", ["u1 [mm];u2 [mm]", ""])
def test_a_file_without_times_needs_a_rate(tmp_path: Path, header: str) -> None:
    """Its first column was proposed as the times, and the plate as the table."""
    path = tmp_path / "a.csv"
    rows = "".join(f"{u:.4f};{u / 2:.4f}\n" for u in TABLE_MM)
    path.write_text((f"{header}\n" if header else "") + rows)
    desk = Desk(path)
    names = header.split(";") if header else ["0", "1"]
    assert [desk.form[name] for name in ("time", "table", "second")] == ["", *names]
    assert (
        "no column of times is found. Choose it by “Time”, or set “Rows a second”" in desk.state.message.text
    )
    desk.set_form(rate="100", unit="mm")
    assert desk.state.summary.startswith("300 samples, 2.990\u202fs, 100\u202fHz")
    assert desk.state.can_import


def test_how_far_a_file_is_read_is_shown(tmp_path: Path) -> None:
    desk, busy = Desk(written(tmp_path / "a.csv")), []
    desk.presenter.set_form({**desk.form, "from_s": "0.5"})
    (call,) = desk.worker.calls

    def report(progress: Progress) -> None:
        call.progress(progress)
        busy.append(desk.state.busy)

    call.done(tasks.preview_import(*call.arguments, report))
    assert busy[-1] == "Reading a.csv, 100\u202f%"
    assert desk.state.busy == ""
