"""A test that leaves a widget, thread or process behind fails."""

import contextlib
import gc
import multiprocessing
import sys
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot
from window_desk import Desk

from app.qt.theme import Theme
from config.schema import RecentUse
from tests.waiting import PATIENCE_S


@pytest.fixture(autouse=True)
def nothing_left_behind(qapp: QApplication) -> Iterator[None]:
    """Fail when widgets, threads or child processes outlive the test."""
    threads, children = set(threading.enumerate()), child_processes()
    widgets = set(map(id, QApplication.topLevelWidgets()))
    yield
    gone(lambda: [w for w in QApplication.topLevelWidgets() if id(w) not in widgets], "widgets")
    gone(lambda: [t for t in threading.enumerate() if t not in threads], "threads")
    gone(lambda: sorted(child_processes() - children), "processes")


def gone(left: Callable[[], list[object]], what: str) -> None:
    end_s = time.perf_counter() + PATIENCE_S
    while found := left():
        if time.perf_counter() > end_s:
            pytest.fail(f"{what} left behind: {found}")
        gc.collect()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QCoreApplication.processEvents()
        time.sleep(0.005)


def child_processes() -> set[int]:
    """Process ids of our children; those of multiprocessing alone where the system does not list them.

    The resource tracker, which multiprocessing keeps until the interpreter ends, does not count.
    """
    found = {child.pid for child in multiprocessing.active_children() if child.pid is not None}
    if sys.platform == "linux":
        for task in Path("/proc/self/task").glob("*/children"):
            with contextlib.suppress(FileNotFoundError):
                found |= {int(pid) for pid in task.read_text().split()}
    return found - {getattr(resource_tracker._resource_tracker, "_pid", None)}


@pytest.fixture
def recent() -> RecentUse | None:
    """What was used at the last start, for `desk`; a file of tests may have another."""
    return None


@pytest.fixture
def desk(theme: Theme, qtbot: QtBot, recent: RecentUse | None) -> Iterator[Desk]:
    """An active window on fakes."""
    made = Desk(theme, qtbot, recent=recent)
    made.window.activateWindow()
    yield made
    made.window.close()
