import numpy as np
import pytest
from device_kit import Wire, ramp_at, run_for
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.hbm_aed import commands
from drivers.devices.hbm_aed.codec import Format, ValueDecoder, encode_frames
from drivers.devices.hbm_aed.source import IDENTITY_QUERY, HbmAedSource, make_source
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.registry import find_driver
from drivers.samples import DeviceIdentity
from drivers.simulated.device import DeviceSetup, SimulatedDevice

IDENTITY = b'HBM,"AED104         ","1234   ",P20\r\n'
"""AD104 manual, page 51."""


class Device(ScriptedLink):
    """An AED that sends `full_hz` / 2 ** divider values a second by a clock of its own."""

    frame_bytes = 99

    def __init__(
        self, monkeypatch, full_hz=100.0, divider=0, refuses=(), limit_hz=1e9, kind=Format.BINARY
    ) -> None:
        super().__init__(self._answer_to)
        self.full_hz, self.divider, self.refuses, self.limit_hz, self.kind = (
            full_hz,
            divider,
            refuses,
            limit_hz,
            kind,
        )
        self._now_ns, self._started_ns, self._given = 10**12, None, 0
        for name in ("drivers.stream.time.perf_counter", "drivers.host_time.host_ns"):
            scale = 1 if name.endswith("host_ns") else 1e-9
            monkeypatch.setattr(name, lambda scale=scale: self._now_ns * scale)

    def _answer_to(self, sent: bytes) -> bytes:
        if sent in self.refuses:
            return b"?\r\n"
        if sent == b"MSV?0;":
            self._started_ns, self._given = self._now_ns, 0
        elif sent == b";STP;":
            self._started_ns = None
        elif sent == b"IDN?;":
            return IDENTITY
        elif sent == b"ICR?;":
            return b"%02d\r\n" % self.divider
        elif not sent.startswith(b"S"):
            if sent.startswith(b"ICR"):
                self.divider = int(sent[3:-1])
            return b"0\r\n"
        return b""

    def read(self) -> bytes:
        self._now_ns += 20_000_000
        if self._started_ns is None:
            return super().read()
        sent_hz = min(self.full_hz / 2**self.divider, self.limit_hz)
        first, self._given = self._given, int((self._now_ns - self._started_ns) * 1e-9 * sent_hz)
        frames = encode_frames(self.kind, counts(first, self._given))
        return b"".join(frame[: self.frame_bytes] for frame in frames)


def counts(first: int, end: int) -> np.ndarray:
    index = np.arange(first, end)
    return np.column_stack([1000 * index, 0 * index])


def test_the_conversation_of_a_start(monkeypatch):
    link = Device(monkeypatch)
    source = make_source({}, None)
    first = source.start(link)
    assert link.sent == [b";STP;", b"IDN?;", b"COF8;", b"CSM0;", b"ASF0;", b"ICR?;", b"MSV?0;"]
    assert source.identity == DeviceIdentity("hbm-aed", "HBM AED104", "P20", "1234")
    assert (source.rate_hz, source.channels) == (100.0, 1)
    block = join(source.decode(first, 0))
    np.testing.assert_array_equal(block.counts, counts(0, len(block)))
    assert len(block) > 50
    source.stop(link)
    assert link.sent[-1] == b";STP;"


@pytest.mark.parametrize(
    ("full_hz", "divider", "asked_hz", "rate_hz", "said"),
    [
        (600.0, 0, None, 600.0, []),
        (1200.0, 1, None, 600.0, []),
        (1200.0, 5, None, 37.5, []),
        (100.0, 3, None, 12.5, []),
        (1200.0, 4, 600.0, 600.0, [b"ICR1;", b"MSV?0;"]),
        (600.0, 0, 600.0, 600.0, []),
    ],
)
def test_the_rate_is_told_by_timing_and_set_by_its_divider(
    monkeypatch, full_hz, divider, asked_hz, rate_hz, said
):
    link = Device(monkeypatch, full_hz, divider)
    source = make_source({}, asked_hz)
    source.start(link)
    assert source.rate_hz == rate_hz
    assert [sent for sent in link.sent[7:] if sent != b";STP;"] == said


def test_rates_that_cannot_be(monkeypatch):
    with pytest.raises(SettingsError, match=r"cannot send 500 Hz: give one of 600, 300, 150, 75"):
        make_source({}, 500.0).start(Device(monkeypatch, 600.0))
    slow = Device(monkeypatch, 1200.0, limit_hz=160.0)
    with pytest.raises(ProtocolError, match=r"sends 160 values a second at ICR0, .*raise its baud rate"):
        make_source({}, None).start(slow)
    with pytest.raises(ProtocolError, match=r"set to 600 Hz and sends 160 Hz: raise its baud rate"):
        make_source({}, 600.0).start(Device(monkeypatch, 1200.0, divider=4, limit_hz=160.0))


def test_a_device_that_is_back_is_set_again_and_not_timed_again(monkeypatch):
    source = make_source({}, None)
    source.start(Device(monkeypatch, 1200.0, divider=1))
    link = Device(monkeypatch, 1200.0, divider=4)  # it lost its power, and what was set
    first = source.resume(link)
    assert link.sent[-2:] == [b"ICR1;", b"MSV?0;"]
    assert len(first) / 6 / 600.0 < 0.1
    assert source.rate_hz == 600.0


def test_text_a_filter_that_is_left_and_an_address(monkeypatch):
    link = Device(monkeypatch, kind=Format.ASCII)
    source = make_source({"format": "ascii", "filter": "device", "address": "3"}, None)
    first = source.start(link)
    assert link.sent == [b";STP;", b"S03;", b"IDN?;", b"COF11;", b"CSM0;", b"ICR?;", b"MSV?0;"]
    assert "left as it is: state it" in str(source.run_note)
    block = join(source.decode(first, 0))
    np.testing.assert_array_equal(block.counts, counts(0, len(block)))


def test_what_a_model_refuses(monkeypatch):
    with pytest.raises(ProtocolError, match="does not take COF8;"):
        make_source({}, None).start(Device(monkeypatch, refuses=[b"COF8;"]))
    make_source({}, None).start(Device(monkeypatch, refuses=[b"CSM0;"]))


def test_values_without_line_ends_are_told(monkeypatch):
    link = Device(monkeypatch)
    link.frame_bytes = 4
    with pytest.raises(NoDataError, match=r"without line ends, .* set format to ascii"):
        make_source({}, None).start(link)


def test_a_silent_device(monkeypatch):
    monkeypatch.setattr(HbmAedSource, "answer_timeout_s", 0.05)
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, None).start(ScriptedLink(lambda _: b""))


def test_the_identity_is_read_whole():
    assert str(IDENTITY_QUERY.parse(IDENTITY)) == "AED104, firmware P20"
    assert commands.encode_identity(commands.Identity("AED104", "1234", "P20")) == IDENTITY
    assert all(IDENTITY_QUERY.parse(IDENTITY[:end]) is None for end in range(len(IDENTITY)))


@pytest.mark.parametrize(
    ("settings", "fault"),
    [({"format": "cof2"}, "Invalid enum value 'cof2'"), ({"address": "90"}, "address 90 is none of a bus")],
)
def test_settings_are_checked(settings, fault):
    assert fault in refusal(make_source, settings, None)


# --- the simulated device ---------------------------------------------------------------------


def ask(device: SimulatedDevice, wire: Wire, said: bytes, now_ns: int = 0) -> bytes:
    before = len(wire.sent)
    wire.inbox = said
    device.step(now_ns)
    return bytes(wire.sent[before:])


def test_the_simulated_device_answers_and_sends_when_it_is_asked():
    wire = Wire()
    device = SimulatedDevice(wire, find_driver("hbm-aed").make_simulated({}), ramp_at, DeviceSetup(600.0))
    run_for(device, 0.1)
    assert wire.sent == b""
    assert ask(device, wire, b";IDN?;ID") == IDENTITY
    assert ask(device, wire, b"N?\n") == IDENTITY
    assert ask(device, wire, b"icr?;") == b"01\r\n"
    assert ask(device, wire, b"ICR0;ICR?;ICR9;COF8;COF2;ASF0;TAR;") == b"0\r\n00\r\n?\r\n0\r\n?\r\n0\r\n?\r\n"
    wire.sent.clear()
    ask(device, wire, b"MSV?0;")
    run_for(device, 0.1)
    (block,) = ValueDecoder(Format.BINARY, 1200.0).feed(bytes(wire.sent), 0)
    np.testing.assert_array_equal(block.counts[:, 0], np.arange(len(block)))
    assert len(block) == device.log.samples >= 119
    assert ask(device, wire, b";STP;", now_ns=100_000_000) == b""
    assert ask(device, wire, b"", now_ns=200_000_000) == b""
