import binascii

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from wire_helpers import cut_at, cuts, join, single_bytes

from drivers.devices.csv_lines.codec import (
    MAX_LINE_BYTES,
    LineDecoder,
    clock_step_from_lines,
    encode_line,
    encode_lines,
    has_good_line,
    rate_from_lines,
)
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.samples import Losses, SampleStatus

C = Column
RATE_HZ = 100.0
TIMED = LineFormat()
SEQUENCED = LineFormat((C.SEQUENCE, C.TABLE, C.RELATIVE, C.CRC))
BARE = LineFormat((C.TABLE, C.RELATIVE))
GOOD, MISSING, DAMAGED = SampleStatus.GOOD, SampleStatus.MISSING, SampleStatus.DAMAGED


def readings(samples: int) -> np.ndarray:
    index = np.arange(samples)
    return np.stack([index * 10 - 5, 1000 - index], axis=1)


def stream(layout: LineFormat, samples: int, first: int = 0) -> list[bytes]:
    times_s = (first + np.arange(samples)) / RATE_HZ
    return encode_lines(layout, times_s, readings(samples), first)


def decode(layout: LineFormat, pieces, rate_hz: float = RATE_HZ, **options):
    """The first line is left out as a rule: give it."""
    decoder = LineDecoder(layout, rate_hz, **options)
    list(decoder.feed(b"\n", 0))
    block = join([block for piece in pieces for block in decoder.feed(piece, 0)])
    return block, decoder


# --- encoding ------------------------------------------------------------------------------


def test_lines_as_they_are_written():
    assert encode_line(LineFormat(), 1.5, 12, -3) == b"1500000,12,-3\r\n"
    assert encode_line(LineFormat((C.TIME_MS, C.RELATIVE, C.TABLE)), 1.5, 12, -3) == b"1500,-3,12\r\n"
    european = LineFormat((C.TIME_S, C.IGNORE, C.TABLE, C.RELATIVE), separator=";", decimal=",")
    assert encode_line(european, 1.5, 0.25, -3) == b"1,5;0;0,25;-3\r\n"


def test_counters_wrap_as_the_device_lets_them():
    assert encode_line(LineFormat(), 4294.967297, 0, 0) == b"1,0,0\r\n"
    layout = LineFormat((C.SEQUENCE, C.TABLE, C.RELATIVE), sequence_bits=8)
    assert encode_line(layout, 0, 0, 0, sequence=257) == b"1,0,0\r\n"


def test_checksums_cover_what_stands_before_their_separator():
    columns = (C.TABLE, C.RELATIVE)
    # 31 ^ 2C ^ 32 = 2F
    assert encode_line(LineFormat((*columns, C.XOR)), 0, 1, 2) == b"1,2,2F\r\n"
    crc = binascii.crc_hqx(b"1,2", 0xFFFF)
    assert encode_line(LineFormat((*columns, C.CRC)), 0, 1, 2) == b"1,2,%04X\r\n" % crc


# --- numbers -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (b"0", 0.0),
        (b"-8388608", -8388608.0),
        (b"+7", 7.0),
        (b" 12 ", 12.0),
        (b"9007199254740991", 9007199254740991.0),
        (b"0.1", 0.1),
        (b"-.5", -0.5),
        (b"5.", 5.0),
        (b"1e3", 1000.0),
        (b"-1.25E-3", -0.00125),
        (b"1e+22", 1e22),
        (b"0.00000000000000000012345", 1.2345e-19),
    ],
)
def test_numbers(text, value):
    block, _ = decode(BARE, [text + b"," + text + b"\n"])
    assert block.counts.tolist() == [[value, value]]


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"-",
        b".",
        b"e5",
        b"1e",
        b"1e+",
        b"1e1234",
        b"1.2.3",
        b"0x10",
        b"nan",
        b"inf",
        b"1 2",
        b"1-",
        b"--1",
    ],
)
def test_what_is_no_number_breaks_the_line(text):
    block, decoder = decode(BARE, [b"1,2\n", b"3," + text + b"\n", text + b",4\n", b"5,6\n"])
    assert block.status.tolist() == [GOOD, DAMAGED, DAMAGED, GOOD]
    assert decoder.losses.damaged == 2


@given(st.floats(-1e280, 1e280), st.integers(-(2**53), 2**53))
@example(1.2345678901234567e-280, 0)
@settings(deadline=None)
def test_any_float_comes_through_nearly_and_any_count_exactly(value, count):
    block, _ = decode(BARE, [f"{value!r},{count}\n".encode()])
    read, exact = block.counts[0]
    assert exact == count
    assert read == pytest.approx(value, rel=1e-15, abs=1e-280)


@given(st.integers(-(10**15) + 1, 10**15 - 1), st.integers(0, 22))
@settings(deadline=None)
def test_decimal_numbers_of_fifteen_digits_are_exact(digits, places):
    text = f"{digits}e-{places}".encode()
    block, _ = decode(BARE, [text + b",0\n"])
    assert block.counts[0, 0] == float(text)


# --- lines that are whole --------------------------------------------------------------------


@pytest.mark.parametrize(
    "layout", [TIMED, SEQUENCED, BARE, LineFormat((C.TIME_S, C.TABLE, C.RELATIVE, C.XOR))]
)
@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r"])
@pytest.mark.parametrize(
    "pieces", [lambda data: [data], single_bytes, lambda data: cut_at(data, [3, 12, 13, 50])]
)
def test_whole_lines_in_any_cut(layout, end, pieces):
    data = b"".join(stream(layout, 12)).replace(b"\r\n", end)
    block, decoder = decode(layout, pieces(data))
    np.testing.assert_array_equal(block.counts, readings(12))
    assert block.counts.dtype == np.float64
    assert not block.status.any()
    assert decoder.losses == Losses(samples=12)
    if layout.time_column is None:
        assert block.device_time_s is None
    else:
        np.testing.assert_allclose(block.device_time_s, np.arange(12) / RATE_HZ, atol=1e-9)


@pytest.mark.parametrize(("separator", "between"), [("\t", b"\t"), (" ", b"   "), (";", b" ; "), ("|", b"|")])
def test_separators(separator, between):
    layout = LineFormat((C.TIME_US, C.IGNORE, C.TABLE, C.RELATIVE), separator=separator)
    line = between.join([b"5", b"6.5", b"-7", b"8"])
    block, _ = decode(layout, [b"  " + line + b"  \r\n" if separator == " " else line + b"\r\n"])
    assert block.counts.tolist() == [[-7, 8]]


def test_decimal_commas():
    layout = LineFormat((C.TIME_S, C.TABLE, C.RELATIVE), separator=";", decimal=",")
    block, _ = decode(layout, [b"0,01;1,25;-2,5e1\n0,02;3;,5\n"])
    assert block.counts.tolist() == [[1.25, -25], [3, 0.5]]


def test_banner_comments_and_blank_lines_are_passed_over():
    lines = stream(TIMED, 4)
    data = b"HX711 ready\r\n\r\ntime,table,relative\n" + lines[0] + b"# gain 128\n\n\n" + b"".join(lines[1:])
    block, decoder = decode(TIMED, [data])
    np.testing.assert_array_equal(block.counts, readings(4))
    assert decoder.losses == Losses(samples=4, discarded_bytes=len("HX711 readytime,table,relative"))


def test_the_first_line_may_be_the_end_of_one():
    decoder = LineDecoder(TIMED, RATE_HZ)
    data = b"".join(stream(TIMED, 5, first=1000))
    block = join(decoder.feed(data[4:], 0))
    np.testing.assert_array_equal(block.counts, readings(5)[1:])


def test_overloads_are_marked_and_counted():
    data = b"0,8388607,0\n10000,8388606,-8388607\n20000,9000000,-9000000\n"
    block, decoder = decode(TIMED, [data], overload_count=8388607)
    table, relative = SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE
    assert block.status.tolist() == [table, relative, table | relative]
    assert decoder.losses.overloaded == 3


@pytest.mark.parametrize("layout", [LineFormat(), LineFormat((C.TIME_MS, C.TABLE, C.RELATIVE), time_bits=16)])
def test_times_wrap(layout):
    unit_s = 1e-6 if layout.time_column is C.TIME_US else 1e-3
    times_s = layout.time_wrap * unit_s - 0.05 + np.arange(20) / RATE_HZ
    block, decoder = decode(layout, encode_lines(layout, times_s, readings(20)))
    np.testing.assert_allclose(block.device_time_s, np.arange(20) / RATE_HZ, atol=1e-6)
    assert decoder.losses == Losses(samples=20)


# --- what is lost, told by a sequence ---------------------------------------------------------


def test_a_sequence_proves_what_is_missing():
    lines = stream(SEQUENCED, 10, first=2**32 - 5)
    block, decoder = decode(SEQUENCED, [*lines[:3], *lines[6:]])
    assert block.status.tolist() == [GOOD] * 3 + [MISSING] * 3 + [GOOD] * 4
    assert decoder.losses == Losses(samples=10, missing=3)


def test_broken_lines_are_damaged_and_not_missing_too():
    lines = stream(SEQUENCED, 10)
    lines[4] = lines[4].replace(b",", b";", 1)
    block, decoder = decode(SEQUENCED, [*lines[:6], *lines[8:]])
    assert block.status.tolist() == [GOOD] * 4 + [DAMAGED, GOOD] + [MISSING] * 2 + [GOOD] * 2
    assert decoder.losses.damaged == 1
    assert decoder.losses.missing == 2


def test_two_lines_run_together_are_one_broken_and_one_missing():
    lines = stream(SEQUENCED, 6)
    lines[2] = lines[2].replace(b"\r\n", b"")
    block, decoder = decode(SEQUENCED, lines)
    assert block.status.tolist() == [GOOD] * 2 + [DAMAGED, MISSING] + [GOOD] * 2
    assert (decoder.losses.damaged, decoder.losses.missing) == (1, 1)


@pytest.mark.parametrize("checksum", [C.XOR, C.CRC])
def test_a_checksum_finds_a_wrong_digit(checksum):
    layout = LineFormat((C.TIME_US, C.TABLE, C.RELATIVE, checksum))
    lines = stream(layout, 6)
    lines[3] = lines[3].replace(b",25,", b",27,")
    block, decoder = decode(layout, lines)
    assert block.status.tolist() == [GOOD] * 3 + [DAMAGED] + [GOOD] * 2
    assert decoder.losses.damaged == 1


@pytest.mark.parametrize(
    ("checksum", "said"),
    [
        (C.CRC, b"%04X" % binascii.crc_hqx(b"-12,34", 0xFFFF)),
        (C.CRC, b"%04x" % binascii.crc_hqx(b"-12,34", 0xFFFF)),
        (C.XOR, b"%02x" % (0x2D ^ 0x31 ^ 0x32 ^ 0x2C ^ 0x33 ^ 0x34)),
    ],
)
def test_a_checksum_is_read_in_capitals_and_small_letters_and_must_be_whole(checksum, said):
    layout = LineFormat((C.TABLE, C.RELATIVE, checksum))
    lines = [
        b"-12,34," + text + b"\n" for text in (said, said[:-1], said + b"0", b"", said[:-1] + b"g", said)
    ]
    block, _ = decode(layout, lines)
    assert block.status.tolist() == [GOOD] + [DAMAGED] * 4 + [GOOD]


@pytest.mark.parametrize("place", [b"5,", b"900,", b"4000000000,"])
def test_a_wrong_sequence_number_without_checksum_invents_no_gap(place):
    layout = LineFormat((C.SEQUENCE, C.TABLE, C.RELATIVE))
    lines = stream(layout, 20)
    lines[9] = place + lines[9].partition(b",")[2]
    block, decoder = decode(layout, lines)
    assert block.status.tolist() == [GOOD] * 9 + [DAMAGED] + [GOOD] * 10
    assert decoder.losses.damaged == 1
    assert decoder.losses.missing == decoder.losses.restarts == 0


def test_the_same_line_twice_counts_once():
    lines = stream(SEQUENCED, 4)
    block, decoder = decode(SEQUENCED, [*lines[:2], lines[1], *lines[2:]])
    np.testing.assert_array_equal(block.counts, readings(4))
    assert decoder.losses.repeated == 1
    assert decoder.losses.samples == 4


# --- what is lost, told by time -----------------------------------------------------------------


def test_time_tells_what_is_missing_as_an_estimate():
    lines = stream(TIMED, 10)
    block, decoder = decode(TIMED, [*lines[:3], *lines[6:]])
    assert block.status.tolist() == [GOOD] * 3 + [MISSING] * 3 + [GOOD] * 4
    np.testing.assert_allclose(block.device_time_s, np.arange(10) / RATE_HZ, atol=1e-9)
    assert decoder.losses == Losses(samples=10, missing_estimated=3)


def test_a_line_known_to_be_broken_is_not_estimated_too():
    lines = stream(TIMED, 10)
    lines[4] = b"garbled\n"
    block, decoder = decode(TIMED, [*lines[:6], *lines[8:]])
    assert block.status.tolist() == [GOOD] * 4 + [DAMAGED, GOOD] + [MISSING] * 2 + [GOOD] * 2
    assert (decoder.losses.damaged, decoder.losses.missing_estimated) == (1, 2)


@pytest.mark.parametrize("wrong_us", [b"95000", b"700000", b"3000000000", b"4"])
def test_a_wrong_time_invents_no_gap(wrong_us):
    lines = stream(TIMED, 20)
    lines[9] = wrong_us + b"," + lines[9].partition(b",")[2]
    block, decoder = decode(TIMED, lines)
    assert len(block) == 20
    assert decoder.losses.missing_estimated == decoder.losses.restarts == 0
    assert decoder.losses.damaged == (0 if wrong_us == b"95000" else 1)  # half a period is only late


def test_jitter_of_less_than_half_a_period_loses_nothing():
    rng = np.random.default_rng(3)
    times_s = np.arange(2000) / RATE_HZ + rng.uniform(-0.24, 0.24, 2000) / RATE_HZ
    _, decoder = decode(TIMED, encode_lines(TIMED, times_s + 1, readings(2000)))
    assert decoder.losses == Losses(samples=2000)


def test_a_late_line_is_no_gap():
    times_s = np.array([0, 1, 2, 3.8, 4, 5, 6]) / RATE_HZ
    _, decoder = decode(TIMED, encode_lines(TIMED, times_s, readings(7)))
    assert decoder.losses == Losses(samples=7)


@pytest.mark.parametrize("column", [C.TIME_MS, C.TIME_S])
@pytest.mark.parametrize("rate_hz", [300.0, 667.0, 900.0, 1000.0, 10_000.0])
def test_a_coarse_clock_loses_nothing_and_tells_the_rate(column, rate_hz):
    layout = LineFormat((column, C.TABLE, C.RELATIVE))
    times_ms = [int(1000 * k / rate_hz) for k in range(3000)]
    lines = [
        b"%d,1,2\n" % ms if column is C.TIME_MS else f"{ms / 1000:.3f},1,2\n".encode() for ms in times_ms
    ]
    data = b"\n" + b"".join(lines)
    step_s = clock_step_from_lines(layout, data)
    assert step_s == pytest.approx(1e-3)
    if rate_hz != 10_000:  # 0.3 s are too little
        assert rate_from_lines(layout, data) == pytest.approx(rate_hz, rel=1e-3)
    _, decoder = decode(layout, lines, rate_hz=rate_hz, clock_step_s=step_s)
    assert decoder.losses == Losses(samples=3000)


def test_the_step_of_a_clock():
    assert clock_step_from_lines(LineFormat(), b"") == 1e-6
    assert clock_step_from_lines(BARE, b"\n1,2\n") == 0
    european = LineFormat((C.TABLE, C.TIME_S, C.RELATIVE), separator=";", decimal=",")
    assert clock_step_from_lines(european, b"\n1,5; 0,01 ;2\nbanner\n1;0,02;3\n") == 0.01
    assert clock_step_from_lines(european, b"\n1;2;3\n") == 1


# --- without either --------------------------------------------------------------------------


def test_bare_lines_have_a_row_for_each_broken_one():
    lines = stream(BARE, 6)
    lines[3] = b"1;2\n"
    block, decoder = decode(BARE, lines)
    assert block.status.tolist() == [GOOD] * 3 + [DAMAGED] + [GOOD] * 2
    assert decoder.losses.damaged == 1


def test_the_hosts_clock_tells_how_many_bare_lines_lack():
    decoder = LineDecoder(BARE, RATE_HZ)
    for k, line in enumerate([b"\n", *stream(BARE, 1200)]):
        if k % 10 or k == 0 or k > 1000:
            for _ in decoder.feed(line, k * 10_000_000):
                pass
    assert decoder.losses.samples == 1100
    assert decoder.losses.missing_estimated == pytest.approx(100, abs=2)


def test_bare_lines_that_come_late_are_not_lost():
    decoder = LineDecoder(BARE, RATE_HZ)
    for k, line in enumerate([b"\n", *stream(BARE, 1000)]):
        late_ns = 400_000_000 if k % 100 < 30 else 0
        for _ in decoder.feed(line, k * 10_000_000 + late_ns):
            pass
    assert decoder.losses.missing_estimated == 0


def test_a_moment_behind_the_hosts_clock_is_no_loss():
    decoder = LineDecoder(BARE, RATE_HZ)
    for k, line in enumerate([b"\n", *stream(BARE, 100)]):
        for _ in decoder.feed(line, k * 10_000_000 + (k % 7) * 9_000_000):
            pass
    assert decoder.losses.missing_estimated == 0


# --- devices that begin anew ---------------------------------------------------------------------


@pytest.mark.parametrize("layout", [TIMED, SEQUENCED])
def test_time_or_sequence_that_go_back_are_a_new_start(layout):
    decoder = LineDecoder(layout, RATE_HZ)
    blocks = list(decoder.feed(b"\n" + b"".join(stream(layout, 5, first=700)), 0))
    blocks += list(decoder.feed(b"banner\r\n" + b"".join(stream(layout, 5)), 2_000_000_000))
    block = join(blocks)
    absent = len(block) - 10
    assert absent == 200 - 6
    assert block.status.tolist() == [GOOD] * 5 + [DAMAGED] + [MISSING] * (absent - 1) + [GOOD] * 5
    assert decoder.losses.restarts == 1
    assert decoder.losses.missing_estimated == absent - 1
    if layout is TIMED:
        np.testing.assert_allclose(np.diff(block.device_time_s), 1 / RATE_HZ, atol=1e-9)


def test_a_restart_that_was_asked_for():
    decoder = LineDecoder(TIMED, RATE_HZ)
    list(decoder.feed(b"\n" + b"".join(stream(TIMED, 5)), 0))
    decoder.expect_restart()
    more = join_from(decoder.feed(b"half a li\n" + b"".join(stream(TIMED, 5, first=400)), 0), 5)
    assert more == 5
    assert decoder.losses.restarts == 1
    assert decoder.losses.samples == 10


@pytest.mark.parametrize("layout", [TIMED, SEQUENCED])
@pytest.mark.parametrize("first", [0, 1005, 1205, 400])
def test_after_a_broken_link_the_device_is_believed_if_the_host_agrees(layout, first):
    decoder = LineDecoder(layout, RATE_HZ)
    list(decoder.feed(b"\n" + b"".join(stream(layout, 5)) + b"half a li", 0))
    decoder.expect_restart()
    elapsed_ns = round(1005 / RATE_HZ * 1e9)
    rows = join_from(decoder.feed(b"ne\n" + b"".join(stream(layout, 5, first=first)), elapsed_ns), 5)
    is_believed = first == 1005
    assert rows == 1000 + 5
    assert decoder.losses.restarts == (not is_believed)
    assert decoder.losses.damaged == 1
    proven = is_believed and layout is SEQUENCED
    assert (decoder.losses.missing, decoder.losses.missing_estimated) == ((999, 0) if proven else (0, 999))


def test_after_a_broken_link_lines_without_time_are_estimated():
    decoder = LineDecoder(BARE, RATE_HZ)
    list(decoder.feed(b"\n" + b"".join(stream(BARE, 5)), 0))
    decoder.expect_restart()
    rows = join_from(decoder.feed(b"\n" + b"".join(stream(BARE, 5)), round(105 / RATE_HZ * 1e9)), 5)
    assert rows == 100 + 5
    assert decoder.losses.missing_estimated == 100


def join_from(blocks, first: int) -> int:
    rows = 0
    for block in blocks:
        assert block.first_index == first + rows
        rows += len(block)
    return rows


# --- bounds ---------------------------------------------------------------------------------------


def test_a_line_without_end_is_given_up():
    decoder = LineDecoder(TIMED, RATE_HZ)
    lines = stream(TIMED, 3)
    endless = b"7" * (10 * MAX_LINE_BYTES)
    blocks = []
    for piece in [b"\n", lines[0], *single_bytes(endless), b"\n", *lines[1:]]:
        blocks += decoder.feed(piece, 0)
        assert decoder.unfinished_bytes <= 3 * MAX_LINE_BYTES
    assert join(blocks).status.tolist() == [GOOD] * 3
    assert decoder.losses.discarded_bytes == len(endless)


def test_a_doubtful_line_waits_for_the_next_but_not_for_ever():
    decoder = LineDecoder(TIMED, RATE_HZ)
    lines = stream(TIMED, 9)
    list(decoder.feed(b"\n" + lines[0] + lines[1] + lines[7], 0))
    assert decoder.losses.samples == 2
    for _ in range(200):
        for _ in decoder.feed(b"# nothing but comments from now on\n", 0):
            pass
        assert decoder.unfinished_bytes <= 3 * MAX_LINE_BYTES
    assert decoder.losses.samples == 8


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=3000), st.data())
def test_no_noise_upsets_the_decoder_whatever_the_cut(noise, data):
    for layout in (TIMED, SEQUENCED, BARE):
        whole, decoder = decode(layout, [noise])
        pieces, decoder_2 = decode(layout, cut_at(noise, data.draw(cuts(noise))))
        np.testing.assert_array_equal(whole.counts, pieces.counts)
        assert decoder.losses == decoder_2.losses
        assert decoder.losses.discarded_bytes <= len(noise) + 1


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_wrong_digits_come_out_alike_whatever_the_cut(data):
    layout = data.draw(st.sampled_from([TIMED, LineFormat((C.SEQUENCE, C.TABLE, C.RELATIVE)), SEQUENCED]))
    wire = bytearray(b"".join(stream(layout, 25, first=900)))
    for place in data.draw(st.lists(st.integers(0, len(wire) - 1), max_size=8)):
        wire[place] = data.draw(st.sampled_from(b"0123456789,?\n"))
    whole, decoder = decode(layout, [bytes(wire)])
    pieces, decoder_2 = decode(layout, cut_at(bytes(wire), data.draw(cuts(wire))))
    np.testing.assert_array_equal(whole.counts, pieces.counts)
    np.testing.assert_array_equal(whole.status, pieces.status)
    assert decoder.losses == decoder_2.losses


# --- any damage at all ------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_every_sequenced_sample_between_first_and_last_good_one_is_accounted_for(data):
    lines = stream(SEQUENCED, data.draw(st.integers(5, 30)), first=2**32 - 8)
    fates = data.draw(st.lists(st.sampled_from("....lc"), min_size=len(lines), max_size=len(lines)))
    wire = b""
    for fate, line in zip(fates, lines, strict=True):
        place = data.draw(st.integers(0, len(line) - 3))  # the line's end stays
        wire += {".": line, "l": b"", "c": line[:place] + b"?" + line[place + 1 :]}[fate]
    good = np.array([fate == "." for fate in fates])
    if np.count_nonzero(good) < 2:
        return
    first, last = np.flatnonzero(good)[[0, -1]]
    block, decoder = decode(SEQUENCED, cut_at(wire, data.draw(cuts(wire))))
    losses = decoder.losses
    held = len(block) < last - first + 1  # the last line may wait for one that confirms it
    last = np.flatnonzero(good)[-2] if held else last
    assert len(block) == losses.samples == last - first + 1
    np.testing.assert_array_equal(block.status == 0, good[first : last + 1])
    np.testing.assert_array_equal(
        block.counts[block.status == 0],
        readings(len(lines))[np.flatnonzero(good)][: np.count_nonzero(block.status == 0)],
    )
    assert losses.samples == np.count_nonzero(block.status == 0) + losses.damaged + losses.missing
    broken = [fate == "c" for fate in fates[first : last + 1]]
    assert losses.damaged == sum(broken)


# --- rate ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("column", [C.TIME_US, C.TIME_MS, C.TIME_S])
def test_the_rate_that_times_show(column):
    layout = LineFormat((column, C.TABLE, C.RELATIVE))
    lines = stream(layout, 200, first=2**32 // 10_000 - 50 if column is C.TIME_US else 0)
    del lines[50:70]
    assert rate_from_lines(layout, b"rest\n" + b"".join(lines)) == pytest.approx(RATE_HZ, rel=1e-6)


def test_neither_a_new_start_nor_wrong_digits_spoil_the_rate():
    lines = stream(TIMED, 60, first=900) + stream(TIMED, 200)
    for k in range(5, len(lines), 25):
        lines[k] = b"9" + lines[k]
    for k in range(14, len(lines), 25):
        lines[k] = lines[k][1:]
    assert rate_from_lines(TIMED, b"\n" + b"".join(lines)) == pytest.approx(RATE_HZ, rel=1e-6)


def test_what_shows_no_rate():
    assert rate_from_lines(BARE, b"".join(stream(BARE, 500))) is None
    assert rate_from_lines(TIMED, b"".join(stream(TIMED, 40))) is None  # 0.4 s
    assert rate_from_lines(TIMED, b"") is None


def test_a_good_line_is_seen_only_after_the_first():
    assert not has_good_line(TIMED, b"1,2,3\n")
    assert not has_good_line(TIMED, b"\n1,2,3")
    assert has_good_line(TIMED, b"banner\n1,2,3\r")
