"""Titles, units and file names of any content are exported in every format."""

import sys

import openpyxl
import pytest
import pyuff
from runs_kit import text_file

from app.runs.edits import edit_run
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.exporting import ExportRequest, export_runs
from app.runs.exchange.import_run import import_foreign_file
from app.runs.exchange.importing import ImportPlan
from config.files import load_stand

FORMATS = ("csv", "json", "parquet", "mat", "uff58", "xlsx")
TITLE = "first\nsecond\x0b\ufffe\uffff"

pytestmark = pytest.mark.usefixtures("short_records")


def _imported(folder, unit_name="m"):
    record = text_file(folder, "t,u\n0,1\n1,2\n2,3\n")
    plan = ImportPlan(FileLayout("t", "u"), gain=1.0, unit_name=unit_name)
    import_foreign_file(record, plan, folder / "run.h5", load_stand())
    return folder / "run.h5"


def _exported(run, format_name):
    target = run.parent / f"out.{format_name}"
    (outcome,) = export_runs([run], target, ExportRequest(format_name, "samples"))
    assert not outcome.error
    return target


@pytest.mark.parametrize("format_name", FORMATS)
@pytest.mark.parametrize("unit_name", ["µε", "V/√Hz", "m\ns", "x" * 100])
def test_units_of_any_characters(tmp_path, format_name, unit_name):
    assert _exported(_imported(tmp_path, unit_name), format_name).stat().st_size


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names of files are always text")
@pytest.mark.parametrize("format_name", FORMATS)
def test_a_file_name_that_is_no_text(tmp_path, format_name):
    run = _imported(tmp_path).rename(tmp_path / "run\udcff.h5")
    assert _exported(run, format_name).stat().st_size


def test_a_title_of_two_lines_is_one_line_of_a_universal_file(tmp_path):
    run = _imported(tmp_path)
    edit_run(run, "Ada", title=TITLE)
    found = pyuff.UFF(str(_exported(run, "uff58"))).read_sets()
    assert found["id1"].startswith("first second")
    assert list(found["data"]) == [1.0, 2.0, 3.0]


def test_what_a_workbook_cannot_hold_is_marked(tmp_path):
    run = _imported(tmp_path)
    edit_run(run, "Ada", title=TITLE)
    sheet = openpyxl.load_workbook(_exported(run, "xlsx").rename(tmp_path / "out.xlsx"))["Run"]
    assert {row[0].value: row[1].value for row in sheet.rows}[
        "metadata.title"
    ] == "first\nsecond\ufffd\ufffd\ufffd"
