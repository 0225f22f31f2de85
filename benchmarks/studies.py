"""What every study shares: its options, its worker processes, shares with their error, Markdown tables."""

import argparse
import math
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

Outcome = TypeVar("Outcome")


def option_parser(description: str, records: int) -> argparse.ArgumentParser:
    """Parser of the options that every study understands."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "--records", type=int, default=records, metavar="N", help="records a table (%(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the first record (%(default)s)")
    parser.add_argument(
        "--workers", "--processes", type=int, default=2, metavar="W", help="processes (%(default)s)"
    )
    return parser


def options(description: str, records: int) -> argparse.Namespace:
    """Options that every study understands."""
    return option_parser(description, records).parse_args()


def spread_out(
    work: Callable[[int], Outcome], seeds: Iterable[int], workers: int, label: str
) -> list[Outcome]:
    """`work` on every seed, in order, by `each_outcome`."""
    return list(each_outcome(work, seeds, workers, label))


def each_outcome(
    work: Callable[[int], Outcome], seeds: Iterable[int], workers: int, label: str
) -> Iterator[Outcome]:
    """`work` on every seed, in order, one by one; progress goes to stderr.

    Workers do their linear algebra in one thread: at these sizes more threads only wait for each other,
    and take three times the processor time.
    """
    seeds = list(seeds)
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        outcomes = pool.imap(work, seeds, chunksize=4)
        for done, outcome in enumerate(outcomes, 1):
            yield _counted(outcome, done, len(seeds), label)


def _counted(outcome: Outcome, done: int, total: int, label: str) -> Outcome:
    if done % 50 == 0 or done == total:
        print(f"{label}: {done} of {total}", file=sys.stderr)
    return outcome


def percent(part: int, total: int) -> str:
    """Share with its standard error."""
    if total == 0:
        return "none"
    share = part / total
    return f"{100.0 * share:.1f} ± {100.0 * math.sqrt(max(share * (1.0 - share), 1.0 / total) / total):.1f} %"


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def listed(seeds: Sequence[int], limit: int = 12) -> str:
    """The first few seeds, to repeat a record by."""
    shown = ", ".join(str(seed) for seed in seeds[:limit])
    return (shown + (", …" if len(seeds) > limit else "")) or "none"
