import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.harp.codec import (
    EVENT_BYTES,
    U8,
    U16,
    WRITE,
    EventDecoder,
    HarpMessage,
    encode,
    encode_events,
    rate_from_events,
)
from drivers.samples import Losses, SampleStatus

RATE_HZ = 1000.0
GOOD, MISSING, DAMAGED = SampleStatus.GOOD, SampleStatus.MISSING, SampleStatus.DAMAGED
REPLY = encode(HarpMessage(WRITE, 32, b"\x01"), U8, 5)
LONG_REPLY = encode(HarpMessage(1, 12, bytes(range(25))), U8, 5)


def readings(samples: int, first: int = 0) -> np.ndarray:
    index = first + np.arange(samples)
    return np.stack([index * 3 - 5, 10_000 - index], axis=1)


def events(samples: int, first: int = 0, table: int = 0, relative: int = 1) -> list[bytes]:
    times_s = 3_650_000.0 + (first + np.arange(samples)) / RATE_HZ
    return [row.tobytes() for row in encode_events(times_s, readings(samples, first), table, relative)]


def decode(pieces, **options):
    decoder = EventDecoder(RATE_HZ, **options)
    return join([block for piece in pieces for block in decoder.feed(piece, 0)]), decoder


def test_events_as_they_are_written():
    (wire,) = encode_events(np.array([258.5]), np.array([[1, -2]]))
    assert wire.tobytes().hex(" ") == (
        "03 1a 21 ff 92 02 01 00 00 09 3d 01 00 fe ff 00 00 00 00 00 00 00 00 00 00 00 00 16"
    )
    assert sum(wire[:-1].tolist()) & 0xFF == 0x16


@pytest.mark.parametrize("channels", [(0, 1), (7, 3)])
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [3, 28, 29, 50, 171])]
)
def test_whole_events_in_any_cut(channels, pieces):
    table, relative = channels
    data = b"".join(events(12, table=table, relative=relative))
    block, decoder = decode(pieces(data), table=table, relative=relative)
    np.testing.assert_array_equal(block.counts, readings(12))
    np.testing.assert_allclose(block.device_time_s, np.arange(12) / RATE_HZ, atol=33e-6)
    assert not block.status.any()
    assert decoder.losses == Losses(samples=12)
    assert decoder.unfinished_bytes == 0


def test_other_messages_are_passed_over():
    sent = events(10)
    data = [REPLY, *sent[:4], LONG_REPLY, REPLY, *sent[4:]]
    for pieces in (data, single_bytes(b"".join(data))):
        block, decoder = decode(pieces)
        np.testing.assert_array_equal(block.counts, readings(10))
        assert decoder.losses == Losses(samples=10)


@given(st.binary(max_size=80), st.data())
@settings(deadline=None)
def test_any_cut_gives_the_same(rubbish, data):
    wire = b"".join([*events(5), rubbish, *events(5, first=5), REPLY, *events(2, first=20)])
    whole, decoder = decode([wire])
    block, other = decode(cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert other.losses == decoder.losses


def test_overloads_are_marked_and_counted():
    counts = np.array([[32767, 0], [0, -32768], [32766, -32766], [40_000, -40_000]])
    block, decoder = decode([encode_events(np.arange(4) / RATE_HZ, counts).tobytes()])
    assert block.status.tolist() == [4, 8, 0, 12]
    assert block.counts[3].tolist() == [32767, -32768]
    assert decoder.losses.overloaded == 3


def test_time_tells_what_is_missing():
    sent = events(10)
    block, decoder = decode([*sent[:3], *sent[6:]])
    assert block.status.tolist() == [GOOD] * 3 + [MISSING] * 3 + [GOOD] * 4
    np.testing.assert_array_equal(block.counts[6:], readings(10)[6:])
    assert decoder.losses == Losses(samples=10, missing_estimated=3)


@pytest.mark.parametrize(
    "harm",
    [
        lambda event: event[:9] + event[10:],
        lambda event: event[:9] + b"\x00" + event[9:],
        lambda event: event[:1],
        lambda event: event[:-1],
        lambda event: event[:1] + b"\xff" + event[2:],  # a length that takes the next ones along
        lambda event: b"\x04" + event[1:],
        lambda event: event[:12] + bytes([event[12] ^ 0x40]) + event[13:],
    ],
)
def test_a_broken_event_is_damaged_and_the_next_is_found(harm):
    sent = events(30)
    sent[8] = harm(sent[8])
    for pieces in ([b"".join(sent)], single_bytes(b"".join(sent))):
        block, decoder = decode(pieces)
        assert block.status.tolist() == [GOOD] * 8 + [DAMAGED] + [GOOD] * 21
        np.testing.assert_array_equal(block.counts[9:], readings(30)[9:])
        assert decoder.losses.damaged == 1
        assert decoder.losses.missing_estimated == 0


@pytest.mark.parametrize("leap_s", [-5.0, 3.0, 1e6])
def test_a_wrong_time_whose_checksum_passes_invents_no_gap(leap_s):
    sent = events(30)
    time_s = 3_650_000.0 + 8 / RATE_HZ + leap_s
    sent[8] = encode_events(np.array([time_s]), readings(30)[8:9])[0].tobytes()
    for pieces in ([b"".join(sent)], sent, single_bytes(b"".join(sent))):
        block, decoder = decode(pieces)
        assert block.status.tolist() == [GOOD] * 8 + [DAMAGED] + [GOOD] * 21
        assert decoder.losses.restarts == decoder.losses.missing_estimated == 0


def test_a_leap_that_the_next_event_bears_out_is_a_gap():
    sent = [*events(5), *events(5, first=505)]
    for pieces in ([b"".join(sent)], sent):
        block, decoder = decode(pieces)
        assert len(block) == 510
        assert decoder.losses == Losses(samples=510, missing_estimated=500)


def test_after_a_broken_link_time_goes_on_where_the_hosts_clock_bears_it_out():
    decoder = EventDecoder(RATE_HZ)
    blocks = list(decoder.feed(b"".join(events(5)), 0))
    decoder.expect_restart()
    blocks += decoder.feed(b"".join(events(5, first=2000)), 2_000_000_000)
    assert len(join(blocks)) == 2005
    assert (decoder.losses.restarts, decoder.losses.missing_estimated) == (0, 1995)


def test_a_device_that_counts_anew_starts_anew():
    decoder = EventDecoder(RATE_HZ)
    blocks = list(decoder.feed(b"".join(events(5)), 0))
    decoder.expect_restart()
    fresh = encode_events(np.arange(5) / RATE_HZ, readings(5)).tobytes()
    blocks += decoder.feed(fresh, 2_000_000_000)
    block = join(blocks)
    assert len(block) == pytest.approx(2005, abs=10)
    assert decoder.losses.restarts == 1
    np.testing.assert_allclose(np.diff(block.device_time_s), 1 / RATE_HZ, atol=1e-4)


def without_boards(samples: int, first: int, boards=(0, 1)) -> list[bytes]:
    """Events in which the channels of `boards` are 0, as interrupts.c of the device fills them."""
    wire = [bytearray(event) for event in events(samples, first, table=2, relative=6)]
    for event in wire:
        for board in boards:
            event[11 + 8 * board : 19 + 8 * board] = bytes(8)
        event[-1] = sum(event[:-1]) & 0xFF
    return [bytes(event) for event in wire]


@pytest.mark.parametrize(("boards", "channels"), [((0, 1), ["0 to 3", "4 to 7"]), ((1,), ["4 to 7"])])
def test_a_pulled_reader_board_is_no_reading_of_0(boards, channels):
    whole = [*events(200, table=2, relative=6), *events(200, 1200, table=2, relative=6)]
    sent = [*whole[:200], *without_boards(1000, 200, boards), *whole[200:]]
    for pieces in ([b"".join(sent)], cut_at(b"".join(sent), range(1000, 28 * 1400, 1500)), sent):
        block, decoder = decode(pieces, table=2, relative=6)
        assert block.status.tolist() == [GOOD] * 200 + [DAMAGED] * 1000 + [GOOD] * 200
        np.testing.assert_array_equal(block.counts[block.status == GOOD], readings(1400)[block.status == 0])
        assert (decoder.losses.damaged, decoder.losses.restarts) == (1000, 0)
        assert [str(warning) for warning in decoder.take_warnings()] == [
            f"channels {one} all read exactly 0: plug their reader board in" for one in channels
        ]
        assert decoder.take_warnings() == []


def test_a_few_events_of_zeros_are_readings():
    sent = [*events(50, table=2, relative=6), *without_boards(99, 50), *events(50, 149, table=2, relative=6)]
    for pieces in ([b"".join(sent)], sent):
        block, decoder = decode(pieces, table=2, relative=6)
        assert not block.status.any()
        np.testing.assert_array_equal(block.counts[50:149], 0)
        assert decoder.take_warnings() == []
        assert decoder.losses == Losses(samples=199)


def test_a_gauge_that_reads_0_beside_others_that_do_not_is_plugged_in():
    sent = encode_events(np.arange(500) / RATE_HZ, np.zeros((500, 2)), idle_count=1).tobytes()
    block, _ = decode([sent])
    assert len(block) == 500
    assert not block.status.any()


def test_zeros_that_wait_are_bounded():
    decoder = EventDecoder(RATE_HZ)
    list(decoder.feed(b"".join(events(3)), 0))
    for k in range(20):
        list(decoder.feed(b"".join(without_boards(4, 3 + 4 * k)) + LONG_REPLY * 200, 0))
        assert decoder.unfinished_bytes <= (1 << 14) + 200 * len(LONG_REPLY)


@given(st.lists(st.binary(max_size=60), min_size=10, max_size=10))
@settings(deadline=None)
def test_nothing_is_given_that_was_not_sent(rubbish):
    sent = events(20)
    wire = b"".join(b"".join(sent[2 * k : 2 * k + 2]) + waste for k, waste in enumerate(rubbish))
    block, decoder = decode([wire + b"".join(events(3, first=20))])
    good = {tuple(row) for row in block.counts[block.status == GOOD].tolist()}
    assert good <= {tuple(row) for row in readings(23).tolist()}
    assert decoder.losses.samples == len(block)


def test_memory_is_bounded():
    decoder = EventDecoder(RATE_HZ)
    list(decoder.feed(events(1)[0] + events(1, first=4000)[0], 0))
    for _ in range(200):
        list(decoder.feed(b"\x03\xff\x21" * 300, 0))
        assert decoder.unfinished_bytes <= 1300 + EVENT_BYTES


def test_the_rate_is_told_by_the_times():
    assert rate_from_events(b"".join([REPLY, *events(900)])) == pytest.approx(1000, rel=1e-4)
    assert rate_from_events(b"".join(events(300))) is None
    assert rate_from_events(encode(HarpMessage(1, 0, b"\xd0\x04"), U16, 5)) is None
