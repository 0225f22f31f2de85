import threading
import time

import pytest

from drivers.envelope import Unwrapper
from drivers.errors import DeviceLostError, NoDataError, PortUnavailableError, SettingsError
from drivers.pair import link as pair_link
from drivers.pair.decoder import PairedChannel
from drivers.pair.link import PairLink, open_pair
from drivers.pair.source import PairSource, make_pair
from drivers.port import PortInfo
from drivers.registry import find_driver

PATIENT_S = 10.0


class FakePort:
    """A port that brings `data` again and again, until it is lost or silent."""

    def __init__(self, name: str, data: bytes) -> None:
        self.info = PortInfo(name)
        self.is_lost = threading.Event()
        self.is_silent = threading.Event()
        self.is_closed = False
        self._data = data

    def read(self) -> bytes:
        if self.is_lost.is_set():
            raise DeviceLostError(f"{self.info.device} is gone")
        time.sleep(0.005)
        return b"" if self.is_silent.is_set() else self._data

    def write(self, data: bytes) -> None:
        """Nothing listens."""

    def close(self) -> None:
        self.is_closed = True


class FakeChoice:
    """Opens ports one after another; a fault is raised instead."""

    def __init__(self, *ports) -> None:
        self.ports = list(ports)
        self.reopened: list[PortInfo] = []

    def open(self):
        port = self.ports.pop(0)
        if isinstance(port, Exception):
            raise port
        return port

    def reopen(self, lost):
        self.reopened.append(lost)
        if not self.ports:
            raise PortUnavailableError("it is not there")
        return self.open()


class FakeSource:
    """Takes whatever comes."""

    is_polled = False
    rate_hz = 100.0

    def __init__(self, fault: Exception | None = None) -> None:
        self.said: list[str] = []
        self._fault = fault

    def start(self, link) -> bytes:
        self.said.append("start")
        if self._fault:
            raise self._fault
        return b"first" + link.read()

    def resume(self, link) -> bytes:
        self.said.append("resume")
        return link.read()

    def read(self, link) -> bytes:
        return link.read()

    def stop(self, link) -> None:
        self.said.append("stop")


@pytest.fixture
def ports():
    return FakePort("A", b"a"), FakePort("B", b"b")


@pytest.fixture
def sources():
    return FakeSource(), FakeSource()


def stamped(link: PairLink, enough) -> list:
    """Reads until they are enough."""
    unwrapper, got = Unwrapper(), []
    deadline_s = time.monotonic() + PATIENT_S
    while not enough(got):
        assert time.monotonic() < deadline_s, f"only {got[-3:]} came"
        got.extend(unwrapper.feed(link.read()))
    return got


def test_reads_of_both_ports_come_in_envelopes_and_both_devices_are_stopped(ports, sources):
    link = open_pair(tuple(map(FakeChoice, ports)), sources)
    got = stamped(link, lambda reads: all(sum(read.port == gauge for read in reads) > 5 for gauge in (0, 1)))
    link.close()
    link.close()
    assert {(read.port, read.data) for read in got} == {(0, b"firsta"), (0, b"a"), (1, b"firstb"), (1, b"b")}
    for gauge in (0, 1):
        arrivals = [read.arrival_ns for read in got if read.port == gauge]
        assert arrivals == sorted(arrivals)
    assert [source.said for source in sources] == [["start", "stop"]] * 2
    assert all(port.is_closed for port in ports)
    assert (link.url, link.info.device) == ("A + B", "A + B")


@pytest.mark.parametrize("fault", ["is_lost", "is_silent"])
def test_a_device_that_goes_is_found_again_while_the_other_is_read_on(ports, sources, monkeypatch, fault):
    monkeypatch.setattr(pair_link, "_SILENT_S", 0.05)
    choices = FakeChoice(ports[0]), FakeChoice(ports[1], PortUnavailableError("not yet"), FakePort("C", b"c"))
    link = open_pair(choices, sources)
    stamped(link, lambda reads: any(read.data == b"b" for read in reads))
    getattr(ports[1], fault).set()
    got = stamped(link, lambda reads: any(read.data == b"c" for read in reads))
    link.close()
    assert b"" in [read.data for read in got if read.port == 1]
    assert sum(read.port == 0 for read in got) > 20  # meanwhile
    assert choices[1].reopened == [PortInfo("B")] * 2
    assert sources[1].said == ["start", "resume", "stop"]
    assert ports[1].is_closed


def test_a_device_that_stays_away_ends_the_link(ports, sources, monkeypatch):
    monkeypatch.setattr(pair_link, "RECONNECT_TIMEOUT_S", 0.1)
    link = open_pair(tuple(map(FakeChoice, ports)), sources)
    stamped(link, lambda reads: len(reads) > 5)
    ports[0].is_lost.set()
    with pytest.raises(DeviceLostError, match=r"^gauge 1: it was not back within 0.1 s \(it is not there\)"):
        stamped(link, lambda _: False)
    link.close()


def test_a_device_that_cannot_be_started_ends_the_start(ports):
    source = make_pair(find_driver("csv"), {}, None)
    link = open_pair(tuple(map(FakeChoice, ports)), (FakeSource(), FakeSource(NoDataError("only rubbish"))))
    with pytest.raises(NoDataError, match=r"^gauge 2: only rubbish"):
        source.start(link)
    link.close()


def test_a_port_that_cannot_be_opened_closes_the_other(ports, sources):
    choices = FakeChoice(ports[0]), FakeChoice(SettingsError("no such thing"))
    with pytest.raises(SettingsError, match=r"^gauge 2: no such thing"):
        open_pair(choices, sources)
    assert ports[0].is_closed


def test_both_devices_go_on_where_they_were(ports, sources):
    lost = PortInfo("old A"), PortInfo("old B")
    choices = tuple(map(FakeChoice, ports))
    link = open_pair(choices, sources, lost)
    stamped(link, lambda reads: {read.port for read in reads} == {0, 1})
    link.close()
    assert [choice.reopened for choice in choices] == [[one] for one in lost]
    assert [source.said for source in sources] == [["resume", "stop"]] * 2


class PolledSource(FakeSource):
    """Is polled, at a rate that can be set."""

    is_polled = True
    batch_delay_s = 0.0

    def __init__(self, rate_hz: float) -> None:
        super().__init__()
        self.rate_hz = rate_hz

    def set_poll_rate(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz


@pytest.mark.parametrize("rates_hz", [(100.0, 80.0), (80.0, 100.0)])
def test_polled_devices_are_polled_together(ports, rates_hz):
    sources = tuple(map(PolledSource, rates_hz))
    source = PairSource(find_driver("modbus"), tuple(PairedChannel(one, 0) for one in sources))
    link = open_pair(tuple(map(FakeChoice, ports)), sources)
    source.start(link)
    link.close()
    assert [one.rate_hz for one in sources] == [80.0, 80.0]
