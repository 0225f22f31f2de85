"""What recording costs: processor time of the engine and of its writer, and samples lost, against the truth.

`python benchmarks/recording.py [--rates 10000,100000] [--seconds 20] [--tcp] [--window]` prints the table
of docs/benchmarks.md (Linux: processor times and memory are read from /proc). With `--window` another process
reads the live ring as fast as a window at its worst does. Memory is that of the process alone, without the
pages of files that it maps, such as the ring; its growth is that after the first two minutes.
"""

import argparse
import contextlib
import multiprocessing
import os
import tempfile
import time
from dataclasses import astuple, dataclass, field
from pathlib import Path

import numpy as np

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import Arm, Connected, Failed, PortSettings, RunEnded, RunSettings, RunStarted
from app.acquisition.ring import open_ring
from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.motion import RepeatedPullback, released_motion
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.signal import StandSignal
from app.simulated_stand.truth import Truth
from config.files import load_gauges, settings_file

FILES = (str(settings_file("stand.toml")), str(settings_file("gauges.toml")))
SEED = 1
CHECK_ROWS = 100_000  # compared at once
PATIENCE_S = 600.0
BEGUN_S = 30.0  # a run begins within so long of its stream
LOOK_S = 10.0
SETTLED_S = 120.0


@dataclass(frozen=True)
class Cost:
    """Processor time (s) of each process; `live` identifies while the motion dies away."""

    engine: float
    writer: float
    live: float
    stand: float

    def shares(self, before: "Cost", took_s: float) -> str:
        """Per cent of one core since `before`, as cells of a table."""
        parts = zip(astuple(self), astuple(before), strict=True)
        return " | ".join(f"{100 * (now - then) / took_s:.1f} %" for now, then in parts)


@dataclass
class Memory:
    """Memory of one process while it works: moments (s) and kilobytes."""

    times_s: list[float] = field(default_factory=list)
    kilobytes: list[int] = field(default_factory=list)

    def look(self, process_id: int, time_s: float) -> None:
        """Note what it is now."""
        self.times_s.append(time_s)
        self.kilobytes.append(memory_kb(process_id))

    def cell(self) -> str:
        """Megabytes at first and at last, and the growth once it has settled."""
        settled = np.array(self.times_s) > SETTLED_S
        ends = f"{self.kilobytes[0] / 1024:.1f} -> {self.kilobytes[-1] / 1024:.1f} MB"
        if np.count_nonzero(settled) < 10:
            return ends
        slope = np.polyfit(np.array(self.times_s)[settled] / 60, np.array(self.kilobytes)[settled], 1)[0]
        return f"{ends}, {slope:+.1f} kB/min"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rates", default="10000,100000")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--tcp", action="store_true")
    parser.add_argument("--window", action="store_true")
    chosen = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores, {chosen.seconds:g} s each")
    print(
        "| rate, Hz | samples | lost at the port | missing or damaged | engine | writer | live | stand |"
        " memory of engine | of writer |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for rate in chosen.rates.split(","):
        print(record(float(rate), chosen.seconds, chosen.tcp, chosen.window), flush=True)


def record(rate_hz: float, seconds: float, tcp: bool, window: bool) -> str:
    """Record one run, and return its row of the table; costs are per cent of one core."""
    options = SimulatedStandOptions(rate_hz=rate_hz, seed=SEED, tcp_port=0 if tcp else None)
    with tempfile.TemporaryDirectory() as folder, SimulatedStand.start(options) as stand:
        port = PortSettings(url=stand.port, protocol="slipstand-binary")
        with EngineClient.start(port, *FILES, low_latency=window) as engine:
            ring_path = until(engine, Connected).ring_path
            reader = multiprocessing.Process(target=look, args=(ring_path,), daemon=True)
            if window:
                reader.start()
            run = RunSettings(directory=folder, trigger="none", duration_s=seconds, series="1FFM0")
            engine.send(Arm(run))
            until(engine, RunStarted)
            before, began = cost(engine, stand), time.monotonic()
            memory = watch(engine, began, seconds - 1.0)
            shares = cost(engine, stand).shares(before, time.monotonic() - began)
            ended = until(engine, RunEnded, PATIENCE_S + seconds)  # a stand beside a load sends too slowly
            if window:
                reader.terminate()
        stand.stop()
        check_counts(Path(ended.path), stand.truth())
    lost_on_way = stand.truth().wire.samples_lost
    lost = ended.missing + ended.missing_estimated + ended.damaged
    return f"| {rate_hz:g} | {ended.samples} | {lost_on_way} | {lost} | {shares} | {memory} |"


def watch(engine: EngineClient, began: float, duration_s: float) -> str:
    """Wait for so long and look at the memory of engine and writer now and then; cells of a table."""
    writer = next(iter(named_children(engine, "runs.writer")))
    memories = {engine.process_id: Memory(), writer: Memory()}
    while (passed_s := time.monotonic() - began) < duration_s:
        for process_id, memory in memories.items():
            memory.look(process_id, passed_s)
        time.sleep(min(LOOK_S, duration_s - passed_s))
    return " | ".join(memory.cell() for memory in memories.values())


def look(ring_path: str) -> None:
    """Read all new rows 60 times a second, and reduce them as a plot does."""
    ring, next_row = open_ring(ring_path), 0
    while True:
        rows = ring.read_since(next_row)
        next_row = rows.end_index
        everything = ring.read_since(0)
        if len(everything):
            np.nanmin(everything.table_m), np.nanmax(everything.relative_m)
        time.sleep(1 / 60)


def until(engine: EngineClient, kind: type, patience_s: float = PATIENCE_S):
    """Next event of a kind."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        event = engine.wait(0.5)
        if isinstance(event, kind):
            return event
        if isinstance(event, Failed):
            raise SystemExit(f"error: {event.message}")
    raise SystemExit(f"error: no {kind.__name__} in {patience_s:g} s. Try a quieter machine")


def cost(engine: EngineClient, stand: SimulatedStand) -> Cost:
    """Processor time of each process until now; writer and live identification are the engine's children."""
    writer, live = (
        sum(map(processor_s, named_children(engine, name))) for name in ("runs.writer", "live_client")
    )
    return Cost(processor_s(engine.process_id), writer, live, processor_s(stand.process_id))


def named_children(engine: EngineClient, name: str) -> list[int]:
    """The engine's child processes that have `name` in their command."""
    found = children(engine.process_id)
    return [child for child in found if name in Path(f"/proc/{child}/cmdline").read_bytes().decode()]


def memory_kb(process_id: int) -> int:
    """Memory that is this process's own."""
    lines = Path(f"/proc/{process_id}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))


def processor_s(process_id: int) -> float:
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def children(process_id: int) -> list[int]:
    found: list[int] = []
    for task in Path(f"/proc/{process_id}/task").iterdir():
        with contextlib.suppress(OSError):  # a thread that has just ended
            found += map(int, (task / "children").read_text().split())
    return found


def check_counts(path: Path, truth: Truth) -> None:
    """Every stored sample must be the one that was sent under its number."""
    run = open_run(path)
    counts, good = load_counts(run), run.status & 3 == 0
    released = released_motion(truth.stand, truth.timetable)
    motion = RepeatedPullback(truth.stand.pullback_m, released, truth.timetable)
    signal = StandSignal(motion, load_gauges(), truth.options, truth.wire.true_rate_hz)
    sent, _ = signal.take(min(truth.wire.samples, int(BEGUN_S * truth.wire.rate_hz)))
    first = int(np.flatnonzero(good)[0])
    begins = np.flatnonzero((sent[first:] == counts[first]).all(axis=1))
    sent = sent[begins[0] :] if len(begins) else sent[:0]
    for start in range(0, len(counts), CHECK_ROWS):
        stored, is_good = counts[start : start + CHECK_ROWS], good[start : start + CHECK_ROWS]
        if len(begins) and len(sent) < len(stored):
            sent = np.concatenate([sent, signal.take(CHECK_ROWS)[0]])
        if not np.array_equal(stored[is_good], sent[: len(stored)][is_good[: len(sent)]]):
            raise SystemExit(f"error: {path} holds other samples than were sent. Please report this")
        sent = sent[len(stored) :]


if __name__ == "__main__":
    main()
