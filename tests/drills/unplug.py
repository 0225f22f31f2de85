"""Drill: the cable is pulled out during a run and put back; `python -m tests.drills.unplug --count 100`.

Each run must go on over the gap, and each of its rows be what the stand sent at that place, or be marked.
A device with its own power tells by its sequence or its times exactly how many samples are missing, if it
sends such; after one that lost its power the rows are estimated by the host's clock, and how far off they are
is reported. Rows of a device that is asked lie on a grid of the host's clock.
"""

import itertools
import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    Event,
    Failed,
    PortSettings,
    Reconnected,
    RunEnded,
    RunSettings,
    RunStarted,
)
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import settings_file
from drivers.samples import ABSENT, SampleStatus
from tests.drills.report import DrillReport, arguments, run_ways
from tests.drills.sent import Sent, truth_of_now
from tests.drivers.examples import RecordingExample, recording_examples

DURATION_S = 6.0  # a device that is away longest, and comes back as late as it may, is back before
PULLED_WITHIN_S = 1.0
AWAY_S = (0.05, 2.0)
RETURN_LIMIT_S = 2.0
ESTIMATE_LIMIT_S = 0.1
BEHIND_S = 0.05
EXACT_PERIODS = 0.1

SIXTEEN_BITS = """
[table]
gain_m_per_count = 1.0e-6
zero_count = 40.0
[relative]
gain_m_per_count = -1.0e-6
zero_count = -30.0
"""


PAIR = "pair"
"""Two Modbus devices of one gauge each, of which one is unplugged (`tests.drills.unplug_pair`)."""

DEVICES = recording_examples()


@dataclass(slots=True)
class UnplugReport(DrillReport):
    """What came of it."""

    runs: int = 0
    samples: int = 0
    missing: int = 0
    missing_estimated: int = 0
    damaged: int = 0
    back_after_s: list[float] = field(default_factory=list)
    """From the return of the device to the first sample."""
    estimate_off_s: list[float] = field(default_factory=list)
    """By how much rows after an estimated gap are late."""
    starved: int = 0
    """Estimated gaps before which the stand was behind its time, for want of processor: not judged."""

    def figures(self) -> str:
        back_s, off_s = self.back_after_s or [np.nan], self.estimate_off_s or [0.0]
        return (
            f"{self.runs} runs, {self.samples} samples, {self.missing} missing by sequence,"
            f" {self.missing_estimated} estimated, {self.damaged} damaged; back after"
            f" {np.median(back_s):.2f} s (median), {np.max(back_s):.2f} s (longest);"
            f" estimated gaps off by {np.max(np.abs(off_s)) * 1e3:.0f} ms at most ({self.starved} not judged:"
            f" the stand was starved)"
        )


def unplug(
    count: int,
    folder: Path,
    kind: str = "unplug",
    tcp: bool = False,
    seed: int | None = None,
    protocol: str = "slipstand-binary",
    duration_s: float = DURATION_S,
) -> UnplugReport:
    """Pull the cable of a simulated stand once in each of `count` runs.

    Parameters
    ----------
    count : int
    folder : Path
        For the runs.
    kind : str
        `unplug`: the device has its own power; `power`: it is switched off meanwhile.
    tcp : bool
        Over TCP instead of a pseudo-terminal.
    seed : int, optional
        Makes the moments repeatable.
    protocol : str
        One of `DEVICES`.
    duration_s : float
        Of a run; a busy computer pulls the cable and sees the return late.
    """
    device = DEVICES[protocol]
    gauges_file = settings_file("gauges.toml")
    if device.has_16_bits:
        gauges_file = folder / "sixteen-bits.toml"
        gauges_file.write_text(SIXTEEN_BITS)
    options = SimulatedStandOptions(
        protocol=device.protocol,
        device=device.settings,
        rate_hz=device.unplugged_hz,
        seed=1,
        tcp_port=0 if tcp else None,
        decay_s=5.0,
        gauges_file=str(gauges_file),
        table_drift_m_per_s=1e-3,  # at rest all streams would be alike, whose noise is of one seed
    )
    report, moments, sent = UnplugReport(), random.Random(seed), Sent()
    files = (str(settings_file("stand.toml")), str(gauges_file))
    with SimulatedStand.start(options) as stand:
        port = PortSettings(
            stand.port,
            device.protocol,
            rate_hz=device.polled_hz or device.unplugged_hz,
            device=device.settings,
        )
        with EngineClient.start(port, *files) as engine:
            wait_for(engine, Connected)
            for number in range(count):
                said = f"run {number}, {kind}{' over TCP' if tcp else ''}"
                try:
                    ended = _one_run(engine, stand, folder, kind, moments, report, duration_s)
                    _check(ended, stand, sent, report, device, duration_s)
                except (ValueError, TimeoutError) as error:
                    report.faults.append(f"{said}: {error}")
    return report


def _one_run(
    engine: EngineClient,
    stand: SimulatedStand,
    folder: Path,
    kind: str,
    moments: random.Random,
    report: UnplugReport,
    duration_s: float,
) -> RunEnded:
    engine.send(Arm(RunSettings(str(folder), series="1FFM0", trigger="none", duration_s=duration_s)))
    wait_for(engine, RunStarted)
    time.sleep(moments.uniform(0.0, PULLED_WITHIN_S))
    away_s = moments.uniform(*AWAY_S)
    stand.disturb(f"{kind} {away_s:.3f}")
    returns_s = time.monotonic() + away_s
    wait_for(engine, Reconnected)
    report.back_after_s.append(time.monotonic() - returns_s)
    if report.back_after_s[-1] > RETURN_LIMIT_S:
        report.faults.append(f"back only {report.back_after_s[-1]:.2f} s after the return")
    ended = wait_for(engine, RunEnded)
    assert isinstance(ended, RunEnded)
    return ended


def _check(
    ended: RunEnded,
    stand: SimulatedStand,
    sent: Sent,
    report: UnplugReport,
    device: RecordingExample,
    duration_s: float,
) -> None:
    """Hold a run against what was sent."""
    run = open_run(ended.path)
    truth = truth_of_now(stand)
    report.runs += 1
    report.samples += ended.samples
    report.missing += ended.missing
    report.missing_estimated += ended.missing_estimated
    report.damaged += ended.damaged
    if ended.ended is not EndReason.DURATION or len(run) != round(duration_s * ended.rate_hz):
        raise ValueError(f"ended {ended.ended} with {len(run)} rows: {ended.message}")
    marked = int(np.count_nonzero(run.status & SampleStatus.MISSING))
    if marked != ended.missing + ended.missing_estimated or not marked:
        raise ValueError(f"{marked} rows are marked, {ended.missing} + {ended.missing_estimated} are told")
    if device.polled_hz:
        _check_grid(run.status, load_counts(run), truth, sent, report, 1.0 / device.polled_hz)
    else:
        _check_places(run.status, load_counts(run), truth, sent, report, device.is_exact)


def _check_grid(
    status: np.ndarray, counts: np.ndarray, truth: Truth, sent: Sent, report: UnplugReport, cell_s: float
) -> None:
    """Raise ValueError unless each reading was taken when its row says, within a cell or two."""
    rows = np.flatnonzero((status & int(ABSENT)) == 0)
    off_s = sent.times_s(truth, counts, status) - rows * cell_s
    off_s -= np.median(off_s)
    report.estimate_off_s.append(float(off_s[np.argmax(np.abs(off_s))]))
    if abs(report.estimate_off_s[-1]) > 2.0 * cell_s:
        row = int(rows[np.argmax(np.abs(off_s))])
        raise ValueError(f"row {row} was taken {report.estimate_off_s[-1] * 1e3:.1f} ms off its time")


def _check_places(
    status: np.ndarray, counts: np.ndarray, truth: Truth, sent: Sent, report: UnplugReport, is_exact: bool
) -> None:
    """Raise ValueError unless all rows stand where they belong, after an estimated gap nearly."""
    accounts, rate_hz = [*truth.earlier, truth.wire], truth.wire.true_rate_hz
    for before, after in itertools.pairwise(sent.stretches(truth, counts, status)):
        heard_s = accounts[before.stream].started_s + (before.sample + before.end - before.first) / rate_hz
        next_s = accounts[after.stream].started_s + after.sample / rate_hz
        lost_s = max(
            (one.at_s or 0.0 for one in truth.disturbances if (one.at_s or 0.0) < next_s), default=0.0
        )
        is_same = after.stream == before.stream
        # A device of its own power tells what it has not sent yet; that of another stream is lost with it.
        wrong_s = (after.first - before.end) / rate_hz - (next_s - (heard_s if is_same else lost_s))
        if abs(wrong_s) * rate_hz < EXACT_PERIODS and is_same and is_exact:
            continue
        if lost_s - heard_s > BEHIND_S:
            report.starved += 1
            continue
        report.estimate_off_s.append(wrong_s)
        if (is_same and is_exact) or abs(wrong_s) > ESTIMATE_LIMIT_S:
            raise ValueError(f"the rows from {after.first} on are {wrong_s * 1e3:.1f} ms late")


def wait_for(engine: EngineClient, kind: type[Event], patience_s: float = 60.0) -> Event:
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        event = engine.wait(0.05)
        match event:
            case kind():
                return event
            case Failed(message):
                raise ValueError(f"the engine failed: {message}")
            case RunEnded():
                raise ValueError(f"the run ended early, {event.ended}: {event.message}")
    raise TimeoutError(f"no {kind.__name__} within {patience_s:g} s")


def main() -> int:
    """Run the drill in all its forms and print what came of it."""
    from tests.drills.unplug_pair import unplug_pair  # which builds on this one

    parser = arguments(__doc__, 100)
    parser.add_argument("--protocols", default=",".join([*DEVICES, PAIR]), help="separated by commas")
    given = parser.parse_args()
    ways: dict[str, Callable[[int, Path], DrillReport]] = {}
    for tcp in (True,) if sys.platform == "win32" else (False, True):
        for protocol in given.protocols.split(","):
            drill = partial(unplug, protocol=protocol)
            if protocol == PAIR or DEVICES[protocol].is_pair:
                drill = partial(unplug_pair, protocol="modbus" if protocol == PAIR else protocol)
            for kind in ("unplug", "power"):
                said = f"{kind}, {protocol}, {'TCP' if tcp else 'pseudo-terminal'}"
                ways[said] = partial(drill, kind=kind, tcp=tcp, seed=given.seed)
    return run_ways(given.count, ways)


if __name__ == "__main__":
    sys.exit(main())
