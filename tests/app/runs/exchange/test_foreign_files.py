"""Run files opened by programs that are not ours; each test is skipped where its program is not installed."""

import shutil
import subprocess

import numpy as np
import pytest
from runs_kit import ENDING, block

from app.runs.blocks import RunBlock
from app.runs.reader import open_run
from app.runs.writer import write_run

ROWS = 9000
"""More than a chunk."""


@pytest.fixture(scope="module")
def numbers():
    return np.random.default_rng(3).normal(scale=1e-3, size=(ROWS, 2))


@pytest.fixture
def run(tmp_path, metadata, numbers):
    rows = block(0, ROWS)
    write_run(tmp_path / "run.h5", metadata, RunBlock(rows.time_s, numbers, rows.status, rows.counts), ENDING)
    return open_run(tmp_path / "run.h5", trusted=True)


def test_silx_finds_what_to_plot_with_its_units(run, numbers):
    """As silx view draws a file: from the root along the attributes `default`."""
    opened = pytest.importorskip("silx.io", reason="silx is not installed")
    nxdata = pytest.importorskip("silx.io.nxdata")
    with opened.open(str(run.path)) as file:
        plot = nxdata.get_default(file)
        assert plot.is_valid
        assert not plot.issues
        assert plot.is_curve
        assert plot.signal_dataset_name == "table_displacement"
        assert plot.auxiliary_signals_dataset_names == ["relative_displacement"]
        assert plot.axes_dataset_names == ["time"]
        assert [part.attrs["units"] for part in (plot.signal, *plot.auxiliary_signals, *plot.axes)] == [
            "m", "m", "s",
        ]  # fmt: skip
        assert np.array_equal(plot.signal[()], numbers[:, 0])
        assert np.array_equal(plot.auxiliary_signals[0][()], numbers[:, 1])
        assert np.array_equal(plot.axes[0][()], run.time_s)


def test_xarray_takes_time_as_the_coordinate(run, numbers):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    with xarray.open_dataset(run.path, group="entry/motion", engine="h5netcdf") as motion:
        assert list(motion.coords) == ["time"]
        assert np.array_equal(motion.time, run.time_s)
        assert np.array_equal(motion.relative_displacement, numbers[:, 1])
        picked = motion.table_displacement.sel(time=run.time_s[ROWS // 2])
        assert float(picked) == numbers[ROWS // 2, 0]
        assert picked.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("path", "column"),
    [("table_displacement", 0), ("relative_displacement", 1)],
)
def test_h5dump_prints_the_very_numbers(run, numbers, path, column):
    h5dump = shutil.which("h5dump")
    if h5dump is None:
        pytest.skip("h5dump (hdf5-tools) is not installed")
    command = [h5dump, "-m", "%.17g", "-y", "-w", "1", "-d", f"/entry/motion/{path}", str(run.path)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    printed = said.split("DATA {", 1)[1].split("}", 1)[0].replace("\n", " ").split(",")
    assert np.array_equal(np.array(printed, dtype=float), numbers[:, column])
    assert '"m"' in said.rpartition('ATTRIBUTE "units"')[2]
