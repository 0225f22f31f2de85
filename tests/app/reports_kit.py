"""Runs of known truth as files, for figures and reports."""

import datetime
from pathlib import Path

import numpy as np

from analysis.synthetic import Truth, simulate_readings
from app.runs.metadata import RunSource, create_metadata
from app.runs.simulated import store_motion
from config.files import load_gauges, load_stand, published_row

START = datetime.datetime(2026, 11, 21, 13, 30, tzinfo=datetime.UTC)


def truth_of(series: str = "1FFM0", **changes) -> Truth:
    """A short test of a series, with noise."""
    row, of_series = published_row(series), load_stand().series(series)
    return Truth(
        period_s=row.period_s,
        damping_n1_per_s=row.damping_n1_per_s,
        plate_mass_kg=of_series.plate_mass_kg,
        friction_dynamic=row.friction_dynamic,
        pullback_m=of_series.pullback_m,
        rate_hz=250.0,
        duration_s=6.0,
    ).replace(**changes)


def write_run(
    path: Path, series: str = "1FFM0", *, facts: dict | None = None, displacements=None, **changes
) -> Path:
    """Store the readings of a test of a series, of other `displacements` than the exact ones if given."""
    truth = truth_of(series, **changes)
    _, table, relative = simulate_readings(truth, displacements)
    metadata = create_metadata(
        load_stand(),
        load_gauges(),
        START,
        series=series,
        rate_hz=truth.rate_hz,
        source="simulated",
        stated_source=RunSource.SIMULATED,
        **facts or {},
    )
    readings = np.column_stack([table, relative])
    store_motion(path, metadata, readings, release_s=truth.hold_s, rate_hz=truth.rate_hz)
    return path
