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

    def __init__(
        self, intake: ReadQueue, folder: Path, began_ns: int, quicker: float, late_s: float = 0.0
    ) -> None:
        run = RunSettings(
            str(folder), series="1FFM0", trigger="none", pretrigger_s=PRETRIGGER_S, duration_s=DURATION_S
        )
        self._commands = [Arm(run, 1)]
        self._intake = intake
        late_ns = np.random.default_rng(1).exponential(LATE_S * 1e9, ALL_READS)
        taken_ns = np.arange(1, ALL_READS + 1) * READ_NS / quicker
        behind_ns = np.maximum(0.0, late_s * 1e9 - 0.2 * taken_ns)
        self._arrivals_ns = began_ns + taken_ns + behind_ns + late_ns
        self._reads = 0
        self.ended: RunEnded | None = None

    def wait(self, timeout_s: float) -> None:
        """A command is there at once."""

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


def record(tmp_path: Path, quicker: float, late_s: float = 0.0) -> RunEnded:
    source, intake = make_source({}, RATE_HZ), ReadQueue()
    source.prepare()
    connection = HeardConnection()
    owner = Owner(intake, tmp_path, connection.start_ns, quicker, late_s)
    with create_ring(tmp_path / "live.ring", 1 << 12, RATE_HZ, load_gauges()) as ring:
        stream = LiveStream(connection, source, intake, load_gauges(), None)
        connect = Connect(PortSettings("fake://", "slipstand-binary"), "", "")
        Engine(connect, load_stand(), load_gauges(), stream, ring, owner, owner).run()
    assert owner.ended is not None
    return owner.ended


@pytest.mark.parametrize("quicker", [1.0, 1.2, 0.7])
def test_a_wrong_rate_is_said_and_kept_as_the_scale_of_the_clock(tmp_path, quicker):
    ended = record(tmp_path, quicker)
    assert ("instead of 100" in str(ended.message)) == (quicker != 1.0), ended.message
    ending = open_run(ended.path).end
    assert 0.0 < ending.time_base.scale_standard_uncertainty < 1e-3
    assert ending.time_base.scale == pytest.approx(
        1 / quicker, abs=5 * ending.time_base.scale_standard_uncertainty
    )


@pytest.mark.parametrize("late_s", [1.0, 3.0])
def test_a_short_run_of_a_device_that_catches_up_has_no_wrong_rate(tmp_path, late_s):
    ended = record(tmp_path, 1.0, late_s)
    assert "instead of" not in str(ended.message)
    ending = open_run(ended.path).end
    assert ending.time_base.scale == pytest.approx(1.0, abs=1e-3)
