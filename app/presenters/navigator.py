"""What the window gives to its screens: settings of the stand, and where a screen can lead."""

import datetime
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.acquisition.messages import PortSettings
from app.acquisition.pullback.plan import AllowedPlateRange, allowed_plate_range, default_excursion
from app.simulated_stand.options import SimulatedStandOptions
from config.schema import Gauges, Stand


@dataclass(frozen=True, slots=True)
class StandContext:
    """Settings of the stand and the folder of its runs."""

    stand: Stand
    gauges: Gauges
    all_series: tuple[str, ...]
    directory: Path
    today: Callable[[], datetime.date] = datetime.date.today
    """Current date, for the validity of calibrations."""
    clock: Callable[[], float] = time.perf_counter

    def pullback_m(self, series: str) -> float:
        return self.stand.series(series).pullback_m

    def allowed_plate_range(self, series: str) -> AllowedPlateRange | None:
        """Allowed position of the plate before a pull; None where the range of gauge 2 is unknown."""
        range_m = self.gauges.relative.range_m
        excursion_m = default_excursion(self.pullback_m(series))
        return None if range_m is None else allowed_plate_range(range_m, excursion_m)


@dataclass(frozen=True, slots=True)
class ConnectForm:
    port: str = ""
    protocol: str = ""
    baud: str = ""
    rate_hz: str = ""
    parity: str = "N"
    stop_bits: str = "1"
    settings: str = ""
    """Settings of the device, `KEY=VALUE KEY=VALUE`."""
    relative_port: str = ""  # port of gauge 2 if each gauge has a device of its own


class Navigator(Protocol):
    """Opens screens, connections and runs; implemented by the window presenter."""

    def show_start(self) -> None: ...
    def show_record(self) -> None: ...

    def show_runs(self, folder: str, series: str) -> None:
        """Show the runs of a folder on Runs; only those of `series` unless it is empty."""

    def open_run(self, path: str) -> None: ...
    def connect_device(self, form: ConnectForm) -> None:
        """Fill in Start, and connect."""

    def fill_connection(self, form: ConnectForm) -> None: ...
    def fill_second_port(self, url: str) -> None: ...

    def open_simulated(self, series: str) -> None:
        """Start the simulated stand with its usual options, and record from it."""

    def open_stand(self, options: SimulatedStandOptions) -> None: ...
    def open_port(self, port: PortSettings) -> None: ...
    def reconnect(self) -> None: ...

    def close_connection(self) -> None:
        """Disconnect, unless a run is being recorded."""

    def count_simulated(self, counted: bool) -> None:
        """Choose whether simulated runs count beside others, in the plan and on Campaign."""

    def set_gauges(self, gauges: Gauges) -> None: ...
