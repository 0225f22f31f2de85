"""Runs condensed for drawing, held against the samples themselves."""

import numpy as np
import pytest
from runs_kit import ANALYSIS, ENDING, block

from app.runs.blocks import BlockLayout, RunBlock
from app.runs.decimation import decimate, open_decimated
from app.runs.edits import edit_run
from app.runs.reader import open_run
from app.runs.saved_analyses import save_analysis
from app.runs.validator import Validator
from app.runs.writer import write_run

ROWS = 300_000
"""More than are read at once."""


@pytest.fixture(scope="module")
def validator():
    with Validator.start() as validator:
        yield validator


def stored(path, metadata, count=ROWS, layout=None):
    rows = block(0, count, layout)
    random = np.random.default_rng(2)
    rows.readings[:] = random.normal(size=rows.readings.shape)
    gone = random.random(count) < 0.3
    rows.readings[gone] = np.nan
    rows.status[gone] = 1
    if rows.counts is not None:
        rows.counts[:] = random.integers(-(1 << 20), 1 << 20, rows.counts.shape)
    write_run(path, metadata, RunBlock(rows.time_s, rows.readings, rows.status, rows.counts), ENDING)
    return path


def spans_of(column, first, per_span):
    """Rows of spans; the last is filled up with its last reading."""
    filled = np.pad(column[first:], (0, -(len(column) - first) % per_span), mode="edge")
    return filled.reshape(-1, per_span)


def assert_drawn_as(overview, run, spans, before_release_s):
    """Each span of rows from shortly before the release is there with its extremes."""
    first = np.searchsorted(run.time_s, overview.release_s - before_release_s)
    per_span = (len(run) - first) // spans
    assert np.array_equal(overview.time_s[::2], spans_of(run.time_s, first, per_span)[:, 0])
    assert np.array_equal(overview.time_s[1::2], overview.time_s[::2])
    for drawn, column in zip(overview.readings, (run.table_reading, run.relative_reading), strict=True):
        rows = spans_of(column, first, per_span)
        assert np.array_equal(drawn[::2], np.nanmin(rows, axis=1))
        assert np.array_equal(drawn[1::2], np.nanmax(rows, axis=1))


def test_each_span_shows_its_extremes(tmp_path, metadata, validator):
    path = stored(tmp_path / "run.h5", metadata)
    overview = open_decimated(path, 1000, between_s=(-1.0, np.inf), validator=validator)
    assert (overview.path, overview.unit, overview.release_s) == (path, "m", ENDING.events.release_s)
    assert_drawn_as(overview, open_run(path, trusted=True), 1000, 1.0)


def test_a_later_calibration_is_drawn(tmp_path, metadata, validator):
    path = stored(tmp_path / "run.h5", metadata)
    table = metadata.gauges.table.replace(gain_m_per_count=2 * metadata.gauges.table.gain_m_per_count)
    edit_run(path, "Ada", gauges=metadata.gauges.replace(table=table))
    overview = open_decimated(path, 700, between_s=(-0.5, np.inf), validator=validator)
    assert_drawn_as(overview, open_run(path, trusted=True), 700, 0.5)


def test_the_release_is_that_of_the_newest_analysis(tmp_path, metadata, validator):
    path = stored(tmp_path / "run.h5", metadata, 2000)
    save_analysis(path, ANALYSIS, "hash", {})
    overview = open_decimated(path, 100, between_s=(-0.25, np.inf), validator=validator)
    assert overview.release_s == ANALYSIS["events"]["release_s"]
    assert overview.time_s[0] == 0.75


@pytest.mark.parametrize("count", [0, 1, 150])
def test_a_short_run_is_drawn_row_by_row(tmp_path, metadata, validator, count):
    path = stored(tmp_path / "run.h5", metadata, count, BlockLayout(channels=1))
    run = open_run(path, trusted=True)
    overview = open_decimated(path, 100, validator=validator)
    assert np.array_equal(overview.time_s, run.time_s)
    (drawn,) = overview.readings
    assert np.array_equal(drawn, run.table_reading, equal_nan=True)


@pytest.mark.parametrize("count", [299, 1999, 70_001])
def test_the_last_rows_are_drawn(tmp_path, metadata, validator, count):
    path = stored(tmp_path / "run.h5", metadata, count, BlockLayout(channels=1))
    run = open_run(path, trusted=True)
    (drawn,) = open_decimated(path, 100, validator=validator).readings
    per_span = count // 100
    last = run.table_reading[(count - 1) // per_span * per_span :]
    assert drawn[-2:] == pytest.approx([np.nanmin(last), np.nanmax(last)], nan_ok=True)
    time_s, value = decimate((np.arange(count), np.arange(count)), 100)
    assert (time_s[0], value[-1]) == (0, count - 1)


def test_a_part_of_a_run_is_read_as_finely_as_asked(tmp_path, metadata, validator):
    path = stored(tmp_path / "run.h5", metadata)
    run, release_s = open_run(path, trusted=True), ENDING.events.release_s
    part = open_decimated(path, 4000, between_s=(2.0, 3.0), validator=validator)
    seen = (run.time_s >= release_s + 2.0) & (run.time_s <= release_s + 3.0)
    assert np.array_equal(part.time_s, run.time_s[seen])
    np.testing.assert_array_equal(part.readings[0], run.table_reading[seen])
    coarse = open_decimated(path, 100, between_s=(2.0, 3.0), validator=validator)
    assert len(coarse.time_s) == pytest.approx(200, abs=40)
    assert coarse.time_s[0] == part.time_s[0]
