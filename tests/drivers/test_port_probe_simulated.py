"""Ports with a simulated device are probed in real time."""

import sys
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

from drivers import port_probe
from drivers.port import PortInfo, PortUser, port_info
from drivers.port_probe import ProbeOutcome, probe_port
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, make_device
from drivers.simulated.transport import open_pseudo_terminal, open_tcp_port

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")


class Rest:
    """A stand that does not move."""

    def take(self, count: int):
        counts = np.random.default_rng(0).normal(700, 9, (count, 2)).round().astype(np.int32)
        return counts, np.zeros(count, dtype=np.uint8)


@contextmanager
def served(transport, step):
    """The other end of a port, which steps in a thread until the test is done; gives the port's address."""
    ended = threading.Event()

    def run() -> None:
        while not ended.is_set():
            transport.wait(step())

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield transport.url
    finally:
        ended.set()
        thread.join()
        transport.close()


def simulated(transport, protocol: str, settings: dict[str, str], rate_hz: float):
    packing = find_driver(protocol).make_simulated(settings)
    device = make_device(transport, packing, lambda *_: Rest(), DeviceSetup(rate_hz))
    return served(transport, lambda: device.step(time.monotonic_ns()))


@pytest.fixture(autouse=True)
def short_wait(monkeypatch):
    monkeypatch.setattr(port_probe, "FIRST_WAIT_S", 0.3)


@pytest.mark.parametrize(
    ("make", "protocol", "settings", "rate_hz"),
    [
        pytest.param(open_pseudo_terminal, "csv", {"columns": "time_us,table,relative"}, 500.0, marks=posix),
        (open_tcp_port, "csv", {"format": "openscale"}, 20.0),
        (open_tcp_port, "gsv", {}, 1000.0),
    ],
)
def test_what_sends_by_itself_is_recognised_without_a_word(make, protocol, settings, rate_hz):
    said: list[str] = []
    with simulated(make(), protocol, settings, rate_hz) as url:
        found = probe_port(port_info(url), False, said.append)
    assert found.outcome is ProbeOutcome.RECOGNISED
    assert (found.recognition.protocol, found.recognition.settings) == (protocol, settings)
    assert found.recognition.rate_hz == pytest.approx(rate_hz, rel=0.1)
    assert found.line_settings is None
    assert list(map(str, said)) == ["listening"]


@pytest.mark.parametrize(
    ("make", "protocol", "settings", "remark"),
    [
        (open_tcp_port, "slipstand-binary", {}, "firmware simulated-1, 500 Hz"),
        pytest.param(open_pseudo_terminal, "harp", {}, "", marks=posix),
        (open_tcp_port, "dataq", {}, "DI-2108"),
        (open_tcp_port, "enod4", {}, "an eNod4 with address 1: give its rate with --rate"),
        (open_tcp_port, "modbus", {}, "unit 1 answers: choose its register map with --set map=NAME"),
        (
            open_tcp_port,
            "modbus",
            {"framing": "tcp"},
            "unit 1 answers: choose its register map with --set map=NAME",
        ),
    ],
)
def test_what_waits_to_be_asked_is_asked_only_when_told_to(make, protocol, settings, remark):
    with simulated(make(), protocol, settings, 500.0) as url:
        silent = probe_port(port_info(url), False, lambda _: None)
        asked = probe_port(port_info(url), True, lambda _: None)
    assert (silent.outcome, silent.recognition) == (ProbeOutcome.SILENT, None)
    assert str(silent.message) == "nothing sends by itself: try --write, which asks the device who it is"
    assert asked.outcome is ProbeOutcome.RECOGNISED
    assert (asked.recognition.protocol, str(asked.recognition.remark)) == (protocol, remark)
    assert asked.recognition.settings == settings


def test_bytes_that_nobody_knows_are_shown():
    transport = open_tcp_port()

    def step() -> float:
        if transport.receive() is not None:
            transport.send(b"\x13\x07\xff" * 400)
        return 0.02

    with served(transport, step) as url:
        found = probe_port(port_info(url), True, lambda _: None)
    assert found.outcome is ProbeOutcome.UNREADABLE
    assert "first 13 07 ff" in str(found.message)
    assert "set the baud rate where this address gets its bytes from" in str(found.message)


def test_a_port_that_is_held_is_left_alone(monkeypatch):
    monkeypatch.setattr(port_probe, "other_port_users", lambda _: [PortUser(77, "minicom")])
    monkeypatch.setattr(port_probe, "open_port", None)
    found = probe_port(PortInfo("/dev/ttyUSB9"), True, lambda _: None)
    assert found.outcome is ProbeOutcome.IN_USE
    assert str(found.message) == "in use by minicom (process 77): close that program, and look again"


def test_a_port_that_is_not_there():
    found = probe_port(PortInfo("/dev/ttyUSB99"), True, lambda _: None)
    assert found.outcome is ProbeOutcome.UNAVAILABLE
    assert "there is no port /dev/ttyUSB99" in str(found.message)
