"""Where a screen can lead: implemented by the window presenter."""

from dataclasses import dataclass
from typing import Protocol

from app.acquisition.messages import PortSettings
from app.simulated_stand.options import SimulatedStandOptions
from config.schema import Gauges


@dataclass(frozen=True, slots=True)
class ConnectForm:
    """Form of the Start screen, as typed."""

    port: str = ""
    protocol: str = ""
    baud: str = ""
    rate_hz: str = ""
    parity: str = "N"
    settings: str = ""
    """Settings of the device, `KEY=VALUE KEY=VALUE`."""
    relative_port: str = ""
    """Port of gauge 2 if each gauge has a device of its own."""


class Navigator(Protocol):
    """Opens screens, connections and runs for the presenters of single screens."""

    def show_start(self) -> None:
        """Show Start, where a device is connected."""

    def fill_connection(self, form: ConnectForm) -> None:
        """Show Start with `form` filled in."""

    def fill_second_port(self, url: str) -> None:
        """Show Start with the port of gauge 2's own device filled in."""

    def open_simulated(self, series: str) -> None:
        """Start the simulated stand with its usual options, and record from it."""

    def open_stand(self, options: SimulatedStandOptions) -> None:
        """Start a simulated stand, and record from it."""

    def open_port(self, port: PortSettings) -> None:
        """Record from an amplifier."""

    def reconnect(self) -> None:
        """Connect to the same device again."""

    def close_connection(self) -> None:
        """Disconnect, unless a run is being recorded."""

    def set_gauges(self, gauges: Gauges) -> None:
        """Use these calibrations from now on."""

    def show_record(self) -> None:
        """Show Record."""

    def show_runs(self, folder: str, series: str) -> None:
        """Show the runs of a folder on Runs; only those of `series` unless it is empty."""

    def open_run(self, path: str) -> None:
        """Show a run on Identify."""
