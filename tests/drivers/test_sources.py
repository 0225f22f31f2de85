"""What all sources have in common."""

import pytest
from wire_helpers import ScriptedLink

from drivers.errors import DeviceLostError
from drivers.registry import AVAILABLE, find_driver


@pytest.mark.parametrize("protocol", [driver.name for driver in AVAILABLE])
def test_a_device_that_goes_is_lost_and_stopping_it_is_quiet(protocol):
    link = ScriptedLink(lambda _: b"")
    link.is_lost = True
    source = find_driver(protocol).make_source({}, 100.0)
    with pytest.raises(DeviceLostError):
        source.start(link)
    source.stop(link)
