"""Two Slipstands that record into one folder at once never write the same file."""

import sys

import pytest

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import Arm, Connected, EndReason, PortSettings, RunEnded, RunSettings
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from tests.drills.sent import Sent, truth_of_now
from tests.drills.unplug import wait_for

RUNS = 3


def stand(seed: int) -> SimulatedStand:
    return SimulatedStand.start(SimulatedStandOptions(rate_hz=500.0, seed=seed, table_drift_m_per_s=1e-3))


def engine_of(simulated: SimulatedStand) -> EngineClient:
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    return EngineClient.start(PortSettings(simulated.port, "slipstand-binary"), *files)


@pytest.mark.skipif(sys.platform == "win32", reason="two stands, each on a pseudo-terminal")
def test_two_engines_in_one_folder_each_keep_their_own_runs(tmp_path):
    with stand(1) as one, stand(2) as other, engine_of(one) as first, engine_of(other) as second:
        engines = ((first, one), (second, other))
        for engine, _ in engines:
            wait_for(engine, Connected)
        run = RunSettings(str(tmp_path), series="1FFM0", trigger="none", duration_s=0.3)
        kept = []
        for _ in range(RUNS):
            for engine, _ in engines:
                engine.send(Arm(run))
            kept += [(wait_for(engine, RunEnded), simulated) for engine, simulated in engines]
        for ended, _ in kept:
            assert ended.ended is EndReason.DURATION, ended.message
        truths = [truth_of_now(simulated) for _, simulated in kept]
    assert len({ended.path for ended, _ in kept}) == 2 * RUNS == len(list(tmp_path.iterdir()))
    for (ended, _), truth in zip(kept, truths, strict=True):
        recorded = open_run(ended.path)
        assert len(recorded) == ended.samples == 150
        (stretch,) = Sent().stretches(truth, load_counts(recorded), recorded.status)
        assert (stretch.first, stretch.end) == (0, 150)
