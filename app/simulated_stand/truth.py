"""Truth of a simulated stand, and the file with it."""

import contextlib
import os
from pathlib import Path

import msgspec

from app.simulated_stand.options import SimulatedStandOptions, Timetable
from config.durable_files import replace_file
from drivers.simulated.faults import Disturbance
from drivers.simulated.stream_sender import TransmissionLog


class StandTruth(msgspec.Struct, frozen=True, kw_only=True):
    """Parameters of the motion and what follows from them, named as in `analyze --json`."""

    series: str
    friction_dynamic: float
    friction_static: float
    tilt_rad: float
    pullback_m: float
    table_mass_kg: float
    plate_mass_kg: float
    gravity_m_per_s2: float
    period_s: float
    damping_n1_per_s: float
    stiffness_n_per_m: float
    damping_coefficient_kg_per_s: float


class Truth(msgspec.Struct, frozen=True, kw_only=True):
    """True values to compare results with."""

    schema: str = "slipstand-truth/1"
    port: str
    stand: StandTruth
    options: SimulatedStandOptions
    timetable: Timetable
    release_s: list[float]
    """Times of the releases of this session, early ones among them, on the stand's own time (s).

    A session begins with a stream that is started afresh; where that is the only one, sample
    `release_s * wire.true_rate_hz` is the release."""
    plate_offset_m: list[float]  # where the plate stood on the table before each of these releases (m)
    residual_displacement_m: float  # how far each release moves it on (m)
    streams: int
    wire: TransmissionLog
    """The running stream, or the last one."""
    earlier: list[TransmissionLog] = []
    """Those of this session before that one, which ended when a cable or a reader was disconnected."""
    disturbances: list[Disturbance] = []
    """What is planned for this session or was asked for in it, each with its time."""


def write_truth(path: Path, truth: Truth) -> None:
    """Replace the truth file as a whole: whoever reads it finds the old one or the new one."""
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        partial.write_bytes(msgspec.json.format(msgspec.json.encode(truth)))
        replace_file(partial, path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
