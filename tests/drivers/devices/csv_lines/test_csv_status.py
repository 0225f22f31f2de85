"""Lines with a status column, and lines as manuals show them."""

import numpy as np
import pytest
from wire_helpers import join, refusal, single_bytes

from drivers.devices.csv_lines.codec import LineDecoder, encode_line, encode_lines
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.devices.csv_lines.source import make_source, read_csv_settings
from drivers.samples import Losses, SampleStatus

GOOD, DAMAGED, OVERLOAD = SampleStatus.GOOD, SampleStatus.DAMAGED, SampleStatus.OVERLOAD_TABLE
C = Column


def preset(name: str) -> LineFormat:
    return read_csv_settings({"format": name})[0].layout()


def decode(layout: LineFormat, lines: list[bytes], overload_count: float = np.inf):
    """Blocks of lines after one that may be cut, whole and byte by byte."""
    results = []
    for pieces in ([b"".join(lines)], single_bytes(b"".join(lines))):
        decoder = LineDecoder(layout, 10.0, overload_count=overload_count)
        blocks = list(decoder.feed(b"\n", 0))
        for piece in pieces:
            blocks += decoder.feed(piece, 0)
        results.append((join(blocks), decoder.losses))
    (whole, losses), (bytewise, others) = results
    np.testing.assert_array_equal(whole.counts, bytewise.counts)
    np.testing.assert_array_equal(whole.status, bytewise.status)
    assert losses == others
    return whole, losses


@pytest.mark.parametrize(
    ("name", "lines", "values", "status"),
    [
        # Mettler-Toledo 7405, page 72; MT-SICS 11780711: stable, dynamic, over, under, not executable
        (
            "mt-sics",
            [b"S S     100.00 g\r\n", b"S D      99.98 g\r\n", b"S +\r\n", b"S -\r\n", b"S I\r\n",
             b"S D      -0.12 g\r\n"],
            [100.0, 99.98, 0, 0, 0, -0.12],
            [GOOD, GOOD, OVERLOAD, OVERLOAD, DAMAGED, GOOD],
        ),
        # A&D EK-L, page 28: the same examples, spaces before the unit
        (
            "and-balance",
            [b"ST,+0012345.  g\r\n", b"US,-000123.4  g\r\n", b"OL,+999999.9  g\r\n", b"ST,+0000000.0  g\r\n"],
            [12345.0, -123.4, 999999.9, 0],
            [GOOD, GOOD, OVERLOAD, GOOD],
        ),
        # Sartorius GC803S, page 57; WZ-L, page 28 ("+  253 pcs"): sign, spaces, digits, three of the unit
        (
            "sartorius-sbi",
            [b"+   123.56 g  \r\n", b"-     0.10 g  \r\n", b"      7.25 g  \r\n", b"+      253 pcs\r\n",
             b"Stat     ERR 54 \r\n", b"+   123.57 g  \r\n"],
            [123.56, -0.1, 7.25, 253, 0, 123.57],
            [GOOD, GOOD, GOOD, GOOD, DAMAGED, GOOD],
        ),
        # Agilent 34401A, page 159: SD.DDDDDDDDESDD; SCPI 1999: 9.9E+37 for infinity
        (
            "scpi-read",
            [b"+4.27150000E-03\r\n", b"-1.00000000E+00\n", b"+9.90000000E+37\n", b"+2.00000000E+00\n"],
            [4.2715e-3, -1.0, 9.9e37, 2.0],
            [GOOD, GOOD, OVERLOAD, GOOD],
        ),
        # Loadstar, command set: 2345 is 2.345 lb; A answers an ENTER
        ("loadstar-iload", [b"A\r\n", b"2345\r\n", b"-17\r\n"], [2345, -17], [GOOD, GOOD]),
        # DSCUSB manual: sign, digits, point, digits, CR alone
        ("mantracourt-dscusb", [b"+00032.100\r", b"-00000.250\r", b"?\r", b"+00032.125\r"],
         [32.1, -0.25, 0, 32.125], [GOOD, GOOD, DAMAGED, GOOD]),
    ],
    ids=["mt-sics", "and-balance", "sartorius-sbi", "scpi-read", "loadstar-iload", "mantracourt-dscusb"],
)  # fmt: skip
def test_lines_of_the_manuals(name, lines, values, status):
    overload_count = 9.9e37 if name == "scpi-read" else np.inf
    block, losses = decode(preset(name), lines, overload_count)
    assert block.status.tolist() == status
    np.testing.assert_allclose(block.counts[:, 0], values, rtol=1e-15)
    assert losses.overloaded == status.count(OVERLOAD)
    assert losses.damaged == status.count(DAMAGED)


def test_volts_of_a_dataq():
    """Echoes of the commands come before the first line (DATAQ protocol, encode 1)."""
    echoes = [b"stop\r", b"encode 1\r", b"slist 0 0\r", b"srate 6000\r"]
    block, losses = decode(preset("dataq-ascii"), [*echoes, b" 1.2345, -0.0012\r", b"1.2346,-0.0013\r"])
    assert block.counts.tolist() == [[1.2345, -0.0012], [1.2346, -0.0013]]
    assert losses.damaged == 0


TWO = LineFormat(
    (C.TIME_MS, C.STATUS, C.TABLE, C.RELATIVE), overload_status=("OL", "O+"), fault_status=("ERR",)
)


def test_an_overload_is_of_both_gauges_and_a_fault_is_no_reading():
    lines = [b"0,ok,1,2\n", b"100,OL,3,4\n", b"200,O+\n", b"300,ERR,5,6\n", b"400,other,7,8\n"]
    block, losses = decode(TWO, lines)
    both = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
    assert block.status.tolist() == [GOOD, both, both, DAMAGED, GOOD]
    assert block.counts.tolist() == [[1, 2], [3, 4], [0, 0], [0, 0], [7, 8]]
    assert losses == Losses(samples=5, damaged=1, overloaded=2, discarded_bytes=11)


def test_only_the_whole_word_counts():
    lines = [
        b"0,OLD,1,2\n",
        b"100,O,1,2\n",
        b"200,ER,1,2\n",
        b"300, OL ,1,2\n",
        b"400,,1,2\n",
        b"500,ok,1,2\n",
    ]
    block, _ = decode(TWO, lines)
    assert [status in (GOOD, DAMAGED) for status in block.status] == [True, True, True, False, True, True]
    assert block.status[4] == DAMAGED


def test_an_overload_with_a_wrong_checksum_is_damaged():
    layout = LineFormat((C.SEQUENCE, C.STATUS, C.VALUE, C.XOR), overload_status=("OL",))
    lines = [encode_line(layout, 0, k, 0, k, is_overloaded=k == 1) for k in range(3)]
    assert decode(layout, lines)[0].status.tolist() == [GOOD, OVERLOAD, GOOD]
    lines[1] = lines[1].replace(b"OL,1", b"OL,2")
    assert decode(layout, lines)[0].status.tolist() == [GOOD, DAMAGED, GOOD]


@pytest.mark.parametrize("line_end", ["\r\n", "\n", "\r"])
def test_what_is_written_is_read_with_any_line_end(line_end):
    layout = LineFormat(
        (C.WORD, C.STATUS, C.VALUE, C.UNIT), " ", overload_status=("+",), good_status="D", line_end=line_end
    )
    counts = np.stack([np.arange(20) - 10, np.zeros(20, dtype=int)], axis=1)
    flags = np.where(np.arange(20) % 7 == 3, np.uint8(OVERLOAD), np.uint8(0))
    lines = encode_lines(layout, np.arange(20) / 10, counts, status=flags)
    assert lines[0] == b"S D -10 kg" + line_end.encode()
    assert lines[3] == b"S + -7 kg" + line_end.encode()
    block, _ = decode(layout, lines)
    np.testing.assert_array_equal(block.counts, counts)
    np.testing.assert_array_equal(block.status, flags)


@pytest.mark.parametrize(
    ("settings", "fault"),
    [
        ({"overload_status": "OL"}, "overload_status and fault_status OL need a status column"),
        ({"columns": "status,status,value"}, "hold more than one status"),
        ({"columns": "status,time_ms,value", "overload_status": "OL"}, "name time before it"),
        ({"columns": "status,value", "overload_status": "much too long"}, "status 'much too long' cannot be"),
        ({"columns": "status,value", "good_status": ""}, "status '' cannot be: give 1 to 8 characters"),
        ({"start": "\\x1"}, r"start '\\x1' cannot be sent"),
        ({"stop": "é"}, "stop 'é' cannot be sent"),
        ({"line_end": "nl"}, "Invalid enum value 'nl'"),
    ],
)
def test_settings_are_checked(settings, fault):
    assert fault in refusal(make_source, settings, 10.0)
