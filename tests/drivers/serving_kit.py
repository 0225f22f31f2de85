"""A simulated device on a wire, stepped in a thread, for programs that open its port."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, SimulatedDevice, make_device
from drivers.simulated.stream_sender import Signal
from drivers.simulated.transport import Transport


@contextmanager
def serving(
    transport: Transport,
    protocol: str,
    settings: dict[str, str],
    signal_at: Callable[[float, float], Signal],
    setup: DeviceSetup,
) -> Iterator[SimulatedDevice]:
    """The device of a protocol; its port is `transport.url`."""
    device = make_device(transport, find_driver(protocol).make_simulated(settings), signal_at, setup)
    is_over = threading.Event()

    def run() -> None:
        while not is_over.is_set():
            transport.wait(min(device.step(time.monotonic_ns()), 0.02))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield device
    finally:
        is_over.set()
        thread.join()
        transport.close()
