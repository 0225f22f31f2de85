import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.packets import MAX_BLOCK_ROWS
from drivers.pair.merging import MAX_WAITING, ChannelSamples, HostTimeFit, Merger
from drivers.samples import SampleStatus

DAMAGED, MISSING = int(SampleStatus.DAMAGED), int(SampleStatus.MISSING)
NS = 1_000_000_000
times = st.lists(st.integers(0, 3 * NS), min_size=1, max_size=40).map(sorted)


def readings(host_ns, counts=None, status=None) -> ChannelSamples:
    n = len(host_ns)
    return ChannelSamples(
        np.asarray(host_ns, np.int64),
        np.arange(n) if counts is None else np.asarray(counts),
        np.zeros(n, np.uint8) if status is None else np.asarray(status, np.uint8),
    )


@given(base_ns=times, other_ns=times, base=st.integers(0, 1))
def test_every_reading_gets_the_nearest_of_the_other_gauge(base_ns, other_ns, base):
    merger = Merger(base, other_period_s=10.0)
    merger.add(base, readings(base_ns, counts=base_ns))
    merger.add(1 - base, readings(other_ns, counts=other_ns))
    rows = merger.take(100 * NS)
    assert rows.counts[:, base].tolist() == base_ns
    nearest = [min(abs(one - other) for other in other_ns) for one in base_ns]
    assert np.abs(rows.counts[:, 1] - rows.counts[:, 0]).tolist() == nearest
    assert (rows.lag_ns == rows.counts[:, 1] - rows.counts[:, 0]).all()


def test_a_row_waits_for_a_reading_that_is_not_earlier_and_then_for_none():
    merger = Merger(0, other_period_s=0.1)
    merger.add(1, readings([0]))
    merger.add(0, readings([0, NS // 10]))
    assert len(merger.take(NS // 10)) == 1
    assert merger.take(NS // 10) is None
    assert not merger.is_overdue(NS * 35 // 100)
    assert merger.is_overdue(NS * 36 // 100)
    assert merger.take(NS * 36 // 100).status.tolist() == [SampleStatus.RELATIVE_MISSING]


@pytest.mark.parametrize(("period_s", "is_repeated"), [(0.05, False), (0.01, False), (0.0001, True)])
def test_a_reading_is_not_repeated_in_the_row_of_one_that_is_missing(period_s, is_repeated):
    """Only where a period is as short as the errors of the host's times."""
    period_ns = round(period_s * NS)
    merger = Merger(0, other_period_s=period_s)
    merger.add(1, readings([0, period_ns, 3 * period_ns], [1, 2, 4]))
    merger.add(0, readings([0, period_ns, 2 * period_ns, 3 * period_ns]))
    rows = merger.take(NS)
    assert rows.is_paired.tolist() == [True, True, is_repeated, True]


def test_flags_of_each_gauge():
    merger = Merger(0, other_period_s=0.1)
    clipped = int(SampleStatus.OVERLOAD_TABLE)
    at_ns = np.arange(6) * NS
    merger.add(0, readings(at_ns, [1, 0, 3, 0, 0, 6], [0, DAMAGED, clipped, MISSING, DAMAGED, 0]))
    merger.add(1, readings(at_ns, [7, 8, 9, 0, 0, 12], [clipped, 0, 0, DAMAGED, MISSING, DAMAGED]))
    rows = merger.take(10 * NS)
    assert rows.status.tolist() == [
        SampleStatus.OVERLOAD_RELATIVE,
        SampleStatus.TABLE_MISSING,
        SampleStatus.OVERLOAD_TABLE,
        MISSING,
        DAMAGED,
        SampleStatus.RELATIVE_MISSING,
    ]
    assert rows.counts.tolist() == [[1, 7], [0, 8], [3, 9], [0, 0], [0, 0], [6, 0]]
    assert rows.counts.dtype.kind == "i"
    assert rows.is_paired.tolist() == [True, False, True, False, False, False]


@pytest.mark.parametrize("gauge", [0, 1])
def test_claims_of_gaps_without_end_in_one_instant_are_not_all_kept(gauge):
    merger = Merger(0, other_period_s=0.01)
    laid = 0
    for _ in range(12):
        merger.add(gauge, readings(np.zeros(MAX_BLOCK_ROWS), status=np.full(MAX_BLOCK_ROWS, MISSING)))
        while (rows := merger.take(0)) is not None:
            laid += len(rows)
        assert merger.buffered <= MAX_WAITING
    assert laid == (0 if gauge else 12 * MAX_BLOCK_ROWS - MAX_WAITING)
    merger.add(gauge, readings([NS], [5]))
    merger.add(1 - gauge, readings([NS], [6]))
    while (rows := merger.take(NS)) is not None:
        last = rows
    assert sorted(last.counts[-1].tolist()) == [5, 6]


def late_line(line: HostTimeFit, start_s: float, seconds: float, rate: float, seed: int) -> None:
    """A reading each 10 ms, at least 2 ms late, one in ten up to 30 ms."""
    random = np.random.default_rng(seed)
    own_s = np.arange(start_s, start_s + seconds, 0.01)
    late_s = 2e-3 + 1e-3 * random.exponential(size=len(own_s))
    late_s += np.where(random.random(len(own_s)) < 0.1, 0.03 * random.random(len(own_s)), 0.0)
    arrival_s = np.maximum.accumulate(own_s * rate + late_s)
    for one_s, came_s in zip(own_s, arrival_s, strict=True):
        line.add(one_s, round(NS * came_s))


def test_time_is_told_by_the_punctual_reads():
    line = HostTimeFit()
    late_line(line, 0.0, 10.0, 1.0003, seed=5)
    own_s = np.array([9.0, 9.9])
    assert np.abs(line.host_ns(own_s) * 1e-9 - own_s * 1.0003 - 2e-3).max() < 3e-4
    assert 1e-5 < line.scatter_s < 3e-4


def test_what_is_older_than_some_seconds_has_no_say():
    line, fresh = HostTimeFit(), HostTimeFit()
    late_line(line, 0.0, 20.0, 1.01, seed=5)
    late_line(line, 20.0, 7.0, 1.01, seed=6)
    late_line(fresh, 20.0, 7.0, 1.01, seed=6)
    own_s = np.array([26.5])
    assert line.host_ns(own_s) == fresh.host_ns(own_s)


def test_after_a_break_the_device_may_count_anew():
    line = HostTimeFit()
    late_line(line, 0.0, 5.0, 1.0, seed=5)
    line.reset()
    line.add(0.0, 50 * NS)
    assert line.host_ns(np.array([0.0, 0.5])).tolist() == [50 * NS, 50 * NS + NS // 2]
