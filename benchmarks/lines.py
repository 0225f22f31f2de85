"""Lines of text at a steady rate: the whole recording beside LDAQ, in turns, on pseudo-terminals of one kind.

`python benchmarks/lines.py --ldaq PYTHON [--rates 1000,10000] [--seconds 20] [--turns 4]` prints the table of
docs/benchmarks.md (Linux: processor times are read from /proc). PYTHON is an interpreter that has LDAQ, as in
`ingest.py`.

A process sends lines of a time and two values; what the terminal does not take is lost, as on a UART. Where
the sender itself was held up it goes on later instead of sending much at once, so what is lost is the
reader's loss. Slipstand records: engine, writer and live identification decode, check, journal and store, and
are counted together. LDAQ's `SerialAcquisitionSimple.run_acquisition` (called directly: its `Core` wants a
keyboard and a window) splits and converts the lines and fills its ring buffer; it stores and checks nothing.
Run `python -m tools.compile_all` before.
"""

import argparse
import contextlib
import multiprocessing
import os
import subprocess
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

Row = tuple[float, float, int, int]
"""Processor share, waits a second, lines sent and lost."""


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
    print("| lines a second | turn | reader | processor | waits a second | sent | lost | load |")
    print("|---|---|---|---|---|---|---|---|")
    for rate in map(float, chosen.rates.split(",")):
        for turn in range(chosen.turns):
            for name, reader in readers.items():
                with feeding(rate) as (port, feeder):
                    share, waits, sent, lost = reader(port, rate, chosen.seconds, feeder)
                cells = f"{100 * share:.2f} % | {waits:.0f} | {sent} | {lost} | {os.getloadavg()[0]:.1f}"
                print(f"| {rate:g} | {turn + 1} | {name} | {cells} |", flush=True)


class Feeder:
    """Lines sent and lost until now, as the sending process counts them."""

    def __init__(self) -> None:
        self.sent: Synchronized[int] = multiprocessing.Value("q", 0)
        self.lost: Synchronized[int] = multiprocessing.Value("q", 0)

    def counted(self) -> tuple[int, int]:
        """Lines sent and lost until now."""
        return self.sent.value, self.lost.value

    def run(self, device: int, rate_hz: float) -> None:
        """Send lines at the rate, never waiting for the reader."""
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
    files = Path(f"/proc/{process_id}/fd").iterdir()
    return any(os.path.realpath(file) == port for file in files)


def measured(process_ids: list[int], seconds: float, feeder: Feeder) -> Row:
    """What the processes cost together over some seconds, and what was lost meanwhile."""
    sent, lost = feeder.counted()
    before = {process_id: (processor_s(process_id), waits(process_id)) for process_id in process_ids}
    began_s = time.perf_counter()
    time.sleep(seconds)
    took_s = time.perf_counter() - began_s
    lasting = [process_id for process_id in process_ids if Path(f"/proc/{process_id}").exists()]
    spent_s = sum(processor_s(process_id) - before[process_id][0] for process_id in lasting)
    waited = sum(waits(process_id) - before[process_id][1] for process_id in lasting)
    sent_now, lost_now = feeder.counted()
    return spent_s / took_s, waited / took_s, sent_now - sent, lost_now - lost


def waits(process_id: int) -> int:
    """How often the threads of a process have waited until now."""
    lines = (
        line
        for task in Path(f"/proc/{process_id}/task").iterdir()
        for line in (task / "status").read_text().splitlines()
    )
    return sum(int(line.split()[1]) for line in lines if line.startswith("voluntary_ctxt_switches"))


if __name__ == "__main__":
    main()
