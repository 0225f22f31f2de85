import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pair_kit import EPOCH_NS, Device, decode, lags_s, pair_source, wire_of
from wire_helpers import cut_at, cuts, join

from drivers.envelope import wrap
from drivers.errors import ProtocolError, SettingsError
from drivers.pair.source import make_pair
from drivers.registry import find_driver
from drivers.samples import SampleStatus

ALIKE = (Device(phase_s=0.001), Device(phase_s=0.003))
UNLIKE = (
    Device(rate_hz=200.0, clock_ppm=80.0, jitter_s=3e-4),
    Device(rate_hz=330.0, clock_ppm=-50.0, phase_s=0.0007, jitter_s=3e-4),
)
SETTLING_ROWS = 200


@pytest.mark.parametrize("devices", [ALIKE, UNLIKE, UNLIKE[::-1]])
def test_each_row_has_the_nearest_reading_of_the_other_gauge(devices):
    source = pair_source(devices)
    rows = join(decode(source, [b"".join(wire_of(devices))]))
    slower_hz, quicker_hz = sorted(device.rate_hz for device in devices)
    assert source.rate_hz == slower_hz
    assert len(rows) == pytest.approx(20.0 * slower_hz, abs=10)
    assert not rows.status[SETTLING_ROWS:-3].any()
    lag_s = lags_s(rows)[SETTLING_ROWS:]
    assert np.abs(lag_s).max() < 0.5 / quicker_hz + 5e-4


def test_gauge_1_makes_the_rows_of_devices_about_as_quick():
    devices = (Device(rate_hz=100.0), Device(rate_hz=90.0))
    source = pair_source(devices)
    rows = join(decode(source, wire_of(devices)))
    assert source.rate_hz == 100.0
    np.testing.assert_array_equal(np.diff(rows.counts[5:1990, 0]), 10_000)


@pytest.fixture(scope="module")
def wire():
    return b"".join(wire_of(UNLIKE, duration_s=4.0))


@pytest.fixture(scope="module")
def whole(wire):
    return join(decode(pair_source(UNLIKE), [wire]))


@given(data=st.data())
@settings(max_examples=6, deadline=None)
def test_rows_do_not_depend_on_the_cuts(wire, whole, data):
    rows = join(decode(pair_source(UNLIKE), cut_at(wire, data.draw(cuts(wire)))))
    np.testing.assert_array_equal(rows.counts, whole.counts)
    np.testing.assert_array_equal(rows.status, whole.status)


def test_rubbish_between_envelopes_is_left_out_and_counted(whole):
    source = pair_source(UNLIKE)
    rows = join(decode(source, [b"\xa9rubbish" + envelope for envelope in wire_of(UNLIKE, duration_s=4.0)]))
    np.testing.assert_array_equal(rows.counts, whole.counts)
    # each device's first line is left out as well, since it may be the end of one
    assert source.losses.discarded_bytes >= 8 * len(wire_of(UNLIKE, duration_s=4.0))


@pytest.mark.parametrize("start_s", [1.0, 2.7])
def test_a_replay_that_begins_later_comes_to_the_same_rows(start_s):
    devices = tuple(
        Device(rate_hz, ppm, phase, latency_s=5e-4, jitter_s=1e-3, bursts=0.05)
        for rate_hz, ppm, phase in ((100.0, 60.0, 0.0), (104.0, -900.0, 0.004))
    )
    envelopes = wire_of(devices, duration_s=14.0)
    live = join(decode(pair_source(devices), envelopes))
    later = join(decode(pair_source(devices), envelopes[round(start_s * 204) :]))
    missing = len(live) - len(later)
    same = slice(round((start_s + 7.0) * 100), None)
    replayed = np.vstack([np.full((missing, 2), np.nan), later.counts])
    np.testing.assert_array_equal(replayed[same], live.counts[same])


def test_what_is_kept_is_bounded_while_one_device_is_silent():
    for gauge in (0, 1):
        source = pair_source()
        only = [piece for piece in wire_of(ALIKE, duration_s=25.0) if piece[4] == gauge]
        rows = decode(source, only)
        assert source._decoder.buffered <= 1002
        if gauge == 0:  # it makes the rows, and waits at first two seconds for the other one
            assert len(join(rows)) == pytest.approx(2300, abs=3)
            assert (join(rows).status == SampleStatus.RELATIVE_MISSING).all()
        else:
            assert rows == []


def test_only_the_reading_that_is_missing_is_marked():
    pieces = wire_of(ALIKE)
    silent = [
        piece for n, piece in enumerate(pieces) if not (800 < n < 1200 and piece[4] == 1)
    ]  # from 4 s to 6 s
    source = pair_source()
    rows = join(decode(source, silent))
    is_missing = rows.status == SampleStatus.RELATIVE_MISSING
    assert is_missing[402:596].all()
    assert not is_missing[1:397].any()
    assert not is_missing[603:].any()
    assert (rows.counts[is_missing, 1] == 0).all()
    np.testing.assert_array_equal(np.diff(rows.counts[5:1990, 0]), 10_000)
    assert source.losses.missing_estimated == np.count_nonzero(is_missing)


def test_readings_of_gauge_1_that_are_missing_are_marked_alone():
    pieces = wire_of(ALIKE)
    silent = [piece for n, piece in enumerate(pieces) if not (800 < n < 840 and piece[4] == 0)]
    rows = join(decode(pair_source(), silent))
    is_missing = rows.status == SampleStatus.TABLE_MISSING
    assert 18 <= np.count_nonzero(is_missing) <= 21
    assert len(rows) == pytest.approx(2000, abs=3)
    np.testing.assert_array_equal(np.diff(rows.counts[5:1990, 1]), 10_000)


def test_an_overload_is_that_of_its_own_gauge():
    source = pair_source(overload_count="1e9", **{"relative.overload_count": "10000000"})
    rows = join(decode(source, wire_of(ALIKE)))
    clipped = (rows.status & SampleStatus.OVERLOAD_RELATIVE) != 0
    np.testing.assert_array_equal(clipped, rows.counts[:, 1] >= 10_000_000)
    assert not (rows.status & SampleStatus.OVERLOAD_TABLE).any()
    assert source.losses.overloaded == np.count_nonzero(clipped) > 900


def test_a_lost_device_is_told_of_and_marked():
    pieces = wire_of(ALIKE)
    broken = wrap(1, EPOCH_NS + 4_000_000_000, b"")
    silent = [piece for n, piece in enumerate(pieces) if not (800 < n < 1000 and piece[4] == 1)]
    source = pair_source()
    decode(source, [*silent[:801], broken])
    assert list(map(str, source.take_warnings())) == [
        "the device of gauge 2 is lost and is looked for: the other gauge goes on"
    ]
    decode(source, silent[801:])
    (note,) = map(str, source.take_warnings())
    assert note.startswith("the device of gauge 2 was away and is back: 1.0")


def lines(places, leap_s: float = 0.0) -> list[bytes]:
    """Envelopes of two devices at 1 kHz that read at these milliseconds; gauge 1's clock is so far ahead."""
    leaps_s = (leap_s, 0.0)
    return [
        wrap(gauge, EPOCH_NS + k * 1_000_000 + 500_000, b"%d,%d\r\n" % (1000 * k + 1e6 * leaps_s[gauge], k))
        for k in places
        for gauge in (0, 1)
    ]


def test_rows_of_a_long_gap_come_in_pieces_and_few_are_held():
    source, blocks, held = pair_source((Device(1000.0), Device(1000.0))), [], []
    for piece in [*lines(range(2000)), *lines(range(300_000, 302_000))]:
        for block in source.decode(piece, 0):
            blocks.append(block)
            held.append(source._decoder.buffered)
    assert max(map(len, blocks)) == 65_536
    assert max(held) < 2 * 65_536
    rows = join(blocks)
    assert len(rows) == pytest.approx(302_000, abs=300)
    assert np.count_nonzero(rows.status) == pytest.approx(298_000, abs=300)


def test_a_clock_that_leaps_ahead_neither_holds_rows_up_nor_pairs_them_wrong():
    source = pair_source((Device(1000.0), Device(1000.0)))
    rows = join(decode(source, [*lines(range(2000)), *lines(range(2000, 3000), leap_s=100.0)]))
    both = rows.status == 0
    assert (rows.counts[-1] == 2999).all()
    assert np.abs(rows.counts[both, 1] - rows.counts[both, 0]).max() <= 2


def test_damaged_first_lines_do_not_contradict_the_rate():
    """Of each second of the first 600 lines of gauge 1 the last digit of the time is gone."""
    pieces = lines(range(4000))
    for k in range(1, 600, 2):
        pieces[2 * k] = wrap(0, EPOCH_NS + k * 1_000_000 + 500_000, b"%d,0\r\n" % (100 * k))
    rows = join(decode(pair_source((Device(1000.0), Device(1000.0))), pieces))
    assert (rows.counts[-1] > 3900).all()


def test_what_cannot_be_a_pair():
    with pytest.raises(SettingsError, match="both gauges on one port"):
        make_pair(find_driver("harp"), {}, None)
    with pytest.raises(SettingsError, match="have no value"):
        make_pair(find_driver("csv"), {"columns": "time_us,table,relative"}, None)
    with pytest.raises(SettingsError, match=r"relative\.rate 'fast' is no number"):
        make_pair(find_driver("csv"), {"relative.rate": "fast"}, None)
    with pytest.raises(ProtocolError, match="not known: start them"):
        list(make_pair(find_driver("csv"), {}, None).decode(b"x", 0))
