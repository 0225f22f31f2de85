import numpy as np
import pytest
from runs_kit import ENDING, block

from analysis.record import GaugeFilter, GaugeUncertainty, StandMasses
from app.runs.analysis_input import combine_clock_scale, to_record
from app.runs.blocks import BlockLayout, RunBlock
from app.runs.errors import UnsuitableRunError
from app.runs.reader import open_run
from app.runs.writer import write_run
from config.schema import Filter, Gauge, Gauges
from drivers.clock import TimeBase


def _stored(path, metadata, rows, ending=ENDING):
    write_run(path, metadata, rows, ending)
    return open_run(path, trusted=True)


def test_everything_known_reaches_the_analysis(tmp_path, metadata):
    record = to_record(_stored(tmp_path / "run.h5", metadata, block(0, 100)))

    assert np.array_equal(record.time_s, np.arange(100) / 500.0)
    assert np.array_equal(record.table_displacement_m, block(0, 100).readings[:, 0])
    assert np.array_equal(record.relative_displacement_m, block(0, 100).readings[:, 1])
    assert record.masses == StandMasses(131.6, 27.4, 0.3, 0.02, 9.81, 0.005)
    assert record.pullback_m == 0.012
    assert record.clock_scale == pytest.approx(1.00002, abs=1e-9)
    assert record.clock_scale_uncertainty == pytest.approx(3e-6, rel=1e-3)
    assert record.table_gauge == GaugeUncertainty(0.003, 5e-6, 0.0, 2e-5, 0.0165)
    assert record.relative_gauge == GaugeUncertainty(0.003, 5e-6, 0.0, 2e-5, 0.033)
    assert not record.gauge_2_measures_plate


def test_flags_become_gaps_and_overloads(tmp_path, metadata):
    rows = block(0, 6)
    rows.status[:] = [0, 1, 2, 4, 8, 13]
    record = to_record(_stored(tmp_path / "run.h5", metadata, rows))

    assert list(np.isnan(record.table_displacement_m)) == [False, True, True, False, False, True]
    assert list(np.isnan(record.relative_displacement_m)) == [False, True, True, False, False, True]
    assert list(record.table_overload) == [False, False, False, True, False, True]
    assert list(record.relative_overload) == [False, False, False, False, True, True]


def test_what_is_not_stated_stays_not_stated(tmp_path, metadata):
    gauges = Gauges(table=Gauge(1.0, 0.0), relative=Gauge(1.0, 0.0, measures="plate"))
    record = to_record(_stored(tmp_path / "run.h5", metadata.replace(gauges=gauges), block(0, 6)))
    assert record.table_gauge == GaugeUncertainty(None, 0.0, 0.0, 0.0, None)
    assert record.gauge_2_measures_plate


def test_a_stated_filter_adds_its_delay(tmp_path, metadata):
    table = metadata.gauges.table.replace(filter=Filter("none"))
    relative = metadata.gauges.relative.replace(delay_s=1e-3, filter=Filter("bessel", 4, 50.0))
    gauges = metadata.gauges.replace(table=table, relative=relative)
    record = to_record(_stored(tmp_path / "run.h5", metadata.replace(gauges=gauges), block(0, 6)))
    assert record.table_gauge.filter is None
    assert record.relative_gauge.filter == GaugeFilter("bessel", 4, 50.0, 0.05)
    delay_s = 2.11392 / (2 * np.pi * 50.0)  # -3 dB frequency of the Bessel filter of order 4 with delay 1 s
    assert record.relative_gauge.lateness_s == pytest.approx(delay_s + 1e-3, rel=1e-5)
    uncertainty_s = np.hypot(2e-5, 0.05 * delay_s)
    assert record.relative_gauge.lateness_s_uncertainty == pytest.approx(uncertainty_s, rel=1e-4)


def test_one_gauge_alone(tmp_path, metadata):
    layout = BlockLayout(1, "")
    assert (
        to_record(_stored(tmp_path / "run.h5", metadata, block(0, 6, layout))).relative_displacement_m is None
    )


def test_other_quantities_need_to_be_asked_for(tmp_path, metadata):
    run = _stored(tmp_path / "run.h5", metadata.replace(quantity="velocity", unit="m/s"), block(0, 6))
    with pytest.raises(UnsuitableRunError, match="velocity in m/s"):
        to_record(run)
    assert np.array_equal(to_record(run, metres_only=False).table_displacement_m, run.table_reading)


def test_a_run_without_samples(tmp_path, metadata):
    empty = RunBlock(np.zeros(0), np.zeros((0, 2)), np.zeros(0, np.uint8), np.zeros((0, 2), np.int32))
    with pytest.raises(UnsuitableRunError, match="no samples"):
        to_record(_stored(tmp_path / "run.h5", metadata, empty))


def test_a_clock_timed_worse_than_it_was_made_is_taken_nearly_as_made() -> None:
    scale, uncertainty = combine_clock_scale(TimeBase(0.9954, 0.0021))
    assert scale == pytest.approx(1.0 - 0.0046 * 1e-6 / (1e-6 + 0.0021**2))
    assert uncertainty == pytest.approx((1.0 / (1e6 + 0.0021**-2)) ** 0.5)


def test_a_rate_that_is_really_wrong_is_taken_as_timed() -> None:
    scale, _ = combine_clock_scale(TimeBase(0.98, 5e-5))
    assert scale == pytest.approx(0.98, abs=1e-4)


def test_a_clock_that_nobody_timed_is_kept() -> None:
    assert combine_clock_scale(TimeBase()) == (1.0, 0.0)
