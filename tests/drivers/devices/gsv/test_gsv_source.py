import struct

import numpy as np
import pytest
from gsv_kit import TWO, frames, readings
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.gsv.codec import FrameLayout, ValueKind
from drivers.devices.gsv.commands import (
    Code,
    InputType,
    encode_request,
    encode_response,
    set_float,
    set_input,
    write_rate,
)
from drivers.devices.gsv.source import GsvSource, make_source
from drivers.errors import NoDataError, ProtocolError
from drivers.samples import ChannelFilter, DeviceIdentity

FRAMES = 300


class Firmware:
    """Answers as a GSV does."""

    def __init__(self, layout=TWO, rate_hz=500.0, obeys_rate=True, refuses=()) -> None:
        self.layout = layout
        self.rate_hz = rate_hz
        self.obeys_rate = obeys_rate
        self.refuses = refuses

    def __call__(self, sent: bytes) -> bytes:
        code = sent[2]
        if code in self.refuses:
            return encode_response(0x40)
        match code:
            case Code.WRITE_RATE if self.obeys_rate:
                (self.rate_hz,) = struct.unpack(">f", sent[3:7])
            case Code.READ_RATE:
                return encode_response(0, struct.pack(">f", self.rate_hz))
            case Code.SERIAL_NUMBER:
                return encode_response(0, bytes.fromhex("00e5cc61"))
            case Code.FIRMWARE:
                return encode_response(0, bytes.fromhex("0001002d"))
            case Code.START:
                return encode_response(0) + b"".join(frames(FRAMES, self.layout))
        return encode_response(0)


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(GsvSource, "timeout_s", 0.3)
    monkeypatch.setattr(GsvSource, "answer_timeout_s", 0.05)


def read_out(source, link, first: bytes, arrival_ns: int = 0):
    return join(block for data in (first, *iter(link.read, b"")) for block in source.decode(data, arrival_ns))


def test_the_conversation_of_a_start():
    link = ScriptedLink(Firmware(), waiting=b"".join(frames(20))[7:])
    source = make_source({}, None)
    first = source.start(link)
    assert link.sent == [
        encode_request(Code.STOP),
        encode_request(Code.STOP),
        encode_request(Code.SERIAL_NUMBER),
        encode_request(Code.FIRMWARE),
        set_float(),
        encode_request(Code.READ_RATE),
        encode_request(Code.START),
    ]
    assert source.identity == DeviceIdentity("gsv", "ME-Systeme GSV", "1.45", "15060065")
    assert source.rate_hz == 500.0
    assert source.filters == (ChannelFilter(1, 200.0),) * 2
    block = read_out(source, link, first)
    np.testing.assert_array_equal(block.counts, readings(FRAMES - 1))
    assert source.losses.discarded_bytes == 0
    source.stop(link)
    assert link.sent[-1] == encode_request(Code.STOP)


def test_rate_and_input_range_are_set():
    link = ScriptedLink(Firmware(FrameLayout(8)))
    source = make_source({"table": "2", "relative": "7", "input": "bridge-2.5v"}, 1000)
    source.start(link)
    assert link.sent[5:8] == [
        set_input(2, InputType.BRIDGE_2_5_V),
        set_input(7, InputType.BRIDGE_2_5_V),
        write_rate(1000),
    ]
    assert source.rate_hz == 1000.0


def test_the_gauges_channels_are_chosen():
    layout = FrameLayout(8, table=7, relative=2)
    link = ScriptedLink(Firmware(layout))
    source = make_source({"table": "7", "relative": "2"}, None)
    block = read_out(source, link, source.start(link))
    np.testing.assert_array_equal(block.counts, readings(FRAMES - 1))


def test_whole_numbers_are_taken_where_the_format_is_left_to_the_device():
    firmware = Firmware(FrameLayout(2, ValueKind.INT24))
    link = ScriptedLink(firmware)
    source = make_source({"format": "device"}, None)
    block = read_out(source, link, source.start(link))
    assert set_float() not in link.sent
    np.testing.assert_array_equal(block.counts, readings(FRAMES - 1))
    with pytest.raises(ProtocolError, match="sends int24 where float32 was asked for: set format to device"):
        make_source({}, None).start(ScriptedLink(firmware))


def test_a_rate_that_is_not_taken_is_said():
    with pytest.raises(ProtocolError, match="does not take 2000 Hz and stays at 500 Hz: ask for --rate 500"):
        make_source({}, 2000).start(ScriptedLink(Firmware(obeys_rate=False)))
    with pytest.raises(ProtocolError, match=r"does not take 2000 Hz \(the command is not known\)"):
        make_source({}, 2000).start(ScriptedLink(Firmware(refuses=[Code.WRITE_RATE])))
    with pytest.raises(ProtocolError, match="does not tell its rate"):
        make_source({}, None).start(ScriptedLink(Firmware(refuses=[Code.READ_RATE])))


class Stream(ScriptedLink):
    """A device that sends `sent_hz` frames a second by a clock of its own, whatever rate it says."""

    def __init__(self, monkeypatch, sent_hz: float) -> None:
        firmware = Firmware()
        super().__init__(lambda sent: b"" if sent[2] == Code.START else firmware(sent))
        self._sent_hz, self._now_ns, self._started_ns, self._given = sent_hz, 10**12, None, 0
        for name in ("drivers.stream.time.perf_counter", "drivers.host_time.host_ns"):
            scale = 1 if name.endswith("host_ns") else 1e-9
            monkeypatch.setattr(name, lambda scale=scale: self._now_ns * scale)

    def _lag_s(self, elapsed_s: float) -> float:
        return 0.0

    def write(self, data: bytes) -> None:
        super().write(data)
        if data[2] == Code.START:
            self._started_ns = self._now_ns

    def read(self) -> bytes:
        self._now_ns += 20_000_000
        if self._started_ns is None:
            return super().read()
        elapsed_s = (self._now_ns - self._started_ns) * 1e-9
        due = int(self._sent_hz * (elapsed_s + self._lag_s(elapsed_s)))
        first, self._given = self._given, due
        return b"".join(frames(due - first, first=first)) if due > first else b""


def test_the_stream_is_timed_because_a_gsv_6_may_not_have_taken_its_rate(monkeypatch):
    monkeypatch.setattr(GsvSource, "timeout_s", 3.0)
    with pytest.raises(ProtocolError, match=r"says 500 Hz and sends 100 Hz: switch it off .* --rate 100$"):
        make_source({}, 500).start(Stream(monkeypatch, 100.0))
    with pytest.raises(ProtocolError, match=r"says 500 Hz and sends 2\.99 Hz"):
        make_source({}, 500).start(Stream(monkeypatch, 3.0))
    with pytest.raises(ProtocolError, match="says 500 Hz and sends 600 Hz"):
        make_source({}, 500).start(Stream(monkeypatch, 600.0))
    for sent_hz in (500.0, 530.0):
        link = Stream(monkeypatch, sent_hz)
        source = make_source({}, 500)
        first = source.start(link)
        assert 0.5 <= len(first) / TWO.length / sent_hz < 0.7  # all of it is decoded
        assert source.rate_hz == 500.0


def test_a_busy_computer_is_no_wrong_rate(monkeypatch):
    class Late(Stream):
        """Samples are lost, now more, now less."""

        def _lag_s(self, elapsed_s: float) -> float:
            return -0.6 * elapsed_s + 0.1 * np.sin(3 * elapsed_s)

    monkeypatch.setattr(GsvSource, "timeout_s", 3.0)
    assert make_source({}, 500).start(Late(monkeypatch, 500.0))
    assert make_source({}, 500).start(Stream(monkeypatch, 350.0))  # lost as evenly as a short buffer loses


def test_a_slow_stream_is_not_timed(monkeypatch):
    monkeypatch.setattr(GsvSource, "timeout_s", 3.0)
    source = make_source({}, 2)
    assert source.start(Stream(monkeypatch, 2.0))


def test_the_scale_of_whole_numbers_is_said_to_be_unverified():
    source = make_source({"format": "device"}, None)
    source.start(ScriptedLink(Firmware(FrameLayout(2, ValueKind.INT16))))
    assert "sends int16, whose scale was not verified on hardware: calibrate in this format" in str(
        source.run_note
    )
    source = make_source({}, None)
    source.start(ScriptedLink(Firmware()))
    assert not source.run_note


def test_a_device_that_does_not_say_who_it_is():
    source = make_source({}, None)
    source.start(ScriptedLink(Firmware(refuses=[Code.SERIAL_NUMBER, Code.FIRMWARE])))
    assert source.identity == DeviceIdentity("gsv", "ME-Systeme GSV")


def test_an_input_range_that_the_model_has_not():
    with pytest.raises(ProtocolError, match=r"input single-ended on channel 1 \(the command is not known\)"):
        make_source({"input": "single-ended"}, None).start(ScriptedLink(Firmware(refuses=[Code.SET_INPUT])))


def test_too_few_channels():
    with pytest.raises(ProtocolError, match="sends 2 channels and the relative gauge is to be 3"):
        make_source({"relative": "3"}, None).start(ScriptedLink(Firmware()))


def test_a_silent_device():
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, None).start(ScriptedLink(lambda _: b""))


def test_a_device_that_sends_and_does_not_listen():
    link = ScriptedLink(lambda _: b"".join(frames(3)))
    with pytest.raises(NoDataError, match="sends and does not answer: check the line"):
        make_source({}, None).start(link)


def test_a_wrong_baud_rate_says_what_came():
    link = ScriptedLink(lambda _: b"\x00\x1f\xa3\xff" * 20)
    with pytest.raises(NoDataError, match=r"received \d+ bytes, first 00 1f .*baud rate \(usual is 115200"):
        make_source({}, None).start(link)


def test_lines_of_text_are_recognised():
    link = ScriptedLink(lambda _: b"17\r\n1000,12,13\r\n2000,14,15\r\n")
    with pytest.raises(NoDataError, match=r"lines of text .* choose protocol csv"):
        make_source({}, None).start(link)


def test_a_second_start_goes_on_with_the_same_account():
    source = make_source({}, None)
    rows = 0
    for arrival_ns in (0, 2_000_000_000):
        link = ScriptedLink(Firmware())
        first = source.start(link)
        for data in (first, *iter(link.read, b"")):
            rows += sum(len(block) for block in source.decode(data, arrival_ns))
        assert list(source.decode(b"", 0)) == []
    assert source.losses.samples == rows
    assert source.losses.restarts == 1
    assert source.losses.missing_estimated + source.losses.damaged == rows - 2 * (FRAMES - 1)


def test_replayed_bytes_need_no_start_but_the_rate():
    block = join(make_source({}, 500).decode(b"".join(frames(50)), 0))
    np.testing.assert_array_equal(block.counts, readings(49))
    assert list(make_source({}, None).decode(b"".join(frames(50)), 0)) == []


@pytest.mark.parametrize(
    ("settings", "rate_hz", "fault"),
    [
        ({"chanel": "1"}, None, "setting 'chanel' is not known to gsv: allowed are table, relative"),
        ({"table": "0"}, None, "table 0 is no channel: give 1 to 16"),
        ({"relative": "17"}, None, "relative 17 is no channel"),
        ({"table": "2"}, None, "table and relative are both channel 2"),
        ({"format": "int12"}, None, "settings of gsv: Invalid enum value 'int12'"),
        ({"input": "10v"}, None, "settings of gsv: Invalid enum value '10v'"),
        ({}, 0.0, "rate 0 Hz cannot be set"),
    ],
)
def test_settings_are_checked(settings, rate_hz, fault):
    assert fault in refusal(make_source, settings, rate_hz)
