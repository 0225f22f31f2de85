import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.lsl.codec import CONFIRMED_S, StreamDecoder
from drivers.packets import MAX_GAP_S
from drivers.samples import SampleStatus
from drivers.stream_packets import StreamDescription, pack_chunk, pack_description

RATE_HZ = 1000.0
CLOCK_S = 81_234.5  # of the sender, whatever it is
DESCRIPTION = StreamDescription("stand", "Displacement", "rig-7", "lab-pc", 3, RATE_HZ, ("a", "b", "c"))
MISSING, DAMAGED = SampleStatus.MISSING, SampleStatus.DAMAGED


def readings(indices) -> np.ndarray:
    index = np.asarray(indices, dtype=float)
    return np.column_stack([index / 3, index * 0.1, -index])


def stream(indices, jitter_s=0.0, size: int = 10, offset_s: float = 0.0) -> bytes:
    """Chunks of samples taken at index / rate, stamped late by `jitter_s`."""
    index = np.asarray(indices)
    stamps_s = CLOCK_S + index / RATE_HZ + jitter_s
    parts = (slice(at, at + size) for at in range(0, len(index), size))
    chunks = (pack_chunk(stamps_s[part], readings(index[part]), offset_s, 0) for part in parts)
    return pack_description(DESCRIPTION, 0) + b"".join(chunks)


def decode(*pieces: bytes, decoder: StreamDecoder | None = None, arrivals_ns=None):
    decoder = decoder or StreamDecoder(2, 0, RATE_HZ)
    arrivals_ns = arrivals_ns or [0] * len(pieces)
    feeds = [decoder.feed(piece, at) for piece, at in zip(pieces, arrivals_ns, strict=True)]
    return join([block for feed in feeds for block in feed]), decoder


def missing(block) -> int:
    return int(np.count_nonzero(block.status & MISSING))


@pytest.mark.parametrize("cut", [lambda data: [data], single_bytes, lambda data: cut_at(data, [3, 60, 61])])
def test_samples_in_any_cut_have_their_readings_and_times(cut):
    block, decoder = decode(*cut(stream(np.arange(50))))
    np.testing.assert_array_equal(block.counts, readings(np.arange(50))[:, [2, 0]])
    np.testing.assert_allclose(block.device_time_s, np.arange(50) / RATE_HZ, atol=1e-9)
    assert (decoder.losses.samples, decoder.losses.discarded_bytes) == (50, 0)
    assert not block.status.any()


@pytest.mark.parametrize("lost", [1, 7, 400, 5000])
def test_a_gap_of_the_stamps_becomes_rows(lost):
    indices = np.r_[0:3000, 3000 + lost : 4000 + lost]
    block, decoder = decode(stream(indices))
    assert missing(block) == lost == decoder.losses.missing_estimated
    np.testing.assert_array_equal(np.flatnonzero(block.status), np.arange(3000, 3000 + lost))
    np.testing.assert_array_equal(block.counts[-1], readings([3999 + lost])[0, [2, 0]])
    assert block.device_time_s[-1] == pytest.approx((3999 + lost) / RATE_HZ, abs=1e-3)


def test_scatter_of_stamps_is_no_gap_and_is_smoothed():
    """Chunks of 20 that a computer stamps up to 5 ms late, at a rate 0.1 % above the nominal one."""
    rng = np.random.default_rng(1)
    jitter_s = np.repeat(rng.uniform(0, 0.005, 500), 20) + np.arange(10_000) * -1e-6
    block, decoder = decode(stream(np.arange(10_000), jitter_s, size=20))
    assert decoder.losses.samples == 10_000
    assert decoder.losses.restarts == missing(block) == 0
    steps_s = np.diff(block.device_time_s)[3000:]
    assert steps_s.min() > 0.00098
    assert steps_s.max() < 0.00102
    assert steps_s.mean() == pytest.approx(0.000999, rel=3e-4)


def test_a_sender_that_stood_still_for_a_moment_lost_nothing():
    """It stamps the waiting samples all at once."""
    late_s = np.zeros(4000)
    late_s[2000:2060] = (60 - np.arange(60)) / RATE_HZ
    block, decoder = decode(stream(np.arange(4000), late_s))
    assert missing(block) == decoder.losses.restarts == 0
    assert len(block) == 4000


def test_a_gap_waits_until_it_is_confirmed():
    decoder = StreamDecoder(0, 1, RATE_HZ)
    confirming = round(CONFIRMED_S * RATE_HZ)
    block, _ = decode(stream(np.r_[0:2000, 2500 : 2500 + confirming - 1]), decoder=decoder)
    assert len(block) == 2000
    (later,) = decoder.feed(stream(np.arange(2500 + confirming - 1, 2500 + confirming + 5)), 0)
    assert later.first_index == 2000
    assert len(later) == 500 + confirming + 5


def test_the_clock_offset_is_added_to_the_stamps():
    """A correction of 1 ms is followed, and one of 0.5 s is a gap."""
    rows = np.arange(1000)
    block, decoder = decode(stream(rows, offset_s=2.0), stream(rows + 1000, offset_s=2.001))
    assert missing(block) == decoder.losses.restarts == 0
    shifted, decoder = decode(stream(rows, offset_s=2.0), stream(rows + 1000, offset_s=2.5))
    assert missing(shifted) == 500


def test_what_is_no_number_is_a_damaged_row():
    stamps_s = CLOCK_S + np.arange(200) / RATE_HZ
    values = readings(np.arange(200))
    values[50:53, 2] = np.nan
    values[120, 1] = np.inf  # of a channel without a gauge
    block, decoder = decode(pack_chunk(stamps_s, values, 0.0, 0))
    assert np.flatnonzero(block.status & DAMAGED).tolist() == [50, 51, 52]
    assert (decoder.losses.damaged, decoder.losses.missing_estimated) == (3, 0)
    assert len(block) == 200


def test_overload_is_a_size():
    block, decoder = decode(stream(np.arange(100)), decoder=StreamDecoder(0, 2, RATE_HZ, overload=90.0))
    assert np.flatnonzero(block.status == SampleStatus.OVERLOAD_RELATIVE).tolist() == list(range(90, 100))
    assert decoder.losses.overloaded == 10


@pytest.mark.parametrize("clock_s", [0.0, -5000.0])
def test_a_broken_connection_is_a_gap_by_stamps_or_by_the_hosts_clock(clock_s):
    """The sender goes on, or starts anew with another clock."""
    decoder = StreamDecoder(2, 0, RATE_HZ)
    first = list(decoder.feed(stream(np.arange(1000)), 1_000_000_000))
    decoder.expect_restart()
    later = list(decoder.feed(stream(np.arange(3000, 3100), clock_s), 3_100_000_000))
    block = join([*first, *later])
    assert missing(block) == 2000
    assert decoder.losses.restarts == (1 if clock_s else 0)


def test_stamps_that_fall_behind_are_a_new_start():
    block, decoder = decode(stream(np.arange(1000)), stream(np.arange(0, 1000)))
    assert (decoder.losses.restarts, len(block), missing(block)) == (1, 2000, 0)
    assert (np.diff(block.device_time_s) > 0).all()


def test_a_gap_beyond_belief_is_a_new_start():
    beyond = round((MAX_GAP_S + 3) * RATE_HZ)
    block, decoder = decode(stream(np.r_[0:1000, beyond : beyond + 200]))
    assert (decoder.losses.restarts, len(block)) == (1, 1200)


def test_a_damaged_chunk_is_discarded_and_its_rows_are_missing():
    chunks = [stream(np.arange(10 * k, 10 * k + 10)) for k in range(400)]
    chunks[300] = chunks[300][:-30] + b"\x55" + chunks[300][-29:]
    block, decoder = decode(b"".join(chunks))
    assert missing(block) == 10
    assert decoder.losses.discarded_bytes > 0
    short = pack_chunk(np.array([1.0]), np.array([[1.0, 2.0]]), 0.0, 0)  # without channel 2
    assert list(StreamDecoder(2, 0, RATE_HZ).feed(short, 0)) == []


@given(st.binary(max_size=80), st.data())
@settings(deadline=None)
def test_any_cut_gives_the_same(garbage, data):
    wire = stream(np.arange(30)) + garbage + stream(np.r_[30:60, 90:300])
    whole, all_at_once = decode(wire)
    block, decoder = decode(*cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert decoder.losses == all_at_once.losses
