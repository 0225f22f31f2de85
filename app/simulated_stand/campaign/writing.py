"""One synthetic test as a run file: exact motion, gauges that err, converter, the ordinary writer."""

import datetime
import math
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from analysis.motion.motion import Motion
from app.runs.batch.tasks import in_words
from app.runs.layout import RunBlock, StoredRun, count_flags
from app.runs.metadata import Ending, Events, RunMetadata, describe_run
from app.runs.store import store_run
from app.simulated_stand.campaign.tests import CLOCK_UNCERTAINTY, SyntheticTest
from app.simulated_stand.gauges import GaugeFaults, SimulatedGauge
from config.files import load_gauges, load_stand
from config.schema import Gauge, Gauges
from drivers.samples import DeviceIdentity, SampleStatus

Floats = NDArray[np.float64]
_HELD_S = 1.0
_PLACES_M = (2e-4, 2e-3)
"""Standard deviations of where table and plate stand at rest, as the gauges read them."""


def write_test(test: SyntheticTest) -> StoredRun:
    """Record a synthetic test, faster than it would happen.

    Raises
    ------
    RunError
    """
    block, release_s = sample_test(test, load_gauges())
    return store_run(Path(test.path), test_metadata(test), block, _ending(test, block, release_s))


def sample_test(test: SyntheticTest, gauges: Gauges) -> tuple[RunBlock, float]:
    """What is recorded of a test, counts and readings by the stated calibration; and the time of release (s).

    The record's time is the device's; gauge 2 is late by `lag_s`, and both read by their true gains.
    """
    options, errors = test.options, test.errors
    rng = np.random.default_rng((*test.seed, 1))
    count = math.ceil((_HELD_S + options.duration_s) * options.rate_hz)
    time_s = np.arange(count) / options.rate_hz
    release_s = _HELD_S + rng.random() / options.rate_hz
    since_s = time_s * (1.0 + errors.clock) - release_s
    motion = test.parameters.simulate(options.duration_s + 1.0)
    places_m = rng.normal(scale=_PLACES_M)
    shown = _displacements(motion, since_s, errors.lag_s, of_plate=gauges.relative.measures == "plate")
    stated = (gauges.table, gauges.relative)
    columns = [
        _converted(gauge, gain, bend, place + x, options.noise_m, rng)
        for gauge, gain, bend, place, x in zip(
            stated, errors.gains, errors.bends_m, places_m, shown, strict=True
        )
    ]
    status = np.zeros(count, np.uint8)
    flags = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)
    for (_, overloaded), flag in zip(columns, flags, strict=True):
        status[overloaded] |= np.uint8(flag)
    counts = np.column_stack([counts for counts, _ in columns])
    readings = [gauge.displacement_m(c.astype(float)) for gauge, c in zip(stated, counts.T, strict=True)]
    return RunBlock(time_s, np.column_stack(readings), status, counts), release_s / (1.0 + errors.clock)


class RecordedTest(msgspec.Struct, frozen=True):
    """What became of a test: its run, or why there is none."""

    path: str
    error: str = ""


def record_test(test: SyntheticTest, _progress: object = None) -> RecordedTest:
    """`write_test` for a crew: never raises, what goes wrong is in the answer."""
    try:
        return RecordedTest(write_test(test).path)
    except Exception as error:
        return RecordedTest(test.path, in_words(error))


def test_metadata(test: SyntheticTest) -> RunMetadata:
    """What the run says of itself: the stated stand, and the truth beside it."""
    return describe_run(
        load_stand(),
        load_gauges(),
        test.start_time,
        series=test.series,
        title=f"Synthetic pullback test {test.series}",
        operator="demo",
        note="simulated, not recorded from a stand",
        device=DeviceIdentity("simulate", "synthetic campaign", serial_number=f"seed {test.options.seed}"),
        rate_hz=test.options.rate_hz,
        source="simulated",
        truth=test.truth,
    )


def _displacements(motion: Motion, since_s: Floats, lag_s: float, *, of_plate: bool) -> tuple[Floats, Floats]:
    """True displacements (n,) that gauge 1 and the later gauge 2 are to read."""
    table, _ = motion.sample_displacements(since_s)
    table_then, relative = motion.sample_displacements(since_s - lag_s)
    return table, relative + table_then if of_plate else relative


def _converted(
    gauge: Gauge, gain: float, bend_m: float, displacement_m: Floats, noise_m: float, rng: np.random.Generator
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Counts (n,) of a gauge that reads too much by the share `gain`, and where it is overloaded."""
    true = gauge.replace(gain_m_per_count=gauge.gain_m_per_count / (1.0 + gain))
    return SimulatedGauge(true, GaugeFaults(noise_m, nonlinearity_m=bend_m), rng).read(
        displacement_m, np.zeros(len(displacement_m))
    )


def _ending(test: SyntheticTest, block: RunBlock, release_s: float) -> Ending:
    return Ending(
        ended="simulated",
        end_time=test.start_time + datetime.timedelta(seconds=float(block.time_s[-1])),
        events=Events(pulled_back_s=0.0, release_s=release_s),
        losses=count_flags(block.status),
        clock_scale_uncertainty=CLOCK_UNCERTAINTY,
    )
