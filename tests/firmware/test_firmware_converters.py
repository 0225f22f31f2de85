"""The converters' own code, on chips that are simulated bit by bit from their data sheets (`simulator/`).

Whatever a data sheet forbids (times too short, a command at the wrong moment) makes `running` fail.
"""

import numpy as np
import pytest
from board_kit import listening, running

from drivers.samples import Losses, SampleStatus

HIGHEST, LOWEST = 2**23 - 1, -(2**23)
COUNT = 64


def readings():
    """Numbers that differ from each other, in each channel; three are at an end of the range."""
    index = np.arange(COUNT)
    table, relative = 260_003 * index - 8_000_000, 7_777_777 - 190_001 * index
    table[7], relative[13] = HIGHEST, LOWEST
    table[40], relative[40] = LOWEST, HIGHEST
    return np.column_stack([table, relative])


def overloads(counts):
    ends = np.isin(counts, (HIGHEST, LOWEST))
    flags = np.array([SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE], dtype=np.uint8)
    return (ends * flags).sum(axis=1)


def places(values, among):
    """Where each of `values` stands `among` numbers that differ."""
    order = np.argsort(among)
    found = order[np.searchsorted(among, values, sorter=order)]
    np.testing.assert_array_equal(among[found], values)
    return found


def test_two_hx711_are_read_bit_by_bit_and_paired(workshop):
    given = readings()
    with (
        running(workshop, workshop.firmware("hx711"), "hx711", given) as board,
        listening(board, 80) as listener,
    ):
        assert listener.source.identity.firmware == "1.0.0+hx711"
        listener.listen(115)
    np.testing.assert_array_equal(listener.counts[0], given[0])  # switched on together
    steps = [np.diff(places(listener.counts[:, gauge], given[:, gauge])) % COUNT for gauge in (0, 1)]
    assert set(steps[1]) == {1}  # the slower chip sets the pace
    assert set(steps[0]) == {1, 2}  # and the faster one, by 2 %, is a reading ahead every now and then
    assert np.count_nonzero(steps[0] == 2) == 2
    np.testing.assert_array_equal(listener.status, overloads(listener.counts))
    assert np.count_nonzero(listener.status) >= 3
    np.testing.assert_allclose(np.diff(listener.times_s), 1.02 / 80, rtol=0.001)


@pytest.mark.parametrize(
    ("converter", "rate_hz", "samples_per_frame"),
    [
        ("ads1256", 100, 1),
        ("ads1256", 1000, 5),
        ("ads1256", 1020, 5),
        ("ads131m02", 1000, 5),
        ("ads131m02", 4000, 20),
    ],
)
def test_a_converter_of_both_gauges_is_read(workshop, converter, rate_hz, samples_per_frame):
    given = readings()
    with (
        running(workshop, workshop.firmware(converter), converter, given) as board,
        listening(board, rate_hz) as listener,
    ):
        assert listener.source.identity.firmware == f"1.0.0+{converter}"
        listener.listen(max(2 * COUNT, 10 * samples_per_frame))
    expected = np.resize(given, listener.counts.shape)
    np.testing.assert_array_equal(listener.counts, expected)
    of_frame = np.bitwise_or.reduceat(
        overloads(expected), np.arange(0, len(expected), samples_per_frame)
    ).repeat(samples_per_frame)
    np.testing.assert_array_equal(listener.status, of_frame)
    overloaded = np.count_nonzero(of_frame)
    assert overloaded >= 6 * samples_per_frame
    assert listener.source.losses == Losses(samples=len(expected), overloaded=overloaded)


def test_the_two_conversions_of_an_ads1256_begin_half_a_period_apart(workshop):
    with (
        running(workshop, workshop.firmware("ads1256"), "ads1256") as board,
        listening(board, 500) as listener,
    ):
        listener.listen(200)
    table_us, relative_us = listener.counts.T
    np.testing.assert_allclose(relative_us - table_us, 1000, rtol=0, atol=25)
    assert (relative_us - table_us).mean() == pytest.approx(1000, abs=10)
    told_us = listener.times_s * 1e6
    np.testing.assert_allclose(table_us - table_us[0], told_us, rtol=0, atol=25)


def test_a_rate_too_fast_for_the_chip_is_refused(workshop):
    firmware = workshop.firmware("ads1256")
    with running(workshop, firmware, "ads1256") as board, listening(board, 1000):
        pass
    with (
        running(workshop, firmware, "ads1256") as board,
        pytest.raises(Exception, match="does not take 1021 Hz and stays at 1000 Hz"),
        listening(board, 1021),
    ):
        pass


def test_an_ads131m02_converts_both_inputs_at_once(workshop):
    with (
        running(workshop, workshop.firmware("ads131m02"), "ads131m02") as board,
        listening(board, 2000) as listener,
    ):
        listener.listen(400)
        assert listener.source.filters[0].order == 3
    table_us, relative_us = listener.counts.T
    np.testing.assert_array_equal(relative_us, table_us)
    np.testing.assert_allclose(np.diff(table_us), 500, atol=1)
    told_us = listener.times_s * 1e6
    np.testing.assert_allclose(table_us - table_us[0], told_us, rtol=0, atol=25)


@pytest.mark.parametrize(("fault", "lost"), [("noisy", {1}), ("hasty", {2, 3})])
def test_readings_of_an_ads131m02_that_came_damaged_or_too_fast_are_left_out_and_counted(
    workshop, fault, lost
):
    given = readings()
    with (
        running(workshop, workshop.firmware("ads131m02"), f"ads131m02-{fault}", given) as board,
        listening(board, 1000) as listener,
    ):
        listener.listen(5 * COUNT)
    is_missing = (listener.status & SampleStatus.MISSING) != 0
    expected = np.resize(given, listener.counts.shape)
    np.testing.assert_array_equal(listener.counts[~is_missing], expected[~is_missing])
    first, last = np.flatnonzero(np.diff(is_missing.astype(int), prepend=0, append=0)).reshape(-1, 2).T
    assert len(first) >= 5
    assert set(last - first) <= lost
    assert listener.source.losses.missing == np.count_nonzero(is_missing)


def test_an_ads131m02_has_rates_of_its_own(workshop):
    with (
        running(workshop, workshop.firmware("ads131m02"), "ads131m02") as board,
        pytest.raises(Exception, match="does not take 500 Hz and stays at 1000 Hz"),
        listening(board, 500),
    ):
        pass
