"""How a later reading of gauge 2 changes the friction coefficient; a run carries the skew."""

import dataclasses
import math

import numpy as np
import pytest
from runs_kit import ENDING, block

from analysis.identify import identify
from analysis.synthetic import Truth, simulate_record
from app.runs.analysis_input import build_record, to_record
from app.runs.reader import open_run
from app.runs.writer import write_run
from drivers.clock import TimeBase
from drivers.samples import SampleStatus

FRICTION = 0.1
EARLIER = simulate_record(Truth(friction_dynamic=FRICTION, rate_hz=300.0, duration_s=6.0, lag_s=1e-3, seed=4))
"""Gauge 2 shows what was 1 ms before: it was read 1 ms earlier than its row says."""


def found(metadata, skew):
    carried = build_record(
        metadata,
        EARLIER.time_s,
        EARLIER.table_displacement_m,
        EARLIER.relative_displacement_m,
        TimeBase(1.0, 1e-6, *skew),
    )
    gauges = {
        name: dataclasses.replace(getattr(carried, name), gain_relative=None, range_m=None)
        for name in ("table_gauge", "relative_gauge")
    }
    return identify(
        carried.replace(masses=EARLIER.masses, pullback_m=None, **gauges), model="coulomb"
    ).results["friction_dynamic"]


def plain(metadata):
    """Gauges without delays of their own, so that the skew is all there is."""
    gauges = metadata.gauges
    bare = {"delay_s": 0.0, "delay_standard_uncertainty_s": 0.0, "nonlinearity_m": None}
    return metadata.replace(
        gauges=gauges.replace(table=gauges.table.replace(**bare), relative=gauges.relative.replace(**bare))
    )


def test_a_millisecond_shifts_the_friction_by_half_a_percent_and_carried_it_is_held(metadata):
    metadata = plain(metadata)
    unaware = found(metadata, (0.0, 0.0))
    assert 0.003 < abs(unaware.value / FRICTION - 1.0) < 0.01
    assert unaware.interval_95[0] < FRICTION < unaware.interval_95[1], "the plate alone gives another value"

    uncertain = found(metadata, (0.0, 1e-3))
    assert uncertain.interval_95[0] < FRICTION < uncertain.interval_95[1]

    known = found(metadata, (-1e-3, 4e-4))
    assert known.interval_95[0] < FRICTION < known.interval_95[1]
    assert known.value == pytest.approx(FRICTION, rel=2e-3)
    assert known.standard_uncertainty < unaware.standard_uncertainty


def test_the_skew_of_a_run_adds_to_the_delays_of_its_gauges(tmp_path, metadata):
    ending = ENDING.replace(time_base=TimeBase(1.0, 1e-6, 2e-4, 3e-4))
    gauge = metadata.gauges.relative.replace(delay_s=1e-3, delay_standard_uncertainty_s=4e-4)
    metadata = metadata.replace(gauges=metadata.gauges.replace(relative=gauge))
    write_run(tmp_path / "run.h5", metadata, block(0, 100), ending)
    run = open_run(tmp_path / "run.h5")
    assert run.end.time_base == ending.time_base
    read = to_record(run).relative_gauge
    assert read.delay_s == pytest.approx(8e-4)
    assert read.delay_s_uncertainty == pytest.approx(math.hypot(3e-4, 4e-4))


def test_a_reading_that_is_missing_alone_leaves_the_other(tmp_path, metadata):
    rows = block(0, 6)
    rows.status[2:4] = [SampleStatus.TABLE_MISSING, SampleStatus.RELATIVE_MISSING]
    write_run(tmp_path / "run.h5", metadata, rows, ENDING)
    read = to_record(open_run(tmp_path / "run.h5"))
    assert np.flatnonzero(np.isnan(read.table_displacement_m)).tolist() == [2]
    assert np.flatnonzero(np.isnan(read.relative_displacement_m)).tolist() == [3]
