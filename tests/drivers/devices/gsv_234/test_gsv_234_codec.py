import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.gsv_234.codec import FORMATS, GSV_2, GSV_3, GSV_4, FrameDecoder, encode_frames
from drivers.samples import Losses, SampleStatus

RATE_HZ = 100.0
GOOD, MISSING, DAMAGED = SampleStatus.GOOD, SampleStatus.MISSING, SampleStatus.DAMAGED
BOTH = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE


def readings(model: str, samples: int, first: int = 0) -> np.ndarray:
    index = first + np.arange(samples)
    one = np.column_stack([37 * index - 5000, 12_000 - 11 * index])
    one[:, len(FORMATS[model].places) :] = 0
    return one.astype(np.int32)


def frames(model: str, samples: int, first: int = 0) -> list[bytes]:
    return [row.tobytes() for row in encode_frames(FORMATS[model], readings(model, samples, first))]


def decode(model: str, pieces):
    decoder = FrameDecoder(FORMATS[model], RATE_HZ)
    return join([block for piece in pieces for block in decoder.feed(piece, 0)]), decoder


def test_frames_as_the_vendor_writes_them():
    """GSV4_python_testScripts and GSV-3-test-scripts: (high * 256 + low - 32768) / 32768 of the range."""
    block, _ = decode(GSV_4, [bytes.fromhex("a5 c000 4000 8000 8000 0d0a") * 2])
    assert block.counts.tolist() == [[16384, -16384]]
    block, _ = decode(GSV_3, [bytes.fromhex("a5 c001") * 10])
    assert block.counts[0].tolist() == [16385, 0]


def test_a_frame_of_the_gsv_2_manual():
    """GSV-2AS manual, page 16: 80 00 00 is zero, FF FF FF the end of the range; bits 3 and 4 are switches."""
    wire = bytes.fromhex("2c00 800000 2c08 800001 2c18 ffffff 2c10 7fffff 2c00 000000 2c00 000000")
    block, _ = decode(GSV_2, [wire])
    assert block.counts[:, 0].tolist() == [0, 1, 2**23 - 1, -1, -(2**23)]
    assert block.status.tolist() == [
        GOOD,
        GOOD,
        SampleStatus.OVERLOAD_TABLE,
        GOOD,
        SampleStatus.OVERLOAD_TABLE,
    ]


def test_frames_as_they_are_written():
    assert encode_frames(FORMATS[GSV_4], np.array([[1, -32768]]), (4, 1)).tobytes().hex(" ") == (
        "a5 00 00 80 00 80 00 80 01 0d 0a"
    )
    assert encode_frames(FORMATS[GSV_3], np.array([[40_000, 0]])).tobytes().hex(" ") == "a5 ff ff"
    assert encode_frames(FORMATS[GSV_2], np.array([[-2, 0]])).tobytes().hex(" ") == "2c 00 7f ff fe"


@pytest.mark.parametrize("model", FORMATS)
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [2, 12, 13, 50, 71])]
)
def test_whole_frames_in_any_cut(model, pieces):
    block, decoder = decode(model, pieces(b"".join(frames(model, 40))))
    np.testing.assert_array_equal(block.counts, readings(model, 39))
    assert block.device_time_s is None
    assert not block.status.any()
    assert decoder.losses == Losses(samples=39)
    assert decoder.unfinished_bytes == FORMATS[model].marks.length


@pytest.mark.parametrize("model", FORMATS)
@given(st.binary(max_size=80), st.data())
@settings(deadline=None, max_examples=40)
def test_any_cut_gives_the_same(model, garbage, data):
    wire = b"".join([*frames(model, 15), garbage, *frames(model, 15, first=15)])
    whole, decoder = decode(model, [wire])
    block, other = decode(model, cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert other.losses == decoder.losses


def test_an_end_of_the_range_is_an_overload_of_its_gauge():
    counts = np.array([[0, 0], [32767, 5], [9, -32768], [40_000, -40_000], [0, 0]])
    block, decoder = decode(GSV_4, [encode_frames(FORMATS[GSV_4], counts).tobytes()])
    table, relative = SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE
    assert block.status.tolist() == [GOOD, table, relative, table | relative]
    assert decoder.losses.overloaded == 3


@pytest.mark.parametrize("model", FORMATS)
@pytest.mark.parametrize(
    ("harm", "broken"),
    [
        (lambda frame: frame[:1] + frame[2:], 1),  # a byte lost
        (lambda frame: frame[:-1], 1),
        (lambda frame: b"\x13" + frame[1:], 2),  # takes the one before along
        (lambda frame: frame[:1], 1),
    ],
    ids=["lost", "short", "another beginning", "one byte"],
)
def test_a_row_stands_for_each_broken_frame(model, harm, broken):
    sent = frames(model, 40)
    sent[12] = harm(sent[12])
    block, decoder = decode(model, [b"".join(sent)])
    assert len(block) == 39
    assert decoder.losses.damaged == broken == np.count_nonzero(block.status == DAMAGED)
    assert block.status[12] == DAMAGED
    good = block.status == GOOD
    np.testing.assert_array_equal(block.counts[good], readings(model, 39)[good])
    assert not block.counts[~good].any()


@pytest.mark.parametrize("model", FORMATS)
def test_a_stream_that_is_joined_within_a_frame(model):
    block, decoder = decode(model, [b"".join(frames(model, 40))[2:]])
    np.testing.assert_array_equal(block.counts, readings(model, 38, first=1))
    assert decoder.losses == Losses(samples=38, discarded_bytes=FORMATS[model].marks.length - 2)


@pytest.mark.parametrize("model", FORMATS)
def test_memory_is_bounded(model):
    layout = FORMATS[model]
    decoder = FrameDecoder(layout, RATE_HZ)
    for _ in range(200):
        list(decoder.feed(frames(model, 1)[0][:-1] * 5, 0))
        assert decoder.unfinished_bytes <= layout.marks.length * (1 + layout.marks.confirming)


def test_rows_stand_for_the_time_of_a_broken_connection():
    decoder = FrameDecoder(FORMATS[GSV_4], RATE_HZ)
    list(decoder.feed(b"".join(frames(GSV_4, 11)), 10**9))
    decoder.expect_restart()
    (block, *_) = decoder.feed(b"".join(frames(GSV_4, 11, first=60)), 1_500_000_000)
    assert block.first_index == 10
    assert np.count_nonzero(block.status == MISSING) == decoder.losses.missing_estimated
    assert decoder.losses.restarts == 1
    assert len(block) == 50
