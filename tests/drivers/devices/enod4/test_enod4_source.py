import numpy as np
import pytest
from device_kit import Wire, ramp_at, run_for
from wire_helpers import ScriptedLink, join, refusal

from drivers.devices.enod4.codec import Checksum, FrameDecoder, encode_frames
from drivers.devices.enod4.source import Enod4Source, make_source
from drivers.errors import NoDataError, ProtocolError
from drivers.registry import find_driver
from drivers.samples import SampleStatus
from drivers.simulated.device import DeviceSetup, SimulatedDevice

RATE_HZ = 500.0
VALUES = np.arange(300, dtype=np.int32)
START_GROSS, STOP = bytes.fromhex("01 E2 0D FF"), bytes.fromhex("01 E3 0D FF")


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(Enod4Source, "timeout_s", 0.3)


def stream(checksum: Checksum = Checksum.FRAME) -> bytes:
    return b"".join(encode_frames(VALUES, np.full(len(VALUES), 0x80), checksum))


def device(sent: bytes, checksum: Checksum = Checksum.FRAME) -> bytes:
    """Sends a command back that it has done, and its stream after a start."""
    return sent if sent[1] == 0xE3 else sent + stream(checksum)


def test_the_conversation_of_a_start():
    link = ScriptedLink(device, waiting=stream()[5:40])
    source = make_source({}, RATE_HZ)
    first = source.start(link)
    assert link.sent == [STOP, START_GROSS]
    assert (source.identity.protocol, source.identity.name, source.channels) == ("enod4", "Scaime eNod4", 1)
    block = join(block for data in (first, *iter(link.read, b"")) for block in source.decode(data, 0))
    np.testing.assert_array_equal(block.counts[:, 0], VALUES)
    assert source.losses.discarded_bytes == 0
    source.stop(link)
    assert link.sent[-1] == STOP


@pytest.mark.parametrize(("value", "code"), [("net", "E0"), ("factory", "E1"), ("gross", "E2")])
def test_the_measurement_and_the_address_are_chosen(value, code):
    link = ScriptedLink(device)
    make_source({"value": value, "address": "7"}, RATE_HZ).start(link)
    assert link.sent[1] == bytes.fromhex(f"07 {code} 0D FF")


def test_what_is_wrong_at_the_start_is_said_in_one_line():
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, RATE_HZ).start(ScriptedLink(lambda _: b""))
    with pytest.raises(ProtocolError, match="sums of other bytes: give --set checksum=data"):
        make_source({}, RATE_HZ).start(ScriptedLink(lambda sent: device(sent, Checksum.DATA)))
    refused = bytes.fromhex("01 FE 0D 5A")
    with pytest.raises(NoDataError, match="does not know the command: set its protocol to fast SCMBus"):
        make_source({}, RATE_HZ).start(ScriptedLink(lambda sent: b"" if sent == STOP else refused))


@pytest.mark.parametrize(
    ("settings", "rate_hz", "fault"),
    [
        ({}, None, "an eNod4 does not send its rate: give --rate"),
        ({}, float("nan"), "an eNod4 does not send its rate: give --rate"),
        ({"address": "0"}, 100.0, "settings of enod4: Expected `int` >= 1"),
        ({"value": "tare"}, 100.0, "Invalid enum value 'tare'"),
    ],
)
def test_settings_are_checked(settings, rate_hz, fault):
    assert fault in refusal(make_source, settings, rate_hz)


def simulated(settings: dict[str, str]) -> tuple[SimulatedDevice, Wire]:
    wire = Wire()
    simulated_device = SimulatedDevice(
        wire, find_driver("enod4").make_simulated(settings), ramp_at, DeviceSetup(RATE_HZ)
    )
    simulated_device.step(0)
    return simulated_device, wire


def test_the_simulated_device_sends_between_start_and_stop():
    one, wire = simulated({"checksum": "data"})
    run_for(one, 0.1)
    assert not wire.sent
    wire.inbox = START_GROSS[:2]
    one.step(100_000_000)
    wire.inbox = START_GROSS[2:]
    for time_ns in range(100_000_000, 200_000_000, 1_000_000):
        one.step(time_ns)
    assert wire.sent.startswith(START_GROSS)
    (block,) = FrameDecoder(RATE_HZ, Checksum.DATA).feed(bytes(wire.sent[4:]), 0)
    np.testing.assert_array_equal(np.diff(block.counts[:, 0]), 1)
    assert len(block) == pytest.approx(50, abs=2)
    wire.inbox = STOP
    one.step(200_000_000)
    sent = len(wire.sent)
    one.step(300_000_000)
    assert len(wire.sent) == sent


def test_the_simulated_device_refuses_and_ignores():
    one, wire = simulated({"address": "3"})
    wire.inbox = bytes.fromhex("01 E2 0D FF 03 55 0D FF")  # another address, another command
    one.step(0)
    assert bytes(wire.sent) == bytes.fromhex("03 FE 0D FF")


def test_an_overload_is_flagged():
    packing = find_driver("enod4").make_simulated({})
    status = np.array([0, SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE], dtype=np.uint8)
    wire = b"".join(packing.encode(0, np.zeros((3, 2), dtype=np.int32), status, np.zeros(3)))
    (block,) = FrameDecoder(RATE_HZ).feed(wire, 0)
    assert block.status.tolist() == [0, SampleStatus.OVERLOAD_TABLE, 0]
