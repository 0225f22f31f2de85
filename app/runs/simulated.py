"""Simulated tests as run files, with their truth."""

import datetime
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.runs.blocks import RunBlock, StoredRun
from app.runs.metadata import SIMULATION_PROTOCOL, EndMetadata, Events, RunMetadata, create_metadata
from app.runs.writer import write_run
from config.files import load_stand
from config.schema import Gauge, Gauges
from drivers.samples import DeviceIdentity, Losses

if TYPE_CHECKING:
    from analysis.motion.two_mass import Motion, TwoMassParameters

Floats = NDArray[np.float64]
Displacements = Callable[[Floats], tuple[Floats, Floats]]
Read = Callable[[Displacements, Floats], tuple[Floats, Floats]]
PLATEAU_S = 1.0
_EXACT = Gauge(
    gain_m_per_count=1.0,
    zero_count=0.0,
    gain_relative_standard_uncertainty=0.0,
    zero_standard_uncertainty_m=0.0,
    nonlinearity_m=0.0,
)


def write_simulated_run(
    path: Path,
    motion: "Motion",
    parameters: "TwoMassParameters",
    *,
    series: str | None = None,
    rate_hz: float = 1000.0,
    replace: bool = False,
    effects: Mapping[str, float] = {},
    read: Read | None = None,
) -> StoredRun:
    """Store a simulated motion, held at the pullback for `PLATEAU_S` first. Raises RunError, ConfigError.

    `effects` are true deviations from the ideal stand, by their parameters; `read` is what gauges make of
    the motion.
    """
    held = round(PLATEAU_S * rate_hz)
    count = held + int(np.floor(motion.duration_s * rate_hz * (1.0 + 1e-12))) + 1
    times_s = (np.arange(count) - held) / rate_hz
    show = motion.sample_displacements
    table, relative = show(times_s) if read is None else read(show, times_s)
    metadata = create_metadata(
        load_stand(),
        Gauges(table=_EXACT, relative=_EXACT),
        datetime.datetime.now().astimezone(),
        series=series,
        pullback_m=abs(parameters.pullback_m),
        table_mass_kg=parameters.table_mass_kg,
        plate_mass_kg=parameters.plate_mass_kg,
        title=f"Simulated pullback test {series or ''}".strip(),
        device=DeviceIdentity(protocol=SIMULATION_PROTOCOL, name="exact simulation"),
        rate_hz=rate_hz,
        source="simulated",
        truth={name: value for name, value in asdict(parameters).items() if value is not None}
        | {"friction_static": parameters.static_or_dynamic, **effects},
    )
    metadata = metadata.replace(stand=metadata.stand.replace(gravity_m_per_s2=parameters.gravity_m_per_s2))
    readings = np.column_stack([table, relative])
    return store_motion(path, metadata, readings, release_s=held / rate_hz, rate_hz=rate_hz, replace=replace)


def store_motion(
    path: Path,
    metadata: RunMetadata,
    readings: Floats,
    *,
    release_s: float,
    rate_hz: float,
    replace: bool = False,
) -> StoredRun:
    """Store even samples (n, 2) as a run without counts. Raises RunError."""
    n = len(readings)
    block = RunBlock(time_s=np.arange(n) / rate_hz, readings=readings, status=np.zeros(n, np.uint8))
    ending = EndMetadata(
        ended="simulated",
        end_time=metadata.known_start_time + datetime.timedelta(seconds=n / rate_hz),
        events=Events(pulled_back_s=0.0, release_s=release_s),
        losses=Losses(samples=n),
    )
    return write_run(path, metadata, block, ending, replace=replace)
