"""Texts as loggers and programs write them: stamps, units, rates, and what they say of their start."""

import datetime
import hashlib

import numpy as np
import pytest

from app.runs.errors import ImportFileError
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.import_run import find_release, import_foreign_file
from app.runs.exchange.importing import ImportPlan, read_record
from app.runs.exchange.recognition import ParseOptions, survey_file
from app.runs.exchange.text_files import TextFile
from app.runs.reader import open_run
from config.files import load_stand

ROWS = 60
BASIC = FileLayout("", "u1")


def record_of(folder, text, plan=None, encoding="utf-8"):
    path = folder / "logger.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return read_record(path, plan or ImportPlan(BASIC))


def stamped(pattern, step_ms=125, zone=None):
    """Rows whose stamps Python's strftime has written, `%f` cut to milliseconds."""
    begun = datetime.datetime(2025, 11, 23, 23, 59, 57, tzinfo=zone)
    stamps = (begun + datetime.timedelta(milliseconds=step_ms * row) for row in range(ROWS))
    return ["Time;u1", *(f"{one.strftime(pattern).replace('@', f'{one.microsecond // 1000:03d}')};{row}"
                         for row, one in enumerate(stamps))]  # fmt: skip


BERLIN_WINTER = datetime.timezone(datetime.timedelta(hours=1))


@pytest.mark.parametrize(
    "pattern",
    [
        "%Y-%m-%d %H:%M:%S.@", "%Y-%m-%dT%H:%M:%S.@", "%d.%m.%Y %H:%M:%S,@", "%m/%d/%Y %I:%M:%S.@ %p",
        "%Y/%m/%d %H:%M:%S.@", "%d-%b-%Y %H:%M:%S.@", "%Y%m%dT%H%M%S.@", "%b %d, %Y %H:%M:%S.@",
        "%a %d.%m.%y %H:%M:%S:@", "%d/%b/%Y %H:%M:%S.@", "%H:%M:%S.@", "%M:%S.@",
    ],
)  # fmt: skip
def test_date_times_are_times(tmp_path, pattern):
    record = record_of(tmp_path, "\n".join(stamped(pattern)) + "\n")
    assert np.array_equal(record.time_s, 0.125 * np.arange(ROWS)), "past midnight too"
    assert record.facts.rate_hz == 8.0
    if "%d" in pattern:
        assert record.facts.start == datetime.datetime(2025, 11, 23, 23, 59, 57).astimezone()
    else:
        assert record.facts.start is None


def test_stamps_of_ctime_are_times(tmp_path):
    record = record_of(tmp_path, "\n".join(stamped("%a %b %d %H:%M:%S %Y", step_ms=1000)) + "\n")
    assert np.array_equal(record.time_s, np.arange(ROWS))
    assert record.facts.start == datetime.datetime(2025, 11, 23, 23, 59, 57).astimezone()


@pytest.mark.parametrize("zone", ["+01:00", "+0100", " +01:00"])
def test_a_zone_is_taken(tmp_path, zone):
    lines = stamped("%Y-%m-%dT%H:%M:%S.@")
    text = "\n".join([lines[0], *(line.replace(";", f"{zone};") for line in lines[1:])])
    expected = datetime.datetime(2025, 11, 23, 23, 59, 57, tzinfo=BERLIN_WINTER)
    assert record_of(tmp_path, text).facts.start == expected
    utc = "\n".join([lines[0], *(line.replace(";", "Z;") for line in lines[1:])])
    assert record_of(tmp_path, utc).facts.start == expected.replace(tzinfo=datetime.UTC)


def test_a_date_beside_the_time_of_day_is_its_day(tmp_path):
    rows = [line.replace(" ", ";") for line in stamped("%d.%m.%Y %H:%M:%S.@")[1:]]
    record = record_of(tmp_path, "\n".join(["Date;Time;u1", *rows]))
    assert np.array_equal(record.time_s, 0.125 * np.arange(ROWS))
    assert record.facts.start == datetime.datetime(2025, 11, 23, 23, 59, 57).astimezone()


def test_a_date_that_may_be_read_both_ways_is_asked_for(tmp_path):
    text = "Time;u1\n" + "".join(f"03/11/2025 14:00:{row:02d};{row}\n" for row in range(ROWS))
    with pytest.raises(ImportFileError, match="--date-order dmy or mdy"):
        record_of(tmp_path, text)
    record = record_of(tmp_path, text, ImportPlan(FileLayout("", "u1", date_order="mdy")))
    assert record.facts.start.date() == datetime.date(2025, 3, 11)


def test_seconds_since_1970_tell_the_start_and_begun_overrules(tmp_path):
    text = "t,u1\n" + "".join(f"{1763900000 + row / 4},{row}\n" for row in range(ROWS))
    record = record_of(tmp_path, text)
    assert record.facts.start == datetime.datetime.fromtimestamp(1763900000, datetime.UTC)
    begun = datetime.datetime(2019, 5, 4, 14, 3, tzinfo=BERLIN_WINTER)
    later = record_of(tmp_path, text, ImportPlan(BASIC, begun=begun, from_s=1763900000.25))
    assert later.facts.start == begun + datetime.timedelta(seconds=0.25)


def test_seconds_since_1904_are_those_of_labview(tmp_path):
    text = "t,u1\n" + "".join(f"{1763900000 + 2082844800 + row / 4},{row}\n" for row in range(ROWS))
    assert record_of(tmp_path, text).facts.start == datetime.datetime.fromtimestamp(1763900000, datetime.UTC)


def test_a_file_without_times_is_told_what_it_needs(tmp_path):
    text = "u1,u2\n" + "".join(f"{row},{row}\n" for row in range(ROWS))
    with pytest.raises(
        ImportFileError, match=r"no column of times is found. Choose it by --time, or set --rate"
    ):
        record_of(tmp_path, text)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-8-sig", "UTF8", "cp866"])
def test_a_text_is_read_in_the_encoding_that_is_given(tmp_path, encoding):
    text = "Время;u1\n" + "".join(f"{row};{row}\n" for row in range(ROWS))
    plan = ImportPlan(FileLayout("Время", "u1", encoding=encoding))
    assert list(record_of(tmp_path, text, plan, encoding).cells[0]) == list(range(ROWS))


PREAMBLE = "".join(f"Испытание стола, строка {row}, сухое трение\n" for row in range(80))


@pytest.mark.parametrize(
    ("encoding", "found", "header", "above"),
    [
        ("utf-16", "utf-16-le", "Время, с;Стол, мм", ""),
        ("utf-16-le", "utf-16-le", "Время, с;Стол, мм", ""),
        ("utf-16-be", "utf-16-be", "Время, с;Стол, мм", PREAMBLE),
        ("utf-16-le", "utf-16-le", "Time [s];Table [mm]", PREAMBLE),
        ("cp1251", "cp1251", "Время, с;Стол, мм", ""),
        ("cp1251", "cp1251", "t (с);u1 (мм)", ""),
        ("cp1251", "cp1251", "Time (с);Weg (м)", ""),
        ("cp866", "cp866", "Время, с;Стол, мм", ""),
        ("cp1252", "cp1252", "Größe;Weg [mm]", ""),
        ("cp1252", "cp1252", "Zeit (s);Hub des Schüttlers [µm]", "Gerät: Größe 3, 20 °C\n"),
        ("cp1252", "cp1252", "Temps écoulé [s];Déplacement à la table [mm]", ""),
        ("cp1252", "cp1252", "t [s];u1 [µm]", "T = 21 °C\n"),
        ("utf-8", "utf-8", "Zeit (s);Größe [µm]", ""),
        ("utf-8-sig", "utf-8", "Время, с;Стол, мм", ""),
    ],
)
def test_an_encoding_is_found_out_and_told(tmp_path, encoding, found, header, above):
    path = tmp_path / "logger.csv"
    text = above + f"{header}\n" + "".join(f"{row / 8};{row}\n" for row in range(ROWS))
    path.write_bytes(text.encode(encoding))
    survey = survey_file(path, ParseOptions())
    assert survey.encoding == found
    assert survey.lines[0] == (above or header).split("\n")[0]
    assert survey.preview.columns == tuple(header.split(";"))
    record = read_record(path, ImportPlan(FileLayout("0", "1")))
    assert list(record.cells[0]) == list(range(ROWS))


@pytest.mark.parametrize("encoding", ["utf-32", "cp037", "hex", "none"])
def test_an_encoding_in_which_digits_are_no_ascii_is_refused(tmp_path, encoding):
    with pytest.raises(ImportFileError, match=f"--encoding '{encoding}' is not known"):
        record_of(tmp_path, "t,u1\n0,1\n", ImportPlan(FileLayout("t", "u1", encoding=encoding)))


@pytest.mark.parametrize(
    ("header", "time_s", "table_m"),
    [
        ("t (ms);u1 [mm]", 1e-3, 1e-3),
        ("t;u1\nms;mm", 1e-3, 1e-3),
        ("Zeit;Weg\n[s];[µm]", 1.0, 1e-6),
        ("Время, мс;Стол, см", 1e-3, 1e-2),
        ("t_s;u1_um", 1.0, 1e-6),
        ("t;u1", 1.0, 1.0),
    ],
)
def test_units_that_the_file_names_are_taken(tmp_path, header, time_s, table_m):
    text = f"{header}\n" + "".join(f"{row};{2 * row}\n" for row in range(ROWS))
    record = record_of(
        tmp_path, text, ImportPlan(FileLayout("0", "1")), "cp1251" if "Время" in header else "utf-8"
    )
    assert record.time_s == pytest.approx(time_s * np.arange(ROWS), rel=1e-14)
    assert record.block.readings[:, 0] == pytest.approx(2 * table_m * np.arange(ROWS), rel=1e-14)
    told = ImportPlan(FileLayout("0", "1"), time_unit="us", unit="m")
    record = record_of(tmp_path, text, told, "cp1251" if "Время" in header else "utf-8")
    assert record.time_s == pytest.approx(1e-6 * np.arange(ROWS), rel=1e-14)
    assert list(record.block.readings[:, 0]) == list(2.0 * np.arange(ROWS))


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("t;u1 [mV/V]", "what one mV/V means is not known. Add --gain"),
        ("t;u1 [mm/s]", "unit of velocity. Add --quantity velocity"),
        ("t [mm];u1", "mm is no unit of time"),
    ],
)
def test_a_unit_that_does_not_tell_the_reading_is_asked_for(tmp_path, header, said):
    text = f"{header}\n" + "".join(f"{row};{row}\n" for row in range(ROWS))
    with pytest.raises(ImportFileError, match=said):
        record_of(tmp_path, text, ImportPlan(FileLayout("0", "1")))


def test_a_rate_stands_for_times(tmp_path):
    text = "u1\n" + "".join(f"{row},5\n" for row in range(ROWS))
    record = record_of(tmp_path, text, ImportPlan(FileLayout("", "u1", decimal=",", rate_hz=2000.0)))
    assert np.array_equal(record.time_s, np.arange(ROWS) / 2000.0)
    assert record.facts.rate_hz == 2000.0
    assert list(record.cells[0]) == [row + 0.5 for row in range(ROWS)]
    with pytest.raises(ImportFileError, match="--time and --rate exclude each other"):
        record_of(tmp_path, text, ImportPlan(FileLayout("0", "u1", rate_hz=1.0)))


ONE_COLUMN = "".join(f"{row},50\n" for row in range(ROWS))


def test_decimal_commas_of_one_column_are_no_second_column(tmp_path):
    plan = ImportPlan(FileLayout("", "0", rate_hz=100.0))
    assert list(record_of(tmp_path, "u1\n" + ONE_COLUMN, plan).cells[0]) == [row + 0.5 for row in range(ROWS)]
    assert list(record_of(tmp_path, "u1,u2\n" + ONE_COLUMN, plan).cells[0]) == list(range(ROWS))
    bare = FileLayout("", "0", rate_hz=100.0, header=False)
    with pytest.raises(ImportFileError, match=r"'20,50' may be one number or two. Add --decimal , or"):
        record_of(tmp_path, ONE_COLUMN, ImportPlan(bare))


def test_decimal_commas_between_quotes_are_read(tmp_path):
    text = '"t","u1"\n' + "".join(f'"{row},25","{row},5"\n' for row in range(ROWS))
    record = record_of(tmp_path, text, ImportPlan(FileLayout("t", "u1")))
    assert list(record.cells[0]) == [row + 0.5 for row in range(ROWS)]


def test_a_unit_that_is_not_named_is_told(tmp_path):
    text = "t;u1 [mm];rel\n" + "".join(f"{row};{row};{row}\n" for row in range(ROWS))
    notes = record_of(tmp_path, text, ImportPlan(FileLayout("t", "1", "2"))).facts.notes
    assert list(map(str, notes)) == [
        "'u1 [mm]' is in mm, as the file says",
        "'rel' names no unit: it is taken as m. --unit states another",
    ]


def test_marks_of_absent_readings(tmp_path):
    marks = ["", "NaN", "N/A", "#N/A", "NULL", "-", "---", "1.#QNAN", "-1.#IND", "oops"]
    text = "t;u1\n" + "".join(f"{row};{mark}\n" for row, mark in enumerate([*marks, *range(60)]))
    record = record_of(tmp_path, text, ImportPlan(FileLayout("t", "u1", missing=("oops",))))
    assert np.isnan(record.cells[0][: len(marks)]).all()
    assert list(record.cells[0][len(marks) :]) == list(range(60))
    with pytest.raises(ImportFileError, match="line 11, column 'u1': 'oops' is not a number"):
        record_of(tmp_path, text)


def test_a_mark_that_is_a_number_is_absent_however_it_is_written(tmp_path):
    cells = ["-9999", "-9999.00", "-9.999e3", *map(str, range(60))]
    text = "t;u1\n" + "".join(f"{row};{cell}\n" for row, cell in enumerate(cells))
    record = record_of(tmp_path, text, ImportPlan(FileLayout("t", "u1", missing=("-9999",))))
    assert np.isnan(record.cells[0][:3]).all()
    assert list(record.cells[0][3:]) == list(range(60))


def test_rounded_stamps_of_an_even_logger_are_made_even(tmp_path):
    rate_hz, rows = 300.0, 3000
    times = np.arange(rows) / rate_hz + 0.0007
    text = "t,u1\n" + "".join(f"{int(at * 100) / 100},{n}\n" for n, at in enumerate(times))
    record = record_of(tmp_path, text)
    found_hz, uncertainty = record.facts.rate_hz, record.facts.interval_uncertainty
    assert 0.0 < uncertainty < 2e-5
    assert abs(found_hz / rate_hz - 1.0) < 3.0 * uncertainty
    assert "rounded to 0.01 s" in str(record.facts.notes[0])


def test_repeated_stamps_of_an_uneven_record_are_refused(tmp_path):
    times = np.concatenate([np.arange(100) / 300.0, 5.0 + np.arange(100) / 300.0])
    text = "t,u1\n" + "".join(f"{int(at * 100) / 100},{n}\n" for n, at in enumerate(times))
    with pytest.raises(ImportFileError, match=r"line 3, column 't': time 0.0 comes twice.*--rate HZ"):
        record_of(tmp_path, text)


def test_a_footer_is_left_out_and_told(tmp_path):
    text = "t;u1\n" + "".join(f"{row};{row}\n" for row in range(ROWS)) + "Mean;29,5\nEnd of record\n"
    record = record_of(tmp_path, text)
    assert len(record) == ROWS
    assert "line 62" in str(record.facts.notes[0])
    with pytest.raises(ImportFileError, match="line 62, column 't': 'Mean'"):
        record_of(tmp_path, text + "60;60\n")


def test_a_footer_is_looked_for_at_the_end_alone(tmp_path, monkeypatch):
    decoded = []
    decode = TextFile.decode
    monkeypatch.setattr("app.runs.exchange.csv_reading.PIECE_BYTES", 64)
    monkeypatch.setattr(TextFile, "decode", lambda file, data: decoded.append(data) or decode(file, data))
    text = "t;u1\n" + "".join(f"{row};{row}\n" for row in range(1000)) + "Mean;29,5\n"
    assert len(record_of(tmp_path, text, ImportPlan(FileLayout("t", "u1")))) == 1000
    assert sum(map(len, decoded)) < 2 * len(text)


def test_a_run_keeps_its_file_and_what_is_known_of_its_start(tmp_path):
    path = tmp_path / "old test.csv"
    path.write_text("t,u1\n" + "".join(f"{row / 10},{row}\n" for row in range(ROWS)))
    made = import_foreign_file(path, ImportPlan(BASIC), tmp_path / "run.h5", load_stand())
    run = open_run(made.run, trusted=True)
    source = run.metadata.source_file
    assert (source.name, source.size_bytes) == ("old test.csv", path.stat().st_size)
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (run.metadata.start_time, run.end.end_time) == (None, None), (
        "the date of the file is not the test's"
    )
    begun = datetime.datetime(2019, 5, 4, 14, 3, tzinfo=BERLIN_WINTER)
    made = import_foreign_file(path, ImportPlan(BASIC, begun=begun), tmp_path / "dated.h5", load_stand())
    dated = open_run(made.run, trusted=True)
    assert dated.metadata.start_time == begun
    assert dated.end.end_time == begun + datetime.timedelta(seconds=5.9)


@pytest.mark.parametrize("rows", [1, 49])
def test_what_is_too_short_is_no_record(tmp_path, rows):
    path = tmp_path / "short.csv"
    path.write_text("t,u1\n" + "".join(f"{row},{row}\n" for row in range(rows)))
    with pytest.raises(ImportFileError, match=f"holds {rows} readings of gauge 1, too few"):
        import_foreign_file(path, ImportPlan(FileLayout("t", "u1")), tmp_path / "run.h5", load_stand())
    assert not (tmp_path / "run.h5").exists()


def test_pieces_are_read_as_one(tmp_path, monkeypatch):
    """Rows, comments and a label are the same wherever the file is cut."""
    monkeypatch.setattr("app.runs.exchange.csv_reading.PIECE_BYTES", 64)
    rows = "".join(f"{row / 8},{row}.25\r\n" + ("# lost\r\n" if row % 7 == 3 else "") for row in range(200))
    record = record_of(tmp_path, "by X\r\n\r\nt,u1\r\n" + rows)
    assert list(record.cells[0]) == [row + 0.25 for row in range(200)]
    with pytest.raises(ImportFileError, match="line 205, column 't': time goes back"):
        record_of(tmp_path, "by X\r\n\r\nt,u1\r\n" + rows.replace("\r\n22.0,", "\r\n2.0,"))


def test_a_release_is_found_after_a_hold_only(tmp_path):
    time_s = np.arange(4000) / 500.0
    swing = np.where(time_s < 2.0, 12.0, 12.0 * np.exp(-0.2 * (time_s - 2.0)) * np.cos(9.0 * (time_s - 2.0)))
    swing += np.random.default_rng(1).normal(0.0, 0.02, len(time_s))
    for first, expected in ((0, 2.0), (1500, None)):
        text = "t,u1 [mm]\n" + "".join(
            f"{t},{u:.5f}\n" for t, u in zip(time_s[first:], swing[first:], strict=True)
        )
        found = find_release(record_of(tmp_path, text, ImportPlan(FileLayout("", "u1 [mm]"))))
        assert found == (None if expected is None else pytest.approx(expected, abs=0.02))
