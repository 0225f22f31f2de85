"""How soon a release is told: from the moment at which a simulated stand lets go to the event that says so.

`python benchmarks/release_told.py [--rates 500,1000,2000,10000] [--tests 20] [--tcp]` prints a table of
docs/benchmarks.md. The whole way is in it: the samples until the release shows in the noise (20 um), their
frames, port, reader, decoder, state machine, and the pipe to whoever asked for the run. It takes seven
seconds a test, as the stand does. Beside busy programs it shows how long each process waits for a core.
"""

import argparse
import os
import tempfile
import time

import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Failed,
    PortSettings,
    PullbackState,
    RunEnded,
    RunSettings,
    StateChanged,
)
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file

FILES = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
BEGIN_S = 6.0
"""After so long, engine and stand are ready."""
TEST_S = 7.01237
"""From one release to the next: each falls at another place between two samples and two frames."""
PATIENCE_S = 60.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rates", default="500,1000,2000,10000")
    parser.add_argument("--tests", type=int, default=20)
    parser.add_argument("--tcp", action="store_true")
    chosen = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores, {chosen.tests} releases each")
    print("| rate, Hz | told after, ms: median | 95 % | largest | beyond 20 ms | not told |")
    print("|---|---|---|---|---|---|")
    for rate in chosen.rates.split(","):
        after_ms = 1e3 * np.array(told_after_s(float(rate), chosen.tests, chosen.tcp))
        median, high, largest = np.percentile(after_ms, [50.0, 95.0, 100.0])
        late, missed = np.count_nonzero(after_ms > 20.0), chosen.tests - len(after_ms)
        print(f"| {rate} | {median:.1f} | {high:.1f} | {largest:.1f} | {late} | {missed} |", flush=True)


def told_after_s(rate_hz: float, tests: int, tcp: bool) -> list[float]:
    """Times (s) from each release to the first word of it."""
    began_s = time.time() + BEGIN_S
    options = SimulatedStandOptions(
        rate_hz=rate_hz,
        noise_m=20e-6,
        start_at_unix_s=began_s,
        pull_s=0.6,
        decay_s=2.0,
        every_s=TEST_S,
        tcp_port=0 if tcp else None,
    )
    release_s = options.rest_s + options.pull_s + options.hold_s
    with tempfile.TemporaryDirectory() as folder, SimulatedStand.start(options) as stand:
        port = PortSettings(url=stand.port, protocol="slipstand-binary")
        with EngineClient.start(port, *FILES) as engine:
            run = RunSettings(directory=folder, series="1FFM0", pretrigger_s=0.2, duration_s=1.0)
            engine.send(Arm(run, tests))
            told_s = released_at(engine, tests)
    after_s = (np.array(told_s) - began_s - release_s) % TEST_S
    return [float(value) for value in after_s]


def released_at(engine: EngineClient, tests: int) -> list[float]:
    """Times of day (Unix, s) at which each release was told for the first time."""
    told_s: list[float] = []
    is_told, last_s = False, time.monotonic()
    while time.monotonic() < last_s + PATIENCE_S:
        event, now_s = engine.wait(0.5), time.time()
        if isinstance(event, Failed):
            raise SystemExit(f"error: {event.message}")
        if isinstance(event, StateChanged) and event.state is PullbackState.RELEASED and not is_told:
            told_s.append(now_s)
            is_told = True
        elif isinstance(event, RunEnded):
            is_told, last_s = False, time.monotonic()
            if len(told_s) >= tests or event.remaining == 0:
                break
    return told_s


if __name__ == "__main__":
    main()
