"""The decimated live history draws the extremes of its rows, for any span, pixels and cuts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.presenters.decimated_history import DecimatedHistory

CAPACITY = 4096


def filled(values: np.ndarray, cut: int, capacity: int = CAPACITY) -> DecimatedHistory:
    """A history of rows 1 ms apart, appended in blocks of `cut` rows."""
    history = DecimatedHistory(capacity)
    time_s = np.arange(len(values)) * 1e-3
    for start in range(0, len(values), cut):
        history.append(time_s[start : start + cut], values[start : start + cut])
    return history


@given(
    rows=st.integers(1, 3000),
    cut=st.integers(1, 700),
    pixels=st.integers(32, 400),
    window=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=60, deadline=None)
def test_no_peak_is_lost_and_none_invented(
    rows: int, cut: int, pixels: int, window: tuple[float, float], seed: int
) -> None:
    values = np.random.default_rng(seed).normal(size=(rows, 2)).astype(np.float32)
    history = filled(values, cut)
    first, last = sorted(int(w * rows) for w in window)
    time_s = np.arange(rows) * 1e-3
    lines = history.lines(first * 1e-3 - 1e-6, last * 1e-3 - 1e-6, pixels)
    for channel, line in enumerate(lines):
        shown = values[first:last, channel]
        assert len(line.value) == len(line.time_s) <= 4 * pixels + 4
        assert np.all(np.diff(line.time_s) >= 0.0)
        if last - first:
            # The first span may begin before the window, by less than its own length.
            reach = max(1, (last - first) // pixels)
            around = values[max(0, first - reach) : last, channel]
            assert shown.max() <= line.value.max() <= around.max()
            assert around.min() <= line.value.min() <= shown.min()
            assert line.time_s[-1] <= time_s[last - 1]


def test_each_point_stands_at_its_place() -> None:
    values = np.zeros((2048, 2))
    values[1234] = (5.0, -7.0)
    table, relative = filled(values, 100).lines(0.0, 2.048, 200)
    assert table.time_s[table.value.argmax()] == pytest.approx(1.234, abs=0.008)
    assert relative.value.min() == -7.0


def test_rows_as_few_as_pixels_are_drawn_as_they_are() -> None:
    values = np.random.default_rng(1).normal(size=(100, 2)).astype(np.float32)
    table, relative = filled(values, 7).lines(0.0, 1.0, 100)
    np.testing.assert_array_equal(table.value, values[:, 0])
    np.testing.assert_array_equal(relative.value, values[:, 1])


def test_the_newest_row_is_drawn_at_once() -> None:
    values = np.zeros((1999, 2))
    values[-1] = 3.0
    table, _ = filled(values, 50).lines(0.0, 3.0, 100)
    assert table.value[-1] == 3.0


def test_absent_rows_break_the_line_only_where_nothing_came() -> None:
    values = np.ones((1000, 2))
    values[500:520] = np.nan
    values[700, 0] = np.nan
    table, relative = filled(values, 64).lines(0.0, 1.0, 1000)
    assert np.isnan(table.value).sum() == 21
    assert relative.has_gaps
    coarse, _ = filled(values, 64).lines(0.0, 1.0, 250)
    assert 8 <= np.isnan(coarse.value).sum() <= 12  # whole spans of 4 rows within the 20, two points each


@given(seed=st.integers(0, 2**32 - 1), pixels=st.integers(100, 1000), start=st.floats(0.0, 0.9))
@settings(max_examples=15, deadline=None)
def test_a_long_run_is_drawn_whole_though_its_first_rows_are_forgotten(seed, pixels, start) -> None:
    count = 40 * CAPACITY + 123
    values = np.random.default_rng(seed).normal(size=(count, 2)).astype(np.float32)
    history = filled(values, 5000)
    assert len(history) <= CAPACITY
    first = int(start * count)
    for channel, line in enumerate(history.lines(first * 1e-3, count * 1e-3, pixels)):
        shown, before = values[first:, channel], max(0, first - count // pixels - 1)
        assert shown.max() <= line.value.max() <= values[before:, channel].max()
        assert values[before:, channel].min() <= line.value.min() <= shown.min()
        assert 2 * min(pixels, CAPACITY // 4) * 0.9 <= len(line.value) <= 4 * pixels + 60


def test_a_full_history_forgets_its_older_half_and_goes_on() -> None:
    count = 3 * CAPACITY + 17
    values = np.stack((np.arange(count), -np.arange(count)), axis=1).astype(float)
    history = filled(values, 333)
    assert CAPACITY // 2 <= len(history) <= CAPACITY
    assert history.end_s == pytest.approx((count - 1) * 1e-3)
    table, relative = history.lines(history.end_s - 1.0, history.end_s + 1.0, 50)
    assert table.value[-1] == count - 1
    assert relative.value[-1] == -(count - 1)
    assert table.value.min() >= count - 1 - 1000 - 32


def test_a_block_longer_than_the_history_leaves_its_end() -> None:
    values = np.tile(np.arange(3.0 * CAPACITY)[:, None], (1, 2))
    history = filled(values, len(values))
    table, _ = history.lines(0.0, 1e9, 10)
    assert table.value.max() == 3 * CAPACITY - 1


def test_means_leave_out_absent_rows() -> None:
    values = np.array([[1.0, -4.0], [np.nan, np.nan], [3.0, 2.0]])
    history = filled(values, 3)
    np.testing.assert_allclose(history.mean(0.0, 1.0), (2.0, -1.0))
    assert np.isnan(history.mean(5.0, 6.0)).all()


def test_a_cleared_history_takes_a_new_clock() -> None:
    history = filled(np.ones((3000, 2)), 500)
    history.clear()
    assert len(history) == 0
    assert np.isnan(history.end_s)
    history.append(np.array([0.0, 1.0]), np.array([[1.0, 2.0], [3.0, 4.0]]))
    np.testing.assert_array_equal(history.lines(-1.0, 2.0, 10)[1].value, (2.0, 4.0))


def test_a_line_says_whether_it_is_condensed_and_how_much_ink_it_takes() -> None:
    values = np.tile([[-1.0, 0.0], [1.0, 0.0]], (1000, 1))
    history = filled(values, 100)
    whole, flat = history.lines(0.0, 2.0, 100)
    assert whole.is_min_max
    assert whole.strokes(2.0) == pytest.approx(len(whole.value), rel=0.1)
    assert flat.strokes(2.0) == 0.0
    assert not history.lines(0.0, 0.05, 100)[0].is_min_max
