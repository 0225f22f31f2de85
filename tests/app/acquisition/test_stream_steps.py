"""Averaging, detection of rest, calibration and history between decoder and state machine."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.acquisition.pullback.averages import (
    BinAverager,
    SlidingWindow,
    fit_parabola_start,
    noise_m,
    stationary_level,
)
from app.acquisition.stream.live_stream import DecodedRead, ReadHistory
from app.runs.blocks import calibrate
from config.files import load_gauges
from drivers.samples import Losses, SampleBlock, SampleStatus


@given(
    rate_hz=st.sampled_from([100.0, 500.0, 1000.0, 1700.0, 3000.0]),
    first=st.integers(0, 50),
    cuts=st.lists(st.integers(0, 40), min_size=1, max_size=20),
    lost=st.floats(0.0, 0.9),
    seed=st.integers(0, 9),
)
def test_bins_are_the_means_of_their_samples_however_these_come(rate_hz, first, cuts, lost, seed):
    random = np.random.default_rng(seed)
    table, relative = random.normal(size=(2, sum(cuts)))
    table[random.random(len(table)) < lost] = np.nan
    relative[random.random(len(table)) < lost] = np.nan
    binning, n = BinAverager(rate_hz), max(1, round(rate_hz * 0.002))
    found, start = [], 0
    for cut in cuts:
        bins = binning.add(first + start, table[start : start + cut], relative[start : start + cut])
        found += zip(bins.center, bins.table_m, bins.relative_m, strict=True)
        start += cut
    expected = []
    for number in range(first // n, (first + len(table)) // n):
        part = slice(max(0, number * n - first), (number + 1) * n - first)
        if np.isfinite(table[part]).any():
            seen = relative[part][np.isfinite(relative[part])]
            mean = seen.mean() if len(seen) else np.nan
            expected.append((number * n + (n - 1) / 2, np.nanmean(table[part]), mean))
    np.testing.assert_allclose(np.array(found).reshape(-1, 3), np.array(expected).reshape(-1, 3), atol=1e-12)


def test_noise_is_measured_through_slow_motion_and_jumps():
    random = np.random.default_rng(1)
    n = 20_000
    noise = 20e-6 * random.standard_normal(n)
    moving = noise + 1e-3 * np.sin(np.arange(n) / 500) + 5e-3 * (np.arange(n) > 7000)
    # The median of |differences| of n normal values is uncertain by about 1.2 / sqrt(n).
    assert noise_m(moving) == pytest.approx(20e-6, rel=5 * 1.2 / np.sqrt(n))
    assert noise_m(np.full(100, 3e-3)) > 0.0


def test_a_stretch_forgets_and_finds():
    stretch, index = SlidingWindow(10.0, spacing=1.0), np.arange(1000.0)
    for start, end in itertools.pairwise([0, *range(1, 500), 502, 509, 520, 533, 633, 640, 1000]):
        stretch.add(index[start:end], index[start:end] * 2.0)
        assert stretch.latest(10.0)[-1].tolist() == [end - 1, (end - 1) * 2.0]
        np.testing.assert_array_equal(stretch.latest(10.0)[:, 0], index[max(0, end - 11) : end])
    np.testing.assert_array_equal(stretch.latest(4.0)[:, 0], [995, 996, 997, 998, 999])
    np.testing.assert_array_equal(stretch.between(992.5, 994)[:, 1], [1986, 1988])
    assert len(SlidingWindow(10.0, 1.0).latest(5.0)) == 0


def test_still_is_what_does_not_move_more_than_its_noise():
    random = np.random.default_rng(2)
    index = np.arange(100.0)
    still = np.column_stack([index, 5e-3 + 20e-6 * random.standard_normal(100)])
    level = stationary_level(still, 99.0, 0.0)
    assert level.mean_m == pytest.approx(5e-3, abs=10e-6)
    assert level.since == 0.0
    assert stationary_level(still, 200.0, 0.0) is None  # not long enough
    moving = still + np.column_stack([0 * index, 1e-6 * index])
    assert stationary_level(moving, 99.0, 0.0) is None
    assert stationary_level(moving, 99.0, 100e-6) is not None


@given(start=st.floats(2.0, 12.0), growth=st.floats(1e-6, 1e-3))
def test_the_beginning_of_a_parabola_is_found(start, growth):
    index = np.arange(20.0)
    distance = growth * np.maximum(index - start, 0.0) ** 2
    assert fit_parabola_start(np.column_stack([index, distance])) == pytest.approx(start, abs=0.2)


def test_of_one_reading_of_a_fall_nothing_more_is_known():
    """As where a polled device lost those around it."""
    assert fit_parabola_start(np.array([[7.0, -1e-3]])) == 7.0


def block(counts, status=None, first_index=0):
    counts = np.asarray(counts, dtype=np.int32)
    if status is None:
        status = np.zeros(len(counts), dtype=np.uint8)
    return SampleBlock(first_index, counts, np.asarray(status, dtype=np.uint8), arrival_ns=0)


def test_calibration_takes_counts_to_metres_and_absent_rows_to_nan():
    gauges = load_gauges()
    status = [0, SampleStatus.MISSING, SampleStatus.DAMAGED, SampleStatus.OVERLOAD_TABLE]
    rows = calibrate(block([(12000 + 500_000, -8000 - 1000)] * 4, status), gauges)
    np.testing.assert_allclose(rows.readings[0], (1e-3, -4e-6))
    np.testing.assert_array_equal(np.isnan(rows.readings).all(axis=1), [False, True, True, False])
    np.testing.assert_array_equal(rows.relative_m, rows.readings[:, 1])
    plate = gauges.replace(relative=gauges.relative.replace(measures="plate"))
    np.testing.assert_allclose(calibrate(block([(512_000, -9000)]), plate).relative_m, [-4e-6 - 1e-3])


@given(
    first=st.integers(0, 20), count=st.integers(0, 20), start=st.integers(-5, 50), length=st.integers(-5, 50)
)
def test_rows_are_cut_by_index(first, count, start, length):
    index = np.arange(first, first + count)
    cut = calibrate(block(np.column_stack([index, index]), first_index=first), load_gauges())
    cut = cut.between(start, start + length)
    expected = [k for k in range(first, first + count) if start <= k < start + length]
    np.testing.assert_array_equal(cut.counts[:, 0], expected)
    assert len(cut) == 0 or (cut.first_index, cut.end_index) == (expected[0], expected[-1] + 1)


def test_history_keeps_what_a_pretrigger_needs_and_no_more():
    history = ReadHistory(100)
    gauges = load_gauges()
    assert (history.first_index, history.next_index) == (0, 0)
    for first in range(0, 1000, 7):
        rows = calibrate(block(np.zeros((7, 2)), first_index=first), gauges)
        history.add(DecodedRead(b"", 0, (rows,), Losses()))
        history.add(DecodedRead(b"rest of a frame", 0, (), Losses()))
        assert history.next_index == first + 7
        assert history.first_index <= max(0, first + 7 - 100)
    assert history.next_index - history.first_index < 100 + 7
    assert sum(1 for _ in history.reads()) < 2 * (100 / 7 + 2)
    chosen = list(history.reads(990))
    assert chosen[0].rows[0].first_index <= 990 < chosen[0].rows[0].end_index


def test_losses_of_one_read_are_the_difference():
    assert Losses(samples=10, missing=3) - Losses(samples=4, missing=1) == Losses(samples=6, missing=2)
