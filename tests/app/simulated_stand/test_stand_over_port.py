"""Amplifiers read over their port by a clock of the test: how busy this computer is changes nothing."""

import datetime
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest

from analysis.identify import identify
from app.runs.analysis_input import build_record
from app.runs.blocks import calibrate
from app.runs.metadata import create_metadata
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.stand import SimulatedStandDevice
from config.files import load_gauges, load_stand
from drivers.clock import TimeBase
from drivers.driver import GAUGES
from drivers.envelope import wrap
from drivers.pair.source import PairSource, make_pair
from drivers.port import Port, open_port
from drivers.registry import find_driver
from drivers.samples import SampleBlock, SampleStatus
from drivers.simulated.transport import Transport, open_pseudo_terminal, open_tcp_port
from drivers.stream import SampleSource

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the simulated stand needs a pseudo-terminal")

MOTION = {"rest_s": 0.3, "pull_s": 0.4, "hold_s": 0.6, "decay_s": 5.0, "recentre_s": 0.3}
RECORDED_S = 6.0
PAIR_STARTS_S = 3.0
"""Until two devices begin their common motion: they are started before."""
BATCH_S = 0.02  # how long bytes collect in a port before they are read
STEP_S = 0.004
"""How often devices that send by themselves are looked after: a pseudo-terminal takes so much at once."""
READ_S = 0.05  # longest read, as of a port
BEGAN = datetime.datetime(2026, 11, 23, tzinfo=datetime.UTC)

POLLED = {"modbus": {}, "modbus-tcp": {"framing": "tcp"}}
PAIRS = {
    "AED": ("hbm-aed", {}, 600.0),
    "AED, text": ("hbm-aed", {"format": "ascii"}, 600.0),
    "eNod4": ("enod4", {}, 500.0),
    "GSV-3": ("gsv-234", {"format": "gsv-3"}, 500.0),
    "GSV-2": ("gsv-234", {"format": "gsv-2"}, 500.0),
    "DSCUSB": ("csv", {"format": "mantracourt-dscusb"}, 300.0),
    "iLoad": ("csv", {"format": "loadstar-iload"}, 500.0),
    "OpenScale": ("csv", {"format": "openscale"}, 100.0),
}


class Clock:
    """Stands for the module `time`; the devices go on as it does."""

    def __init__(self) -> None:
        self.now_ns = 10**12
        self.devices: list[SimulatedStandDevice] = []
        self.shortest_step_s = STEP_S

    def perf_counter_ns(self) -> int:
        return self.now_ns

    def perf_counter(self) -> float:
        return self.now_ns * 1e-9

    time = perf_counter

    def step(self, longest_s: float = READ_S) -> None:
        """Go on until a device has something to do, or for the shortest step."""
        wait_s = min(device.step(self.now_ns) for device in self.devices)
        self.now_ns += max(1000, round(min(longest_s, max(wait_s, self.shortest_step_s)) * 1e9))

    def sleep(self, seconds: float) -> None:
        end_ns = self.now_ns + max(1000, round(seconds * 1e9))
        while self.now_ns < end_ns:
            self.step((end_ns - self.now_ns) * 1e-9)


class CountedTransport(Transport):
    """A device's end of a port, which takes what was written however late the system brings it."""

    def __init__(self, inner: Transport) -> None:
        self._inner = inner
        self.resets_device, self.burst_s = inner.resets_device, inner.burst_s
        self.sent = self.received = self.written = 0
        """Bytes by the device, to it, and by the reader."""

    @property
    def url(self) -> str:
        return self._inner.url

    def wait(self, timeout_s: float) -> None:
        self._inner.wait(timeout_s)

    def receive(self) -> bytes | None:
        data = self._inner.receive()
        while data is not None and self.received + len(data) < self.written:
            self._inner.wait(READ_S)
            data += self._inner.receive() or b""
        self.received += len(data or b"")
        return data

    def send(self, data: bytes) -> int:
        took = self._inner.send(data)
        self.sent += took
        return took

    def unplug(self) -> None:
        self._inner.unplug()

    def plug_in(self) -> None:
        self._inner.plug_in()

    def close(self) -> None:
        self._inner.close()


class SteppedLink:
    """An open port. What was sent is read whole, and nothing is waited for that was not sent."""

    def __init__(self, port: Port, transport: CountedTransport, clock: Clock) -> None:
        self._port, self._transport, self._clock = port, transport, clock
        self._taken = 0

    def read(self) -> bytes:
        end_s = self._clock.perf_counter() + READ_S
        while self._transport.sent == self._taken and self._clock.perf_counter() < end_s:
            self._clock.step()
        data = b""
        while self._taken + len(data) < self._transport.sent:
            data += self._port.read()
        self._taken += len(data)
        return data

    def write(self, data: bytes) -> None:
        self._transport.written += len(data)
        self._port.write(data)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    for module in ("drivers.stream", "drivers.polling", "drivers.devices.modbus.source"):
        monkeypatch.setattr(f"{module}.time", clock)
    monkeypatch.setattr("app.simulated_stand.stand.time", clock)
    for module in ("drivers.host_time", "drivers.stream", "drivers.polling"):
        monkeypatch.setattr(f"{module}.host_ns", clock.perf_counter_ns)
    return clock


@contextmanager
def opened(
    options: SimulatedStandOptions, clock: Clock, transport: Transport
) -> Iterator[tuple[SimulatedStandDevice, SteppedLink]]:
    """A stand, and the open port that leads to it."""
    with ExitStack() as stack:
        counted = CountedTransport(transport)
        stack.callback(counted.close)
        stand = SimulatedStandDevice(options, counted, lambda _: None)
        clock.devices.append(stand)
        port = stack.enter_context(open_port(counted.url, 115200))
        yield stand, SteppedLink(port, counted, clock)


def rows_of_one(source: SampleSource, link: SteppedLink, clock: Clock) -> Iterator[SampleBlock]:
    yield from decoded(source, source.start(link), clock)
    end_s = clock.perf_counter() + RECORDED_S
    while clock.perf_counter() < end_s:
        yield from decoded(source, source.read(link), clock)


def rows_of_two(
    pair: PairSource, links: list[SteppedLink], clock: Clock, end_s: float
) -> Iterator[SampleBlock]:
    halves = [
        (gauge, channel.source, link)
        for gauge, (channel, link) in enumerate(zip(pair.channel_sources, links, strict=True))
    ]
    first = b""
    for gauge, source, link in halves:
        source.batch_delay_s = BATCH_S
        data = source.start(link)
        first += wrap(gauge, clock.now_ns, data)
    yield from decoded(pair, first, clock)
    while clock.perf_counter() < end_s:
        for gauge, source, link in halves:
            data = source.read(link)
            yield from decoded(pair, wrap(gauge, clock.now_ns, data) if data else b"", clock)


def decoded(source: SampleSource, data: bytes, clock: Clock) -> Iterator[SampleBlock]:
    return source.decode(data, clock.now_ns) if data else iter(())


@pytest.mark.parametrize("name", POLLED)
def test_a_polled_device_shows_the_true_friction(clock: Clock, name: str) -> None:
    clock.shortest_step_s = 0.0
    options = SimulatedStandOptions(protocol="modbus", device=POLLED[name], seed=2, **MOTION)
    transport = open_tcp_port() if name == "modbus-tcp" else open_pseudo_terminal()
    with opened(options, clock, transport) as (stand, link):
        source = find_driver("modbus").make_source(POLLED[name], None)
        assert_friction(rows_of_one(source, link, clock), source, stand)
    assert source.losses.missing == source.losses.damaged == 0


@pytest.mark.parametrize("name", PAIRS)
def test_two_devices_of_one_gauge_show_the_true_friction(clock: Clock, name: str) -> None:
    protocol, settings, rate_hz = PAIRS[name]
    starts_s = clock.time() + PAIR_STARTS_S
    with ExitStack() as stack:
        stands, links = zip(
            *(
                stack.enter_context(
                    opened(
                        SimulatedStandOptions(
                            protocol=protocol, device=settings, gauge=gauge, rate_hz=rate_hz, seed=number,
                            start_at_unix_s=starts_s, clock_ppm=60.0 - 130.0 * number, **MOTION,
                        ),
                        clock,
                        open_pseudo_terminal(),
                    )
                )
                for number, gauge in enumerate(GAUGES)
            ),
            strict=True,
        )  # fmt: skip
        pair = make_pair(find_driver(protocol), settings, rate_hz)
        assert_friction(rows_of_two(pair, list(links), clock, starts_s + RECORDED_S), pair, stands[0])


def assert_friction(rows: Iterator[SampleBlock], source: SampleSource, stand: SimulatedStandDevice) -> None:
    """The rows hold the friction that the stand has, to 1 %."""
    truth = stand.truth()
    gauges = load_gauges(truth.options.gauges_file)
    blocks = [calibrate(block, gauges) for block in rows]
    status = np.concatenate([block.status for block in blocks])
    readings = np.concatenate([block.readings for block in blocks])
    assert not (status & int(SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE)).any()
    metadata = create_metadata(load_stand(), gauges, BEGAN, series="1FFM0")
    times_s = np.arange(len(status)) / source.rate_hz
    time_base = TimeBase().with_skew(source.skew(0, len(status)))
    record = build_record(metadata, times_s, readings[:, 0], readings[:, 1], time_base)
    found = identify(record).results["friction_dynamic"]
    assert found.value == pytest.approx(truth.stand.friction_dynamic, rel=0.01)
