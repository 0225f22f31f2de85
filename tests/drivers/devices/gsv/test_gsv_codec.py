import numpy as np
import pytest
from gsv_kit import RATE_HZ, TWO, decode, frames, readings
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.gsv.codec import (
    MAX_FRAME_BYTES,
    FrameDecoder,
    FrameLayout,
    ValueKind,
    encode_frames,
    find_layout,
)
from drivers.errors import ProtocolError
from drivers.samples import Losses, SampleStatus

GOOD, MISSING, DAMAGED = SampleStatus.GOOD, SampleStatus.MISSING, SampleStatus.DAMAGED
BOTH = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
LAYOUTS = [
    TWO,
    FrameLayout(8, table=3, relative=1),
    FrameLayout(16, table=16, relative=2),
    FrameLayout(2, ValueKind.INT24),
    FrameLayout(6, ValueKind.INT24, table=6, relative=5),
]


# --- whole ------------------------------------------------------------------------------------


def test_frames_as_they_are_written():
    assert encode_frames(TWO, np.array([[1.0, -2.0]])).tobytes().hex(" ") == (
        "aa 11 b0 3f 80 00 00 c0 00 00 00 85"
    )
    short = FrameLayout(3, ValueKind.INT16, table=3, relative=1)
    assert (
        encode_frames(short, np.array([[1, -32768]]), 1).tobytes().hex(" ") == "aa 12 91 00 00 80 00 80 01 85"
    )
    assert encode_frames(FrameLayout(2, ValueKind.INT24), np.array([[0, -1]]), 2).tobytes().hex(" ") == (
        "aa 11 a2 80 00 00 7f ff ff 85"
    )


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [3, 12, 13, 50, 71])]
)
def test_whole_frames_in_any_cut(layout, pieces):
    """The last frame is given once the next one has begun."""
    block, decoder = decode(pieces(b"".join(frames(12, layout))), layout)
    np.testing.assert_array_equal(block.counts, readings(11))
    assert block.counts.dtype == np.float64
    assert block.device_time_s is None
    assert not block.status.any()
    assert decoder.losses == Losses(samples=11)
    assert decoder.unfinished_bytes == layout.length


def test_sixteen_bits():
    layout = FrameLayout(2, ValueKind.INT16)
    counts = np.array([[-32768, 32767], [0, -1], [0, 0]])
    block, _ = decode([encode_frames(layout, counts).tobytes()], layout)
    assert block.counts.tolist() == counts[:2].tolist()


def test_values_that_hold_what_begins_and_ends_a_frame():
    hard = np.frombuffer(bytes.fromhex("aa11b085 8585aa11 85aa11b0 aaaaaaaa"), dtype=">f4").astype(float)
    counts = np.concatenate([hard.reshape(2, 2)] * 20)
    data = encode_frames(TWO, counts).tobytes()
    block, decoder = decode(single_bytes(data))
    np.testing.assert_array_equal(block.counts, counts[:-1])
    assert decoder.losses.discarded_bytes == 0


@given(st.binary(max_size=80), st.data())
@settings(deadline=None)
def test_any_cut_gives_the_same(rubbish, data):
    wire = b"".join([*frames(5), rubbish, *frames(5, first=5)])
    whole, decoder = decode([wire])
    block, other = decode(cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert other.losses == decoder.losses


@pytest.mark.parametrize("flag", [1, 2, 3])
def test_overloads_are_marked_on_both_gauges_and_counted(flag):
    data = encode_frames(TWO, readings(4), np.array([0, flag, 0, 0], dtype=np.uint8)).tobytes()
    block, decoder = decode([data])
    assert block.status.tolist() == [GOOD, BOTH, GOOD]
    assert decoder.losses.overloaded == 1


# --- damaged ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("harm", "broken"),
    [
        (lambda frame: frame[:5] + frame[6:], 1),  # a byte lost
        (lambda frame: frame[:5] + b"\x00" + frame[5:], 1),  # one too many
        (lambda frame: frame[:1], 1),
        (lambda frame: frame[:4], 1),
        (lambda frame: frame[:-1], 1),
        (lambda frame: frame[:1] + b"\x13" + frame[2:], 1),  # another number of channels
        (lambda frame: frame[:2] + b"\xa0" + frame[3:], 1),  # another kind
        (lambda frame: frame[:3] + b"\x7f\xc0" + frame[5:], 1),  # not a number
        (lambda frame: frame[:7] + b"\xff\x80" + frame[9:], 1),  # infinite
        (lambda frame: frame[:-1] + b"\x84", 1),
        (lambda frame: b"\xab" + frame[1:], 2),  # takes the one before along
        (lambda frame: frame[1:], 2),
        (lambda frame: frame + b"\x00\x01\x02", 1),  # its next one does not follow
    ],
)
def test_a_row_stands_for_each_broken_frame(harm, broken):
    sent = frames(20)
    sent[8] = harm(sent[8])
    block, decoder = decode([b"".join(sent)])
    assert len(block) == 19
    assert decoder.losses.damaged == broken == np.count_nonzero(block.status == DAMAGED)
    assert block.status[8] == DAMAGED
    good = block.status == GOOD
    np.testing.assert_array_equal(block.counts[good], readings(19)[good])
    assert not block.counts[~good].any()


def test_rubbish_before_the_first_frame_is_discarded_and_no_loss():
    block, decoder = decode([b"\x00\xaa\x50\x00\x85\xaa\x11\xb0rubbish", *frames(5)])
    np.testing.assert_array_equal(block.counts, readings(4))
    assert decoder.losses == Losses(samples=4, discarded_bytes=15)


@given(st.lists(st.binary(max_size=40), min_size=12, max_size=12))
@settings(deadline=None)
def test_frames_with_rubbish_between_them_are_found_by_the_next_pair(rubbish):
    """What is given as good was sent; the frame before rubbish is not to be had."""
    sent = frames(24)
    pairs = [b"".join(sent[2 * k : 2 * k + 2]) + waste for k, waste in enumerate(rubbish)]
    block, decoder = decode([b"".join(pairs), *frames(3, first=24)])
    good = {tuple(row) for row in block.counts[block.status == GOOD].tolist()}
    first_of_pairs = {tuple(row) for row in readings(24)[::2].tolist()}
    assert len(first_of_pairs - good) <= 1  # rubbish may end like the beginning of a frame
    assert decoder.losses.samples == len(block)


def test_memory_is_bounded():
    decoder = FrameDecoder(FrameLayout(16), RATE_HZ)
    head = encode_frames(FrameLayout(16), np.zeros((1, 2))).tobytes()[:3]
    for _ in range(200):
        list(decoder.feed(head * 300, 0))
        assert decoder.unfinished_bytes <= MAX_FRAME_BYTES
    assert decoder.losses.samples == 0


# --- what did not come -------------------------------------------------------------------------


def test_the_hosts_clock_tells_how_many_lack():
    decoder = FrameDecoder(TWO, RATE_HZ)
    for k, frame in enumerate(frames(1500)):
        if not 700 <= k < 800:
            for _ in decoder.feed(frame, k * 10_000_000):
                pass
    assert decoder.losses.samples == 1399
    assert decoder.losses.missing_estimated == pytest.approx(100, abs=1)


def test_samples_that_come_late_are_not_lost():
    decoder = FrameDecoder(TWO, RATE_HZ)
    sent = frames(1000)
    for k in range(0, 1000, 50):
        late_ns = 400_000_000 if k > 800 else 0  # the last ones, too
        for frame in (b"".join(sent[k : k + 25]), b"".join(sent[k + 25 : k + 50])):
            for _ in decoder.feed(frame, (k + 25) * 10_000_000 + late_ns):
                pass
    assert decoder.losses.missing_estimated == 0


def test_a_moment_behind_the_hosts_clock_is_no_loss():
    decoder = FrameDecoder(TWO, RATE_HZ)
    for k, frame in enumerate(frames(100)):
        for _ in decoder.feed(frame, k * 10_000_000 + (k % 7) * 9_000_000):
            pass
    assert decoder.losses.missing_estimated == 0


def test_a_slow_clock_is_no_loss():
    decoder = FrameDecoder(TWO, RATE_HZ)
    wire = b"".join(frames(100))
    for k in range(600):  # ten minutes, 400 ppm slow
        for _ in decoder.feed(wire, round(k * 1_000_000_000 * 1.0004)):
            pass
    assert decoder.losses.missing_estimated == 0


def test_after_a_broken_link_rows_stand_for_the_time_that_passed():
    decoder = FrameDecoder(TWO, RATE_HZ)
    blocks = list(decoder.feed(b"".join(frames(6)), 0))
    decoder.expect_restart()
    blocks += decoder.feed(b"".join(frames(6, first=100)), 2_000_000_000)
    block = join(blocks)
    absent = 200 - 5
    assert block.status.tolist() == [GOOD] * 5 + [DAMAGED] + [MISSING] * (absent - 1) + [GOOD] * 5
    assert decoder.losses == Losses(
        samples=205, missing_estimated=194, damaged=1, restarts=1, discarded_bytes=TWO.length
    )


# --- layout ------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_the_layout_is_told_by_two_frames(layout):
    sent = frames(3, layout)
    assert find_layout(b"\xaa\x50\x00\x85" + sent[0] + sent[1]) == (layout.channels, layout.kind)
    assert find_layout(b"\xaa\x11\xb0" + sent[0][5:] + sent[1] + sent[2]) == (layout.channels, layout.kind)
    assert find_layout(sent[0] + sent[1][:-1]) is None
    assert find_layout(b"") is None


def test_a_gauge_on_a_channel_that_is_not_sent():
    with pytest.raises(ProtocolError, match="2 channels and the relative gauge is to be 3: set"):
        FrameLayout(2, relative=3)
