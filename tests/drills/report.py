"""What the drills share: reports that end in a count of faults, and their command lines."""

import argparse
import sys
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


@dataclass(slots=True, kw_only=True)
class DrillReport(ABC):
    """What came of a drill; each has figures of its own."""

    faults: list[str] = field(default_factory=list)

    @abstractmethod
    def figures(self) -> str:
        """What was done and found, but for the faults."""

    def __str__(self) -> str:
        return "\n".join([f"{self.figures()}; {len(self.faults)} faults", *self.faults])


@dataclass(slots=True)
class InputReport(DrillReport):
    """What came of inputs that must each be taken, or refused in one line, before long."""

    tried: int = 0
    refused: int = 0
    longest_s: float = 0.0

    def attempt(
        self,
        said: str,
        read: Callable[[], T],
        refusals: tuple[type[Exception], ...],
        *,
        names: str = "",
        limit_s: float,
        clock: Callable[[], float] = time.process_time,
    ) -> T | None:
        """Read an input; None where that is refused, or a fault.

        Parameters
        ----------
        said : str
            What the input is called.
        read : callable
        refusals : tuple of exceptions
            Whose message must be one line.
        names : str
            What the message must name.
        limit_s : float
            By `clock`.
        """
        self.tried += 1
        start_s, taken = clock(), None
        try:
            taken = read()
        except refusals as error:
            self.refused += 1
            if not str(error).strip() or "\n" in str(error) or names not in str(error):
                self.faults.append(f"{said}: {error!r}")
        except Exception as error:
            self.faults.append(f"{said}: {type(error).__name__}: {error}")
        took_s = clock() - start_s
        self.longest_s = max(self.longest_s, took_s)
        if took_s > limit_s:
            self.faults.append(f"{said}: took {took_s:.1f} s")
        return taken


def arguments(description: str | None, count: int, seed: int | None = None) -> argparse.ArgumentParser:
    """Options of every drill."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--count", type=int, default=count, help="in all")
    parser.add_argument("--seed", type=int, default=seed)
    return parser


def chosen_ways(parser: argparse.ArgumentParser, given: str, known: Sequence[str]) -> list[str]:
    """Ways as they were given, separated by commas. Ends the program where one is not `known`."""
    ways = list(filter(None, given.split(",")))
    for way in ways:
        if way not in known:
            parser.error(f"{way!r} is none of {', '.join(known)}")
    return ways


def run_ways(
    count: int, ways: Mapping[str, Callable[[int, Path], DrillReport]], keep: Path | None = None
) -> int:
    """Run a drill in each way, with its share of `count`, and print what came of it.

    Parameters
    ----------
    count : int
        In all.
    ways : mapping
        What each is called, and what runs it a number of times in a folder.
    keep : Path, optional
        The folder; if absent, one that is removed afterwards.

    Returns
    -------
    int
        Exit code: 1 where a fault was found, or nothing could be run.
    """
    faults = 0
    for number, (way, drill) in enumerate(ways.items()):
        share = count // len(ways) + (number < count % len(ways))
        if not share:
            continue
        with tempfile.TemporaryDirectory(prefix="slipstand-drill-") as folder:
            report = drill(share, keep or Path(folder))
        sys.stdout.write(f"{way}: {report}\n")
        sys.stdout.flush()
        faults += len(report.faults)
    return 1 if faults or not ways else 0
