"""Listening and asking on a wire of one baud rate, by a simulated clock."""

from collections.abc import Callable
from functools import cache

import pytest
from probe_kit import misread, wire_of

from drivers.errors import SettingsError
from drivers.port_probe import COMMON_LINE_SETTINGS, FIRST_WAIT_S, identity_queries, listen, query_identity
from drivers.recognition import recognise
from drivers.source import LineSettings


class FakeWire:
    """A device that sends 100 bytes each 20 ms, over and over, as a port tuned like this hears them."""

    has_baud = True

    def __init__(
        self,
        heard_at: Callable[[LineSettings], bytes] = lambda _: b"",
        silent_s: float = 0.0,
        refused: tuple[LineSettings, ...] = (),
    ) -> None:
        self._heard_at = cache(heard_at)
        self._silent_s = silent_s
        self._refused = refused
        self._at = 0
        self.now_s = 0.0
        self.tuning = COMMON_LINE_SETTINGS[0]
        self.sent: list[tuple[LineSettings, bytes]] = []
        self.answer = b""

    def clock(self) -> float:
        return self.now_s

    def read(self) -> bytes:
        self.now_s += 0.02
        data = self._heard_at(self.tuning)
        if self.now_s <= self._silent_s or not data:
            answer, self.answer = self.answer, b""
            return answer
        self._at += 100
        return (data + data)[self._at % len(data) :][:100]

    def write(self, data: bytes) -> None:
        self.sent.append((self.tuning, data))

    def configure(self, line_settings: LineSettings) -> None:
        if line_settings in self._refused:
            raise SettingsError("no such baud rate")
        self.tuning = line_settings


def sending(protocol: str, settings: dict[str, str], sent: LineSettings) -> Callable[[LineSettings], bytes]:
    data = wire_of(protocol, settings)[:2500]

    def heard_at(tuning: LineSettings) -> bytes:
        if tuning == sent:
            return data
        # A receiver that expects a parity bit where there is none loses most characters.
        parity = sent.parity if tuning.parity == "N" or sent.parity != "N" else "E"
        return misread(data, sent.baud, tuning.baud, parity)

    return heard_at


@pytest.mark.parametrize(
    ("protocol", "settings", "sent"),
    [
        ("csv", {"columns": "time_us,table,relative"}, LineSettings(115200)),
        ("csv", {"format": "openscale"}, LineSettings(9600)),
        ("gsv", {}, LineSettings(230400)),
        ("gsv-234", {"format": "gsv-2"}, LineSettings(38400)),
        ("slipstand-binary", {}, LineSettings(460800)),
        ("harp", {}, LineSettings(1_000_000)),
        ("csv", {"columns": "time_us,table,relative"}, LineSettings(19200, "E")),
    ],
)
def test_the_baud_rate_and_parity_are_found(protocol, settings, sent):
    wire = FakeWire(sending(protocol, settings, sent), silent_s=2.0)
    said: list[str] = []
    heard = listen(wire, said.append, clock=wire.clock)
    assert heard.line_settings == sent
    assert heard.recognition.protocol == protocol
    assert str(said[-1]) == f"listening at {sent}"
    assert wire.sent == []


def test_a_silent_device_is_not_listened_to_at_other_baud_rates():
    wire = FakeWire()
    said: list[str] = []
    heard = listen(wire, said.append, clock=wire.clock)
    assert (heard.recognition, heard.received) == (None, b"")
    assert list(map(str, said)) == ["listening at 115200 baud 8N1"]
    assert FIRST_WAIT_S <= wire.now_s < FIRST_WAIT_S + 0.1


def test_what_no_baud_rate_makes_readable_ends():
    wire = FakeWire(lambda _: b"\x13\x07\xff\x80" * 200)
    heard = listen(wire, lambda _: None, clock=wire.clock)
    assert heard.recognition is None
    assert heard.received.startswith(b"\x13") or b"\x13\x07" in heard.received
    assert wire.now_s < 30


def test_a_baud_rate_that_the_port_has_not_is_passed_over():
    sent = LineSettings(230400)
    wire = FakeWire(sending("gsv", {}, sent), refused=(LineSettings(9600), LineSettings(460800)))
    assert listen(wire, lambda _: None, clock=wire.clock).line_settings == sent


def test_slow_lines_are_waited_for():
    wire = FakeWire()
    line = [0]

    def read() -> bytes:
        wire.now_s += 0.02
        if wire.now_s * 2 < line[0] + 1:
            return b""
        line[0] += 1
        return b"%d,%d.25,kg,\r\n" % (500 * line[0], line[0])

    wire.read = read
    heard = listen(wire, lambda _: None, clock=wire.clock)
    assert heard.recognition.settings == {"format": "openscale"}
    assert heard.recognition.rate_hz == pytest.approx(2, rel=0.05)


def test_a_torrent_is_known_before_its_window_is_over():
    wire = FakeWire()
    data = wire_of("slipstand-binary")

    def read() -> bytes:
        wire.now_s += 0.02
        return data

    wire.read = read
    assert listen(wire, lambda _: None, clock=wire.clock).recognition.protocol == "slipstand-binary"
    assert wire.now_s < 0.8


def test_questions_hold_no_character_that_a_device_obeys():
    for protocol, question in identity_queries():
        assert not set(question.data) & set(b"x!SPR"), protocol
        assert recognise(question.data * 50) is None


def test_each_question_is_asked_at_its_baud_rates_and_in_order():
    wire = FakeWire()
    assert query_identity(wire, lambda _: None, clock=wire.clock) is None
    expected = [
        (tuning, question.data) for _, question in identity_queries() for tuning in question.line_settings
    ]
    assert wire.sent == expected
    known = [
        "gsv-234",
        "slipstand-binary",
        "harp",
        "gsv",
        "modbus",
    ]  # AA, which a GSV sends, is a rate to a GSV-4
    on_serial_lines = [protocol for protocol, query in identity_queries() if not query.is_network]
    assert [protocol for protocol in on_serial_lines if protocol in known] == known


def test_network_addresses_alone_are_asked_for_protocols_of_networks():
    wire = FakeWire()
    wire.has_baud = False
    assert query_identity(wire, lambda _: None, clock=wire.clock) is None
    of_all = [data for _, data in wire.sent]
    wire.sent = []
    assert query_identity(wire, lambda _: None, clock=wire.clock, is_network=True) is None
    # units 1 and 255, function 3, one register from 0 on, behind transaction, protocol 0 and length 6
    asked = [bytes.fromhex("0001 0000 0006 01 03 0000 0001"), bytes.fromhex("00FF 0000 0006 FF 03 0000 0001")]
    assert [data for _, data in wire.sent] == asked
    assert not set(asked) & set(of_all)


def test_the_first_answer_ends_it():
    wire = FakeWire()
    write = wire.write

    def answering(data: bytes) -> None:
        write(data)
        if wire.tuning == LineSettings(115200) and data == b"I":
            wire.answer = b"\x00slipstand-fw 1.4 2000 2\n"

    wire.write = answering
    answered = query_identity(wire, lambda _: None, clock=wire.clock)
    assert answered.line_settings == LineSettings(115200)
    assert str(answered.recognition.remark) == "firmware 1.4, 2000 Hz"
    (asked,) = [query for protocol, query in identity_queries() if protocol == "slipstand-binary"]
    assert wire.sent[-len(asked.line_settings) :] == [(tuning, b"I") for tuning in asked.line_settings]


def test_a_device_of_one_gauge_that_answers_is_one():
    wire = FakeWire()
    write = wire.write

    def answering(data: bytes) -> None:
        write(data)
        if data == b"IDN?;":
            wire.answer = b'HBM,"AED104         ","1234   ",P20\r\n'

    wire.write = answering
    found = query_identity(wire, lambda _: None, clock=wire.clock).recognition
    assert (found.protocol, found.channels, str(found.remark)) == ("hbm-aed", 1, "AED104, firmware P20")
