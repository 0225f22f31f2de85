"""Parts of a finished line as they are drawn, held against all its rows."""

import numpy as np
import pytest

from app.presenters.decimated_line import DecimatedLine

RATE_HZ = 2000.0
RANDOM = np.random.default_rng(5)
TIME_S = np.cumsum(RANDOM.uniform(0.2e-3, 0.8e-3, 300_001))
VALUES = RANDOM.normal(size=len(TIME_S))
VALUES[RANDOM.random(len(VALUES)) < 0.2] = np.nan
VALUES[1000:9000] = np.nan


@pytest.mark.parametrize("pixels", [64, 1000, 1919])
@pytest.mark.parametrize(("start_s", "end_s"), [(-5.0, 500.0), (0.0, 150.0), (3.3, 99.9), (40.0, 47.0)])
def test_each_span_has_its_extremes(start_s: float, end_s: float, pixels: int) -> None:
    line = DecimatedLine(TIME_S, VALUES).part(start_s, end_s, pixels)
    assert line.is_min_max
    starts = np.searchsorted(TIME_S, line.time_s[::2])
    (per_span,) = set(np.diff(starts))
    rows = np.count_nonzero((start_s <= TIME_S) & (end_s >= TIME_S))
    assert rows / (2.1 * pixels) < per_span <= rows / pixels + 1
    assert starts[0] % per_span == 0, "spans begin at the same rows wherever the part begins"
    last = min(starts[-1] + per_span, len(VALUES))
    padded = np.append(VALUES[starts[0] : last], np.full(per_span * len(starts) - (last - starts[0]), np.nan))
    spans = padded.reshape(-1, per_span)
    np.testing.assert_array_equal(line.value[::2], np.fmin.reduce(spans, axis=1))
    np.testing.assert_array_equal(line.value[1::2], np.fmax.reduce(spans, axis=1))


def test_all_rows_are_there_where_they_have_room_and_one_beyond_each_end() -> None:
    line = DecimatedLine(TIME_S, VALUES).part(10.0, 10.5, 1000)
    first, end = np.searchsorted(TIME_S, (10.0, 10.5))
    np.testing.assert_array_equal(line.time_s, TIME_S[first - 1 : end + 1])
    np.testing.assert_array_equal(line.value, VALUES[first - 1 : end + 1])


@pytest.mark.parametrize(("start_s", "end_s"), [(-9.0, -5.0), (900.0, 901.0)])
def test_beside_the_line_its_end_is_left(start_s: float, end_s: float) -> None:
    assert len(DecimatedLine(TIME_S, VALUES).part(start_s, end_s, 800).time_s) <= 1


def test_a_thinned_line_has_every_nth_row() -> None:
    line = DecimatedLine(TIME_S, VALUES).thinned(0.0, 150.0, 1000)
    at = np.searchsorted(TIME_S, line.time_s)
    assert len(set(np.diff(at))) == 1
    assert 1000 <= len(at) <= 2100
    np.testing.assert_array_equal(line.value, VALUES[at])
