"""What is shown of a device that sends no more is dated by its last sample, on a clock of the test."""

import datetime

import pytest
from ring_kit import ring_rows

from app.acquisition.messages import Connected, Failed, Reconnected, Reconnecting
from app.presenters.device_status import SILENT_S, DeviceMonitor, DeviceStatus

BEGIN = datetime.datetime(2026, 2, 1, 14, 3, tzinfo=datetime.UTC)


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def seconds(self) -> float:
        return self.now_s

    def time_of_day(self) -> datetime.datetime:
        return BEGIN + datetime.timedelta(seconds=self.now_s - 100.0)


@pytest.fixture
def clock() -> Clock:
    return Clock()


def connected(clock: Clock, rate_hz: float = 500.0) -> DeviceMonitor:
    monitor = DeviceMonitor(clock.seconds, clock.time_of_day)
    monitor.on_event(Connected("GSV-8", "1.45", rate_hz, "/ring"))
    return monitor


def send(monitor: DeviceMonitor, clock: Clock, until_s: float) -> None:
    while clock.now_s < until_s:
        clock.now_s += 0.1
        monitor.on_rows(ring_rows(0, [0.0], [0.0], [0.0], 0))


def test_nothing_is_live_without_a_device(clock: Clock) -> None:
    monitor = DeviceMonitor(clock.seconds, clock.time_of_day)
    clock.now_s += 60.0
    assert monitor.status() == DeviceStatus()
    assert not monitor.status().is_live


def test_a_device_that_sends_is_live(clock: Clock) -> None:
    monitor = connected(clock)
    send(monitor, clock, 121.0)
    assert monitor.status().is_live


def test_a_lost_device_is_dated_at_once_by_its_last_sample(clock: Clock) -> None:
    monitor = connected(clock)
    send(monitor, clock, 121.0)
    monitor.on_event(Reconnecting("the port is gone"))
    assert monitor.status() == DeviceStatus("GSV-8", "14:03:21")
    clock.now_s += 600.0
    assert monitor.status() == DeviceStatus("GSV-8", "14:03:21")
    monitor.on_event(Reconnected(600.0, "back"))
    assert monitor.status().is_live


def test_silence_is_dated_before_anybody_calls_the_device_lost(clock: Clock) -> None:
    monitor = connected(clock)
    send(monitor, clock, 121.0)
    clock.now_s += 0.9 * SILENT_S
    assert monitor.status().is_live
    clock.now_s += 0.2 * SILENT_S
    assert monitor.status().stopped_at == "14:03:21"
    send(monitor, clock, 124.0)
    assert monitor.status().is_live


def test_a_slow_device_may_be_silent_between_its_samples(clock: Clock) -> None:
    monitor = connected(clock, rate_hz=0.5)
    clock.now_s += 9.0
    assert monitor.status().is_live
    clock.now_s += 2.0
    assert not monitor.status().is_live


def test_a_failed_connection_leaves_no_device(clock: Clock) -> None:
    monitor = connected(clock)
    monitor.on_event(Reconnecting("the port is gone"))
    monitor.on_event(Failed("the engine ended"))
    assert monitor.status() == DeviceStatus()
