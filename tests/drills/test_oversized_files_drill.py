"""The short form of the drill with foreign files that are larger than they look."""

from functools import partial

import pytest

from tests.drills import oversized_files as files

pytest.importorskip("openpyxl")
pytest.importorskip("pyarrow")

SMALLER = {
    "far.xlsx": files.write_far_workbook,
    "wide.xlsx": partial(files.write_wide_workbook, rows=2000),
    "zeros.mat": partial(files.write_zeros_in_matlab, count=17_000_000),
    "cells.mat": partial(files.write_cells_in_matlab, count=1_500_000),
    "zeros.parquet": partial(files.write_zeros_in_parquet, rows=18_000_000),
    "line.csv": partial(files.write_long_line, count=500_000),
}


def test_files_are_refused_or_read_within_bounds(tmp_path):
    report = files.oversized_files(tmp_path, SMALLER)
    assert not report.faults, str(report)
    assert (report.tried, report.refused) == (6, 5)
    assert report.memory_bytes < 400e6


@pytest.mark.slow
def test_a_workbook_with_more_rows_than_a_sheet_is_refused_before_it_is_read(tmp_path):
    report = files.oversized_files(
        tmp_path, {"long.xlsx": partial(files.write_long_workbook, rows=1_048_576)}
    )
    assert not report.faults, str(report)
    assert report.refused == 1
    assert report.memory_bytes < 200e6
