"""Modbus TCP: frames of the specification, and the conversation with a device that numbers its answers."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from modbus_kit import COUNTS, Clock, Transmitter, rows

from drivers.devices.modbus.frames import Function, Response, exception_response
from drivers.devices.modbus.simulated import find_tcp_commands
from drivers.devices.modbus.source import ModbusSource, explain, make_source
from drivers.devices.modbus.tcp_frames import TcpRequest
from drivers.errors import DeviceLostError, NoDataError, ProtocolError
from drivers.samples import Losses
from drivers.simulated.protocol import CommandParser

THREE = TcpRequest(17, Function.READ_HOLDING, 0x6B, 3, transaction=1)
"""The request of MODBUS Application Protocol V1.1b3, 6.3 (unit 11h) with the header of the Messaging on
TCP/IP Implementation Guide V1.0b, 3.1.3; the eNod4-F Ethernet manual, page 19, shows the same one."""
THREE_WIRE = bytes.fromhex("0001 0000 0006 11 03 006B 0003")
ANSWER = bytes.fromhex("0001 0000 0009 11 03 06 022B 0000 0064")
"""The response of 6.3 in the same header."""
REFUSED = bytes.fromhex("0001 0000 0003 11 83 02")
FROM = {"framing": "tcp"}


def test_frames_as_they_are_written():
    assert THREE.encode() == THREE_WIRE
    assert THREE.parse_response(ANSWER) == Response(bytes.fromhex("022B 0000 0064"))
    assert THREE.parse_response(REFUSED) == exception_response(2)
    write = TcpRequest(1, Function.WRITE_MULTIPLE, 0, 1, (2,), transaction=0x1501)
    assert write.encode() == bytes.fromhex("1501 0000 0009 01 10 0000 0001 02 0002")
    assert write.parse_response(bytes.fromhex("1501 0000 0006 01 10 0000 0001")) == Response(b"")
    assert str(explain(REFUSED)).startswith("the device refuses, illegal data address (exception 2)")


def test_a_number_is_that_of_one_transaction_and_wraps():
    assert THREE.numbered(0x10002).encode()[:2] == b"\x00\x02"
    assert "another request" in str(THREE.numbered(2).parse_response(ANSWER).fault)
    unchecked = TcpRequest(17, Function.READ_HOLDING, 0x6B, 3)
    assert not unchecked.parse_response(ANSWER).fault


@given(st.integers(0, len(ANSWER) - 1), st.integers(1, 255))
def test_a_damaged_head_is_no_response(place, damage):
    """All that Modbus TCP protects is in the first 9 bytes."""
    data = bytearray(ANSWER)
    data[place] ^= damage
    response = THREE.parse_response(bytes(data))
    assert bool(response.fault) == (place < 9)


@given(st.binary(max_size=40), st.integers(0, len(ANSWER)))
def test_the_response_is_found_behind_others_and_garbage(before, cut):
    """Garbage could hold the number of the request; 32 bits of it do so by chance alone."""
    other = THREE.numbered(7)
    earlier = bytes.fromhex("0007 0000 0003 11 83 06") + before
    assert not THREE.is_complete(earlier + ANSWER[:cut]) or cut == len(ANSWER)
    assert THREE.split(earlier + ANSWER) == (earlier, ANSWER)
    assert other.is_complete(earlier)
    assert THREE.split(earlier) == (b"", earlier)


def test_a_listener_finds_requests_in_any_cut_and_behind_garbage():
    for cut in range(len(THREE_WIRE)):
        listener = CommandParser(find_tcp_commands)
        found = listener.feed(b"\xff" * 9 + THREE_WIRE[:cut]) + listener.feed(THREE_WIRE[cut:] + THREE_WIRE)
        assert [(one.code, one.parameters) for one in found] == [(1 << 8 | 17, THREE_WIRE[7:])] * 2
    assert len(CommandParser(find_tcp_commands).feed(bytes(100_000))) == 0


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    clock.install(monkeypatch)
    return clock


def started(link: Transmitter, rate_hz: float | None = 200.0, **settings: str) -> ModbusSource:
    source = make_source(FROM | settings, rate_hz)
    source.start(link)
    return source


def read(source: ModbusSource, link: Transmitter, calls: int) -> list[bytes]:
    return [data for _ in range(calls) if (data := source.read(link))]


def test_the_conversation(clock):
    link = Transmitter(clock, **FROM)
    source = started(link, None)
    block = rows(source, read(source, link, 20))
    np.testing.assert_array_equal(block.counts, np.tile(COUNTS, (20, 1)))
    assert source.losses == Losses(samples=20)
    numbers = [int.from_bytes(data[:2], "big") for data in link.sent]
    assert numbers == list(range(1, len(numbers) + 1))
    assert {data[2:] for data in link.sent} == {bytes.fromhex("0000 0006 01 03 0000 0004")}


def test_a_late_answer_costs_its_own_row_and_the_next_one_is_believed(clock):
    """Over RTU the answer after a time-out is not believed; a number says whose it is."""
    link = Transmitter(clock, **FROM)
    source = started(link)
    reads = read(source, link, 2)
    late = []
    link.on_wire = lambda answer: late.append(answer) or b""
    assert read(source, link, 1) == []
    link.registers.store_sample(COUNTS + 5, 0)
    link.on_wire = lambda answer: late[0] + answer
    reads += read(source, link, 2)[:1]
    link.on_wire = lambda answer: answer
    reads += read(source, link, 3)
    block = rows(source, reads)
    good = block.status == 0
    np.testing.assert_array_equal(np.unique(block.counts[good], axis=0), [COUNTS, COUNTS + 5])
    assert source.losses.damaged == 1
    assert source.losses.missing > 30  # the time-out of 0.2 s
    assert source.losses.discarded_bytes == len(late[0])


@pytest.mark.parametrize(
    "on_wire",
    [
        lambda answer: answer[:9],
        lambda answer: b"\x55" + answer[1:],
        lambda answer: answer[:6] + b"\x05" + answer[7:],
        lambda answer: answer[:4] + b"\x00\xff" + answer[6:],
        lambda _: b"\x5a" * 300,
    ],
    ids=["cut", "other number", "wrong unit", "wrong length", "garbage"],
)
def test_answers_that_are_none_are_never_believed_and_the_next_is(clock, on_wire):
    link = Transmitter(clock, **FROM)
    source = started(link)
    reads = read(source, link, 1)
    link.on_wire = on_wire
    reads += read(source, link, 3)
    link.on_wire = lambda answer: answer
    block = rows(source, reads + read(source, link, 20))
    assert np.count_nonzero(block.status == 0) >= 10
    np.testing.assert_array_equal(np.unique(block.counts[block.status == 0], axis=0), [COUNTS])
    assert source.losses.damaged == 3
    assert link.waiting == b""


def test_a_connection_on_which_nothing_is_answered_is_given_up(clock):
    """Its other end may have been switched off, which TCP does not show: it has to be opened again."""
    link = Transmitter(clock, **FROM)
    source = started(link)
    link.on_wire = lambda _: b""
    begin_s = clock.perf_counter()
    with pytest.raises(DeviceLostError, match="the device has not answered for 2 s: check its power and the"):
        read(source, link, 1000)
    assert clock.perf_counter() - begin_s == pytest.approx(2.1, abs=0.15)
    link.on_wire = lambda answer: answer
    clock.sleep(60.0)
    source.resume(link)
    assert read(source, link, 5)


def test_a_serial_line_on_which_nothing_is_answered_is_kept(clock):
    link = Transmitter(clock)
    source = make_source({}, 200.0)
    source.start(link)
    link.on_wire = lambda _: b""
    assert read(source, link, 100) == []


def test_a_unit_that_a_gateway_has_not_is_named(clock):
    link = Transmitter(clock, **FROM)
    with pytest.raises(
        ProtocolError, match=r"unit 9 refuses .* gateway target did not answer \(exception 11"
    ):
        started(link, unit="9")
    link.on_wire = lambda _: b""
    with pytest.raises(NoDataError, match="check unit and port number \\(usually 502\\)"):
        started(link)


def test_a_flintec_is_zeroed_by_its_bit_command(clock):
    settings = {"map": "flintec-dad141", "channel": "table", "zero": "true"}
    link = Transmitter(clock, **settings)
    started(link, **settings)
    assert [data[6:] for data in link.sent if data[7] == 6] == [bytes.fromhex("01 06 2061 0002")]
    link.registers.store_sample(COUNTS, 0)
    assert struct.unpack_from(">i", link.registers.respond(_command(link), True, 0.0), 9) == (0,)


def _command(link: Transmitter):
    (command,) = CommandParser(find_tcp_commands).feed(link.sent[-1])
    return command
