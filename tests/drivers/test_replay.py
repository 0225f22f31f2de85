import numpy as np
import pytest
from replay_kit import replay, split_reads
from wire_helpers import join

from drivers.devices.csv_lines.codec import encode_lines
from drivers.devices.csv_lines.columns import LineFormat
from drivers.devices.slipstand_binary.codec import FrameDecoder, encode_frames
from drivers.errors import NoDataError
from drivers.registry import find_driver

RATE_HZ = 500.0
COUNTS = np.arange(2000).reshape(1000, 2)


def binary() -> bytes:
    frames = encode_frames(0, np.arange(500) * 4000, COUNTS)
    return b"".join(row.tobytes() for k, row in enumerate(frames) if k not in (40, 41, 300))


def lines() -> bytes:
    return b"\n" + b"".join(encode_lines(LineFormat(), np.arange(1000) / RATE_HZ, COUNTS))


def reads(data: bytes, size: int) -> list[tuple[int, bytes]]:
    return [(10**9 + 1000 * at, data[at : at + size]) for at in range(0, len(data), size)]


@pytest.mark.parametrize("size", [1, 44, 500, 200_000])
@pytest.mark.parametrize("rate_hz", [None, RATE_HZ])
def test_a_replay_gives_what_the_decoder_gave(size, rate_hz):
    live = FrameDecoder(RATE_HZ)
    expected = join(live.feed(binary(), 0))
    source = find_driver("slipstand-binary").make_source({}, rate_hz)
    block = join(replay(source, reads(binary(), size)))
    np.testing.assert_array_equal(block.counts, expected.counts)
    np.testing.assert_array_equal(block.status, expected.status)
    assert source.losses == live.losses
    assert source.losses.missing == 6
    assert source.rate_hz == pytest.approx(RATE_HZ)


@pytest.mark.parametrize("size", [1, 44, 200_000])
def test_a_replay_of_lines(size):
    source = find_driver("csv").make_source({}, None)
    block = join(replay(source, reads(lines(), size)))
    np.testing.assert_array_equal(block.counts, COUNTS)


def test_stored_bytes_are_cut_as_they_came():
    assert list(split_reads(b"abcdef", [1, 1, 4, 6], np.array([5, 6, 7, 8]))) == [
        (5, b"a"),
        (6, b""),
        (7, b"bcd"),
        (8, b"ef"),
    ]


@pytest.mark.parametrize("data", [b"", bytes(range(256)) * 20])
def test_bytes_without_a_sample_are_an_error(data):
    source = find_driver("slipstand-binary").make_source({}, None)
    with pytest.raises(NoDataError, match="the recorded bytes hold no sample: "):
        list(replay(source, reads(data, 100)))


def test_endless_rubbish_is_not_hoarded():
    source = find_driver("csv").make_source({}, None)
    with pytest.raises(NoDataError, match="check the baud rate"):
        list(replay(source, reads(b"\x00\xff" * 600_000, 50_000)))
