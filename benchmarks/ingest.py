"""Raw ingest of our reader beside LDAQ, on the same kind of pseudo-terminal, in one run.

`python benchmarks/ingest.py --ldaq PYTHON` prints the table of docs/benchmarks.md. PYTHON is an interpreter
that has LDAQ, which needs more packages than Slipstand wants to have, and is in no lock file:

    python -m venv /tmp/ldaq && /tmp/ldaq/bin/pip install LDAQ==1.3.2

A feeder sends Slipstand binary frames of 32 samples at a steady rate; what the terminal does not take is
lost, as on a UART. Each reader reads them for some seconds in a process of its own. Ours reads as the engine
does, checks CRC and sequence, lays out gaps and hands on blocks. LDAQ's `SerialAcquisition.run_acquisition`
(called directly: its `Core` wants a keyboard and a window) splits at the frames' beginning, unpacks with
`struct`, checks nothing, and fills its ring buffer. Loss is counted from the sequence numbers that came
through after 0.3 s.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import threading
import time
import tty

import numpy as np

from drivers.devices.slipstand_binary.codec import encode_frames

N = 32
RATES_HZ = (10_000, 20_000, 50_000, 100_000, 200_000, 400_000, 800_000, 1_600_000)
COSTED_HZ = (10_000, 100_000)
FED_S = 12.0
READ_S = 3.0
TRIES = 3
STEP_S = 0.0005

OURS = """
import json, queue, resource, sys, time
from drivers.port import open_port
from drivers.stream import PortReader
from drivers.devices.slipstand_binary.codec import FrameDecoder
from drivers.devices.slipstand_binary.source import make_source

port_name, rate, seconds = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
source = make_source({}, rate)
source.prepare()
print("ready", flush=True)
reads = queue.SimpleQueue()
decoder, skipped, samples = FrameDecoder(rate), None, 0
with open_port(port_name, 460800) as port:
    source.batch_delay_s, source.collect_limit = 0.015, port.collect_limit  # as an engine with a window
    keep = lambda arrival_ns, data: reads.put((arrival_ns, data))
    reader = PortReader(lambda: source.read(port), keep, lambda ended: None)
    used, end = resource.getrusage(resource.RUSAGE_SELF), time.monotonic() + seconds
    reader.start()
    while time.monotonic() < end:
        time.sleep(0.01)
        parts = [reads.get() for _ in range(reads.qsize())]
        for block in decoder.feed(b"".join(data for _, data in parts), parts[-1][0] if parts else 0):
            samples += len(block)
        if skipped is None and samples > 0.3 * rate:
            skipped = decoder.losses.missing + decoder.losses.damaged
    spent = resource.getrusage(resource.RUSAGE_SELF)
    reader.stop()
lost = decoder.losses.missing + decoder.losses.damaged - (skipped or 0)
cpu_s = spent.ru_utime + spent.ru_stime - used.ru_utime - used.ru_stime
print(json.dumps({"samples": samples, "lost": lost, "cpu_s": cpu_s}))
"""

LDAQ = """
import json, resource, sys
import numpy as np
from LDAQ.serial_communication import SerialAcquisition

port_name, rate, seconds, n = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
print("ready", flush=True)
frame = (("uint8", 1), ("uint32", 2), ("uint8", 1), ("int32", 2 * n), ("uint16", 1))
source = SerialAcquisition(port_name, 460800, frame, start_bytes=bytes((0xAA, 0x55, 1)), end_bytes=b"",
                           sample_rate=rate / n, channel_names=[f"c{k}" for k in range(2 * n + 5)])
used = resource.getrusage(resource.RUSAGE_SELF)
source.run_acquisition(seconds)
spent = resource.getrusage(resource.RUSAGE_SELF)
sequence = source.Trigger.ringbuff.get_data()[:, 1]
sequence = sequence[sequence > 0]
kept = sequence[sequence >= sequence[0] + 0.3 * rate]
cpu_s = spent.ru_utime + spent.ru_stime - used.ru_utime - used.ru_stime
lost = int(kept[-1] - kept[0]) + n - len(kept) * n
print(json.dumps({"samples": len(sequence) * n, "lost": lost, "cpu_s": cpu_s}))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--ldaq", metavar="PYTHON", help="interpreter that has LDAQ; ours alone without")
    parser.add_argument("--turns", type=int, default=4)
    chosen = parser.parse_args()
    readers = {"Slipstand": (sys.executable, OURS)} | ({"LDAQ": (chosen.ldaq, LDAQ)} if chosen.ldaq else {})
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    costs = " | ".join(f"cpu a 1e6 samples at {rate / 1000:g} kHz, s" for rate in COSTED_HZ)
    print(f"| turn | reader | highest rate without loss, Hz | first loss | {costs} | load |")
    print(f"|---|---|---|---|{'---|' * len(COSTED_HZ)}---|")
    for turn in range(chosen.turns):
        for name, reader in readers.items():
            cells = [cost(read(*reader, frames(rate_hz), rate_hz)) for rate_hz in COSTED_HZ]
            cells = [str(turn + 1), name, *climb(*reader), *cells, f"{os.getloadavg()[0]:.1f}"]
            print(f"| {' | '.join(cells)} |", flush=True)


def climb(python: str, code: str) -> tuple[str, str]:
    """The highest rate at which a reader once lost nothing, and what it lost at the next, as cells."""
    highest = 0
    for rate_hz in RATES_HZ:
        wire = frames(rate_hz)
        for _ in range(TRIES):
            step = read(python, code, wire, rate_hz)
            if not step["lost"]:
                highest = rate_hz
                break
        else:
            return (
                f"{highest:g}",
                f"{100 * step['lost'] / (step['samples'] + step['lost']):.2g} % at {rate_hz:g} Hz",
            )
    return f"{highest:g}", "none"


def cost(step: dict[str, float]) -> str:
    """Processor time of what came through."""
    return f"{step['cpu_s'] / step['samples'] * 1e6:.2f}"


def read(python: str, code: str, wire: memoryview, rate_hz: int) -> dict[str, float]:
    """Feed a terminal while a reader's process reads it; return what that one says."""
    device, reader_end = os.openpty()
    tty.setraw(reader_end)
    os.set_blocking(device, False)
    done = threading.Event()
    feeder = threading.Thread(target=feed, args=(device, wire, rate_hz, done))
    arguments = [os.ttyname(reader_end), str(rate_hz), str(READ_S), str(N)]
    with subprocess.Popen([python, "-c", code, *arguments], stdout=subprocess.PIPE) as process:
        process.stdout.readline()  # it has loaded its libraries, and opens the port now
        feeder.start()
        said, _ = process.communicate(timeout=120.0)
    done.set()
    feeder.join()
    os.close(device)
    os.close(reader_end)
    return json.loads(said.splitlines()[-1])


def feed(device: int, wire: memoryview, rate_hz: int, done: threading.Event) -> None:
    """Send round and round at the rate, never waiting for the reader."""
    frame = len(wire) // (int(FED_S * rate_hz) // N)
    began, sent = time.monotonic(), 0
    while not done.is_set():
        due = int((time.monotonic() - began) * rate_hz) // N * frame
        while sent < due:
            piece = wire[sent % len(wire) :][: min(due - sent, 8192)]
            with contextlib.suppress(BlockingIOError):
                os.write(device, piece)
            sent += len(piece)
        time.sleep(STEP_S)


def frames(rate_hz: int) -> memoryview:
    """Some seconds of frames; counts so small that none looks like a frame's beginning, which LDAQ needs."""
    count = int(FED_S * rate_hz) // N
    counts = (np.arange(count * N * 2) % 100).astype(np.int32).reshape(-1, 2)
    times_us = np.round(np.arange(count) * N * 1e6 / rate_hz).astype(np.int64)
    return memoryview(encode_frames(0, times_us, counts).tobytes())


if __name__ == "__main__":
    main()
