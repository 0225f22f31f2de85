import numpy as np
import pytest
from runs_kit import ENDING, block

from app.runs.analysis_input import to_record
from app.runs.errors import RunExistsError
from app.runs.exchange.content import ExportedRun, sample_columns
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.exporting import write_exported_run
from app.runs.exchange.import_run import import_foreign_file
from app.runs.exchange.importing import ImportPlan
from app.runs.reader import open_run
from app.runs.writer import write_run
from config.files import load_stand
from drivers.clock import TimeBase
from drivers.samples import SampleStatus


def test_an_exported_run_imports_to_the_same_record(tmp_path, metadata):
    rows = block(0, 500)
    rows.readings[:] += np.random.default_rng(1).normal(size=rows.readings.shape) * 1e-5
    rows.readings[7] = np.nan
    rows.status[7] = SampleStatus.MISSING
    write_run(tmp_path / "run.h5", metadata, rows, ENDING.replace(time_base=TimeBase()))
    run = open_run(tmp_path / "run.h5", trusted=True)

    write_exported_run("csv", ExportedRun(run, None, sample_columns(run)), tmp_path / "run.csv")
    layout = FileLayout("time_s", "table_displacement_m", "relative_displacement_m")
    import_foreign_file(
        tmp_path / "run.csv", ImportPlan(layout), tmp_path / "again.h5", load_stand(), series="1FFM1"
    )
    again = to_record(open_run(tmp_path / "again.h5", trusted=True))

    record = to_record(run)
    for name in ("time_s", "table_displacement_m", "relative_displacement_m"):
        assert getattr(again, name).tobytes() == getattr(record, name).tobytes()
    assert (again.masses, again.pullback_m) == (record.masses, record.pullback_m)
    with pytest.raises(RunExistsError):
        write_exported_run("csv", ExportedRun(run, None, sample_columns(run)), tmp_path / "run.csv")


@pytest.mark.parametrize(
    ("quantity", "unit", "name"), [("velocity", "m/s", "m_per_s"), ("acceleration", "m/s^2", "m_per_s2")]
)
def test_columns_are_named_by_quantity_and_unit(tmp_path, metadata, quantity, unit, name):
    write_run(tmp_path / "run.h5", metadata.replace(quantity=quantity, unit=unit), block(0, 3), ENDING)
    write_exported_run(
        "csv",
        ExportedRun(
            open_run(tmp_path / "run.h5", trusted=True),
            None,
            sample_columns(open_run(tmp_path / "run.h5", trusted=True)),
        ),
        tmp_path / "run.csv",
    )
    header, first, *_ = (tmp_path / "run.csv").read_text().splitlines()
    readings = f"table_{quantity}_{name},relative_{quantity}_{name}"
    assert header == f"time_s,{readings},status,table_count,relative_count,simulated"
    assert first == "0.0,0.0,0.001,0,0,1000,1"


def test_replacing_is_asked_for(tmp_path, metadata):
    write_run(tmp_path / "run.h5", metadata, block(0, 3), ENDING)
    run = open_run(tmp_path / "run.h5", trusted=True)
    (tmp_path / "run.csv").write_text("old")
    write_exported_run("csv", ExportedRun(run, None, sample_columns(run)), tmp_path / "run.csv", replace=True)
    assert (tmp_path / "run.csv").read_text().startswith("time_s,")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.csv", "run.h5"]
