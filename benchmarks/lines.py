"""Lines of text at a steady rate: the whole recording beside LDAQ, in turns, on pseudo-terminals of one kind.

`python benchmarks/lines.py --ldaq PYTHON [--rates 1000,10000] [--seconds 20] [--turns 4]` prints the tables
of docs/benchmarks.md (Linux: processor times are read from /proc). PYTHON is an interpreter that has LDAQ, as
in `ingest.py`. "Ends" is what the processes cost in all, less their share over the time in which they ran.

A process sends lines of a time and two values; what the terminal does not take is lost, as on a UART. Where
the sender itself was held up it goes on later instead of sending much at once, so what is lost is the
reader's loss. Slipstand records: engine, writer and live identification decode, check, journal and store, and
are counted together. LDAQ's `SerialAcquisitionSimple.run_acquisition` (called directly: its `Core` wants a
keyboard and a window) splits and converts the lines and fills its ring buffer; it stores and checks nothing.

A flood is a million lines, sent as fast as they are taken; nothing is lost. Beside the recording stands the
loop that is shortest to write: it reads what is there, splits it and converts it with `float`.
Run `python -m tools.compile_all` before.
"""

import argparse
import contextlib
import math
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

from recording import FILES, children, processor_s, until

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import Arm, PortSettings, RunEnded, RunSettings, RunStarted

SETTLE_S = 2.0
BURST_S = 0.01
TICK_S = 0.001

LDAQ = """
import sys
from LDAQ.serial_communication import SerialAcquisitionSimple

port_name, rate, seconds = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
source = SerialAcquisitionSimple(port_name, 460800, ",", sample_rate=rate, channel_names=["time", "a", "b"])
source.run_acquisition(seconds)
"""

CHUNK_LOOP = """
import sys, time
import numpy as np
from serial import Serial

began_s = time.process_time()
rest, blocks, lines = b"", [], int(sys.argv[2])
with Serial(sys.argv[1], 460800) as port:
    port.readline()  # begun before
    while lines > 0:
        *whole, rest = (rest + port.read(max(1, port.in_waiting))).split(b"\\r\\n")
        blocks.append(np.array([[float(value) for value in line.split(b",")] for line in whole]))
        lines -= len(whole)
print(time.process_time() - began_s)
"""

Row = tuple[float, float, int, int]
"""Processor share, waits a second, lines sent and lost."""
FLOOD_LINES = 1_000_000
FLOOD_HZ = 100_000.0
"""Rate that the lines of a flood state; they come as fast as they are taken."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--ldaq", metavar="PYTHON", help="interpreter that has LDAQ; ours alone without")
    parser.add_argument("--rates", default="1000,10000")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--turns", type=int, default=4)
    chosen = parser.parse_args()
    readers: dict[str, Callable[[str, float, float, Feeder], Row]] = {"Slipstand": record}
    if chosen.ldaq:
        readers["LDAQ"] = lambda *about: read_with_ldaq(chosen.ldaq, *about)
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores, {chosen.seconds:g} s each")
    print("| lines a second | turn | reader | processor | waits a second | sent | lost | ends, s | load |")
    print("|---|---|---|---|---|---|---|---|---|")
    for rate in map(float, chosen.rates.split(",")):
        for turn in range(chosen.turns):
            for name, reader in readers.items():
                with feeding(rate) as (port, feeder):
                    before_s, began_s = ended_children_s(), time.perf_counter()
                    share, waits, sent, lost = reader(port, rate, chosen.seconds, feeder)
                    steady_s = share * (time.perf_counter() - began_s)
                    apart_s = ended_children_s() - before_s - steady_s
                cells = f"{100 * share:.2f} % | {waits:.0f} | {sent} | {lost} | {apart_s:.2f}"
                print(f"| {rate:g} | {turn + 1} | {name} | {cells} | {os.getloadavg()[0]:.1f} |", flush=True)
    print("\n| flood | turn | processor time, s a million lines | elapsed, s | load |")
    print("|---|---|---|---|---|")
    for turn in range(chosen.turns):
        for name, read in (("Slipstand", record_flood), ("chunk loop", read_in_chunks)):
            with feeding(math.inf) as (port, feeder):
                began_s = time.perf_counter()
                flood_s = read(port, feeder)
                took_s = time.perf_counter() - began_s
            cells = f"{flood_s:.2f} | {took_s:.1f} | {os.getloadavg()[0]:.1f}"
            print(f"| {name} | {turn + 1} | {cells} |", flush=True)


class Feeder:
    """Lines sent and lost until now, as the sending process counts them."""

    def __init__(self) -> None:
        self.sent: Synchronized[int] = multiprocessing.Value("q", 0)
        self.lost: Synchronized[int] = multiprocessing.Value("q", 0)
        self.flows = multiprocessing.Event()  # what has begun slowly

    def counted(self) -> tuple[int, int]:
        """Lines sent and lost until now."""
        return self.sent.value, self.lost.value

    def run(self, device: int, rate_hz: float) -> None:
        """Send lines at the rate, never waiting for the reader; at an infinite one a flood, which does."""
        if rate_hz == math.inf:
            at_once = round(FLOOD_HZ * BURST_S)
            for first in range(0, 4 * FLOOD_LINES, at_once):
                lines = b"".join(line(k, FLOOD_HZ) for k in range(first, first + at_once))
                while lines:
                    lines = lines[os.write(device, lines) :]
                self.flows.wait(BURST_S)
            time.sleep(3600.0)  # the terminal stays open
        os.set_blocking(device, False)
        began_s, sent = time.perf_counter(), 0
        while True:
            late_s = time.perf_counter() - began_s - sent / rate_hz
            began_s += max(0.0, late_s - BURST_S)
            due = int((time.perf_counter() - began_s) * rate_hz)
            lines = b"".join(line(k, rate_hz) for k in range(sent, due))
            try:
                while lines:
                    lines = lines[os.write(device, lines) :]
            except BlockingIOError:
                self.lost.value += lines.count(b"\n")
            self.sent.value = sent = max(sent, due)
            time.sleep(TICK_S)


def line(k: int, rate_hz: float) -> bytes:
    return b"%d,%d,%d\r\n" % (k * 1e6 / rate_hz, 8_000 + k % 7, -4_000 - k % 5)


@contextlib.contextmanager
def feeding(rate_hz: float) -> Iterator[tuple[str, Feeder]]:
    """Name of a terminal to which lines are sent."""
    device, reader_end = os.openpty()
    tty.setraw(reader_end)
    feeder = Feeder()
    process = multiprocessing.get_context("fork").Process(target=feeder.run, args=(device, rate_hz))
    process.start()
    try:
        yield os.ttyname(reader_end), feeder
    finally:
        process.kill()
        process.join()
        os.close(device)
        os.close(reader_end)


def record(port: str, rate_hz: float, seconds: float, feeder: Feeder) -> Row:
    """Record a run of lines."""
    settings = PortSettings(url=port, protocol="csv", device={"columns": "time_us,table,relative"})
    with tempfile.TemporaryDirectory() as folder, EngineClient.start(settings, *FILES) as engine:
        run = RunSettings(directory=folder, trigger="none", duration_s=seconds + 2 * SETTLE_S, series="1FFM0")
        engine.send(Arm(run))
        until(engine, RunStarted)
        time.sleep(SETTLE_S)
        row = measured([engine.process_id, *children(engine.process_id)], seconds, feeder)
        ended = until(engine, RunEnded)
        if not ended.path or ended.samples < seconds * rate_hz / 2:
            raise SystemExit(f"error: {ended.samples} samples in {ended.path!r}. Please report this")
    return row


def record_flood(port: str, feeder: Feeder) -> float:
    """Record a run of a flood. Returns the processor time of all processes from its begin on (s)."""
    device = {"columns": "time_us,table,relative"}
    settings = PortSettings(url=port, protocol="csv", rate_hz=FLOOD_HZ, device=device)
    with tempfile.TemporaryDirectory() as folder, EngineClient.start(settings, *FILES) as engine:
        duration_s = FLOOD_LINES / FLOOD_HZ
        engine.send(Arm(RunSettings(directory=folder, trigger="none", duration_s=duration_s, series="1FFM0")))
        until(engine, RunStarted)
        processes = [engine.process_id, *children(engine.process_id)]
        before_s = spent_s(processes)
        feeder.flows.set()
        ended = until(engine, RunEnded)
        after_s = spent_s(processes)
    if ended.samples < FLOOD_LINES or ended.missing or ended.damaged:
        raise SystemExit(f"error: {ended} of {FLOOD_LINES} lines. Please report this")
    return sum(after_s[process] - before_s[process] for process in after_s)


def read_in_chunks(port: str, feeder: Feeder) -> float:
    feeder.flows.set()
    command = [sys.executable, "-c", CHUNK_LOOP, port, str(FLOOD_LINES)]
    return float(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def ended_children_s() -> float:
    """Processor time of all child processes that have ended, theirs included (s)."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def read_with_ldaq(python: str, port: str, rate_hz: float, seconds: float, feeder: Feeder) -> Row:
    arguments = [python, "-c", LDAQ, port, str(rate_hz), str(seconds + 10 * SETTLE_S)]
    with subprocess.Popen(arguments, stdout=subprocess.DEVNULL) as process:
        while not reads_port(process.pid, port):
            time.sleep(0.1)
        time.sleep(SETTLE_S)
        row = measured([process.pid], seconds, feeder)
        process.kill()
    return row


def reads_port(process_id: int, port: str) -> bool:
    for file in Path(f"/proc/{process_id}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            if os.path.realpath(file) == port:
                return True
    return False


def measured(process_ids: list[int], seconds: float, feeder: Feeder) -> Row:
    """What the processes cost together over some seconds, and what was lost meanwhile."""
    sent, lost = feeder.counted()
    before_s, waited = spent_s(process_ids), {process: waits(process) for process in process_ids}
    began_s = time.perf_counter()
    time.sleep(seconds)
    took_s = time.perf_counter() - began_s
    after_s = spent_s(process_ids)
    worked_s = sum(after_s[process] - before_s[process] for process in after_s)
    waited_more = sum(waits(process) - waited[process] for process in after_s)
    sent_now, lost_now = feeder.counted()
    return worked_s / took_s, waited_more / took_s, sent_now - sent, lost_now - lost


def spent_s(process_ids: list[int]) -> dict[int, float]:
    """Processor time of each process that is there (s)."""
    return {process: processor_s(process) for process in process_ids if Path(f"/proc/{process}").exists()}


def waits(process_id: int) -> int:
    """How often the threads of a process that are there have waited until now."""
    count = 0
    for task in Path(f"/proc/{process_id}/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # ended meanwhile
            lines = (task / "status").read_text().splitlines()
            count += sum(int(line.split()[1]) for line in lines if line.startswith("voluntary_ctxt_switches"))
    return count


if __name__ == "__main__":
    main()
