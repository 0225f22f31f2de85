"""The reference firmware's protocol, on a simulated board with the pattern instead of a converter."""

import re
import struct
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from board_kit import BAUD, ask, listening, run_make, running

from drivers.devices.slipstand_binary.codec import FrameFlags
from drivers.errors import ProtocolError
from drivers.port import open_port
from drivers.samples import Losses

DROPPED = FrameFlags.DROPPED_BEFORE
_SYNC = b"\xaa\x55\x01"


class Head(NamedTuple):
    flags: int
    sequence: int
    time_us: int
    samples: int


def heads(wire: bytes) -> list[Head]:
    """Frames that follow each other without a byte between; the first and the last may be cut off."""
    return list(_heads(wire[wire.index(_SYNC) :]))


def _heads(wire: bytes) -> Iterator[Head]:
    while len(wire) >= 13:
        assert wire[:3] == _SYNC
        head = Head(*struct.unpack_from("<BIIB", wire, 3))
        yield head
        wire = wire[13 + 8 * head.samples + 2 :]


def heads_after_a_reset(wire: bytes) -> list[Head]:
    """All that looks like the head of a frame: a reset may cut one off anywhere."""
    starts = [found.start() for found in re.finditer(re.escape(_SYNC), wire[:-10])]
    return [Head(*struct.unpack_from("<BIIB", wire, start + len(_SYNC))) for start in starts]


def pattern(index):
    """Numbers that firmware/pattern.c promises."""
    table = 4099 * np.asarray(index, dtype=np.int64) % 2**24 - 2**23
    return np.column_stack([table, -1 - table])


@pytest.fixture
def board(workshop):
    with running(workshop, workshop.firmware("pattern")) as board:
        yield board


@pytest.mark.parametrize("converter", ["ads1256", "ads131m02", "hx711", "pattern"])
def test_it_compiles_without_a_warning_and_fits(workshop, converter, tmp_path):
    made = run_make(f"CONVERTER={converter}", f"BUILD={tmp_path}")
    assert (made.returncode, made.stderr) == (0, "")
    flash, ram = re.search(r"flash (\d+) of \d+ bytes, RAM (\d+) of", made.stdout).groups()
    assert 1000 < int(flash) < 32768 - 2048
    assert 1000 < int(ram) < 2048 - 256


def test_a_baud_rate_that_the_clock_cannot_make_is_refused(workshop, tmp_path):
    made = run_make("CONVERTER=pattern", "BAUD=460800", f"BUILD={tmp_path}")
    assert made.returncode != 0
    assert "baud rate is not possible at this clock. Use 250000, 500000 or 1000000" in made.stderr


def test_our_driver_identifies_it_and_reads_what_the_pattern_promises(board):
    with listening(board) as listener:
        assert listener.source.identity.firmware == "1.0.0+pattern"
        assert listener.source.rate_hz == 1000
        listener.listen(800)
    index = np.arange(listener.samples)
    np.testing.assert_array_equal(listener.counts, pattern(index))
    np.testing.assert_allclose(listener.times_s, index / 1000, rtol=0, atol=2e-6)
    assert not listener.status.any()
    assert listener.source.losses == Losses(samples=listener.samples)


@pytest.mark.parametrize(("rate_hz", "samples"), [(30, 1), (399, 1), (400, 2), (1000, 5), (4999, 24)])
def test_a_rate_is_set_and_a_frame_spans_5_ms(board, rate_hz, samples):
    with listening(board, rate_hz) as listener:
        listener.listen(6 * samples)
    found = heads(listener.wire)
    assert {head.samples for head in found} == {samples}
    assert [head.sequence for head in found] == list(range(0, samples * len(found), samples))
    span_us = samples / rate_hz * 1e6
    np.testing.assert_allclose(np.diff([head.time_us for head in found]), span_us, rtol=0, atol=1)
    assert listener.source.losses.missing == 0


def test_a_rate_that_it_cannot_do_leaves_all_as_it_was(board):
    with open_port(board.url, BAUD) as port:
        assert ask(port, b"R10001\nI") == b"slipstand-fw 1.0.0+pattern 1000 2\n"
    with (
        pytest.raises(ProtocolError, match="does not take 20000 Hz and stays at 1000 Hz"),
        listening(board, 20000),
    ):
        pass


def test_rubbish_between_commands_is_passed_over(board):
    with open_port(board.url, BAUD) as port:
        answer = ask(port, b"R\nxR12y3\nR999999999999\nR-5\n\x00\xffR250\r\nI")
    assert answer == b"slipstand-fw 1.0.0+pattern 250 2\n"


def test_it_stops_and_starts_anew(board):
    with listening(board) as listener:
        listener.listen(50)
    with open_port(board.url, BAUD) as port:
        while port.read():
            pass  # the end of what was under way
        assert ask(port, b"I").startswith(b"slipstand-fw")  # and nothing before it
    with listening(board) as listener:
        listener.listen(50)
    assert heads(listener.wire)[0].sequence == 0


def test_it_answers_between_the_frames_of_a_stream_that_goes_on(board):
    with listening(board) as listener:
        listener.listen(100)
        listener.port.write(b"I")
        answer = b"slipstand-fw 1.0.0+pattern 1000 2\n"
        listener.listen_until(lambda: answer in listener.wire)
        listener.listen(listener.samples + 100)
    np.testing.assert_array_equal(listener.counts, pattern(np.arange(listener.samples)))
    assert listener.source.losses == Losses(samples=listener.samples, discarded_bytes=len(answer))


def test_a_line_that_cannot_follow_loses_whole_frames_and_the_next_one_says_so(board):
    with listening(board, 8000) as listener:
        listener.listen(8000)
    losses = listener.source.losses
    assert losses.missing > 500
    assert (losses.damaged, losses.discarded_bytes, losses.unexplained_drops) == (0, 0, 0)
    found = heads(listener.wire)
    after_loss = [now.sequence != before.sequence + before.samples for before, now in pairwise(found)]
    assert [bool(head.flags & DROPPED) for head in found[1:]] == after_loss
    assert {head.samples for head in found} == {32}
    came = np.flatnonzero(listener.status == 0)
    np.testing.assert_array_equal(listener.counts[came], pattern(came))


@pytest.mark.parametrize(
    ("hang", "bootloader"),
    [(b"H", False), (b"H", True), (b"C", False)],
    ids=["no-bootloader", "bootloader", "clock-stopped"],
)
def test_the_watchdog_resets_a_loop_that_hangs_and_the_stream_goes_on(workshop, hang, bootloader):
    firmware = workshop.firmware("pattern", "DEFINES=-DTEST_HANG")
    with running(workshop, firmware, bootloader=bootloader) as board, listening(board, 500) as listener:
        listener.listen(100)
        listener.port.write(hang)
        listener.listen_until(lambda: listener.source.losses.restarts == 1)
        listener.listen(listener.samples + 100)
        first = next(head for head in reversed(heads_after_a_reset(listener.wire)) if head.sequence == 0)
        assert first.flags & DROPPED
        listener.source.stop(listener.port)
        assert ask(listener.port, b"I", b"slipstand-fw 1.0.0+pattern.watchdog 500 2\n")
        assert ask(listener.port, b"SPI", b"slipstand-fw 1.0.0+pattern 500 2\n")


def test_a_hanging_loop_cannot_be_ordered_of_the_firmware_that_is_flashed(board):
    with listening(board) as listener:
        listener.port.write(b"HC")
        listener.listen(600)
    assert listener.source.losses.restarts == 0


def test_our_driver_starts_a_board_anew_that_was_reset_by_hand(board):
    with listening(board, 500) as listener:
        listener.listen(100)
        board.press_reset()
        while listener.port.read():
            pass  # what was under way; the board now waits to be started
        listener.resume()
        listener.listen(listener.samples + 100)
        assert listener.source.losses.restarts == 1
        assert listener.source.identity.firmware == "1.0.0+pattern"
        assert listener.source.rate_hz == 500
