import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.dataq.codec import (
    FOLLOWING,
    PLAIN,
    WITH_DIGITAL,
    ScanDecoder,
    encode_scans,
    find_layout,
    header,
    layout_in_header,
)
from drivers.samples import Losses, SampleStatus

RATE_HZ = 1000.0
LAYOUTS = pytest.mark.parametrize("layout", [PLAIN, WITH_DIGITAL], ids=["plain", "with-digital"])
MISSING, DAMAGED = SampleStatus.MISSING, SampleStatus.DAMAGED


def readings(samples: int, first: int = 0) -> np.ndarray:
    """Of 12 bits, so that all models can send them."""
    index = first + np.arange(samples)
    return np.stack([16 * (index % 900) - 3200, 6400 - 16 * (index % 700)], axis=1)


def scans(samples: int, layout=WITH_DIGITAL, first: int = 0) -> bytes:
    return encode_scans(layout, readings(samples, first), 12).tobytes()


def decode(pieces, layout=WITH_DIGITAL):
    decoder = ScanDecoder(layout, RATE_HZ)
    return join([block for piece in pieces for block in decoder.feed(piece, 0)]), decoder


def words(*values: int) -> bytes:
    return b"".join(value.to_bytes(2, "little") for value in values)


@pytest.mark.parametrize(
    ("layout", "word", "volts"),
    [  # DATAQ, Command Protocol, 1 August 2019, pages 61, 63, 66, 68; the DI-1100's with its inputs at 3
        (PLAIN, 0b0111_1111_1111_0011, 9.995),
        (PLAIN, 0b0000_0000_0001_0011, 0.0048),
        (PLAIN, 0b1111_1111_1111_0011, -0.0048),
        (PLAIN, 0b1000_0000_0000_0011, -10.0),
        (WITH_DIGITAL, 0b0111_1111_1110_0000, 9.990),
        (WITH_DIGITAL, 0b0111_1111_1111_1100, 9.9988),
        (WITH_DIGITAL, 0b0111_1111_1111_1110, 9.9994),
        (WITH_DIGITAL, 0b1111_1111_1111_1111, -0.0003),
        (WITH_DIGITAL, 0b1000_0000_0000_0000, -10.0),
    ],
)
def test_words_of_the_manual_are_its_volts(layout, word, volts):
    scan = words(word, 0x0010) if layout is PLAIN else words(word, 0x0010, 0x7F00)
    block, _ = decode([scan * (FOLLOWING + 1)], layout)
    assert block.counts[0, 0] * 10 / 32768 == pytest.approx(volts, abs=6e-4)
    assert block.counts[0, 1] == 16


@LAYOUTS
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [3, 12, 13, 50, 71])]
)
def test_whole_scans_in_any_cut(layout, pieces):
    block, decoder = decode(pieces(scans(12 + FOLLOWING, layout)), layout)
    np.testing.assert_array_equal(block.counts, readings(12))
    assert block.counts.dtype == np.int32
    assert block.device_time_s is None
    assert not block.status.any()
    assert decoder.losses == Losses(samples=12)
    assert decoder.unfinished_bytes == FOLLOWING * layout.length


@LAYOUTS
@pytest.mark.parametrize("lost", [1, 2, 3, 5, 7, 22])
@pytest.mark.parametrize("at", [100, 101, 103])
def test_lost_bytes_put_no_reading_into_the_wrong_gauge(layout, lost, at):
    at *= layout.length
    data = scans(300, layout)
    block, decoder = decode([data[: at + 1] + data[at + 1 + lost :]], layout)
    good = block.counts[block.status == 0]
    sent = set(map(tuple, readings(300).tolist()))
    assert all(row in sent for row in map(tuple, good.tolist()))
    assert len(good) >= 300 - FOLLOWING - (FOLLOWING + 3 + lost // layout.length)
    assert 0 < decoder.losses.damaged <= FOLLOWING + 3
    assert np.count_nonzero(block.status & DAMAGED) == decoder.losses.damaged


def test_a_gauge_at_rest_at_zero_is_not_taken_for_the_digital_inputs():
    """After a lost byte the inputs that were seen before show where a scan begins."""
    rest = encode_scans(WITH_DIGITAL, np.zeros((400, 2))).tobytes()
    moving = encode_scans(WITH_DIGITAL, np.tile([[500, -700]], (20, 1))).tobytes()
    block, _ = decode([moving + rest[:601] + rest[604:] + moving])
    assert (block.counts[block.status == 0][-10:] == [500, -700]).all()


def test_a_digital_input_may_change():
    open_inputs, one_low = words(160, 320, 0x7F00), words(160, 320, 0x7E01)
    block, decoder = decode([open_inputs * 20 + one_low * 20 + open_inputs * 20])
    assert decoder.losses == Losses(samples=60 - FOLLOWING)
    assert (block.counts == [160, 320]).all()


def test_after_a_second_without_a_scan_other_inputs_are_believed():
    two_low = words(160, 320, 0x7C03)
    block, _ = decode([words(160, 320, 0x7F00) * 20 + b"\xff" * 5000 + two_low * 20])
    assert np.count_nonzero(block.status == 0) >= 36 - FOLLOWING


def test_full_scale_is_overload_of_its_gauge():
    counts = np.array([[32752, 0], [0, -32768], [32767, -32752], [32751, 0]] + [[0, 0]] * FOLLOWING)
    block, decoder = decode([encode_scans(WITH_DIGITAL, counts).tobytes()])
    table, relative = SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE
    assert block.status.tolist() == [table, relative, table | relative, 0]
    assert decoder.losses.overloaded == 3


@LAYOUTS
@given(st.binary(max_size=80), st.data())
@settings(deadline=None)
def test_any_cut_gives_the_same(layout, garbage, data):
    stream = header("1100") + scans(9, layout) + garbage + scans(9, layout) + b"stop 01" + scans(9, layout)
    whole, all_at_once = decode([stream], layout)
    block, decoder = decode(cut_at(stream, data.draw(cuts(stream))), layout)
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert decoder.losses == all_at_once.losses


def test_an_overflow_leaves_rows_for_the_time_until_the_next_scan():
    decoder = ScanDecoder(WITH_DIGITAL, RATE_HZ)
    first = list(decoder.feed(header("2108") + scans(50) + b"stop 01", 1_000_000_000))
    assert sum(map(len, first)) == 50 - FOLLOWING
    later = list(decoder.feed(header("2108") + scans(50, first=200), 1_200_000_000))
    block = join([*first, *later])
    assert np.count_nonzero(block.status & MISSING) == 200 - (50 - FOLLOWING)
    np.testing.assert_array_equal(block.counts[block.status == 0][-1], readings(50, 200)[-1 - FOLLOWING])
    assert (decoder.losses.restarts, decoder.losses.damaged) == (1, 0)
    assert decoder.losses.missing_estimated == 200 - (50 - FOLLOWING)
    (warning,) = decoder.take_warnings()
    assert "ran out of room" in str(warning)
    assert decoder.take_warnings() == []


def test_a_broken_connection_leaves_rows_for_its_time():
    decoder = ScanDecoder(PLAIN, RATE_HZ)
    first = list(decoder.feed(scans(50, PLAIN), 1_000_000_000))
    decoder.expect_restart()
    later = list(decoder.feed(header("1100") + scans(50, PLAIN), 1_500_000_000))
    block = join([*first, *later])
    assert np.count_nonzero(block.status & MISSING) == 500 - (50 - FOLLOWING)
    assert decoder.losses.restarts == 1


def test_scans_that_never_came_are_estimated_from_the_clock():
    decoder = ScanDecoder(WITH_DIGITAL, RATE_HZ)
    for k in range(60):  # each read brings 80 of 100 scans
        list(decoder.feed(scans(80, first=80 * k), k * 100_000_000))
    assert 59 * 20 - 2 * 200 <= decoder.losses.missing_estimated <= 59 * 20  # two windows of a second late
    assert decoder.losses.missing == decoder.losses.damaged == 0


@pytest.mark.parametrize(
    ("data", "layout"),
    [
        (scans(200)[5:], WITH_DIGITAL),
        (scans(200, PLAIN)[3:], PLAIN),
        (bytes(2000), None),
        (b"12.5,13.5\r\n" * 100, None),
        (b"", None),
    ],
)
def test_the_layout_is_known_by_its_fixed_bits(data, layout):
    assert find_layout(data) is layout


def test_the_header_tells_the_layout():
    assert layout_in_header(header("1100") + b"\0") is PLAIN
    assert layout_in_header(header("4208")) is WITH_DIGITAL
    assert layout_in_header(b"info 1 2008\r") is None
