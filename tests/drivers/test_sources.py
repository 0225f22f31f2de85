"""What all sources have in common."""

import pytest
from wire_helpers import ScriptedLink

from drivers.errors import DeviceLostError
from drivers.registry import AVAILABLE, find_driver
from drivers.stream import RATE_GROWTH


@pytest.mark.parametrize("protocol", [driver.name for driver in AVAILABLE])
def test_a_device_that_goes_is_lost_and_stopping_it_is_quiet(protocol):
    link = ScriptedLink(lambda _: b"")
    link.is_lost = True
    source = find_driver(protocol).make_source({}, 100.0)
    with pytest.raises(DeviceLostError):
        source.start(link)
    source.stop(link)


@pytest.mark.parametrize("needed_bytes", [4000, 9990])
def test_data_awaited_with_growth_is_examined_now_and_then_and_when_it_ends(needed_bytes):
    examined: list[int] = []

    def is_good(data: bytes) -> bool:
        examined.append(len(data))
        return len(data) >= needed_bytes

    link = ScriptedLink(lambda _: b"", waiting=bytes(9990))
    source = find_driver("csv").make_source({}, 100.0)
    received, good = source.await_data(link, 1.0, is_good, RATE_GROWTH)
    assert good
    assert received == bytes(examined[-1])
    assert needed_bytes <= examined[-1] <= needed_bytes * (1 + RATE_GROWTH) + 50
    assert len(examined) < 50  # of 80 and 200 reads, and the sizes grow
    assert sum(examined) < needed_bytes * (2 / RATE_GROWTH)


def test_data_that_grow_no_more_are_examined_once():
    examined: list[int] = []
    link = ScriptedLink(lambda _: b"", waiting=bytes(110))
    source = find_driver("csv").make_source({}, 100.0)
    source.await_data(link, 0.1, lambda data: examined.append(len(data)), 2.0)
    assert examined == [50, 110]


def test_what_has_come_until_the_time_is_over_is_examined() -> None:
    link = ScriptedLink(lambda _: b"")
    link.read = lambda: b"x"  # type: ignore[method-assign]
    source = find_driver("csv").make_source({}, 100.0)
    received, good = source.await_data(link, 0.1, lambda data: len(data) > 1, 1e9)
    assert good
    assert len(received) > 2
