"""Drill: one of two devices of one gauge each is unplugged during a run; a part of `tests.drills.unplug`."""

import random
import time
from pathlib import Path

import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Connected,
    EndReason,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
)
from app.runs.reader import Run, load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import settings_file
from drivers.driver import GAUGES
from drivers.samples import ABSENT_BY_GAUGE
from tests.drills.sent import Sent, truth_of_now
from tests.drills.unplug import (
    AWAY_S,
    DURATION_S,
    PULLED_WITHIN_S,
    RETURN_LIMIT_S,
    UnplugReport,
    wait_for,
)
from tests.drivers.examples import recording_examples

STARTS_S = 5.0
"""Both stands are ready before their common motion begins."""
OFF_LIMIT_S = 0.03


def unplug_pair(
    count: int,
    folder: Path,
    kind: str = "unplug",
    tcp: bool = False,
    seed: int | None = None,
    protocol: str = "modbus",
    duration_s: float = DURATION_S,
) -> UnplugReport:
    """Pull the cable of one of two devices of one gauge, in turn, once in each of `count` runs.

    The run must go on with the other device alone, and each reading be what its stand took at that time.
    Devices that are asked are asked half as often as they could be, so that a busy computer can do it too.
    """
    device = recording_examples()[protocol]
    rate_hz = device.unplugged_hz if device.polled_hz is None else 0.5 * device.polled_hz
    report, moments = UnplugReport(), random.Random(seed)
    starts_at_s = time.time() + STARTS_S
    options = [
        SimulatedStandOptions(
            protocol=device.protocol, device=device.settings, gauge=gauge, rate_hz=device.unplugged_hz,
            seed=number, decay_s=5.0,
            tcp_port=0 if tcp else None, table_drift_m_per_s=1e-3, relative_drift_m_per_s=1e-3,
            start_at_unix_s=starts_at_s,
        )
        for number, gauge in enumerate(GAUGES, start=1)
    ]  # fmt: skip
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    with SimulatedStand.start(options[0]) as table, SimulatedStand.start(options[1]) as relative:
        stands, sent = (table, relative), (Sent(), Sent())
        port = PortSettings(
            table.port,
            device.protocol,
            rate_hz=rate_hz,
            device=device.settings,
            relative_url=relative.port,
        )
        with EngineClient.start(port, *files) as engine:
            wait_for(engine, Connected)
            time.sleep(max(0.0, starts_at_s - time.time()))
            for number in range(count):
                lost = number % 2
                try:
                    ended = _one_run(engine, stands[lost], folder, kind, moments, duration_s)
                    _check(ended, lost, stands, sent, starts_at_s, report, rate_hz, duration_s)
                except (ValueError, TimeoutError) as error:
                    report.faults.append(f"run {number}, {kind} of gauge {lost + 1}: {error}")
    return report


def _one_run(
    engine: EngineClient,
    stand: SimulatedStand,
    folder: Path,
    kind: str,
    moments: random.Random,
    duration_s: float,
) -> RunEnded:
    engine.send(Arm(RunSettings(str(folder), series="1FFM0", trigger="none", duration_s=duration_s)))
    wait_for(engine, RunStarted)
    time.sleep(moments.uniform(0.2, PULLED_WITHIN_S))
    stand.disturb(f"{kind} {moments.uniform(*AWAY_S):.3f}")
    ended = wait_for(engine, RunEnded)
    assert isinstance(ended, RunEnded)
    return ended


def _check(
    ended: RunEnded,
    lost: int,
    stands: tuple[SimulatedStand, SimulatedStand],
    sent: tuple[Sent, Sent],
    starts_at_s: float,
    report: UnplugReport,
    rate_hz: float,
    duration_s: float,
) -> None:
    """Hold a run against what both stands took."""
    run = open_run(ended.path)
    report.runs += 1
    report.samples += ended.samples
    report.missing += ended.missing
    report.missing_estimated += ended.missing_estimated
    report.damaged += ended.damaged
    if ended.ended is not EndReason.DURATION or abs(len(run) - duration_s * rate_hz) > 1:
        raise ValueError(f"ended {ended.ended} with {len(run)} rows: {ended.message}")
    gone = [np.flatnonzero(run.status & int(flag)) for flag in ABSENT_BY_GAUGE]
    if len(gone[lost]) < AWAY_S[0] * rate_hz or len(gone[lost]) > len(run) - 10:
        raise ValueError(f"{len(gone[lost])} readings of gauge {lost + 1} are marked as missing")
    began_s = run.metadata.start_time.timestamp() - starts_at_s
    truths = [truth_of_now(stand) for stand in stands]
    for gauge in (0, 1):
        _check_gauge(run, gauge, truths[gauge], sent[gauge], began_s, report)
    returned_s = max(
        one.at_s + one.seconds
        for one in truths[lost].disturbances
        if one.at_s is not None and one.at_s < began_s + duration_s
    )
    there = np.setdiff1d(np.arange(len(run)), gone[lost])
    again_s = began_s + run.time_s[there] - returned_s
    if not (again_s > 0.0).any():
        raise ValueError("not back before the end of the run")
    report.back_after_s.append(float(again_s[again_s > 0.0].min()))
    if report.back_after_s[-1] > RETURN_LIMIT_S:
        raise ValueError(f"back only {report.back_after_s[-1]:.2f} s after the return")


def _check_gauge(
    run: Run, gauge: int, truth: Truth, sent: Sent, began_s: float, report: UnplugReport
) -> None:
    """Raise ValueError unless each reading was taken when its row says, within some cells."""
    counts = load_counts(run)
    if counts is None:
        raise ValueError("the run has no counts")
    rows = np.flatnonzero((run.status & int(ABSENT_BY_GAUGE[gauge])) == 0)
    expected_s = began_s + run.time_s[rows]
    for _ in range(2):  # counts may occur twice: the second time they are looked for where most were found
        off_s = sent.nearest_s(truth, gauge, counts[rows, gauge], expected_s) - expected_s
        expected_s = expected_s + np.nanmedian(off_s)
    if np.isnan(off_s).any():
        row = int(rows[np.argmax(np.isnan(off_s))])
        raise ValueError(f"row {row} of gauge {gauge + 1}, {counts[row, gauge]} counts, was never taken")
    farthest_s = float(off_s[np.argmax(np.abs(off_s))])
    report.estimate_off_s.append(farthest_s)
    if abs(farthest_s) > OFF_LIMIT_S:
        raise ValueError(f"a reading of gauge {gauge + 1} was taken {farthest_s * 1e3:.0f} ms off its row")
