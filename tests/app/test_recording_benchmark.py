"""The benchmark of a recording compares each stored sample with the one that was sent."""

import datetime

import h5py
import numpy as np
import pytest

from app.runs.blocks import RunBlock
from app.runs.metadata import EndMetadata, create_metadata
from app.runs.schema import CHECKSUMS, count_path
from app.runs.writer import write_run
from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from app.simulated_stand.signal import StandSignal
from app.simulated_stand.truth import Truth
from benchmarks import recording
from config.files import load_gauges, load_stand
from drivers.samples import Losses
from drivers.simulated.stream_sender import TransmissionLog

RATE_HZ = 1000.0
BEGUN, ROWS = 300, 4000


@pytest.fixture
def recorded(tmp_path):
    options, timetable = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1), Timetable(0.5, 0.3, 0.4, 2.0, 0.4)
    stand = stand_truth(options, load_stand())
    motion = RepeatedPullback(stand.pullback_m, released_motion(stand, timetable), timetable)
    counts, _ = StandSignal(motion, load_gauges(), options, RATE_HZ).take(BEGUN + ROWS)
    now, counts = datetime.datetime.now().astimezone(), counts[BEGUN:]
    block = RunBlock(
        np.arange(ROWS) / RATE_HZ, np.zeros((ROWS, 2)), np.zeros(ROWS, np.uint8), counts.astype(np.int32)
    )
    metadata = create_metadata(load_stand(), load_gauges(), now, series="1FFM0", rate_hz=RATE_HZ)
    write_run(tmp_path / "run.h5", metadata, block, EndMetadata("duration", now, losses=Losses(ROWS)))
    truth = Truth(
        port="", stand=stand, options=options, timetable=timetable, release_s=[], plate_offset_m=[],
        residual_displacement_m=0.0, streams=1,
        wire=TransmissionLog(RATE_HZ, RATE_HZ, samples=BEGUN + ROWS),
    )  # fmt: skip
    return tmp_path / "run.h5", truth


@pytest.mark.parametrize("rows_at_once", [700, 100_000])
def test_a_wrong_sample_is_found_wherever_it_is(recorded, monkeypatch, rows_at_once):
    path, truth = recorded
    monkeypatch.setattr(recording, "CHECK_ROWS", rows_at_once)
    recording.check_counts(path, truth)
    for row in (ROWS - 1, 0):
        altered = path.with_name(f"altered-{row}.h5")
        altered.write_bytes(path.read_bytes())
        with h5py.File(altered, "r+") as file:
            file[count_path(0)][row] += 1
            del file[CHECKSUMS]
        with pytest.raises(SystemExit, match="holds other samples than were sent"):
            recording.check_counts(altered, truth)
