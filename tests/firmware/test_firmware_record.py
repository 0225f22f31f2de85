"""A pullback through the real firmware: converter, frames, port, run file, friction."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from board_kit import BAUD, running

from app.runs.reader import open_run
from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.signal import StandSignal
from config.files import load_gauges, load_stand

RATE_HZ = 1000
DURATION_S = 5.0

GAUGES = f"""
[table]
gain_m_per_count = 2.0e-9
zero_count = 12000.0
range_m = 0.0165
[relative]
gain_m_per_count = 4.0e-9
zero_count = -8000.0
range_m = 0.033
delay_s = {-1 / (2 * RATE_HZ)}
"""
"""The relative gauge is read half a sample period after its sample's time: so it is early by that much."""


@pytest.fixture
def gauges(tmp_path):
    path = tmp_path / "gauges.toml"
    path.write_text(GAUGES)
    return path


def stand_at_twice_the_rate(options, gauges):
    """What both gauges show every half sample period, and what is true."""
    true = stand_truth(options, load_stand())
    timetable = options.timetable()
    motion = RepeatedPullback(true.pullback_m, released_motion(true, timetable), timetable, 0.0)
    signal = StandSignal(motion, load_gauges(gauges), options, 2.0 * RATE_HZ)
    counts, _ = signal.take(round(2 * RATE_HZ * timetable.cycle_s))
    return counts, true


def slipstand(folder, *words):
    """Run the command in a process of its own, with the user's folders elsewhere."""
    places = {name: str(folder) for name in ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")}
    done = subprocess.run(
        [sys.executable, "-m", "app", *map(str, words), "--json"],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env=os.environ | places,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_pullback_read_by_the_firmware_has_the_true_friction(workshop, gauges, tmp_path):
    options = SimulatedStandOptions(
        rest_s=1.0, pull_s=0.4, hold_s=0.4, decay_s=4.0, recentre_s=1.0, rate_hz=RATE_HZ, seed=3
    )
    counts, true = stand_at_twice_the_rate(options, gauges)
    turned = np.column_stack([counts[0::2, 0], counts[1::2, 1]])
    with running(workshop, workshop.firmware("ads1256"), "ads1256", turned) as board:
        device = ["--port", board.url, "--protocol", "slipstand-binary", "--baud", BAUD, "--rate", RATE_HZ]
        place = ["--directory", tmp_path, "--calibration", gauges, "--series", "1FFM0"]
        recorded = slipstand(
            tmp_path, "record", *device, *place, "--trigger", "none", "--duration", DURATION_S
        )
    assert (recorded["samples"], recorded["missing"], recorded["damaged"]) == (RATE_HZ * DURATION_S, 0, 0)
    run = open_run(recorded["run"])
    assert (run.metadata.device.protocol, run.metadata.device.firmware) == (
        "slipstand-binary",
        "1.0.0+ads1256",
    )
    if abs(run.end.time_base.scale - 1) > 0.002:
        pytest.skip(f"this machine is too busy to simulate in real time: {run.end.time_base.scale:.4f}")
    (found,) = slipstand(tmp_path, "analyze", recorded["run"])
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(true.friction_dynamic, rel=0.01)
