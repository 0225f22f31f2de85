"""Every format reads back equal, by a reader that is not ours, and by `slipstand import`."""

import csv
import json
import shutil
import subprocess
import sys

import numpy as np
import openpyxl
import pandas as pd
import pytest
import pyuff
from runs_kit import ANALYSIS, ENDING, block
from scipy.io import loadmat

from app.runs.analysis_input import to_record
from app.runs.blocks import BlockLayout
from app.runs.errors import ImportFileError, RunExistsError, UnsuitableRunError
from app.runs.exchange.content import ExportedRun, sample_columns
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.export_formats import FORMATS, csv_cell
from app.runs.exchange.exporting import ExportRequest, export_runs, write_exported_run
from app.runs.exchange.import_run import import_foreign_file
from app.runs.exchange.importing import ImportPlan
from app.runs.reader import open_run
from app.runs.saved_analyses import inputs_hash, save_analysis
from app.runs.writer import write_run
from config.files import load_stand
from drivers.clock import TimeBase
from drivers.samples import SampleStatus
from messages.message import EMPTY

CHANNELS = ("time_s", "table_displacement_m", "relative_displacement_m")


@pytest.fixture(scope="module", params=["even", "uneven"])
def stored_run(request, tmp_path_factory, metadata):
    """A file of awkward numbers: all digits, absent readings, counts, and an analysis kept in it."""
    rng = np.random.default_rng(3)
    rows = block(0, 400, BlockLayout(counts="float64"))
    rows.readings[:] += rng.normal(size=rows.readings.shape) * 1e-5
    rows.counts[:] += rng.normal(size=rows.counts.shape)
    rows.readings[5:8] = np.nan
    rows.status[5:8] = SampleStatus.MISSING
    rows.status[9] = SampleStatus.OVERLOAD_TABLE
    if request.param == "uneven":
        rows.time_s[:] = np.sort(rng.uniform(0.0, 1.0, len(rows)))
    path = tmp_path_factory.mktemp("stored") / "=run.h5"
    write_run(path, metadata, rows, ENDING.replace(time_base=TimeBase()))
    save_analysis(path, ANALYSIS, inputs_hash(to_record(open_run(path, trusted=True))))
    return path


@pytest.fixture
def run(stored_run, tmp_path):
    """A copy of that file, which the test may change."""
    return open_run(shutil.copy(stored_run, tmp_path), trusted=True)


def exported_file(run, name):
    path = run.path.parent / f"out{FORMATS[name].suffix}"
    write_exported_run(name, ExportedRun(run, ANALYSIS, sample_columns(run)), path)
    return path


def columns_of(run):
    return {column.name: column.values for column in sample_columns(run)}


def assert_equal(found, run):
    for name, values in columns_of(run).items():
        assert np.array_equal(np.asarray(found[name]), values, equal_nan=values.dtype.kind == "f"), name


def test_csv(run):
    path = exported_file(run, "csv")
    assert_equal(pd.read_csv(path), run)
    table = pd.read_csv(run.path.parent / "out.coefficients.csv")
    f_d = table[table.quantity == "friction_dynamic"].iloc[0]
    assert (float(f_d.value), f_d.interval_95_high, f_d.adequate) == (0.1, 0.1008, False)


def test_a_simulated_run_is_called_so_in_every_format(run):
    for name in ("csv", "parquet", "xlsx"):
        path = exported_file(run, name)
        read = {"csv": pd.read_csv, "parquet": pd.read_parquet}.get(name)
        frame = read(path) if read else pd.read_excel(path, sheet_name="Samples")
        assert (frame["simulated"] == 1).all()
    assert json.loads(exported_file(run, "json").read_text())["source"] == "simulated"
    assert loadmat(exported_file(run, "mat"), simplify_cells=True)["run"]["source"] == "simulated"
    (first, *_) = pyuff.UFF(str(exported_file(run, "uff58"))).read_sets()
    assert first["id1"].startswith("SIMULATED ")


def test_json(run):
    document = json.loads(exported_file(run, "json").read_text())
    found = {name: np.array(c["values"], dtype=float) for name, c in document["samples"].items()}
    assert_equal(found, run)
    assert document["analysis"]["results"] == ANALYSIS["results"]
    assert document["metadata"]["plate_mass_kg"] == run.metadata.plate_mass_kg


def test_parquet(run):
    frame = pd.read_parquet(exported_file(run, "parquet"))
    assert_equal(frame, run)
    assert frame["status"].dtype == np.uint8


def test_mat(run):
    content = loadmat(exported_file(run, "mat"), simplify_cells=True)
    assert_equal(content, run)
    assert content["coefficients"]["friction_dynamic"]["value"] == 0.1
    assert content["coefficients"]["msk64_degree"] == "VIII (8, 16]"
    assert content["run"]["metadata"]["series"] == "1FFM1"


def test_uff58(run):
    sets = pyuff.UFF(str(exported_file(run, "uff58"))).read_sets()
    names = CHANNELS[1:]
    for dataset, name in zip(sets, names, strict=True):
        assert dataset["id2"] == name
        assert dataset["ordinate_axis_units_lab"] == "m"
        assert np.array_equal(dataset["x"], run.time_s)
        assert np.array_equal(dataset["data"], columns_of(run)[name], equal_nan=True)
        assert "0.1" in dataset["id5"]


def test_xlsx(run):
    path = exported_file(run, "xlsx")
    assert_equal(pd.read_excel(path, sheet_name="Samples"), run)
    cells = [cell for sheet in openpyxl.load_workbook(path) for row in sheet for cell in row]
    assert not [cell for cell in cells if cell.data_type == "f"]
    coefficients = pd.read_excel(path, sheet_name="Coefficients")
    assert coefficients.iloc[0]["run"] == "=run"
    assert coefficients.iloc[0]["value"] == 0.1


def test_latex_shows_value_and_uncertainty_to_the_same_digit(run):
    text = exported_file(run, "latex").read_text()
    assert r"$0.10000 \pm 0.00040$" in text
    assert r"=run$^\dagger$ \textbf{SIMULATED} & 1FFM1" in text
    assert text.count(r"\\") == 2


@pytest.mark.parametrize("name", ["csv", "parquet", "mat", "xlsx"])
def test_what_is_exported_imports_to_the_same_record(run, name):
    path = exported_file(run, name)
    import_foreign_file(
        path, ImportPlan(FileLayout(*CHANNELS)), run.path.parent / "again.h5", load_stand(), series="1FFM1"
    )
    again, before = (to_record(open_run(p, trusted=True)) for p in (run.path.parent / "again.h5", run.path))
    assert again.time_s.tobytes() == (before.time_s - before.time_s[0]).tobytes()
    for channel in CHANNELS[1:]:
        assert np.array_equal(getattr(again, channel), getattr(before, channel), equal_nan=True)


def test_no_text_of_a_csv_file_is_a_formula(run):
    export_runs([run.path], run.path.parent / "c.csv", ExportRequest("csv", "coefficients"))
    with (run.path.parent / "c.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[1][0] == "'=run"
    texts = [cell for row in rows for cell in row if cell]
    assert not [cell for cell in texts if cell[0] in "=+@" or (cell[0] == "-" and not is_number(cell))]


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("=1+1", "'=1+1"),
        ("\t=1", "'\t'=1"),
        ("\r\nx", "'\r\nx"),
        ("  @SUM(A1)", "'  @SUM(A1)"),
        ("\u00a0-1", "'\u00a0-1"),
        ("\ufeff=1", "'\ufeff=1"),
        ("\uff1d1", "'\uff1d1"),
        ("\u2212 1", "'\u2212 1"),
        ("a;=1", "a;'=1"),
        ("a\n =1", "a\n' =1"),
        ("1FFM0 2026-11-21", "1FFM0 2026-11-21"),
        ("a;b=c", "a;b=c"),
    ],
)
def test_no_sign_that_begins_a_formula_stands_bare(text, written):
    assert csv_cell(text) == written


def is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def test_several_runs_go_into_a_folder_under_names_that_do_not_meet(run, tmp_path):
    (tmp_path / "b").mkdir()
    shutil.copy(run.path, tmp_path / "b")
    outcomes = export_runs(
        [run.path, tmp_path / "b" / run.path.name], tmp_path / "out", ExportRequest("parquet")
    )
    assert [outcome.error for outcome in outcomes] == [EMPTY, EMPTY]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["=run-2.parquet", "=run.parquet"]


def test_a_run_that_fails_does_not_stop_the_rest(run, tmp_path):
    (tmp_path / "bad.h5").write_bytes(b"no run")
    outcomes = export_runs(
        [tmp_path / "bad.h5", run.path], tmp_path / "c.json", ExportRequest("json", "coefficients")
    )
    assert "not an HDF5 file" in str(outcomes[0].error)
    assert len(json.loads((tmp_path / "c.json").read_text())["coefficients"]) == 3


@pytest.mark.parametrize("name", ["csv", "json", "parquet", "mat", "uff58", "xlsx", "latex"])
def test_nothing_is_overwritten_unless_asked(run, name):
    path = run.path.parent / f"out{FORMATS[name].suffix}"
    path.write_text("mine")
    exported = ExportedRun(run, ANALYSIS, sample_columns(run))
    with pytest.raises(RunExistsError):
        write_exported_run(name, exported, path)
    assert path.read_text() == "mine"
    write_exported_run(name, exported, path, replace=True)
    assert path.read_bytes() != b"mine"
    assert not [p for p in path.parent.iterdir() if p.name.startswith(".")]


def test_a_failure_leaves_nothing_behind(run, monkeypatch):
    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("scipy.io.savemat", full)
    (outcome,) = export_runs([run.path], run.path.parent / "out.mat", ExportRequest("mat"))
    assert "full" in str(outcome.error)
    assert [p.name for p in run.path.parent.iterdir()] == [run.path.name]


@pytest.mark.parametrize(("name", "content"), [("uff58", "coefficients"), ("latex", "samples")])
def test_a_format_that_cannot_hold_it_says_so(run, name, content):
    with pytest.raises(UnsuitableRunError, match="Choose"):
        export_runs([run.path], run.path.parent / "out", ExportRequest(name, content))


@pytest.mark.parametrize(
    ("suffix", "layout", "said"),
    [
        (".parquet", FileLayout("time_s", "nix"), "no column 'nix'"),
        (".mat", FileLayout("time_s", "units.time_s"), "no column 'units.time_s'"),
        (".xlsx", FileLayout("value", "quantity"), "is not a number"),
        (".parquet", FileLayout("time_s", "status", decimal=","), "--decimal"),
        (".mat", FileLayout("time_s", "status", skip=2), "--skip"),
    ],
)
def test_a_wrong_column_is_named(run, suffix, layout, said):
    name = {".parquet": "parquet", ".mat": "mat", ".xlsx": "xlsx"}[suffix]
    with pytest.raises(ImportFileError, match=said):
        import_foreign_file(
            exported_file(run, name), ImportPlan(layout), run.path.parent / "x.h5", load_stand()
        )


@pytest.mark.parametrize("suffix", [".parquet", ".mat", ".xlsx"])
@pytest.mark.parametrize("content", [b"", b"rubbish" * 50, b"PK\x03\x04" + bytes(60)])
def test_rubbish_is_one_line(tmp_path, suffix, content):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(ImportFileError, match=r"bad\.") as caught:
        import_foreign_file(path, ImportPlan(FileLayout("0", "1")), tmp_path / "x.h5", load_stand())
    assert "\n" not in str(caught.value)


def test_nexus_checks_a_run_with_analyses_without_errors(run):
    nxcheck = [sys.executable, "-m", "nexusformat.scripts.nxcheck", "-e", str(run.path)]
    checked = subprocess.run(nxcheck, capture_output=True, text=True, check=True)
    assert "Total number of errors: 0" in checked.stdout + checked.stderr


def test_h5dump_reads_a_run(run):
    if shutil.which("h5dump") is None:
        pytest.skip("h5dump is not installed")
    dumped = subprocess.run(["h5dump", "-H", str(run.path)], capture_output=True, text=True, check=True)
    assert "table_displacement" in dumped.stdout
