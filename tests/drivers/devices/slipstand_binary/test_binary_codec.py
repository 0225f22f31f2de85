import struct

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.slipstand_binary.codec import (
    FrameDecoder,
    FrameFlags,
    encode_frame,
    encode_frames,
    find_frames,
    rate_from_frames,
    samples_per_frame,
)
from drivers.samples import Losses, SampleStatus

RATE_HZ = 500.0
RUBBISH = b"\xaa\x55\x01\x00\x07slipstand\xaa\xaa\x55\x55"
GOOD, MISSING, DAMAGED = SampleStatus.GOOD, SampleStatus.MISSING, SampleStatus.DAMAGED


def readings(samples: int, first: int = 0) -> np.ndarray:
    index = np.arange(first, first + samples, dtype=np.int64)
    return np.stack([index * 1000 - 7, -index * 77 + 3], axis=1).astype(np.int32)


def stream(frames: int, n: int = 2, first_index: int = 0, first_us: int = 0) -> list[bytes]:
    times_us = first_us + np.arange(frames, dtype=np.int64) * n * round(1e6 / RATE_HZ)
    return [row.tobytes() for row in encode_frames(first_index, times_us, readings(frames * n))]


def decode(pieces, rate_hz: float = RATE_HZ, **options):
    decoder = FrameDecoder(rate_hz, **options)
    block = join([block for piece in pieces for block in decoder.feed(piece, 0)])
    return block, decoder


def flipped(frame: bytes, place: int, bit: int = 0) -> bytes:
    return frame[:place] + bytes([frame[place] ^ (1 << bit)]) + frame[place + 1 :]


# --- encoding ------------------------------------------------------------------------------


def test_a_frame_as_the_protocol_writes_it():
    frame = encode_frame(0x01020304, 0x0A0B0C0D, np.array([[1, -2]]), FrameFlags.DROPPED_BEFORE)
    assert frame[:-2].hex(" ") == "aa 55 01 80 04 03 02 01 0d 0c 0b 0a 01 01 00 00 00 fe ff ff ff"
    assert len(frame) == 23


def test_the_crc_of_a_frame_is_the_remainder_of_a_long_division():
    assert encode_frame(0, 0, np.array([[0, 0]]))[-2:] == struct.pack("<H", crc_by_long_division())


def crc_by_long_division() -> int:
    """Of version 1, nothing else set, n = 1 and eight zero bytes: polynomial division in GF(2)."""
    body = bytes([1, 0]) + bytes(8) + bytes([1]) + bytes(8)
    value = (int.from_bytes(body) << 16) ^ (0xFFFF << (8 * len(body)))
    for shift in range(8 * len(body) + 15, 15, -1):
        if value >> shift & 1:
            value ^= 0x11021 << (shift - 16)
    return value


@pytest.mark.parametrize("n", [1, 2, 31, 32])
def test_many_frames_at_once_are_the_single_ones(n):
    counts = readings(5 * n)
    times_us = np.arange(5) * 4000 + 2**32 - 8000
    flags = np.array([0, 1, 2, 3, 0x80], dtype=np.uint8)
    wire = encode_frames(2**32 - n, times_us, counts, flags)
    single = [
        encode_frame(2**32 - n + k * n, int(times_us[k]), counts[k * n : (k + 1) * n], int(flags[k]))
        for k in range(5)
    ]
    assert wire.tobytes() == b"".join(single)


@pytest.mark.parametrize("samples", [0, 33])
def test_a_frame_of_no_or_too_many_samples_is_refused(samples):
    with pytest.raises(ValueError, match=f"{samples} samples"):
        encode_frame(0, 0, readings(samples))


def test_samples_that_do_not_fill_the_frames_are_refused():
    with pytest.raises(ValueError, match="7 samples do not fill 2 frames"):
        encode_frames(0, np.array([0, 1]), readings(7))


@pytest.mark.parametrize(
    ("rate_hz", "n"), [(1, 1), (100, 1), (399, 1), (400, 2), (2000, 10), (6400, 32), (100_000, 32)]
)
def test_frames_span_no_more_than_five_milliseconds_below_6400_hz(rate_hz, n):
    assert samples_per_frame(rate_hz) == n


# --- decoding what is whole -----------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 32])
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [1, 2, 40, 41])]
)
def test_whole_frames_in_any_cut(n, pieces):
    data = b"".join(stream(8, n))
    block, decoder = decode(pieces(data))
    np.testing.assert_array_equal(block.counts, readings(8 * n))
    assert block.counts.dtype == np.int32
    assert not block.status.any()
    np.testing.assert_allclose(block.device_time_s, np.arange(8 * n) / RATE_HZ, atol=1e-12)
    assert decoder.losses == Losses(samples=8 * n)
    assert decoder.unfinished_bytes == 0


def test_blocks_carry_the_time_of_the_read_that_completed_them():
    first, second = stream(2)
    decoder = FrameDecoder(RATE_HZ)
    assert [block.arrival_ns for block in decoder.feed(first + second[:-1], 5)] == [5]
    assert [block.arrival_ns for block in decoder.feed(second[-1:], 9)] == [9]


def test_sequence_and_time_wrap():
    data = b"".join(stream(10, 2, first_index=2**32 - 7, first_us=2**32 - 9000))
    block, decoder = decode([data])
    np.testing.assert_allclose(block.device_time_s, np.arange(20) / RATE_HZ, atol=1e-12)
    assert decoder.losses == Losses(samples=20)


def test_overloads_are_marked_and_counted():
    frames = [
        encode_frame(2 * k, 4000 * k, readings(2, 2 * k), flags) for k, flags in enumerate([0, 1, 2, 3])
    ]
    block, decoder = decode(frames)
    table, relative = SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE
    assert block.status.tolist() == [
        0,
        0,
        table,
        table,
        relative,
        relative,
        table | relative,
        table | relative,
    ]
    assert decoder.losses.overloaded == 6


# --- what is lost ---------------------------------------------------------------------------


def test_frames_that_never_came_are_missing():
    frames = stream(10)
    block, decoder = decode([b"".join(frames[:3] + frames[6:])])
    assert block.status.tolist() == [GOOD] * 6 + [MISSING] * 6 + [GOOD] * 8
    assert not block.counts[6:12].any()
    np.testing.assert_array_equal(block.counts[12:], readings(20)[12:])
    np.testing.assert_allclose(block.device_time_s, np.arange(20) / RATE_HZ, atol=1e-12)
    assert decoder.losses == Losses(samples=20, missing=6)


def test_a_damaged_frame_is_damaged_and_its_neighbours_are_not():
    frames = stream(5)
    frames[2] = flipped(frames[2], 15)
    block, decoder = decode([b"".join(frames)])
    assert block.status.tolist() == [GOOD] * 4 + [DAMAGED] * 2 + [GOOD] * 4
    assert decoder.losses == Losses(samples=10, damaged=2, discarded_bytes=len(frames[2]))


def test_a_frame_cut_short_is_damaged():
    frames = stream(5)
    frames[2] = frames[2][:7] + frames[2][8:]
    block, decoder = decode([b"".join(frames)])
    assert block.status.tolist() == [GOOD] * 4 + [DAMAGED] * 2 + [GOOD] * 4
    assert decoder.losses.damaged == 2


def test_of_a_gap_only_what_the_bytes_can_have_held_is_damaged():
    frames = stream(8)
    frames[3] = flipped(frames[3], 5)
    block, decoder = decode([b"".join(frames[:4] + frames[6:])])
    assert block.status.tolist() == [GOOD] * 6 + [DAMAGED] * 2 + [MISSING] * 4 + [GOOD] * 4
    assert decoder.losses == Losses(samples=16, missing=4, damaged=2, discarded_bytes=31)


def test_an_earlier_damage_does_not_make_a_later_loss_damaged():
    frames = stream(12)
    frames[2] = flipped(frames[2], 5)
    block, _ = decode([b"".join(frames[:7] + frames[9:])])
    assert block.status.tolist() == [GOOD] * 4 + [DAMAGED] * 2 + [GOOD] * 8 + [MISSING] * 4 + [GOOD] * 6


def test_a_device_clock_that_jumps_is_followed_and_loses_nothing():
    times_us = [0, 4000, 5_000_000, 1000, 5000]
    frames = [encode_frame(2 * k, time_us, readings(2, 2 * k)) for k, time_us in enumerate(times_us)]
    block, decoder = decode(frames)
    np.testing.assert_allclose(block.device_time_s[::2], np.array(times_us) * 1e-6, atol=1e-12)
    assert decoder.losses == Losses(samples=10)


def test_rubbish_between_frames_that_lack_nothing_only_counts_as_bytes():
    frames = stream(4)
    data = RUBBISH + frames[0] + RUBBISH + frames[1] + frames[2] + RUBBISH + frames[3] + RUBBISH
    block, decoder = decode([data])
    assert not block.status.any()
    np.testing.assert_array_equal(block.counts, readings(8))
    kept = decoder.unfinished_bytes
    assert decoder.losses == Losses(samples=8, discarded_bytes=4 * len(RUBBISH) - kept)


def test_a_frame_inside_a_false_one_is_found():
    inner = b"".join(stream(20))
    false_head = b"\xaa\x55\x01\x00" + bytes(8) + b"\x20"  # says that 256 bytes of samples follow
    block, decoder = decode([false_head + inner])
    assert len(block) == 40
    assert decoder.losses.discarded_bytes == len(false_head)


@pytest.mark.parametrize("place", range(23))
@pytest.mark.parametrize("bit", [0, 3, 7])
def test_any_single_flip_costs_that_frame_alone(place, bit):
    frames = stream(14, n=1)
    frames[1] = flipped(frames[1], place, bit)
    block, decoder = decode([b"".join(frames) + b"".join(frames[-1:]) * 12])
    assert block.status.tolist() == [GOOD, DAMAGED] + [GOOD] * 12
    assert decoder.losses.damaged == 1


def test_the_unfinished_rest_is_bounded():
    decoder = FrameDecoder(RATE_HZ)
    endless_heads = (b"\xaa\x55\x01\x00" + bytes(8) + b"\x20") * 2000
    for piece in single_bytes(endless_heads):
        assert list(decoder.feed(piece, 0)) == []
        assert decoder.unfinished_bytes <= 270


def test_a_long_gap_comes_in_blocks_of_bounded_size():
    frames = [encode_frame(0, 0, readings(1)), encode_frame(200_000, 0, readings(1))]
    blocks = list(FrameDecoder(RATE_HZ).feed(b"".join(frames), 0))
    assert len(join(blocks)) == 200_001
    assert max(len(block) for block in blocks) <= 65536
    assert join(blocks).status.tolist() == [GOOD] + [MISSING] * 199_999 + [GOOD]


# --- devices that begin anew -----------------------------------------------------------------


@pytest.mark.parametrize("new_seq", [0, 2_000_000_000])
def test_a_sequence_that_goes_back_or_leaps_is_a_new_start(new_seq):
    decoder = FrameDecoder(RATE_HZ)
    frames = [encode_frame(100, 900_000, readings(2)), encode_frame(new_seq, 17, readings(2))]
    blocks = list(decoder.feed(frames[0], 1_000_000_000))
    blocks += list(decoder.feed(frames[1], 1_100_000_000))  # 50 samples later by the host's clock
    block = join(blocks)
    assert block.status.tolist() == [GOOD] * 2 + [MISSING] * 48 + [GOOD] * 2
    np.testing.assert_allclose(np.diff(block.device_time_s), 1 / RATE_HZ, atol=1e-9)
    assert decoder.losses == Losses(samples=52, missing_estimated=48, restarts=1)


def test_the_hosts_time_is_given_to_one_new_start_only():
    decoder = FrameDecoder(RATE_HZ)
    list(decoder.feed(encode_frame(900, 0, readings(2)), 0))
    anew = encode_frame(500, 0, readings(2)) + encode_frame(100, 0, readings(2))
    rows = sum(len(block) for block in decoder.feed(anew, 100_000_000))
    assert rows == 50  # of 0.1 s, the 4 that came included
    assert decoder.losses.restarts == 2


def test_after_a_new_start_the_account_goes_on():
    frames = stream(6, first_index=5000)
    anew = stream(4)
    block, decoder = decode([b"".join(frames + anew[:1] + anew[3:])])
    assert block.status.tolist() == [GOOD] * 14 + [MISSING] * 4 + [GOOD] * 2
    assert decoder.losses == Losses(samples=20, missing=4, restarts=1)


def test_a_start_that_was_asked_for_is_not_taken_for_a_gap():
    decoder = FrameDecoder(RATE_HZ)
    list(decoder.feed(stream(1)[0], 0))
    decoder.expect_restart()
    frame = encode_frame(3000, 0, readings(2))
    assert [len(block) for block in decoder.feed(frame, 0)] == [2]
    assert decoder.losses == Losses(samples=4, restarts=1)


def test_the_estimate_at_a_new_start_is_bounded():
    decoder = FrameDecoder(RATE_HZ, max_gap_s=1.0)
    list(decoder.feed(stream(1, first_index=100)[0], 0))
    block = join([*decoder.feed(b"", 0)])
    rows = sum(len(block) for block in decoder.feed(stream(1)[0], 3_600_000_000_000))
    assert len(block) == 0
    assert rows == 500 + 2


def test_a_gap_up_to_the_limit_is_believed():
    for gap, restarts in ((500, 0), (501, 1)):
        frames = [encode_frame(0, 0, readings(1)), encode_frame(1 + gap, 0, readings(1))]
        _, decoder = decode(frames, max_gap_s=1.0)
        assert decoder.losses.restarts == restarts
        assert decoder.losses.missing == (0 if restarts else gap)


def test_the_same_frame_twice_counts_once():
    frames = stream(4)
    block, decoder = decode([b"".join([frames[0], frames[1], frames[1], *frames[2:]])])
    np.testing.assert_array_equal(block.counts, readings(8))
    assert decoder.losses == Losses(samples=8, repeated=1, discarded_bytes=31)


def test_a_frame_that_comes_late_gives_no_row_in_a_wrong_place():
    frames = stream(6)
    block, decoder = decode([b"".join([frames[0], frames[3], frames[1], frames[2], frames[4], frames[5]])])
    sent = readings(12)
    good = (block.status & SampleStatus.MISSING) == 0
    assert good.tolist() == [True, True, *[False] * 4, *[True] * 6]
    np.testing.assert_array_equal(block.counts[good], sent[good])
    assert (decoder.losses.repeated, decoder.losses.missing, decoder.losses.restarts) == (2, 4, 0)


@pytest.mark.parametrize("frames_before", [2, 20, 60])
def test_a_device_that_restarts_at_once_is_noticed_and_gives_no_row_in_a_wrong_place(frames_before):
    """At 500 Hz, 60 frames of 2 samples last 0.24 s: less than a frame may be late."""
    decoder = FrameDecoder(RATE_HZ)
    before, anew = stream(frames_before), encode_frames(0, np.arange(100) * 4000, readings(200, first=9000))
    blocks = list(decoder.feed(b"".join(before), 1_000_000_000))
    blocks += list(decoder.feed(anew[:3].tobytes(), 1_100_000_000))
    blocks += list(decoder.feed(anew[3:].tobytes(), 1_500_000_000))
    block, n = join(blocks), 2 * frames_before
    np.testing.assert_array_equal(block.counts[:n], readings(n))
    np.testing.assert_array_equal(block.counts[n + 44 :], readings(200, first=9000))
    assert block.status.tolist() == [GOOD] * n + [MISSING] * 44 + [GOOD] * 200
    assert decoder.losses == Losses(samples=n + 244, missing_estimated=44, restarts=1)


@pytest.mark.parametrize("seed", range(30))
def test_many_reads_at_once_give_the_rows_and_losses_of_single_ones(seed):
    """With lost and damaged frames, a restart, and reads without a whole frame."""
    rng = np.random.default_rng(seed)
    frames = stream(60) + stream(60, first_index=int(rng.choice([0, 124, 5000])), first_us=77)
    kept = [flipped(frame, 20) if rng.random() < 0.05 else frame for frame in frames if rng.random() < 0.9]
    wire = b"".join(kept)
    pieces = list(cut_at(wire, rng.integers(1, len(wire), int(rng.choice([20, 400]))).tolist()))
    reads = [(piece, 10_000_000 * number) for number, piece in enumerate(pieces) if piece]
    single, grouped = FrameDecoder(RATE_HZ), FrameDecoder(RATE_HZ)
    one_by_one = [block for read in reads for block in single.feed(*read)]
    at_once = [
        block for first in range(0, len(reads), 7) for block in grouped.feed_reads(reads[first : first + 7])
    ]
    assert grouped.losses == single.losses
    expected, found = join(one_by_one), join(at_once)
    np.testing.assert_array_equal(found.counts, expected.counts)
    np.testing.assert_array_equal(found.status, expected.status)


def test_a_drop_that_the_device_tells_agrees_with_its_gap():
    dropped = FrameFlags.DROPPED_BEFORE
    frames = [encode_frame(0, 0, readings(2), dropped), encode_frame(6, 0, readings(2), dropped)]
    _, decoder = decode(frames)
    assert decoder.losses == Losses(samples=8, missing=4)
    frames = [encode_frame(0, 0, readings(2)), encode_frame(2, 0, readings(2), dropped)]
    _, decoder = decode(frames)
    assert decoder.losses == Losses(samples=4, unexplained_drops=1)


# --- any damage at all -----------------------------------------------------------------------


def after_fate(draw, frame: bytes, fate: str) -> bytes:
    place = draw(st.integers(0, len(frame) - 1))
    match fate:
        case "lost":
            return b""
        case "flipped":
            return flipped(frame, place, draw(st.integers(0, 7)))
        case "cut":
            return frame[:place] + frame[place + 1 :]
        case "rubbish":
            return draw(st.binary(max_size=60)) + frame
    return frame


@st.composite
def damaged_streams(draw):
    """A stream whose frames are lost, flipped, cut, or parted by rubbish; and what survived."""
    n = draw(st.sampled_from([1, 2, 5, 32]))
    first = draw(st.sampled_from([0, 2**32 - 20]))
    frames = stream(draw(st.integers(3, 25)), n, first_index=first)
    fates = st.sampled_from(["whole"] * 6 + ["lost", "flipped", "cut", "rubbish"])
    chosen = [draw(fates) for _ in frames]
    wire = [after_fate(draw, frame, fate) for frame, fate in zip(frames, chosen, strict=True)]
    survived = [k for k, fate in enumerate(chosen) if fate in ("whole", "rubbish")]
    # The last byte of a frame may stand for the first one that the next has lost: then the next is whole.
    assume(not any(frame in b"".join(wire) for k, frame in enumerate(frames) if k not in survived))
    # A tail without sense, so that nothing waits behind a false head.
    return n, b"".join(wire) + bytes(300), survived


@settings(max_examples=200, deadline=None)
@given(damaged_streams(), st.data())
def test_every_sample_between_first_and_last_good_one_is_accounted_for(case, data):
    n, wire, survived = case
    block, decoder = decode([wire])
    losses = decoder.losses
    if not survived:
        assert len(block) == 0
        return
    first, last = survived[0], survived[-1]
    assert len(block) == losses.samples == (last - first + 1) * n
    good = np.repeat([k in survived for k in range(first, last + 1)], n)
    np.testing.assert_array_equal(block.status == 0, good)
    np.testing.assert_array_equal(block.counts[good], readings((last + 1) * n)[first * n :][good])
    assert not block.counts[~good].any()
    assert losses.missing == np.count_nonzero(block.status == MISSING)
    assert losses.damaged == np.count_nonzero(block.status == DAMAGED)
    assert losses.restarts == losses.repeated == losses.missing_estimated == 0

    in_pieces, decoder_2 = decode(cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(in_pieces.counts, block.counts)
    np.testing.assert_array_equal(in_pieces.status, block.status)
    np.testing.assert_allclose(in_pieces.device_time_s, block.device_time_s, atol=1e-12)
    assert decoder_2.losses == losses


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=2000))
def test_noise_gives_no_sample_and_keeps_little(noise):
    block, decoder = decode([noise])
    assert len(block) == 0
    assert decoder.unfinished_bytes <= 270
    assert decoder.losses == Losses(discarded_bytes=len(noise) - decoder.unfinished_bytes)


# --- rate -------------------------------------------------------------------------------------


def test_the_rate_that_frames_show():
    frames = stream(200, first_us=2**32 - 100_000)
    assert rate_from_frames(b"".join(frames)) == pytest.approx(RATE_HZ)
    assert rate_from_frames(b"".join(frames[:50] + frames[90:])) == pytest.approx(RATE_HZ)


def test_the_rate_is_that_after_the_last_new_start():
    slow = [encode_frame(k, 10_000 * k, readings(1)) for k in range(100)]
    assert rate_from_frames(b"".join(slow + stream(200))) == pytest.approx(RATE_HZ)


def test_too_few_frames_show_no_rate():
    assert rate_from_frames(b"") is None
    assert rate_from_frames(b"".join(stream(100))) is None  # 0.4 s


def test_frames_in_rubbish_are_listed():
    found = find_frames(RUBBISH + b"".join(stream(3, 4, first_index=9)) + RUBBISH)
    assert found["seq"].tolist() == [9, 13, 17]
    assert found["n"].tolist() == [4, 4, 4]


@pytest.mark.parametrize("first_index", [0, 1002, 1600, 5000])
def test_after_a_broken_link_the_sequence_is_believed_if_the_host_agrees(first_index):
    decoder = FrameDecoder(RATE_HZ)
    frame = stream(1)[0]
    list(decoder.feed(frame + frame[:10], 0))
    decoder.expect_restart()
    returned = encode_frame(first_index, 2_000_000, readings(2))
    rows = sum(len(block) for block in decoder.feed(returned, round(1002 / RATE_HZ * 1e9)))
    assert rows == 1000 + 2
    is_believed = first_index == 1002
    assert decoder.losses == Losses(
        samples=1004,
        damaged=2,
        missing=998 if is_believed else 0,
        missing_estimated=0 if is_believed else 998,
        restarts=int(not is_believed),
        discarded_bytes=10,
    )
