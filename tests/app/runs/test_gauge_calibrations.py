"""The calibration that a run carries: polynomials, validity, and which part an analysis uses."""

import datetime
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np
import pytest
from runs_kit import ENDING, block

from app.runs.analysis_json import calibration_warnings
from app.runs.blocks import calibrate
from app.runs.edits import edit_run
from app.runs.reader import load_counts, open_run
from app.runs.saved_analyses import metadata_hash
from app.runs.writer import write_run
from app.simulated_stand.signal import GaugeFaults, SimulatedGauge
from config.files import load_gauges
from config.schema import Filter, Gauge
from drivers.samples import SampleBlock

DAY = datetime.date(2026, 1, 12)
BENT = load_gauges().table.replace(polynomial=(-4.0, 150.0))


def test_bent_counts_are_the_same_displacement_recorded_and_read(tmp_path: Path, metadata: Any) -> None:
    gauges = metadata.gauges.replace(table=BENT)
    path = tmp_path / "run.h5"
    write_run(path, metadata.replace(gauges=gauges), block(0, 50), ENDING)
    edit_run(path, "Ada", gauges=gauges)  # readings follow the newest calibration
    run = open_run(path)
    counts = load_counts(run)

    live = calibrate(SampleBlock(0, counts, np.zeros(50, np.uint8), 0), gauges)
    x = BENT.gain_m_per_count * (counts[:, 0] - BENT.zero_count)
    np.testing.assert_allclose(live.table_m, x - 4.0 * x**2 + 150.0 * x**3, rtol=1e-12)
    np.testing.assert_array_equal(run.table_reading, live.table_m)


def test_what_was_seen_before_the_pull_follows_a_later_calibration(tmp_path: Path, metadata: Any) -> None:
    gauges = metadata.gauges.replace(table=BENT)
    path = tmp_path / "run.h5"
    ending = ENDING.replace(zero_m=-0.003, relative_zero_m=None, held_m=0.009)
    write_run(path, metadata.replace(gauges=gauges), block(0, 50), ending)

    moved = BENT.replace(polynomial=(), zero_count=BENT.zero_count + 500_000.0)
    edit_run(path, "Ada", gauges=gauges.replace(table=moved))

    seen = open_run(path).end
    counts = BENT.counts(np.array([ending.zero_m, ending.held_m]))
    np.testing.assert_allclose(BENT.displacement_m(counts), [ending.zero_m, ending.held_m], rtol=1e-12)
    assert [seen.zero_m, seen.held_m] == pytest.approx(list(moved.displacement_m(counts)), rel=1e-12)
    assert seen.relative_zero_m is None


def test_a_bent_simulated_gauge_shows_what_it_is_given() -> None:
    shown_m = np.linspace(-0.012, 0.012, 101)
    gauge = SimulatedGauge(BENT, GaugeFaults(), np.random.default_rng(1))
    counts, overloaded = gauge.read(shown_m, np.zeros(101))
    np.testing.assert_allclose(BENT.displacement_m(counts.astype(float)), shown_m, atol=2e-9)
    assert not overloaded.any()


@pytest.mark.parametrize(
    ("change", "is_stale"),
    [
        ({"certificate": "DKD 123", "calibrated_by": "Ada", "valid_until": DAY, "hysteresis_m": 1e-6}, False),
        ({"polynomial": (1.0,)}, True),
        ({"zero_count": 3.0}, True),
        ({"filter": Filter("bessel", 4, 50.0)}, True),
    ],
)
def test_only_what_changes_a_number_makes_an_analysis_stale(
    tmp_path: Path, metadata: Any, change: dict[str, Any], is_stale: bool
) -> None:
    path = tmp_path / "run.h5"
    write_run(path, metadata, block(0, 50), ENDING)
    with h5py.File(path) as file:
        before = metadata_hash(file)
    table = metadata.gauges.table.replace(**change)
    edit_run(path, "Ada", gauges=metadata.gauges.replace(table=table))
    with h5py.File(path) as file:
        assert (metadata_hash(file) != before) == is_stale


def test_an_expired_calibration_is_named_with_its_day_and_gauge() -> None:
    gauges = load_gauges()
    expired = gauges.replace(relative=gauges.relative.replace(valid_until=DAY))
    (caution,) = calibration_warnings(expired, datetime.date(2026, 2, 1))
    assert caution.code == "calibration-expired"
    assert "gauge 2 (relative) was valid until 2026-01-12, the run is of 2026-02-01" in str(caution.message)
    assert not list(calibration_warnings(expired, DAY))


def test_calibrations_from_before_there_were_bends_are_read() -> None:
    old = {"gain_m_per_count": 1e-9, "zero_count": 5.0, "measures": "plate"}
    gauge = msgspec.convert(old, Gauge)
    assert (gauge.polynomial, gauge.certificate, gauge.hysteresis_m) == ((), "", None)
