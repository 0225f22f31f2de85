import numpy as np
import pytest
from device_kit import Wire, ramp_at, run_for
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.gsv_234 import commands
from drivers.devices.gsv_234.codec import FORMATS, GSV_2, GSV_3, GSV_4, FrameDecoder, encode_frames
from drivers.devices.gsv_234.commands import GSV_3_RATES_HZ, GSV_4_RATES_HZ, LOCK, UNLOCK, Code
from drivers.devices.gsv_234.source import IDENTITY_QUERY, Gsv234Source, make_source, single_gauge_settings
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.registry import find_driver
from drivers.samples import DeviceIdentity
from drivers.simulated.device import DeviceSetup, SimulatedDevice

FRAMES = 300
COUNTS = np.column_stack([np.arange(FRAMES), -np.arange(FRAMES)]).astype(np.int32)


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(Gsv234Source, "timeout_s", 0.3)
    monkeypatch.setattr(Gsv234Source, "answer_timeout_s", 0.05)


class Firmware:
    """Answers as a device does: with the bytes of the GSV-4's manual and vendor's scripts, or a GSV-3's."""

    def __init__(self, model=GSV_4, rate=b"\xab", locked=False, obeys=True) -> None:
        self.model, self.rate, self.locked, self.obeys = model, rate, locked, obeys

    def __call__(self, sent: bytes) -> bytes:
        if sent.startswith(UNLOCK):
            self.locked = False
            sent = sent.removeprefix(UNLOCK).removesuffix(LOCK)
        is_rate = sent[0] in GSV_4_RATES_HZ if self.model == GSV_4 else sent[0] == Code.WRITE_RATE
        if is_rate:
            self.rate = (
                (sent if self.model == GSV_4 else sent[1:]) if self.obeys and not self.locked else self.rate
            )
            return b""
        if sent == b"\x24":
            return encode_frames(FORMATS[self.model], COUNTS).tobytes()
        if self.model == GSV_4:
            return {
                b"\x1f": bytes.fromhex("3b1f01 0008 303530 3038343439303530 0d0a"),  # manual, page 38
                b"\x2b": bytes.fromhex("3b2b01 0001 303530 19 0d0a"),
                b"\x16": b"\x3b\x16\x01\x00\x01050" + self.rate + b"\r\n",
            }.get(sent, b"")
        return {
            b"\x1f": b";08449050",
            b"\x2b": b";\x01\x30",
            b"\x8b": b";" + self.rate,
            b"\x16": b";" + self.rate,
        }.get(sent, b"")


def test_the_conversation_of_a_start():
    link = ScriptedLink(Firmware(), waiting=encode_frames(FORMATS[GSV_4], COUNTS[:20]).tobytes()[7:])
    source = make_source({}, None)
    first = source.start(link)
    assert link.sent == [b"\x23", b"\x2b", b"\x1f", b"\x16", b"\x24"]
    assert source.identity == DeviceIdentity("gsv-234", "ME-Systeme GSV-4", "25", "08449050")
    assert (source.rate_hz, source.channels) == (500.0, 2)
    block = join(block for data in (first, *iter(link.read, b"")) for block in source.decode(data, 0))
    np.testing.assert_array_equal(block.counts, COUNTS[:-1])
    source.stop(link)
    assert link.sent[-1] == b"\x23"


def test_a_device_that_is_back_is_set_again_and_not_timed_again(monkeypatch):
    source = make_source({}, 500.0)
    timed = []
    monkeypatch.setattr(source, "time_stream", lambda _, length: (timed.append(length), (b"", None))[1])
    source.start(ScriptedLink(Firmware()))
    link = ScriptedLink(Firmware(rate=b"\xa9"))  # it lost its power, and its rate
    source.resume(link)
    assert b"\xab" in link.sent
    assert timed == [11]


def test_a_rate_is_set_and_a_locked_device_is_unlocked_for_it():
    link = ScriptedLink(Firmware())
    make_source({}, 250.0).start(link)
    assert link.sent[3:6] == [b"\x16", b"\xaa", b"\x16"]
    link = ScriptedLink(Firmware(locked=True))
    source = make_source({}, 937.5)
    source.start(link)
    assert link.sent[4:8] == [b"\xac", b"\x16", b"\x26\x01berlin\xac\x26\x00berlin", b"\x16"]
    assert source.rate_hz == 937.5
    with pytest.raises(ProtocolError, match="does not take 125 Hz and stays at 500 Hz"):
        make_source({}, 125.0).start(ScriptedLink(Firmware(obeys=False)))


def test_a_rate_that_is_there_is_not_set():
    link = ScriptedLink(Firmware())
    make_source({}, 500.0).start(link)
    assert b"\xab" not in link.sent


def test_a_gsv_3_has_rates_of_its_own():
    link = ScriptedLink(Firmware(GSV_3, rate=b"\x06\xfc\xf3"))
    source = make_source({"format": "gsv-3"}, 1000.0)
    source.start(link)
    assert link.sent[3:6] == [b"\x8b", b"\x8a\x03\xfd\x8f", b"\x8b"]
    assert (source.rate_hz, source.channels) == (1000.0, 1)
    assert source.identity.firmware == "1.48"
    assert source.identity.serial_number == "08449050"


def test_the_formula_of_the_manual_gives_the_rates_that_the_vendor_names():
    for code, rate_hz in GSV_3_RATES_HZ.items():
        periods = (1 << 16) - int.from_bytes(code[1:], "big")
        assert 5e6 / (periods << code[0]) == pytest.approx(rate_hz, rel=4e-4)
    assert commands.rate_from_answer(GSV_3, b"\x05\xfd\x8f") == 250.0
    assert commands.rate_from_answer(GSV_3, b"\xff\xfd\x8f") is None
    assert commands.rate_from_answer(GSV_2, (16_777_216 - 50_000).to_bytes(3, "big")) == 100.0
    assert commands.rate_from_answer(GSV_4, b"\x07") is None


def test_the_rate_of_a_gsv_2_is_its_own():
    rate = (16_777_216 - 20_000).to_bytes(3, "big")
    source = make_source({"format": "gsv-2"}, None)
    source.start(ScriptedLink(Firmware(GSV_2, rate)))
    assert source.rate_hz == 250.0
    with pytest.raises(SettingsError, match="GSV-2 is set with the vendor's program alone: leave --rate out"):
        make_source({"format": "gsv-2"}, 500.0).start(ScriptedLink(Firmware(GSV_2, rate)))


def test_a_rate_that_the_model_has_not():
    with pytest.raises(SettingsError, match=r"GSV-4 cannot send 1000 Hz: give one of 0\.625, .*500, 937\.5"):
        make_source({}, 1000.0).start(ScriptedLink(Firmware()))


def test_devices_that_do_not_answer():
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, None).start(ScriptedLink(lambda _: b""))
    stream = encode_frames(FORMATS[GSV_4], COUNTS[:4]).tobytes()
    with pytest.raises(NoDataError, match="sends and does not answer"):
        make_source({}, None).start(ScriptedLink(lambda _: stream))


def test_the_model_answers_a_probe():
    said = IDENTITY_QUERY.parse
    assert str(said(bytes.fromhex("3b2b01 0001 303530 19 0d0a"))) == "GSV-4, firmware 25"
    assert "GSV-3 or GSV-2, firmware 1.48" in str(said(b";\x01\x30"))
    for part in (b"", b";", b";+\x01", b";+\x01\x00\x01050\x19\r", b"x\x01\x30", b";\x01\x30and more"):
        assert said(part) is None


@pytest.mark.parametrize(
    ("settings", "fault"),
    [
        ({"format": "gsv-5"}, "Invalid enum value 'gsv-5'"),
        ({"table": "5"}, "table 5 is no channel: give 1 to 4"),
        ({"relative": "1"}, "table and relative are both channel 1"),
    ],
)
def test_settings_are_checked(settings, fault):
    assert fault in refusal(make_source, settings, None)


def test_one_device_for_each_gauge():
    assert single_gauge_settings("relative", {"format": "gsv-2"}) == ({"format": "gsv-2"}, 0)
    with pytest.raises(SettingsError, match="a GSV-4 has both gauges on one port"):
        single_gauge_settings("table", {})


# --- the simulated device ---------------------------------------------------------------------


def simulated(model: str, rate_hz: float = 500.0) -> tuple[SimulatedDevice, Wire]:
    wire = Wire()
    device = SimulatedDevice(
        wire, find_driver("gsv-234").make_simulated({"format": model}), ramp_at, DeviceSetup(rate_hz)
    )
    device.step(0)
    return device, wire


def ask(device: SimulatedDevice, wire: Wire, *said: bytes, now_ns: int = 0) -> bytes:
    before = len(wire.sent)
    for piece in said:
        wire.inbox = piece
        device.step(now_ns)
    return bytes(wire.sent[before:])


@pytest.mark.parametrize("model", FORMATS)
def test_the_simulated_device_sends_until_it_is_stopped(model):
    device, wire = simulated(model)
    run_for(device, 0.1)
    (block,) = FrameDecoder(FORMATS[model], 500.0).feed(bytes(wire.sent), 0)
    np.testing.assert_array_equal(block.counts[:, 0], np.arange(len(block)))
    assert len(block) == device.log.samples - 1 >= 49
    assert ask(device, wire, b"\x23", b"", now_ns=200_000_000) == b""


def test_the_simulated_gsv_4_answers_and_wants_to_be_unlocked():
    device, wire = simulated(GSV_4)
    ask(device, wire, b"\x23")
    assert ask(device, wire, b"\x1f") == bytes.fromhex("3b1f01 0008 303530 3038343439303530 0d0a")
    assert ask(device, wire, b"\xaa", b"\x16")[8:9] == b"\xab"
    assert ask(device, wire, UNLOCK[:4], UNLOCK[4:] + b"\xaa" + LOCK + b"\x16")[8:9] == b"\xaa"
    assert ask(device, wire, b"\xa9", b"\x16")[8:9] == b"\xaa"


def test_set_zero_takes_the_last_reading_off():
    device, wire = simulated(GSV_4)
    run_for(device, 0.1)
    said = (b"\x23", UNLOCK, b"\x0c\x01")
    ask(device, wire, *said, now_ns=100_000_000)
    value = ask(device, wire, b"\x3b", now_ns=100_000_000)
    assert value[1:3] == b"\x80\x00"
    assert value[3:5] != b"\x80\x00"
