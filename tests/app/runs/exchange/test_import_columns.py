import codecs
import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runs_kit import text_file

from app.runs.errors import ImportFileError
from app.runs.exchange import csv_reading
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.csv_reading import read_columns
from app.runs.exchange.units import unit_in_name

BASIC = FileLayout("time", "table", "rel")
TABLE = np.array([[0.0, 1.5, -2.0], [0.5, 2.5, -3.0], [1.0, 3.5, -4.0]])
PLAIN = "time,table,rel\n0,1.5,-2\n0.5,2.5,-3\n1.0,3.5,-4\n"
NO_HEADER = PLAIN.partition("\n")[2]


FORMS = {
    "plain": (PLAIN, BASIC),
    "columns by number": (PLAIN, FileLayout("0", "1", "2")),
    "other order": ("rel;note;time;table\n-2;a;0;1.5\n-3;b;0.5;2.5\n-4;c;1;3.5\n", BASIC),
    "tabs": (PLAIN.replace(",", "\t"), BASIC),
    "tabs told": (PLAIN.replace(",", "\t"), FileLayout("time", "table", "rel", delimiter="tab")),
    "blanks": (PLAIN.replace(",", "  "), BASIC),
    "blanks told": ("  " + PLAIN.replace(",", " \t "), FileLayout("time", "table", "rel", delimiter="space")),
    "blanks after commas": (PLAIN.replace(",", ", "), BASIC),
    "semicolons, decimal comma": (
        PLAIN.replace(",", ";").replace(".", ","), FileLayout("time", "table", "rel", decimal=","),
    ),
    "tabs, decimal comma": (
        PLAIN.replace(",", "\t").replace(".", ","), FileLayout("time", "table", "rel", decimal=","),
    ),
    "any delimiter": (PLAIN.replace(",", "!"), FileLayout("time", "table", "rel", delimiter="!")),
    "windows lines": (PLAIN.replace("\n", "\r\n"), BASIC),
    "old mac lines": (PLAIN.replace("\n", "\r"), BASIC),
    "no newline at the end": (PLAIN.rstrip(), BASIC),
    "byte-order mark": (codecs.BOM_UTF8 + PLAIN.encode(), BASIC),
    "utf-16": (PLAIN.encode("utf-16"), BASIC),
    "latin-1": (b"time,table,rel,\xb5m\n0,1.5,-2,0\n0.5,2.5,-3,0\n1,3.5,-4,0\n", BASIC),
    "blanks around names": (PLAIN.replace("time,table", " time , table "), BASIC),
    "name asked with blanks": (PLAIN, FileLayout(" time ", "table", "rel ")),
    "quotes": ('"time","table","rel"\n"0","1.5","-2"\n"0.5","2.5","-3"\n"1","3.5","-4"\n', BASIC),
    "quoted text beside": ('time,note,table,rel\n0,"a, b",1.5,-2\n0.5,"c",2.5,-3\n1,,3.5,-4\n', BASIC),
    "lines before the header": ("by X\n\nversion;2\n" + PLAIN, FileLayout("time", "table", "rel", skip=3)),
    "no header": (NO_HEADER, FileLayout("0", "1", "2", header=False)),
    "lines before, no header": ("a\nb\n" + NO_HEADER, FileLayout("0", "1", "2", skip=2, header=False)),
    "empty trailing columns": (PLAIN.replace("\n", ",,\n"), BASIC),
    "trailing in some rows": ("time,table,rel\n0,1.5,-2,\n0.5,2.5,-3\n1,3.5,-4,,\n", BASIC),
    "blank lines": (PLAIN.replace("\n", "\n\n") + "\n \n", BASIC),
    "rows of delimiters": (PLAIN + ",,\n,,,\n", BASIC),
    "comments": ("# a\n#b\n" + PLAIN.replace("\n0.5", "\n# c\n0.5"), BASIC),
    "units below the header": (PLAIN.replace("rel\n", "rel\ns,mm,mm\n"), BASIC),
    "lines above the header": ("Logger 7;;\n\nStart;14:03:00;\nRate;2;\n" + PLAIN.replace(",", ";"), BASIC),
    "sep=": ("sep=;\n" + PLAIN.replace(",", ";"), BASIC),
    "decimal comma, not told": (PLAIN.replace(",", ";").replace(".", ","), BASIC),
    "blanks, decimal comma, not told": (PLAIN.replace(",", "  ").replace(".", ","), BASIC),
    "a footer": (PLAIN + "Mean,2.5,-3\n\nend of file\n", BASIC),
    "utf-16 without a mark": (PLAIN.encode("utf-16-be"), BASIC),
    "numpy.savetxt": ("# from 3 gauges\n# time,table,rel\n" + NO_HEADER, BASIC),
    "exponents and signs": ("time,table,rel\n0,+15e-1,-.2E1\n5.e-1,2.5,-3\n1,3.5,-4\n", BASIC),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_every_form_reads_the_same(tmp_path, form, monkeypatch):
    content, layout = FORMS[form]
    path = text_file(tmp_path, content)
    assert np.array_equal(read_columns(path, layout).values, TABLE)
    monkeypatch.setattr(csv_reading, "parse_piece", lambda *_: None)
    assert np.array_equal(read_columns(path, layout).values, TABLE)


FAULTS = {
    "no such column": (PLAIN, FileLayout("time", "tabel"), ["no column 'tabel'", "time, table, rel"]),
    "number beyond": (PLAIN, FileLayout("0", "7"), ["no column '7'"]),
    "column twice": ("time,a,a\n0,1,2\n1,1,2\n", FileLayout("time", "a"), ["2 columns named 'a'"]),
    "text in a cell": (PLAIN.replace("2.5", "x"), BASIC, ["line 3", "column 'table'", "'x' is not a number"]),
    "decimal comma": (
        "time;table;rel\n0;1;2\n0,5;1;2\n", FileLayout("time", "table", "rel", decimal="."),
        ["line 3", "column 'time'", "'0,5'", "--decimal ,"],
    ),
    "infinite": (PLAIN.replace("2.5", "-inf"), BASIC, ["line 3", "column 'table'", "infinite"]),
    "no time": (PLAIN.replace("0.5,", ","), BASIC, ["line 3", "column 'time'", "time is missing"]),
    "cut line": (PLAIN + "1.5,3", BASIC, ["line 5", "column 'rel'", "only 2 cells"]),
    "underscores": (PLAIN.replace("2.5", "2_5"), BASIC, ["line 3", "'2_5' is not a number"]),
    "fault after blank lines": ("\n\n" + PLAIN.replace("\n0.5", "\n\n# c\n?.5"), BASIC, ["line 7"]),
    "empty": ("", BASIC, ["holds no line of data"]),
    "only a header": ("time,table,rel\n", BASIC, ["a header but no line of data"]),
    "all skipped": (PLAIN, FileLayout("time", "table", skip=9), ["--skip 9"]),
    "data for a header": (NO_HEADER, FileLayout("0", "1"), ["line 1", "--no-header"]),
    "no delimiter": ("time\n1\n2\n", BASIC, ["line 3", "--delimiter"]),
    "no numbers": ("time,table\na,b\nc,d\n", BASIC, ["line 3", "--skip"]),
    "delimiter of two": (PLAIN, FileLayout("time", "table", delimiter="::"), ["'::'"]),
    "delimiter is the decimal": (
        PLAIN, FileLayout("time", "table", delimiter=",", decimal=","), ["decimal sign ,"],
    ),
    "not text": (b"PK\x03\x04\0\0\0\0", BASIC, ["not a text file"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_one_line_that_names_the_place(tmp_path, fault):
    content, layout, words = FAULTS[fault]
    path = text_file(tmp_path, content)
    with pytest.raises(ImportFileError) as caught:
        read_columns(path, layout)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ImportFileError, match="there is no such file"):
        read_columns(tmp_path / "absent.csv", BASIC)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3), min_size=2, max_size=30),
    st.sampled_from([",", ";", "\t", " "]),
    st.booleans(),
)
def test_any_numbers_by_another_writer_are_read_exactly(tmp_path_factory, rows, delimiter, comma):
    """The csv module of Python is the other program; every float64 comes back to the last bit."""
    if comma and delimiter == ",":
        delimiter = ";"
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(["time", "table", "rel"])
        for row in rows:
            writer.writerow([repr(x).replace(".", ",") if comma else repr(x) for x in row])
    layout = FileLayout(
        "time",
        "table",
        "rel",
        delimiter="tab" if delimiter == "\t" else delimiter,
        decimal="," if comma else ".",
    )
    assert read_columns(path, layout).values.tobytes() == np.array(rows).tobytes()


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("u1 mm", "mm"),
        ("table displacement µm", "µm"),
        ("Стол мм", "мм"),
        ("time ms", "ms"),
        ("u1, mm", "mm"),
        ("gauge in", ""),
        ("u1 min", ""),
        ("channel s", ""),
        ("plate m", ""),
    ],
)
def test_a_unit_may_stand_apart_behind_the_name_of_a_column(name: str, unit: str) -> None:
    assert unit_in_name(name) == unit
