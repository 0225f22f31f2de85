"""The simulated instrument, asked as the maker's example and the manual ask.

What is sent and shown: DI_1100.py and DataqStarterKit.py of dataq-instruments/Python (MIT, 2018), and DATAQ,
"Command Protocol", 1 August 2019. The examples themselves were run against it: docs/peers.md.
"""

import numpy as np
import pytest
from device_kit import Wire, run_for

from drivers.devices.dataq.codec import WITH_DIGITAL, encode_scans
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, SimulatedDevice


class Steady:
    def take(self, count: int):
        return np.tile(np.array([[3200, -6400]], dtype=np.int32), (count, 1)), np.zeros(count, dtype=np.uint8)


@pytest.fixture
def wire():
    return Wire()


def device_on(wire: Wire, model: str) -> SimulatedDevice:
    packing = find_driver("dataq").make_simulated({"model": model})
    device = SimulatedDevice(wire, packing, lambda *_: Steady(), DeviceSetup(2000.0))
    device.step(0)
    return device


def ask(device: SimulatedDevice, wire: Wire, *lines: str) -> str:
    before = len(wire.sent)
    wire.inbox = "".join(f"{line}\r" for line in lines).encode()
    device.step(0)
    return bytes(wire.sent[before:]).decode("latin-1")


def test_each_command_is_echoed_and_scans_are_those_of_the_example(wire):
    """DI_1100.py prints 10 * word / 32768 of four channels, its digital inputs taken out of the first."""
    device = device_on(wire, "1100")
    lines = ["stop", "encode 0", "ps 0", *(f"slist {k} {k}" for k in range(4)), "srate 60000"]
    assert ask(device, wire, *lines) == "".join(f"{line}\r" for line in lines)
    sent = len(wire.sent)
    assert "start" not in ask(device, wire, "start")
    run_for(device, 0.0995)
    words = np.frombuffer(bytes(wire.sent[sent:]), dtype="<i2").reshape(-1, 4)
    assert len(words) == 100
    assert (words == [3200 | 3, -6400, 0, 0]).all()
    assert f"{(int(words[0, 0]) >> 2 << 2) * 10 / 32768:.3f}" == "0.977"


def test_the_scan_list_holds_digital_rate_and_counter_inputs(wire):
    """DataqStarterKit.py: rate is (word + 32768) / 65535, count is word + 32768."""
    device = device_on(wire, "2108")
    ask(device, wire, "slist 0 0", "slist 1 1", "slist 2 1801", "slist 3 10", "slist 4 8")
    sent = len(wire.sent)
    ask(device, wire, "start")
    run_for(device, 0.01)
    words = np.frombuffer(bytes(wire.sent[sent : sent + 10]), dtype="<i2")
    assert words.tolist() == [3200, -6400, -32768, -32768, 0x7F00]


def test_what_the_manual_says_is_answered(wire):
    device = device_on(wire, "4108")
    asked = [
        "info 0",
        "info 1",
        "info 2",
        "info 9",
        "ps 1",
        "ps",
        "srate 375",
        "srate",
        "filter 1 2",
        "deca 3",
    ]
    assert ask(device, wire, *asked).split("\r")[:-1] == [
        "info 0 DATAQ", "info 1 4108", "info 2 87", "info 9 60000000", "ps 1", "ps 32", "srate 375",
        "srate 375", "filter 1 2", "deca 3",
    ]  # fmt: skip
    assert ask(device, wire, "srate 374", "dec 513", "deca 0", "nonsense") == ""
    without_dec = Wire()
    device = device_on(without_dec, "1110")
    assert ask(device, without_dec, "dec 2", "deca 2", "ps 8") == "deca 2\r"


def test_while_it_scans_it_obeys_stop_alone(wire):
    device = device_on(wire, "2108")
    ask(device, wire, "slist 0 0", "slist 1 1", "slist 2 8", "start 0")
    run_for(device, 0.05)
    before = len(wire.sent)
    ask(device, wire, "info 1", "srate 375")
    scan = encode_scans(WITH_DIGITAL, np.array([[3200, -6400]])).tobytes()
    assert set(bytes(wire.sent[before:])) <= set(scan)
    assert ask(device, wire, "stop") == "stop\r"
    assert ask(device, wire, "srate") == "srate 30000\r"


def test_a_packet_is_sent_when_it_is_full(wire):
    device = device_on(wire, "2108")
    ask(device, wire, "ps 2", "slist 0 0", "slist 1 1", "slist 2 8")
    before = len(wire.sent)
    ask(device, wire, "start 0")
    sizes = []
    for time_ms in range(1, 60):
        device.step(time_ms * 1_000_000)
        sizes.append(len(wire.sent) - before)
    assert {size % 64 for size in sizes} == {0}
    assert sizes[-1] == 118 * 6 // 64 * 64


def test_an_instrument_that_is_not_read_stops_when_1024_readings_wait(wire):
    device = device_on(wire, "2108")
    ask(device, wire, "slist 0 0", "slist 1 1", "slist 2 8")
    wire.empty()
    before, wire.room = len(wire.sent), 600
    ask(device, wire, "start 0")
    end_ns = run_for(device, 0.5)
    assert len(wire.sent) - before == 600
    wire.room = 10**6
    end_ns = run_for(device, 0.1, end_ns)
    scans, rest = divmod(600 + 2048, 6)
    scan = encode_scans(WITH_DIGITAL, np.array([[3200, -6400]])).tobytes()
    assert bytes(wire.sent[before:]) == scan * scans + scan[:rest] + b"stop 01"
    assert device.log.samples - device.log.samples_lost == scans
    assert not device.is_streaming
    assert ask(device, wire, "srate") == "srate 30000\r"
    wire.inbox = b"start 0\r"
    run_for(device, 0.1, end_ns)
    assert bytes(wire.sent).endswith(
        b"srate 30000\r" + scan * (200 * 6 // 16 * 16 // 6) + scan[: 200 * 6 // 16 * 16 % 6]
    )
    assert len(device.earlier_logs) == 1  # the stand went on


def test_text_is_volts(wire):
    device = device_on(wire, "2108")
    assert ask(device, wire, "encode 1", "eol 2", "slist 0 1", "slist 1 0") != ""
    sent = len(wire.sent)
    ask(device, wire, "start")
    run_for(device, 0.002)
    assert bytes(wire.sent[sent:]).startswith(b"-1.9531,0.9766\r\n")
