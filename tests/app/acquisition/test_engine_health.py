"""What an engine reports before its first run, in this process and without a device."""

from pathlib import Path

import pytest
from test_engine_rate import HeardConnection
from test_long_run_memory import RATE_HZ, CountingWriter

from app.acquisition import disk_space
from app.acquisition.engine import Engine
from app.acquisition.messages import Connect, Health, PortSettings, Quit
from app.acquisition.ring import create_ring
from app.acquisition.stream.connection import ReadQueue
from app.acquisition.stream.live_stream import LiveStream
from config.files import load_gauges, load_stand
from drivers.devices.slipstand_binary.source import make_source


class Owner:
    """Takes events, and quits after some reports of health."""

    is_closed = False

    def __init__(self) -> None:
        self.health: list[Health] = []
        self._commands = [Quit()]

    def wait(self, timeout_s: float) -> None:
        """A command is there at once."""

    def take(self, timeout_s: float = 0.0):
        return self._commands.pop() if len(self.health) >= 3 and self._commands else None

    def send(self, event) -> None:
        self.health += [event] if isinstance(event, Health) else []


def health_of(tmp_path: Path, directory: str) -> list[Health]:
    source, intake, owner = make_source({}, RATE_HZ), ReadQueue(), Owner()
    with create_ring(tmp_path / "live.ring", 1 << 12, RATE_HZ, load_gauges()) as ring:
        stream = LiveStream(HeardConnection(), source, intake, load_gauges(), None)
        connect = Connect(PortSettings("fake://", "slipstand-binary"), "", "", directory=directory)
        Engine(connect, load_stand(), load_gauges(), stream, ring, owner, owner).run()
    return owner.health


@pytest.fixture(autouse=True)
def without_writer(monkeypatch):
    monkeypatch.setattr("app.acquisition.engine.WriterClient", CountingWriter)


def test_the_free_space_is_that_of_the_folder_of_runs_before_the_first_run(tmp_path, monkeypatch):
    recordings = tmp_path / "recordings"
    monkeypatch.setattr(disk_space, "free_bytes", lambda folder: 7 if folder == recordings else 10**12)
    assert health_of(tmp_path, str(recordings))[-1].free_disk_bytes == 7


def test_space_that_is_not_known_is_not_called_none(tmp_path):
    assert {one.free_disk_bytes for one in health_of(tmp_path, "")} == {None}
