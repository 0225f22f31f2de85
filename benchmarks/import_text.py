"""Import of a large text file: time, and memory of both processes. Linux only."""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
SAMPLE_S = 0.02


def write_record(path: Path, megabytes: float, stamped: bool) -> int:
    """Write rows of time and two gauges; their number."""
    rows = 0
    with path.open("wb") as file:
        file.write(b"time;u1 [mm];u2-u1 [mm]\n")
        while file.tell() < megabytes * 1e6:
            lines = []
            for row in range(rows, rows + 100_000):
                at = (
                    f"2026-11-23 {row // 36_000_000:02d}:{row // 600_000 % 60:02d}:{row // 10_000 % 60:02d}"
                    f".{row % 10_000:04d}"
                    if stamped
                    else f"{row / 10_000:.4f}"
                )
                lines.append(f"{at};{12 - row % 24_001 / 1000:.6f};{row % 7_919 / 1e4:.6f}\n")
            file.write("".join(lines).encode())
            rows += 100_000
    return rows


def resident_bytes(root: int) -> int:
    """Resident memory of a process and those below it; pages of the file that both map count once each."""
    total, waiting = 0, [root]
    while waiting:
        pid = waiting.pop()
        try:
            total += int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_BYTES
            for task in Path(f"/proc/{pid}/task").iterdir():
                waiting += map(int, (task / "children").read_text().split())
        except (OSError, IndexError):
            continue
    return total


def measure(path: Path, output: Path) -> tuple[float, float, int]:
    """Seconds by the clock and of the processor, and the most memory of all processes together."""
    command = [sys.executable, "-m", "app", "import", str(path), "--table", "1", "--relative", "2", "-o"]
    start_s, before = time.perf_counter(), os.times()
    process = subprocess.Popen([*command, str(output)])
    most = 0
    while process.poll() is None:
        most = max(most, resident_bytes(process.pid))
        time.sleep(SAMPLE_S)
    after = os.times()
    if process.returncode:
        raise SystemExit("the import failed")
    processor_s = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - start_s, processor_s, most


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=float, default=200.0)
    megabytes = parser.parse_args().megabytes
    for kind in ("seconds", "date-times"):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "record.csv"
            rows = write_record(path, megabytes, stamped=kind == "date-times")
            wall_s, processor_s, most = measure(path, Path(folder) / "run.h5")
        print(
            f"{kind}: {megabytes:g} MB, {rows} rows: {wall_s:.1f} s, of the processors {processor_s:.1f} s,"
            f" {most / 1e6:.0f} MB"
        )


if __name__ == "__main__":
    main()
