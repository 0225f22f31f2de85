"""Functions for worker processes and clusters."""

import contextlib
import os
import signal
import time
import uuid
from pathlib import Path

from app.runs.rewrite import rewrite
from tests.waiting import wait_until


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
    """Kill the own process: item 4 always, item 1 unless it was tried before; 1 dies first."""
    number, folder = item
    if number == 4:
        wait_until((Path(folder) / "1").exists)  # else 1, which is done again with 4, might die with that
        os.kill(os.getpid(), signal.SIGTERM if os.name == "nt" else signal.SIGKILL)
    tried = Path(folder) / str(number)
    if number == 1 and not tried.exists():
        tried.touch()
        os.kill(os.getpid(), signal.SIGTERM if os.name == "nt" else signal.SIGKILL)
    return number


def waiting(folder: str) -> None:
    """Say which process this is, then wait for long; what is half written is cleared away in the end."""
    half = Path(folder) / f"{os.getpid()}.half"
    try:
        half.touch()
        time.sleep(60.0)
    finally:
        half.unlink()


def waiting_apart(folder: str) -> None:
    """Leave a file for each call, and do as `waiting` does."""
    (Path(folder) / f"{uuid.uuid4().hex}.begun").touch()
    waiting(folder)


def rewriting_for_ever(path: str, change_begins: str) -> None:
    """Rewrite a run and hang while its copy is changed, as a library does that passes no exception on."""

    def hang(_file: object) -> None:
        Path(change_begins).touch()
        while True:
            with contextlib.suppress(SystemExit):
                time.sleep(0.01)

    rewrite(Path(path), hang)
