"""Previews of foreign files: how lines are read, and which column is likely which."""

from pathlib import Path

import numpy as np
import pytest

from app.runs.errors import ImportFileError
from app.runs.exchange.importing import ImportPlan, read_record
from app.runs.exchange.recognition import FilePreview, ParseOptions, preview_file


def written(folder: Path, text: str, name: str = "record.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def roles(found: FilePreview) -> tuple[str, ...]:
    return found.time, found.table, found.second, found.measures, found.time_unit, found.unit


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (
            "time_s,table_displacement_m,relative_displacement_m,table_velocity_m_per_s",
            ("time_s", "table_displacement_m", "relative_displacement_m", "relative", "s", "m"),
        ),
        ("Zeit (ms);u1 (mm);u2 (mm);Note", ("Zeit (ms)", "u1 (mm)", "u2 (mm)", "plate", "ms", "mm")),
        ("t,u2-u1,u1", ("t", "u1", "u2-u1", "relative", "", "")),
        (
            "Время, с\tПлита, мм\tСтол, мм",
            ("Время, с", "Стол, мм", "Плита, мм", "plate", "s", "mm"),
        ),
        ("Время, с\tСтол, мм\tx", ("Время, с", "Стол, мм", "", "relative", "s", "mm")),
        (
            "Time [s];Gauge 1 [µm];Gauge 2 [µm]",
            ("Time [s]", "Gauge 1 [µm]", "Gauge 2 [µm]", "plate", "s", "um"),
        ),
        ("n,t,ch1", ("t", "ch1", "", "relative", "", "")),
    ],
)
def test_columns_are_recognised_by_their_names(
    tmp_path: Path, header: str, expected: tuple[str, ...]
) -> None:
    delimiter = next(sign for sign in "\t;," if sign in header)
    width = header.count(delimiter) + 1
    lines = [delimiter.join(str(row + column) for column in range(width)) for row in range(3)]
    found = preview_file(written(tmp_path, "\n".join([header, *lines])))
    assert roles(found) == expected
    assert found.options == ParseOptions(delimiter, ".", 0, True)
    assert len(found.rows) == 3


def test_decimal_commas_and_missing_headers_are_found_out(tmp_path: Path) -> None:
    found = preview_file(written(tmp_path, "0,000;1,5;0,1\n0,001;1,4;0,2\n"))
    assert found.options == ParseOptions(";", ",", 0, False)
    assert roles(found)[:4] == ("0", "1", "2", "relative")
    assert found.titles == ("column 0", "column 1", "column 2")
    assert found.rows[0] == ("0,000", "1,5", "0,1")


def test_a_name_that_comes_twice_is_asked_for_by_number(tmp_path: Path) -> None:
    found = preview_file(written(tmp_path, "t,u,u\n0,1,2\n1,2,3\n"))
    assert found.columns == ("t", "1", "2")
    assert found.titles == ("t", "u", "u")


def test_what_is_told_is_not_found_out(tmp_path: Path) -> None:
    path = written(tmp_path, "made by a logger\nt;u\n0;1\n1;2\n")
    assert preview_file(path, ParseOptions(skip=1)).columns == ("t", "u")
    with pytest.raises(ImportFileError):
        preview_file(path, ParseOptions(delimiter="|", skip=1))


def test_a_file_without_numbers_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ImportFileError, match="no columns of numbers"):
        preview_file(written(tmp_path, "a,b\nc,d\ne,f\n"))


@pytest.mark.parametrize("suffix", [".mat", ".xlsx", ".parquet"])
def test_other_files_tell_their_columns_and_are_read_by_them(tmp_path: Path, suffix: str) -> None:
    columns = {"time": np.arange(4.0), "u1": np.arange(4.0) + 1, "u2": np.zeros(4)}
    path = tmp_path / f"record{suffix}"
    _write(path, columns)
    found = preview_file(path)
    assert found.columns == ("time", "u1", "u2")
    assert roles(found)[:4] == ("time", "u1", "u2", "plate")
    plan = ImportPlan(_layout(found))
    record = read_record(path, plan)
    assert record.facts.first_s == 0.0
    assert list(record.block.readings[:, 0]) == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("suffix", [".mat", ".xlsx", ".parquet"])
def test_damaged_and_missing_files_are_said(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(ImportFileError, match="no such file"):
        preview_file(tmp_path / f"none{suffix}")
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(b"nothing of the kind" * 20)
    with pytest.raises(ImportFileError, match="cannot be read as"):
        preview_file(path)


def _layout(found: FilePreview) -> object:
    from app.runs.exchange.csv_layout import FileLayout

    return FileLayout(found.time, found.table, found.second or None)


def _write(path: Path, columns: dict[str, np.ndarray]) -> None:
    if path.suffix == ".mat":
        from scipy.io import savemat

        savemat(path, columns)
    elif path.suffix == ".parquet":
        pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        parquet.write_table(pa.table(columns), path)
    else:
        book = pytest.importorskip("openpyxl").Workbook()
        book.active.append(list(columns))
        for row in zip(*columns.values(), strict=True):
            book.active.append([float(value) for value in row])
        book.save(path)
        book.close()
