"""Drill: settings and CSV files of any content; `python -m tests.drills.hostile_texts --count 20000`.

Each is taken or refused in one line, within two seconds and with bounded memory, whatever stands in it.
"""

import random
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import config
from app.runs.errors import RunError
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.csv_reading import read_columns
from config.files import load_gauges, load_stand
from config.schema import ConfigError
from tests.drills.report import InputReport, arguments, run_ways

LIMIT_S = 2.0
MEMORY_LIMIT_BYTES = 100_000_000
CSV = "time_s,table_m,relative_m\n" + "".join(f"{i / 100},{1e-3 * i},{-2e-3 * i}\n" for i in range(200))
_PIECES = (
    "=", "[", "]", "{", "}", '"', "\'", ",", ";", "\t", "\n", "\r", "#", ".", "-", "+", "e", "nan", "inf",
    "1e999", "-1", "0", "9" * 400, "\ufeff", "\u202e", "ä", "\x00", "\x1b", "[[a]]", "a.b.c = 1", "true",
    "1979-05-27", "../../etc/passwd", "[" * 300, '"""', "\U0001f600",
)  # fmt: skip


@dataclass(slots=True)
class TextReport(InputReport):
    """What came of it."""

    memory_bytes: int = 0

    def figures(self) -> str:
        return (
            f"{self.tried} texts: {self.tried - self.refused} taken, {self.refused} refused in one line;"
            f" longest {self.longest_s:.2f} s, {self.memory_bytes / 1e6:.0f} MB at most"
        )


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
        ("record.csv", CSV.encode(), lambda path: read_columns(path, FileLayout("0", "1", "2"))),
    ]
    report = TextReport()
    for name, good, read in kinds:  # libraries are loaded once, which is no text's doing
        (folder / name).write_bytes(good)
        read(folder / name)
    tracemalloc.start()
    try:
        for number in range(count):
            name, good, read = kinds[number % len(kinds)]
            path = folder / name
            path.write_bytes(mutate(good, random.Random(seed * 1_000_003 + number)))
            said, refusals = f"text {number} ({name})", (ConfigError, RunError)
            report.attempt(said, partial(read, path), refusals, limit_s=LIMIT_S)
    finally:
        report.memory_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    if report.memory_bytes > MEMORY_LIMIT_BYTES:
        report.faults.append(f"{report.memory_bytes / 1e6:.0f} MB were taken")
    return report


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
    given = arguments(__doc__, 20_000, seed=0).parse_args()
    return run_ways(given.count, {"hostile texts": partial(hostile_texts, seed=given.seed)})


if __name__ == "__main__":
    sys.exit(main())
