"""Frames written by hand from the manual's description: there is no peer, and the manual shows no frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.enod4.codec import Checksum, FrameDecoder, encode_command, encode_frames, status_words
from drivers.samples import Losses, SampleStatus

RATE_HZ = 100.0
DAMAGED = SampleStatus.DAMAGED
N = 60
VALUES = np.arange(N) * 4099 - 100_000
"""Some of them hold bytes 02, 03 and 10."""


def frames(values=VALUES, checksum: Checksum = Checksum.FRAME) -> list[bytes]:
    words = status_words(np.zeros(len(values), dtype=np.uint8))
    return encode_frames(np.asarray(values, dtype=np.int32), words, checksum)


def decode(pieces, checksum: Checksum = Checksum.FRAME):
    decoder = FrameDecoder(RATE_HZ, checksum)
    return join([block for piece in pieces for block in decoder.feed(piece, 0)]), decoder


@pytest.mark.parametrize(
    ("wire", "value", "status"),
    [
        # sums with the first byte: 02+00+80+00+01+00 = 83h
        ("02 0080 000100 83 03", 256, 0),
        # 02+00+90+FF+FF+FE = 38Eh -> 8E; at rest (bit 4)
        ("02 0090 FFFFFE 8E 03", -2, 0),
        # 02+00+88+01+01+01 = 8Dh; over capacity (bits 3-2 = 10)
        ("02 0088 010101 8D 03", 0x010101, SampleStatus.OVERLOAD_TABLE),
        # 02+00+80+(10+02)+(10+03)+(10+10) = C7h: all three bytes of the value are marked
        ("02 0080 1002 1003 1010 C7 03", 0x020310, 0),
    ],
)
def test_frames_as_the_manual_describes_them(wire, value, status):
    block, decoder = decode([bytes.fromhex(wire)])
    assert block.counts.tolist() == [[value, 0]]
    assert block.status.tolist() == [status]
    assert decoder.losses.samples == 1


@pytest.mark.parametrize(
    ("checksum", "cks", "without_marks"), [(Checksum.FRAME, "C7", "97"), (Checksum.DATA, "C5", "95")]
)
def test_what_the_checksum_is_the_sum_of(checksum, cks, without_marks):
    (sent,) = encode_frames(np.array([0x020310]), np.array([0x80]), checksum)
    assert sent == bytes.fromhex(f"02 0080 1002 1003 1010 {cks} 03")
    for cks_sent in (cks, without_marks):
        wire = bytes.fromhex(f"02 0080 1002 1003 1010 {cks_sent} 03")
        good = [one for one in Checksum if list(FrameDecoder(RATE_HZ, one).feed(wire, 0))]
        assert good == [checksum]
    assert not list(FrameDecoder(RATE_HZ, checksum).feed(bytes.fromhex("02 0080 1002 1003 1010 A7 03"), 0))


def test_commands_as_the_manual_describes_them():
    """Address, command, 0D, and FF, which is always taken for the right CRC-8."""
    assert encode_command(1, 0xE2) == bytes.fromhex("01 E2 0D FF")


@pytest.mark.parametrize("pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [2, 9, 13])])
def test_whole_frames_in_any_cut(pieces):
    block, decoder = decode(pieces(b"".join(frames())))
    np.testing.assert_array_equal(block.counts[:, 0], VALUES)
    assert not block.counts[:, 1].any()
    assert not block.status.any()
    assert decoder.losses == Losses(samples=N)
    assert decoder.unfinished_bytes == 0


@given(st.binary(max_size=60), st.data())
@settings(deadline=None, max_examples=40)
def test_any_cut_gives_the_same(garbage, data):
    wire = b"".join([*frames()[:20], garbage, *frames()[20:]])
    whole, decoder = decode([wire])
    block, other = decode(cut_at(wire, data.draw(cuts(wire))))
    np.testing.assert_array_equal(block.counts, whole.counts)
    np.testing.assert_array_equal(block.status, whole.status)
    assert other.losses == decoder.losses


@pytest.mark.parametrize(
    ("harm", "broken"),
    [
        (lambda frame: frame[:3] + frame[4:], 1),
        (lambda frame: frame[:-1], 1),
        (lambda frame: frame[1:], 1),
        (lambda frame: frame[:-2] + bytes([frame[-2] ^ 1]) + frame[-1:], 1),
        (lambda _: b"", 0),
    ],
    ids=["lost", "short", "without its beginning", "wrong checksum", "gone"],
)
def test_a_row_stands_for_each_broken_frame(harm, broken):
    sent = frames()
    sent[12] = harm(sent[12])
    block, decoder = decode([b"".join(sent)])
    assert decoder.losses.damaged == broken == np.count_nonzero(block.status == DAMAGED)
    good = block.status == 0
    np.testing.assert_array_equal(block.counts[good, 0], np.delete(VALUES, 12))


@pytest.mark.parametrize("word", [0x84, 0x8C, 0xC0], ids=["sensor", "converter", "EEPROM"])
def test_a_frame_that_reports_a_fault_is_a_damaged_row(word):
    sent = frames()
    (sent[30],) = encode_frames(np.array([5]), np.array([word]))
    block, decoder = decode([b"".join(sent)])
    assert np.flatnonzero(block.status == DAMAGED).tolist() == [30]
    assert decoder.losses == Losses(samples=N, damaged=1, discarded_bytes=len(sent[30]))


def test_memory_is_bounded():
    decoder = FrameDecoder(RATE_HZ)
    for piece in (b"\x02\x10", b"\x02" * 5000, b"\x10" * 5000, b"\x02\x00\x80\x00\x00\x00"):
        list(decoder.feed(piece, 0))
        assert decoder.unfinished_bytes <= 13
