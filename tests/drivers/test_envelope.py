import pytest
from hypothesis import given
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, single_bytes

from drivers.crc import crc16
from drivers.envelope import HEADER_BYTES, MAGIC, MAX_DATA_BYTES, StampedRead, Unwrapper, wrap

READS = [
    StampedRead(0, 12_345_678_901_234, b"first"),
    StampedRead(1, -5, b""),
    StampedRead(255, (1 << 63) - 1, MAGIC + b"inside" + MAGIC),
    StampedRead(0, 0, bytes(range(256))),
]
WIRE = b"".join(wrap(read.port, read.arrival_ns, read.data) for read in READS)
stamped = st.builds(
    StampedRead, st.integers(0, 255), st.integers(-(1 << 63), (1 << 63) - 1), st.binary(max_size=80)
)


def unwrap(pieces) -> tuple[list[StampedRead], Unwrapper]:
    unwrapper = Unwrapper()
    return [read for piece in pieces for read in unwrapper.feed(piece)], unwrapper


def test_an_envelope_as_it_is_written():
    wire = wrap(1, 0x0102030405060708, b"123456789")
    # CRC-32 of "123456789" is CBF43926 (CRC RevEng catalogue, CRC-32/ISO-HDLC)
    fields = bytes.fromhex("a9 53 45 31  01  09 00  08 07 06 05 04 03 02 01  26 39 f4 cb")
    assert wire == fields + crc16(fields).to_bytes(2, "little") + b"123456789"


@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [1, 3, 25, 26, 40, 41])]
)
def test_whole_envelopes_in_any_cut(pieces):
    reads, unwrapper = unwrap(pieces(WIRE))
    assert reads == READS
    assert (unwrapper.discarded_bytes, unwrapper.unfinished_bytes) == (0, 0)


def test_a_long_read_becomes_several_envelopes():
    data = bytes(2 * MAX_DATA_BYTES + 7)
    reads, _ = unwrap([wrap(3, 9, data)])
    assert [len(read.data) for read in reads] == [MAX_DATA_BYTES, MAX_DATA_BYTES, 7]
    assert {(read.port, read.arrival_ns) for read in reads} == {(3, 9)}


def test_rubbish_between_envelopes_is_left_out_and_counted():
    rubbish = [b"rubbish", MAGIC[:2], MAGIC + b"\x00" * 30, MAGIC[:1] * 9]
    parts = [wrap(read.port, read.arrival_ns, read.data) for read in READS]
    data = b"".join(junk + part for junk, part in zip(rubbish, parts, strict=True)) + b"end"
    for pieces in ([data], single_bytes(data)):
        reads, unwrapper = unwrap(pieces)
        assert reads == READS
        assert unwrapper.discarded_bytes == len(data) - len(WIRE)


def test_a_cut_envelope_takes_no_other_with_it():
    cut = wrap(0, 7, bytes(50))[:-20]
    reads, unwrapper = unwrap([cut + WIRE])
    assert reads == READS
    assert unwrapper.discarded_bytes == len(cut)


@given(st.integers(0, len(WIRE) - 1), st.integers(1, 255))
def test_one_damaged_byte_costs_one_envelope(place, change):
    damaged = bytearray(WIRE)
    damaged[place] ^= change
    # behind the last envelope, so that one with a damaged length need not wait
    reads, unwrapper = unwrap([bytes(damaged) + WIRE])
    assert len(reads) == 2 * len(READS) - 1
    assert reads[-len(READS) :] == READS
    assert set(reads) <= set(READS)
    lost = next(read for read in READS if reads.count(read) < 2)
    assert unwrapper.discarded_bytes == HEADER_BYTES + len(lost.data)


def test_a_length_with_a_wrong_header_is_not_waited_for():
    damaged = bytearray(wrap(0, 7, b"data"))
    damaged[5] ^= 0xFF
    _, unwrapper = unwrap([bytes(damaged)])
    assert unwrapper.unfinished_bytes == 0


@given(st.binary(max_size=3 * MAX_DATA_BYTES))
def test_what_is_kept_is_bounded(rubbish):
    _, unwrapper = unwrap([rubbish, MAGIC + rubbish])
    assert unwrapper.unfinished_bytes < HEADER_BYTES + MAX_DATA_BYTES
    kept = unwrapper.discarded_bytes + unwrapper.unfinished_bytes
    assert kept == 2 * len(rubbish) + len(MAGIC)


@given(st.lists(stamped, max_size=8), st.data())
def test_what_was_wrapped_comes_out_whatever_the_cut(reads, data):
    wire = b"".join(wrap(read.port, read.arrival_ns, read.data) for read in reads)
    got, unwrapper = unwrap(cut_at(wire, data.draw(cuts(wire))))
    assert got == reads
    assert unwrapper.discarded_bytes == 0


@pytest.mark.parametrize("port", [-1, 256])
def test_a_port_without_a_place(port):
    with pytest.raises(ValueError, match="give 0 to 255"):
        wrap(port, 0, b"")
