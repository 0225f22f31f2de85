"""How the simulated device's bytes leave its process: the seam between it and its wire."""

from typing import Protocol


class Transport(Protocol):
    """The device's end of a wire. It never blocks."""

    @property
    def url(self) -> str:
        """What a reader opens; the same after the wire was unplugged and came back."""

    @property
    def resets_device(self) -> bool:
        """True: a reader that leaves the port resets the device, as DTR does. False: it goes on alone."""

    @property
    def burst_s(self) -> float:
        """So much of a stream may be sent at once when it is late, for a reader to follow."""

    def wait(self, timeout_s: float) -> None:
        """Sleep until the reader has sent something or `timeout_s` is over."""

    def receive(self) -> bytes | None:
        """Return what the reader has sent, b"" if nothing; None while no reader has the port open."""

    def send(self, data: bytes) -> int:
        """Offer `data` and return how many bytes were taken; the rest is lost, as on a UART."""

    def unplug(self) -> None:
        """Let the port vanish under whoever reads it."""

    def plug_in(self) -> None:
        """Let the port appear again under its old address."""

    def close(self) -> None:
        """Give the port up."""
