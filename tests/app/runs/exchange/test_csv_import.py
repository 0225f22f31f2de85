import tracemalloc

import numpy as np
import pytest
from runs_kit import text_file

from app.runs.analysis_input import to_record
from app.runs.errors import ImportFileError, RunExistsError
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.import_run import import_foreign_file
from app.runs.exchange.importing import ImportPlan, read_record
from app.runs.reader import load_counts, open_run
from config.files import load_stand
from drivers.samples import SampleStatus

pytestmark = pytest.mark.usefixtures("short_records")
BASIC = FileLayout("time", "table", "rel")
TABLE = np.array([[0.0, 1.5, -2.0], [0.5, 2.5, -3.0], [1.0, 3.5, -4.0]])
PLAIN = "time,table,rel\n0,1.5,-2\n0.5,2.5,-3\n1.0,3.5,-4\n"


def _import(path, plan, name="run.h5", **facts):
    import_foreign_file(path, plan, path.parent / name, load_stand(), **facts)
    return open_run(path.parent / name, trusted=True)


def test_missing_readings_stay_missing(tmp_path):
    text = "time,table,rel\n0,1.5,-2\n0.5,,-3\n1.0,nan,NaN\n1.5,,\n2,4,\n"
    run = _import(text_file(tmp_path, text), ImportPlan(BASIC))
    assert np.array_equal(run.table_reading, [1.5, np.nan, np.nan, np.nan, 4.0], equal_nan=True)
    assert np.array_equal(run.relative_reading, [-2.0, -3.0, np.nan, np.nan, np.nan], equal_nan=True)
    assert list(run.status) == [0, 0, SampleStatus.MISSING, SampleStatus.MISSING, 0]
    assert run.losses.missing == 2


def test_units_and_calibration(tmp_path):
    path = text_file(tmp_path, PLAIN)
    cases = [
        (ImportPlan(BASIC, unit="mm"), 1e-3 * TABLE[:, 1], "m"),
        (ImportPlan(BASIC, unit="um"), 1e-6 * TABLE[:, 1], "m"),
        (ImportPlan(BASIC), TABLE[:, 1], "m"),
        (ImportPlan(BASIC, gain=2.0, offset=0.5), 2.0 * TABLE[:, 1] + 0.5, "m"),
        (ImportPlan(BASIC, gain=-2.0, unit_name="rad"), -2.0 * TABLE[:, 1], "rad"),
        (ImportPlan(BASIC, quantity="velocity", unit="mm"), 1e-3 * TABLE[:, 1], "m/s"),
        (ImportPlan(BASIC, quantity="acceleration"), TABLE[:, 1], "m/s^2"),
    ]
    for i, (plan, expected, unit) in enumerate(cases):
        run = _import(path, plan, f"{i}.h5")
        assert run.table_reading == pytest.approx(expected, rel=1e-15)
        assert (run.metadata.unit, run.metadata.quantity) == (unit, plan.quantity)
        assert np.array_equal(load_counts(run), TABLE[:, 1:])


def test_uncertainty_of_the_gain_is_only_what_is_stated(tmp_path):
    path = text_file(tmp_path, PLAIN)
    assert to_record(_import(path, ImportPlan(BASIC))).table_gauge.gain_relative is None
    stated = to_record(_import(path, ImportPlan(BASIC, gain_uncertainty=0.01), "stated.h5"))
    assert (stated.table_gauge.gain_relative, stated.relative_gauge.gain_relative) == (0.01, 0.01)


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6)])
def test_time_units(tmp_path, unit, scale):
    run = _import(text_file(tmp_path, PLAIN), ImportPlan(BASIC, time_unit=unit))
    assert run.time_s == pytest.approx(TABLE[:, 0] * scale)
    assert run.metadata.rate_hz == pytest.approx(2.0 / scale)


def test_uneven_times_and_gaps_are_kept(tmp_path):
    run = _import(text_file(tmp_path, "t,u\n10,1\n10.1,2\n10.15,3\n12,4\n"), ImportPlan(FileLayout("t", "u")))
    assert run.time_s == pytest.approx([0.0, 0.1, 0.15, 2.0], abs=1e-12)
    assert run.metadata.rate_hz is None
    assert run.relative_reading is None
    assert "time 0 is its 10.0 s" in run.metadata.source


def test_plate_or_relative(tmp_path):
    path = text_file(tmp_path, PLAIN)
    assert not to_record(_import(path, ImportPlan(BASIC), "a.h5")).gauge_2_measures_plate
    record = to_record(_import(path, ImportPlan(BASIC, measures="plate"), "b.h5"))
    assert record.gauge_2_measures_plate
    assert np.array_equal(record.relative_displacement_m, TABLE[:, 2])


STRETCHES = "t,u\n0,1\n1,2\n2,3\n\n0,4\n1,5\n0.5,6\n"


def test_times_that_go_back_name_the_row(tmp_path):
    path = text_file(tmp_path, STRETCHES)
    with pytest.raises(
        ImportFileError, match=r"line 6, column 't': time goes back from 2.0 to 0.0.*--segment"
    ):
        _import(path, ImportPlan(FileLayout("t", "u")))
    with pytest.raises(ImportFileError, match=r"line 3, column 't': time 1.0 comes twice"):
        _import(text_file(tmp_path, "t,u\n1,1\n1,2\n"), ImportPlan(FileLayout("t", "u")))
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize(("segment", "readings"), [(0, [1, 2, 3]), (1, [4, 5]), (2, [6])])
def test_one_stretch_is_picked(tmp_path, segment, readings):
    run = _import(text_file(tmp_path, STRETCHES), ImportPlan(FileLayout("t", "u"), segment=segment))
    assert list(run.table_reading) == readings


@pytest.mark.parametrize("segment", [-1, 3])
def test_a_stretch_that_is_not_there(tmp_path, segment):
    with pytest.raises(ImportFileError, match=r"no segment.*3 stretches: give 0 to 2"):
        _import(text_file(tmp_path, STRETCHES), ImportPlan(FileLayout("t", "u"), segment=segment))


def test_from_until(tmp_path):
    path = text_file(tmp_path, PLAIN)
    run = _import(path, ImportPlan(BASIC, from_s=0.5, until_s=1.0))
    assert list(run.table_reading) == [2.5, 3.5]
    assert list(run.time_s) == [0.0, 0.5]
    in_ms = _import(path, ImportPlan(BASIC, time_unit="ms", until_s=0.0006), "ms.h5")
    assert list(in_ms.table_reading) == [1.5, 2.5]
    with pytest.raises(ImportFileError, match="no row lies between 5 s and inf s"):
        _import(path, ImportPlan(BASIC, from_s=5.0), "none.h5")


@pytest.mark.parametrize(
    ("plan", "words"),
    [
        (ImportPlan(BASIC, unit="mm", gain=1.0), "exclude each other"),
        (ImportPlan(BASIC, unit_name="rad"), "needs --gain"),
        (ImportPlan(BASIC, gain=0.0), "other than 0"),
        (ImportPlan(BASIC, gain=0.0, offset=1.0), "other than 0"),
        (ImportPlan(BASIC, gain=float("nan")), "finite"),
        (ImportPlan(BASIC, gain_uncertainty=-1.0), "cannot be"),
    ],
)
def test_plans_that_cannot_be(tmp_path, plan, words):
    with pytest.raises(ImportFileError, match=words):
        _import(text_file(tmp_path, PLAIN), plan)


def test_metadata_of_an_import(tmp_path):
    run = _import(
        text_file(tmp_path, PLAIN), ImportPlan(BASIC), series="2SSM1", table_mass_kg=130.0, note="old data"
    )
    metadata = run.metadata
    assert (metadata.series, metadata.pullback_m, metadata.plate_mass_kg) == ("2SSM1", 0.009, 27.4)
    assert (metadata.table_mass_kg, metadata.note) == (130.0, "old data")
    assert metadata.device.name == "record.csv"
    assert run.end.ended == "imported"


def test_nothing_is_overwritten_unasked(tmp_path):
    path = text_file(tmp_path, PLAIN)
    _import(path, ImportPlan(BASIC))
    before = (tmp_path / "run.h5").read_bytes()
    with pytest.raises(RunExistsError):
        _import(path, ImportPlan(BASIC, unit="mm"))
    assert (tmp_path / "run.h5").read_bytes() == before
    import_foreign_file(path, ImportPlan(BASIC, unit="mm"), tmp_path / "run.h5", load_stand(), replace=True)
    assert open_run(tmp_path / "run.h5").table_reading == pytest.approx(TABLE[:, 1] * 1e-3)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["record.csv", "run.h5"]


@pytest.mark.parametrize(
    ("rows", "gain", "words"),
    [
        ("0,1\n1e12,2\n", None, "--time-unit"),
        ("-1e308,1\n1e308,2\n", None, "--time-unit"),
        ("0,1e308\n1,2\n", 1e10, "--gain"),
    ],
)
def test_numbers_that_are_too_large_for_a_record(tmp_path, rows, gain, words):
    record = text_file(tmp_path, "t,u\n" + rows)
    with pytest.raises(ImportFileError, match=words):
        import_foreign_file(
            record, ImportPlan(FileLayout("t", "u"), gain=gain), tmp_path / "run.h5", load_stand()
        )
    assert not (tmp_path / "run.h5").exists()


def test_reading_takes_little_more_memory_than_the_columns(tmp_path):
    """Pieces of text are small, and each gauge goes where it is kept before times are copied."""
    rows, places = 150_000, iter(("1.npy", "2.npy"))
    lines = (f"{at / 1e4:.4f},{12 - at % 24_001 / 1e3:.6f},{at % 7_919 / 1e4:.6f}\n" for at in range(rows))
    path = text_file(tmp_path, "time,table,rel\n" + "".join(lines))
    columns_bytes, text_bytes = 3 * 8 * rows, path.stat().st_size

    def keep(cells):
        place = tmp_path / next(places)
        np.save(place, cells)
        return np.load(place, mmap_mode="r")

    read_record(path, ImportPlan(BASIC, until_s=1.0))  # loads the reader
    tracemalloc.start()
    try:
        record = read_record(path, ImportPlan(BASIC), keep=keep)
        held_bytes, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(record) == rows
    assert held_bytes < columns_bytes / 2
    assert peak_bytes < columns_bytes + 2 * text_bytes
