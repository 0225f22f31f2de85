"""Drill: a device that sends what none should; `python -m tests.drills.hostile_wire`.

A proxy stands between a simulated stand and the engine, and changes what comes while a run is recorded:
frames twice, shuffled, one in a thousand, with random number or time and a right checksum, a megabyte instead
of them, the identity of another device, nothing at all. The stand itself sends at double or half, ten times
or a thousandth of the rate that it states, or gives an identity without end. Each run must go on or end with
one line, no good row be one that was never sent, and the engine's memory stay bounded.
"""

import argparse
import random
import socket
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import (
    Arm,
    Connected,
    Event,
    Failed,
    PortSettings,
    RunEnded,
    RunSettings,
    RunStarted,
)
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import settings_file
from drivers.crc import crc16
from drivers.devices.slipstand_binary.codec import IDENTIFY, SYNC, frame_length, samples_per_frame
from tests.drills.report import DrillReport, chosen_ways, run_ways
from tests.drills.sent import Sent, truth_of_now

RATE_HZ = 500.0
MEMORY_MAX_BYTES = 600_000_000
PATIENCE_S = 60.0
WIRE_S = 10.0
"""Length of a run whose wire is changed: a busy computer has the file of a run seconds after its begin."""
_FRAME = frame_length(samples_per_frame(RATE_HZ))
Change = Callable[[list[bytes], random.Random], list[bytes]]


def _resealed(frame: bytes, place: int, chance: random.Random) -> bytes:
    body = frame[:place] + chance.randbytes(4) + frame[place + 4 : -2]
    return body + crc16(body[2:]).to_bytes(2, "little")


def _sometimes(change: Callable[[bytes, random.Random], bytes]) -> Change:
    def apply(frames: list[bytes], chance: random.Random) -> list[bytes]:
        return [change(frame, chance) if chance.random() < 0.05 else frame for frame in frames]

    return apply


def _shuffled(frames: list[bytes], chance: random.Random) -> list[bytes]:
    return chance.sample(frames, len(frames))


WIRES: dict[str, Change] = {
    "twice": lambda frames, _: [frame for one in frames for frame in (one, one)],
    "shuffled": _shuffled,
    "sequence": _sometimes(lambda frame, chance: _resealed(frame, 4, chance)),
    "time": _sometimes(lambda frame, chance: _resealed(frame, 8, chance)),
    "megabyte": lambda frames, _: [b"#" + b"A" * (1 << 20)] * bool(frames),
    "identity": lambda frames, _: [b"V ADS1256 another 1 500 1\n", *frames],
    "thousandth": lambda frames, chance: [frame for frame in frames if chance.random() < 1e-3],
    "mute": lambda _frames, _: [],
}
RATES = {"double rate": 1.0, "half rate": -0.5, "tenfold rate": 9.0, "thousandth rate": -0.999}
IDENTITIES = {
    "endless identity": b"slipstand-fw " + b"A" * (1 << 20) + b" 500 2\n",
    "endless noise": random.Random(1).randbytes(1 << 20) * 64,
}
"""What comes instead of the answer to the question who the device is."""
ADDRESSES = ("silent port", "unknown name")
WAYS = (*WIRES, *RATES, *IDENTITIES, *ADDRESSES)


@dataclass(slots=True)
class WireReport(DrillReport):
    """What came of it."""

    said: str = ""
    samples: int = 0
    memory_bytes: int = 0

    def figures(self) -> str:
        return f"{self.samples} samples, {self.memory_bytes / 1e6:.0f} MB; {self.said}"


class Proxy(threading.Thread):
    """Passes bytes between a device and its reader, and changes those to the reader once it is told to."""

    def __init__(self, device: str, change: Change, seed: int, identity: bytes = b"") -> None:
        super().__init__(name="proxy", daemon=True)
        self.is_changing = threading.Event()
        self.changed = 0
        """Pieces of the stream that were changed."""
        self._change, self._chance, self._identity = change, random.Random(seed), identity
        host, _, port = device.removeprefix("socket://").partition(":")
        self._device = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self.start()

    def run(self) -> None:
        while True:
            try:
                reader, _ = self._listener.accept()
                device = socket.create_connection(self._device)
            except OSError:
                return
            threading.Thread(target=self._pass_commands, args=(reader, device), daemon=True).start()
            threading.Thread(target=self._pass_frames, args=(device, reader), daemon=True).start()

    def close(self) -> None:
        self._listener.close()

    def _pass_commands(self, source: socket.socket, target: socket.socket) -> None:
        try:
            while data := source.recv(1 << 16):
                if self._identity and IDENTIFY in data:
                    source.sendall(self._identity)
                else:
                    target.sendall(data)
        except OSError:
            pass
        target.close()

    def _pass_frames(self, source: socket.socket, target: socket.socket) -> None:
        rest = b""
        try:
            while data := source.recv(1 << 16):
                if not self.is_changing.is_set():
                    rest = b""
                    target.sendall(data)
                    continue
                self.changed += 1
                frames, rest = _frames(rest + data)
                target.sendall(b"".join(self._change(frames, self._chance)))
                time.sleep(0.05)  # so that some frames come together
        except OSError:
            pass
        target.close()


def _frames(data: bytes) -> tuple[list[bytes], bytes]:
    found = []
    place = data.find(SYNC)
    while place >= 0 and len(data) - place >= _FRAME:
        found.append(data[place : place + _FRAME])
        place = data.find(SYNC, place + _FRAME)
    return found, data[place:] if place >= 0 else b""


def hostile_wire(way: str, folder: Path, seed: int = 0) -> WireReport:
    """Record one run in an empty folder while the wire does what `way` says."""
    report = WireReport()
    try:
        if way in ADDRESSES:
            _no_device(way, folder, report)
        else:
            _one_run(way, folder, seed, report)
    except (ValueError, TimeoutError, OSError) as error:
        report.faults.append(f"{way}: {error}")
    if report.memory_bytes > MEMORY_MAX_BYTES:
        report.faults.append(f"{way}: the engine took {report.memory_bytes / 1e6:.0f} MB")
    return report


def _no_device(way: str, folder: Path, report: WireReport) -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        silent = f"socket://127.0.0.1:{mute.getsockname()[1]}"
        url = silent if way == "silent port" else "socket://no-such-host.invalid:5000"
        with _engine(url) as engine:
            event = _await(engine, (Failed, Connected))
            report.memory_bytes = _memory_bytes(engine.process_id)
    if isinstance(event, Failed):
        _check_said(str(event.message), report)
    else:
        report.faults.append(f"it connected: {event}")


def _one_run(way: str, folder: Path, seed: int, report: WireReport) -> None:
    rate_error = RATES.get(way, 0.0)
    options = SimulatedStandOptions(rate_hz=RATE_HZ, seed=1, tcp_port=0, rate_error=rate_error)
    with SimulatedStand.start(options) as stand:
        change = WIRES.get(way, lambda frames, _: frames)
        proxy = Proxy(stand.port, change, seed, IDENTITIES.get(way, b""))
        try:
            with _engine(proxy.url) as engine:
                event = _await(engine, (Failed, Connected))
                if isinstance(event, Connected):
                    duration_s = WIRE_S if way in WIRES else 3.0
                    run = RunSettings(str(folder), series="1FFM0", trigger="none", duration_s=duration_s)
                    engine.send(Arm(run))
                    event = _await(engine, (Failed, RunStarted, RunEnded))
                if isinstance(event, RunStarted):
                    time.sleep(0.5)
                    if way in WIRES:
                        proxy.is_changing.set()
                    event = _await(engine, (Failed, RunEnded))
                report.memory_bytes = _memory_bytes(engine.process_id)
                truth = truth_of_now(stand)
        finally:
            proxy.close()
        if way in WIRES and not proxy.changed:
            raise ValueError("the run was over before the wire was changed")
        if isinstance(event, Failed):
            _check_said(str(event.message), report)
        elif isinstance(event, RunEnded):
            _check_said(f"{event.ended}. {event.message}", report)
            if event.path:
                stored = open_run(Path(event.path))
                report.samples = len(stored)
                Sent().stretches(truth, load_counts(stored), stored.status)  # type: ignore[arg-type]


def _engine(url: str) -> EngineClient:
    files = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
    return EngineClient.start(PortSettings(url=url, protocol="slipstand-binary"), *files)


def _await(engine: EngineClient, kinds: tuple[type[Event], ...]) -> Event:
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        event = engine.wait(0.05)
        if isinstance(event, kinds):
            return event
    raise TimeoutError(f"nothing within {PATIENCE_S:g} s")


def _check_said(said: str, report: WireReport) -> None:
    report.said = said
    if not said.strip() or "\n" in said or "Traceback" in said or len(said) > 2000:
        raise ValueError(f"said {said[:200]!r}")


def _memory_bytes(process: int) -> int:
    """Most memory that a process ever had; 0 where the system does not tell."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), 0)


def main() -> int:
    """Run the drill in all ways and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ways", default=",".join(WAYS), help="separated by commas")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    ways = chosen_ways(parser, given.ways, WAYS)
    return run_ways(
        len(ways), {way: lambda _, folder, way=way: hostile_wire(way, folder, given.seed) for way in ways}
    )


if __name__ == "__main__":
    sys.exit(main())
