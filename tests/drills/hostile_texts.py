"""Drill: settings and CSV files of any content; `python -m tests.drills.hostile_texts --count 20000`.

Each is taken or refused in one line, within two seconds and with bounded memory, whatever stands in it.
"""

import argparse
import random
import shutil
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import config
from app.runs.csv_columns import read_columns
from app.runs.csv_layout import CsvLayout
from app.runs.errors import RunError
from config.files import load_gauges, load_stand
from config.schema import ConfigError

LIMIT_S = 2.0
MEMORY_LIMIT_BYTES = 100_000_000
CSV = "time_s,table_m,relative_m\n" + "".join(f"{i / 100},{1e-3 * i},{-2e-3 * i}\n" for i in range(200))
_PIECES = (
    "=", "[", "]", "{", "}", '"', "\'", ",", ";", "\t", "\n", "\r", "#", ".", "-", "+", "e", "nan", "inf",
    "1e999", "-1", "0", "9" * 400, "\ufeff", "\u202e", "ä", "\x00", "\x1b", "[[a]]", "a.b.c = 1", "true",
    "1979-05-27", "../../etc/passwd", "[" * 300, '"""', "\U0001f600",
)  # fmt: skip


@dataclass(slots=True)
class TextReport:
    """What came of it."""

    texts: int = 0
    taken: int = 0
    refused: int = 0
    longest_s: float = 0.0
    memory_bytes: int = 0
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        said = (
            f"{self.texts} texts: {self.taken} taken, {self.refused} refused in one line; longest"
            f" {self.longest_s:.2f} s, {self.memory_bytes / 1e6:.0f} MB at most; {len(self.faults)} faults"
        )
        return "\n".join([said, *self.faults])


def hostile_texts(count: int, folder: Path, seed: int = 0) -> TextReport:
    """Read mutated texts of each kind in turn.

    Parameters
    ----------
    count : int
    folder : Path
        For the files.
    seed : int
        Makes it repeatable.
    """
    shipped = Path(config.__file__).parent
    kinds: list[tuple[str, bytes, Callable[[Path], object]]] = [
        ("stand.toml", (shipped / "stand.toml").read_bytes(), load_stand),
        ("gauges.toml", (shipped / "gauges.toml").read_bytes(), load_gauges),
        ("record.csv", CSV.encode(), lambda path: read_columns(path, CsvLayout("0", "1", "2"))),
    ]
    report = TextReport()
    tracemalloc.start()
    try:
        for number in range(count):
            name, good, read = kinds[number % len(kinds)]
            path = folder / name
            path.write_bytes(mutate(good, random.Random(seed * 1_000_003 + number)))
            _read(read, path, f"text {number} ({name})", report)
    finally:
        report.memory_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    if report.memory_bytes > MEMORY_LIMIT_BYTES:
        report.faults.append(f"{report.memory_bytes / 1e6:.0f} MB were taken")
    return report


def _read(read: Callable[[Path], object], path: Path, said: str, report: TextReport) -> None:
    start = time.process_time()
    try:
        read(path)
        report.taken += 1
    except (ConfigError, RunError) as error:
        report.refused += 1
        if "\n" in str(error) or not str(error).strip():
            report.faults.append(f"{said}: {error!r}")
    except Exception as error:
        report.faults.append(f"{said}: {type(error).__name__}: {error}")
    took_s = time.process_time() - start
    report.texts += 1
    report.longest_s = max(report.longest_s, took_s)
    if took_s > LIMIT_S:
        report.faults.append(f"{said}: took {took_s:.1f} s")


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Text with a few faults, or no text at all."""
    if rng.random() < 0.02:
        return rng.randbytes(rng.randrange(3000))
    made = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        place = rng.randrange(len(made) + 1)
        match rng.randrange(5):
            case 0:
                made[place:place] = rng.choice(_PIECES).encode()
            case 1:
                made[place : place + rng.randrange(1, 40)] = b""
            case 2:
                made[place : place + 1] = bytes([rng.randrange(256)])
            case 3:
                made[place:place] = made[place : place + rng.randrange(1, 200)]
            case 4:
                end = place + rng.randrange(1, 12)
                made[place:end] = rng.choice(_PIECES).encode()
    return bytes(made)


def main() -> int:
    """Run the drill, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="slipstand-drill-"))
    try:
        report = hostile_texts(options.count, folder, options.seed)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    sys.stdout.write(f"{report}\n")
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
