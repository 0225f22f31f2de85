"""Functions for worker processes and clusters."""

import os
import signal
import time
from pathlib import Path


def doubled(number: int) -> int:
    return 2 * number


def doubled_slowly(number: int) -> int:
    time.sleep(0.05)
    return 2 * number


def failing(number: int) -> int:
    if number == 3:
        raise ValueError("three is too many")
    return number


def fatal(item: tuple[int, str]) -> int:
    """Kill the own process: item 4 always, item 1 unless it was tried before."""
    number, folder = item
    if number == 4:
        os.kill(os.getpid(), signal.SIGTERM if os.name == "nt" else signal.SIGKILL)
    tried = Path(folder) / str(number)
    if number == 1 and not tried.exists():
        tried.touch()
        os.kill(os.getpid(), signal.SIGTERM if os.name == "nt" else signal.SIGKILL)
    return number


def waiting(folder: str) -> None:
    """Say which process this is, then wait for long; what is half written is cleared away in the end."""
    half = Path(folder) / f"{os.getpid()}.half"
    half.touch()
    try:
        time.sleep(60.0)
    finally:
        half.unlink()


def nothing() -> None:
    pass
