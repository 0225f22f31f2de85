"""Drill: damaged run files are opened; `python -m tests.drills.damaged_runs --count 10000`.

Each must open, or be refused in one line within two seconds; none may bring the program down or take its
memory. What a file's samples say is not protected against flipped bits: HDF5 keeps no checksum of
uncompressed data, and compressed columns do not survive a `kill -9`. How often that happens is counted.
"""

import random
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from analysis.motion.two_mass import TwoMassParameters
from app.runs.errors import RunError
from app.runs.reader import Run, open_run
from app.runs.simulated import write_simulated_run
from app.runs.validator import Validator
from tests.drills.report import InputReport, arguments, run_ways

WALL_LIMIT_S = 12.0
"""The validator ends after 2 s of computing; the wall clock may show more on a busy machine."""


@dataclass(slots=True)
class DamageReport(InputReport):
    """What came of it."""

    opened_equal: int = 0
    opened_other: int = 0
    """Opened with other samples or facts than were written: damage that HDF5 cannot see."""
    broke_validator: int = 0
    """HDF5 crashed or hung on it, in the process that is there for that."""

    def figures(self) -> str:
        return (
            f"{self.tried} damaged files: {self.refused} refused in one line, {self.opened_equal} whole,"
            f" {self.opened_other} opened with other contents; HDF5 crashed or hung on"
            f" {self.broke_validator};"
            f" longest {self.longest_s:.2f} s"
        )


def damaged_runs(count: int, folder: Path, seed: int = 0) -> DamageReport:
    """Damage copies of a good run, and open them.

    Parameters
    ----------
    count : int
    folder : Path
        For the files.
    seed : int
        Makes the damage repeatable.
    """
    good = _good_run(folder)
    whole, data = open_run(good, trusted=True), good.read_bytes()
    report, path = DamageReport(), folder / "damaged.h5"
    with Validator.start() as validator:
        for number in range(count):
            path.write_bytes(damage(data, random.Random(seed * 1_000_003 + number)))
            _open(path, whole, validator, f"file {number}", report)
    path.unlink(missing_ok=True)
    return report


def _open(path: Path, whole: Run, validator: Validator, said: str, report: DamageReport) -> None:
    process = validator.pid
    run = report.attempt(
        said,
        lambda: open_run(path, validator=validator),
        (RunError,),
        names=str(path),
        limit_s=WALL_LIMIT_S,
        clock=time.monotonic,
    )
    if run is not None:
        equal = _is_equal(run, whole)
        report.opened_equal += equal
        report.opened_other += not equal
    report.broke_validator += process is not None and validator.pid != process


def _is_equal(run: Run, whole: Run) -> bool:
    columns = ("time_s", "table_reading", "relative_reading", "status")
    return run.metadata == whole.metadata and all(
        np.array_equal(getattr(run, name), getattr(whole, name), equal_nan=True) for name in columns
    )


def damage(data: bytes, rng: random.Random) -> bytes:
    """Copy of a file with one kind of damage, mostly where HDF5 keeps its own structure."""
    made = bytearray(data)
    match rng.randrange(7):
        case 0:
            del made[rng.randrange(len(made)) :]
        case 1:
            for _ in range(rng.choice((1, 3, 30, 300))):
                made[rng.randrange(len(made))] ^= 1 << rng.randrange(8)
        case 2:
            for _ in range(rng.choice((1, 3, 30))):
                made[_in_structure(made, rng)] = rng.randrange(256)
        case 3:
            start = rng.randrange(len(made))
            made[start : start + rng.choice((16, 512, 4096))] = bytes(rng.choice((16, 512, 4096)))
        case 4:
            size = rng.choice((8, 64, 512))
            a, b = rng.randrange(len(made) - size), _in_structure(made, rng)
            made[b : b + size] = made[a : a + size]
        case 5:
            start = rng.randrange(len(made))
            del made[start : start + rng.choice((1, 8, 4096))]
        case 6:
            place = _in_structure(made, rng)
            made[place : place + 8] = rng.choice((0, 1, 1 << 31, (1 << 63) - 1, (1 << 64) - 1)).to_bytes(
                8, "little"
            )
    return bytes(made)


_SIGNATURES = (b"OHDR", b"TREE", b"HEAP", b"SNOD", b"FRHP", b"BTHD", b"\x89HDF", b"OCHK")


def _in_structure(data: bytes | bytearray, rng: random.Random) -> int:
    """A place shortly after one of HDF5's own marks."""
    found = data.find(rng.choice(_SIGNATURES), rng.randrange(len(data)))
    return min(max(found, 0) + rng.randrange(128), len(data) - 1)


def _good_run(folder: Path) -> Path:
    parameters = TwoMassParameters.from_free_decay(
        period_s=0.32,
        damping_n1_per_s=0.12,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )
    path = folder / "good.h5"
    write_simulated_run(path, parameters.simulate(4.0), parameters, series="1FFM0", rate_hz=200.0)
    return path


def main() -> int:
    """Run the drill, and say what came of it."""
    given = arguments(__doc__, 10_000, seed=0).parse_args()
    return run_ways(given.count, {"damaged runs": partial(damaged_runs, seed=given.seed)})


if __name__ == "__main__":
    sys.exit(main())
