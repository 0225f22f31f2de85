"""A device that sends at another rate than it reports, by scripted arrivals.

A stand in real time cannot show it on a busy machine: its own clock stands still while it has no core.
"""

from pathlib import Path

import numpy as np
import pytest
from test_long_run_memory import RATE_HZ, READ_NS, Connection, frames

from app.acquisition.engine import Engine
from app.acquisition.messages import Arm, Connect, PortSettings, Quit, RunEnded, RunSettings
from app.acquisition.ring import create_ring
from app.acquisition.stream.connection import ReadQueue
from app.acquisition.stream.live_stream import LiveStream
from app.runs.reader import open_run
from config.files import load_gauges, load_stand
from drivers.devices.slipstand_binary.source import make_source

PRETRIGGER_S, DURATION_S = 1.0, 4.0
ALL_READS = 200
LATE_S = 1e-3


class HeardConnection(Connection):
    """It never counts as silent."""

    def __init__(self) -> None:
        super().__init__()
        self.last_poll_ns = self.start_ns


class Owner:
    """Arms once, hands over the reads of a device quicker than it says, and quits when the run is kept."""

    is_closed = False

    def __init__(self, intake: ReadQueue, folder: Path, began_ns: int, quicker: float) -> None:
        run = RunSettings(
            str(folder), series="1FFM0", trigger="none", pretrigger_s=PRETRIGGER_S, duration_s=DURATION_S
        )
        self._commands = [Arm(run, 1)]
        self._intake = intake
        late_ns = np.random.default_rng(1).exponential(LATE_S * 1e9, ALL_READS)
        self._arrivals_ns = began_ns + np.arange(1, ALL_READS + 1) * READ_NS / quicker + late_ns
        self._reads = 0
        self.ended: RunEnded | None = None

    def take(self, timeout_s: float = 0.0):
        if self._commands:
            return self._commands.pop()
        if self._reads < ALL_READS:
            self._intake.put(round(self._arrivals_ns[self._reads]), frames(self._reads))
            self._reads += 1
        return None

    def send(self, event) -> None:
        if isinstance(event, RunEnded):
            self.ended = event
            self._commands.append(Quit())


@pytest.mark.parametrize("quicker", [1.0, 1.2, 0.7])
def test_a_wrong_rate_is_said_and_kept_as_the_scale_of_the_clock(tmp_path, quicker):
    source, intake = make_source({}, RATE_HZ), ReadQueue()
    source.prepare()
    connection = HeardConnection()
    owner = Owner(intake, tmp_path, connection.start_ns, quicker)
    with create_ring(tmp_path / "live.ring", 1 << 12, RATE_HZ, load_gauges()) as ring:
        stream = LiveStream(connection, source, intake, load_gauges(), None)
        connect = Connect(PortSettings("fake://", "slipstand-binary"), "", "")
        Engine(connect, load_stand(), load_gauges(), stream, ring, owner, owner).run()
    assert owner.ended is not None
    assert ("instead of 100" in str(owner.ended.message)) == (quicker != 1.0), owner.ended.message
    ending = open_run(owner.ended.path).end
    assert 0.0 < ending.time_base.scale_standard_uncertainty < 1e-3
    assert ending.time_base.scale == pytest.approx(
        1 / quicker, abs=5 * ending.time_base.scale_standard_uncertainty
    )
