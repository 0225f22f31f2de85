"""What Record works with: the stand as it is set up, and the engine as far as it is needed."""

import datetime
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.acquisition.messages import RunSettings
from app.acquisition.pullback.plan import AllowedPlateRange, allowed_plate_range, default_excursion
from app.acquisition.ring import RingRows
from config.schema import Gauges, Stand


class Recorder(Protocol):
    """The engine as far as Record needs it."""

    def arm(self, run: RunSettings, count: int = 1) -> None:
        """Record so many runs, one after another."""

    def stop(self) -> None:
        """End the run and keep it."""

    def new_rows(self) -> RingRows | None:
        """Samples since the last call; None without any."""


@dataclass(frozen=True, slots=True)
class StandContext:
    """What Record must know of the stand: settings, series, where runs go."""

    stand: Stand
    gauges: Gauges
    all_series: tuple[str, ...]
    directory: Path
    today: Callable[[], datetime.date] = datetime.date.today
    clock: Callable[[], float] = time.monotonic

    def pullback_m(self, series: str) -> float:
        """How far the table is pulled back in a series (m)."""
        return self.stand.series(series).pullback_m

    def allowed_plate_range(self, series: str) -> AllowedPlateRange | None:
        """Where the plate may stand before a pull; None where the range of gauge 2 is not known."""
        range_m = self.gauges.relative.range_m
        return (
            None
            if range_m is None
            else allowed_plate_range(range_m, default_excursion(self.pullback_m(series)))
        )
