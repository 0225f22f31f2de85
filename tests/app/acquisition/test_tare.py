"""The tare of an amplifier and the zero of the calibration: told apart, and each taken off once.

The same pullback is read by an amplifier as it is, and by one whose tare was set elsewhere: all its counts
are shifted by so much. What is stored must be shifted by it, and nothing that is found of the stand.
"""

import datetime
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest
from pullback_kit import follow, recording

from app.acquisition.pullback.plan import PullbackMeasurement, PullbackPlan
from app.runs.analysis_json import zero_warnings
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import Analysis, analyze_run
from app.runs.blocks import CalibratedBlock, RunBlock, calibrate
from app.runs.metadata import EndMetadata, Events, RunMetadata, create_metadata
from app.runs.writer import write_run
from app.simulated_stand.options import Timetable
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.samples import Losses, SampleBlock

RATE_HZ = 500.0
TIMETABLE = Timetable(rest_s=1.0, pull_s=1.0, hold_s=1.0, decay_s=8.0, recentre_s=0.5)
TARE_COUNTS = np.array([1_700_000, -2_250_000])  # 3.4 mm and -9 mm


@dataclass(frozen=True)
class Told:
    """What came of one reading of the pullback."""

    rows: CalibratedBlock
    measurement: PullbackMeasurement
    analysis: Analysis
    path: Path


@pytest.fixture(scope="module")
def counts() -> np.ndarray:
    """Both channels of a pullback (n, 2), as an amplifier without tare sends them."""
    gauges = load_gauges()
    table, relative = recording(RATE_HZ, 10.9, timetable=TIMETABLE, seed=5)
    channels = [
        np.rint(x / gauge.gain_m_per_count + gauge.zero_count)
        for x, gauge in ((table, gauges.table), (relative, gauges.relative))
    ]
    return np.stack(channels, axis=1).astype(np.int32)


def told(folder: Path, counts: np.ndarray, clicks: np.ndarray) -> Told:
    """Calibrate, follow, store and analyse counts shifted by `clicks` (2,)."""
    status = np.zeros(len(counts), np.uint8)
    shifted = (counts + clicks).astype(np.int32)
    rows = calibrate(SampleBlock(0, shifted, status, 0), load_gauges())
    test, _, _ = follow(PullbackPlan(RATE_HZ, 0.012), rows.table_m, rows.relative_m)
    metadata = _metadata()
    ending = EndMetadata(
        "duration", metadata.start_time, Events(release_s=(test.measurement.release_index or 0) / RATE_HZ),
        Losses(samples=len(counts)), zero_m=test.measurement.zero_m, held_m=test.measurement.held_m,
        relative_zero_m=test.measurement.relative_zero_m,
    )  # fmt: skip
    path = folder / f"run{clicks[0]}.h5"
    time_s = np.arange(len(counts)) / RATE_HZ
    write_run(path, metadata, RunBlock(time_s, rows.readings, status, shifted), ending)
    return Told(rows, test.measurement, analyze_run(path, AnalysisRequest(classical=False)), path)


def _metadata() -> RunMetadata:
    start = datetime.datetime(2026, 11, 21, 12, 0, tzinfo=datetime.UTC)
    return create_metadata(load_stand(), load_gauges(), start, series="1FFM0", rate_hz=RATE_HZ)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory, counts: np.ndarray) -> tuple[Told, Told]:
    folder = tmp_path_factory.mktemp("tare")
    return told(folder, counts, 0 * TARE_COUNTS), told(folder, counts, TARE_COUNTS)


def shift_m() -> np.ndarray:
    gauges = load_gauges()
    return TARE_COUNTS * np.array([gauges.table.gain_m_per_count, gauges.relative.gain_m_per_count])


def test_the_zero_of_the_calibration_is_taken_off_once_and_no_tare_is(pair: tuple[Told, Told]) -> None:
    plain, tared = pair
    np.testing.assert_allclose(
        tared.rows.readings - plain.rows.readings, np.tile(shift_m(), (len(plain.rows), 1)), rtol=1e-9
    )
    with h5py.File(tared.path) as file:
        column = file["entry/motion/table_displacement"]
        gauge = load_gauges().table
        by_hand = gauge.gain_m_per_count * (file["entry/instrument/gauge_table/data"][:] - gauge.zero_count)
        np.testing.assert_allclose(column[:], by_hand, atol=1e-15)
        assert column.attrs["zero"] == "that of the calibration; no tare is subtracted"


def test_the_zero_before_the_pull_is_measured_where_it_is(pair: tuple[Told, Told]) -> None:
    plain, tared = pair
    assert plain.measurement.zero_m == pytest.approx(0.0, abs=5e-6)
    assert tared.measurement.zero_m == pytest.approx(shift_m()[0], abs=5e-6)
    assert tared.measurement.relative_zero_m == pytest.approx(shift_m()[1], abs=5e-6)
    assert tared.measurement.pulled_m == pytest.approx(plain.measurement.pulled_m, abs=1e-12)
    assert tared.measurement.release_index == plain.measurement.release_index
    stored = tared.analysis.run.end
    assert stored is not None
    assert stored.zero_m == tared.measurement.zero_m


@pytest.mark.parametrize(
    "name",
    ["friction_dynamic", "period_s", "damping_n1_per_s", "pullback_m", "residual_displacement_m"],
)
def test_a_large_tare_changes_nothing_that_is_found(pair: tuple[Told, Told], name: str) -> None:
    plain, tared = (one.analysis.identification.results[name] for one in pair)
    assert tared.value == pytest.approx(plain.value, abs=0.01 * plain.standard_uncertainty)
    assert tared.standard_uncertainty == pytest.approx(plain.standard_uncertainty, rel=0.01)


def test_the_fitted_zero_is_held_against_that_before_the_pull(pair: tuple[Told, Told]) -> None:
    for one in pair:
        assert "zero-moved" not in [caution.code for caution in one.analysis.identification.warnings]
    analysis = pair[1].analysis
    ending = analysis.run.end
    assert ending is not None
    moved = ending.replace(zero_m=ending.zero_m - 0.3e-3, time_base=TimeBase(1.5))
    (caution,) = zero_warnings(moved, analysis.record, analysis.identification)
    assert caution.code == "zero-moved"
    assert "place +30" in str(caution.message)
