"""An operator's hour in the window, by the clock: one test after another armed, recorded, identified, kept.

`python benchmarks/desktop_hour.py [--minutes 60] [--every 5]` prints a line of docs/benchmarks.md every five
minutes: runs kept, memory of the window and of each process that it started (Linux: read from /proc, without
pages of mapped files), and at last how many samples are missing in the runs. Nothing is fed more quickly than
it comes from the simulated stand.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QEventLoop
from PySide6.QtWidgets import QApplication

from app.presenters.composition import make_window_presenter
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import Action
from app.qt.theme import Theme
from app.qt.window import MainWindow
from app.runs.reader import open_run
from app.simulated_stand.options import SimulatedStandOptions

STAND = SimulatedStandOptions(seed=1, rate_hz=2000.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=5.0)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SLIPSTAND_RECORDINGS"] = os.environ["SLIPSTAND_CONFIG"] = folder
        hour(Path(folder), 60.0 * chosen.minutes, 60.0 * chosen.every)


def hour(folder: Path, length_s: float, every_s: float) -> None:
    """Work in the window, and tell every now and then what it takes."""
    app = QApplication(sys.argv[:1])
    presenter = make_window_presenter(STAND)
    window = MainWindow(Theme(app), presenter)
    window.resize(1280, 800)
    window.show()
    presenter.open_simulated(STAND.series)
    print("| minutes | runs kept | window, MB | its processes, MB |\n|---|---|---|---|")
    began_s = told_s = time.monotonic()
    kept = 0
    while (now_s := time.monotonic()) < began_s + length_s:
        app.processEvents(QEventLoop.ProcessEventsFlag.WaitForMoreEvents)
        kept += act(presenter.record)
        if now_s > told_s + every_s:
            told_s = now_s
            tell((now_s - began_s) / 60.0, kept)
    window.close()
    tell_missing(folder)


def act(record: RecordPresenter) -> bool:
    """Do what an operator does next: arm a test, keep it once its result is there; True if one is kept."""
    state = record.state
    if state.result is None:
        if state.primary is Action.ARM:
            record.dispatch(Action.ARM)
        return False
    if state.primary is Action.NEXT:
        record.dispatch(Action.NEXT)
        return True
    return False


def tell(minutes: float, kept: int) -> None:
    processes = sorted((name_of(process), memory_mb(process)) for process in descendants_of(os.getpid()))
    shown = ", ".join(f"{name} {size:.0f}" for name, size in processes)
    print(f"| {minutes:.0f} | {kept} | {memory_mb(os.getpid()):.1f} | {shown} |", flush=True)


def tell_missing(folder: Path) -> None:
    endings = [run.end for path in folder.rglob("*.h5") if (run := open_run(path, trusted=True)).end]
    absent = sum(ending.losses.missing + ending.losses.damaged for ending in endings if ending is not None)
    print(f"\n{len(endings)} runs, {absent} samples missing or damaged")


def descendants_of(process: int) -> Iterator[int]:
    for listed in Path("/proc").glob(f"{process}/task/*/children"):
        for child in map(int, listed.read_text().split()):
            yield child
            yield from descendants_of(child)


def name_of(process: int) -> str:
    """Name of its module, or how it was started."""
    words = Path(f"/proc/{process}/cmdline").read_text().split("\0")
    return words[words.index("-m") + 1].rpartition(".")[2] if "-m" in words else "worker"


def memory_mb(process: int) -> float:
    """Memory that is the process's own."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("RssAnon")) / 1024.0


if __name__ == "__main__":
    main()
