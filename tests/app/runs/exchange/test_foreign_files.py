"""Run files opened by programs that are not ours; each test is skipped where its program is not installed."""

import shutil
import subprocess

import h5py
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


@pytest.mark.peer
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
        assert plot.signal_name == "table displacement (m)"
        assert plot.axes_names == ["time since the first stored sample (s)"]


@pytest.mark.peer
@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning:nexusformat")
def test_nexusformat_finds_what_nexpy_plots_and_its_labels(run, numbers):
    """NexPy labels an axis by `long_name`, without adding units."""
    nexus = pytest.importorskip("nexusformat.nexus", reason="nexusformat is not installed")
    plot = nexus.nxload(str(run.path)).plottable_data
    assert plot.nxsignal.long_name == "table displacement (m)"
    assert [axis.long_name for axis in plot.nxaxes] == ["time since the first stored sample (s)"]
    assert np.array_equal(plot.nxsignal.nxdata, numbers[:, 0])


def _said(*command: str) -> list[str]:
    program = shutil.which(command[0])
    if program is None:
        pytest.skip(f"{command[0]} is not installed")
    said = subprocess.run([program, *command[1:]], capture_output=True, text=True, check=False)
    if "there is no package called" in said.stderr:
        pytest.skip(said.stderr.strip().splitlines()[0])
    assert said.returncode == 0, said.stderr
    return said.stdout.split()


@pytest.mark.peer
def test_octave_loads_all_of_a_run_whose_texts_are_ascii(tmp_path, metadata, numbers):
    rows, plain = block(0, ROWS), metadata.replace(operator="Ada Weiss", gauge_checks=())
    blocks = RunBlock(rows.time_s, numbers, rows.status, rows.counts)
    write_run(tmp_path / "run.h5", plain, blocks, ENDING)
    code = (
        f"x = load('{tmp_path / 'run.h5'}'); printf('%.17g ', x.entry.motion.table_displacement(end),"
        " numel(x.entry.motion.time)); printf('%s ', x.entry.run.series)"
    )
    last, count, series = _said("octave", "--no-gui", "--norc", "--quiet", "--eval", code)
    assert (float(last), int(count), series) == (numbers[-1, 0], ROWS, plain.series)


@pytest.mark.peer
@pytest.mark.parametrize(
    "library",
    [
        "library(rhdf5); x <- h5dump(f); u <- x$entry$motion$table_displacement; s <- x$entry$run$series",
        "library(hdf5r); x <- H5File$new(f, mode='r'); u <- x[['entry/motion/table_displacement']][];"
        " s <- x[['entry/run/series']][]",
    ],
    ids=["rhdf5", "hdf5r"],
)
def test_r_reads_all_of_it(run, numbers, library):
    printed = "cat(sprintf('%.17g', u[length(u)]), length(u), s)"
    code = f"f <- '{run.path}'; suppressWarnings({{{library}}}); {printed}"
    last, rows, series = _said("Rscript", "-e", code)[-3:]
    assert (float(last), int(rows), series) == (numbers[-1, 0], ROWS, run.metadata.series)


def test_texts_are_ascii_where_they_can_be_and_columns_without_rows_are_not_wide(run):
    """Octave's `load` stops at a text of UTF-8, rhdf5 of R at a column of no 64-bit integers."""
    with h5py.File(run.path) as file:
        datasets: list[h5py.Dataset] = []
        file.visititems(lambda _, item: datasets.append(item) if isinstance(item, h5py.Dataset) else None)
        texts = [(item, kind) for item in datasets if (kind := h5py.check_string_dtype(item.dtype))]
        assert {kind.encoding for item, kind in texts if item[()].isascii()} == {"ascii"}
        assert not [item.name for item in datasets if 0 in item.shape and item.dtype.itemsize == 8]


def test_a_message_that_is_not_ascii_is_stored_as_what_it_is(tmp_path, metadata, numbers):
    rows, said = block(0, ROWS), "обрыв связи ±1 мм"
    blocks = RunBlock(rows.time_s, numbers, rows.status, rows.counts)
    write_run(tmp_path / "run.h5", metadata, blocks, ENDING.replace(message=said))
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["entry/run/message"].asstr()[()] == said
    assert open_run(tmp_path / "run.h5").end.message == said


@pytest.mark.peer
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


@pytest.mark.peer
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
