import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.hbm_aed.codec import FORMATS, Format, ValueDecoder, encode_frames
from drivers.samples import Losses, SampleStatus

GOOD, DAMAGED, OVERLOAD = SampleStatus.GOOD, SampleStatus.DAMAGED, SampleStatus.OVERLOAD_TABLE
COUNTS = np.column_stack([4_567_891 - 230_117 * np.arange(40), np.zeros(40, int)]).astype(np.int32)


def decode(kind: Format, pieces):
    decoder = ValueDecoder(kind, 100.0)
    return join([block for piece in pieces for block in decoder.feed(piece, 0)]), decoder


def test_binary_values_of_the_manual():
    """AD104 manual, pages 21 and 38: high byte first, status in the last byte; 5,120,000 at nominal load."""
    wire = bytes.fromhex(
        "4e2000080d0a ffffff000d0a 7fffff040d0a 800000020d0a 000000010d0a 000001c00d0a 000002080d0a"
    )
    block, _ = decode(Format.BINARY, [wire])
    assert block.counts.tolist() == [[v, 0] for v in (5_120_000, -1, 2**23 - 1, -(2**23), 0, 1, 2)]
    assert block.status.tolist() == [GOOD, GOOD, OVERLOAD, OVERLOAD, OVERLOAD, OVERLOAD, GOOD]


def test_text_values_of_the_manual():
    """Page 21: COF11 is a value of eight characters, the delimiter, the status of three."""
    wire = b" 1000000,008\r\n-0000012,000\r\n+0000003,004\r\n      -7,001\r\n00000005,012\r\n"
    block, _ = decode(Format.ASCII, [wire + wire])
    assert block.counts[:5, 0].tolist() == [1_000_000, -12, 3, -7, 5]
    assert block.status[:5].tolist() == [GOOD, GOOD, OVERLOAD, OVERLOAD, OVERLOAD]


def test_values_as_they_are_written():
    assert encode_frames(Format.BINARY, np.array([[-2, 9]]), 8) == [b"\xff\xff\xfe\x08\r\n"]
    assert encode_frames(Format.ASCII, np.array([[-1234, 9]])) == [b"   -1234,000\r\n"]
    assert encode_frames(Format.BINARY, np.array([[2**24, 0]])) == [b"\x7f\xff\xff\x00\r\n"]


@pytest.mark.parametrize("kind", Format)
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [2, 12, 13, 71])]
)
def test_whole_frames_in_any_cut(kind, pieces):
    block, decoder = decode(kind, pieces(b"".join(encode_frames(kind, COUNTS))))
    np.testing.assert_array_equal(block.counts, COUNTS)
    assert not block.status.any()
    assert decoder.losses == Losses(samples=40)
    assert decoder.unfinished_bytes == 0


@pytest.mark.parametrize("kind", Format)
@given(st.binary(max_size=80), st.data())
@settings(deadline=None, max_examples=40)
def test_any_cut_gives_the_same(kind, garbage, data):
    frames = encode_frames(kind, COUNTS)
    wire = b"".join([*frames[:15], garbage, *frames[15:]])
    whole, decoder = decode(kind, [wire])
    block, other = decode(kind, cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert other.losses == decoder.losses


@pytest.mark.parametrize("kind", Format)
@pytest.mark.parametrize(
    "harm",
    [
        lambda frame: frame[1:],
        lambda frame: frame[:-1],
        lambda frame: frame[:2] + frame[3:],
        lambda frame: frame[:1],
        lambda frame: frame[:-2] + b"\0" + frame[-1:],
    ],
)
def test_a_row_stands_for_a_broken_value(kind, harm):
    sent = encode_frames(kind, COUNTS)
    sent[12] = harm(sent[12])
    block, decoder = decode(kind, [b"".join(sent)])
    assert (len(block), decoder.losses.damaged) == (40, 1)
    assert np.flatnonzero(block.status).tolist() == [12]
    good = block.status == GOOD
    np.testing.assert_array_equal(block.counts[good], COUNTS[good])


@pytest.mark.parametrize("kind", Format)
def test_memory_is_bounded(kind):
    decoder, marks = ValueDecoder(kind, 100.0), FORMATS[kind].marks
    for _ in range(200):
        list(decoder.feed(encode_frames(kind, COUNTS[:1])[0][:-1] * 5, 0))
        assert decoder.unfinished_bytes <= marks.length * (1 + marks.confirming)
