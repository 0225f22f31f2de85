"""Notices of the window, each with the cause that it leaves with."""

import datetime
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path

from app.presenters import recovery
from app.presenters.base import Notice
from app.runs.unattended import UnattendedRun, remove_note

_LOOK_EVERY_S = 3.0  # for what other processes have finished


class NoticeCause(Enum):
    """What a notice tells of, and until when it does."""

    SETTINGS = auto()  # personal settings cannot be read; until they are saved
    PROGRAM_ERROR = auto()  # until it is dismissed
    RECORDING = auto()  # something waits for the end of a recording; until then
    CLOSING = auto()  # the window is to be closed while a run is recorded; until that has ended
    REPLACING = auto()  # a simulated stand is to take the place of an amplifier; until that is disconnected
    CONNECTION = auto()  # a device could not be connected, or is gone; until the next connection
    RUN = auto()  # how the last run ended; until the next one is recorded
    UNFINISHED = auto()  # runs that a crash has left; until there are none
    RECOVERY = auto()  # progress and outcome; until the next run is recorded
    UNATTENDED = auto()  # a run that nobody followed; until it is opened


@dataclass(frozen=True, slots=True)
class CausedNotice:
    """A notice; `subject` tells several of one cause apart."""

    cause: NoticeCause
    notice: Notice
    subject: str = ""


@dataclass(frozen=True, slots=True)
class NoticeSources:
    """What notices are made of that does not come from the window itself."""

    count_unfinished: Callable[[], int] = lambda: 0
    """Number of runs in the folder that a crash has left unfinished."""
    read_notes: Callable[[], Mapping[Path, UnattendedRun]] = dict
    """Notes on runs in the folder that nobody followed, by their files."""
    today: Callable[[], datetime.date] = datetime.date.today
    clock: Callable[[], float] = time.perf_counter


class NoticeList:
    """All notices that hold, the newest last, but questions behind all others: the last one is shown.

    `show` gets the notice to be shown, or None, and the number of the others.
    """

    def __init__(self, sources: NoticeSources, show: Callable[[Notice | None, int], None]) -> None:
        self._sources = sources
        self._show = show
        self._notices: list[CausedNotice] = []
        self._looked_s = -math.inf
        self._was_recording = False
        self._notes_told: set[Path] = set()

    def put(self, cause: NoticeCause, notice: Notice, subject: str = "") -> None:
        """Add a notice, in place of an earlier one of this cause and subject."""
        others = [one for one in self._notices if (one.cause, one.subject) != (cause, subject)]
        self._notices = sorted(
            (*others, CausedNotice(cause, notice, subject)), key=lambda one: one.notice.is_question
        )
        self._update()

    def put_failure(self, cause: NoticeCause, notice: Notice) -> None:
        """Tell of a failure, and before that offer to recover the runs that it left unfinished."""
        self.put(cause, notice)
        if self._sources.count_unfinished():
            self.put(NoticeCause.UNFINISHED, recovery.offer_recovery(notice.text))

    def ask_to_recover(self) -> None:
        """Ask what is to become of unfinished runs, where there are some."""
        count = self._sources.count_unfinished()
        if count:
            self.put(NoticeCause.UNFINISHED, recovery.recovery_question(count))

    def withdraw(self, *causes: NoticeCause) -> None:
        self._remove(lambda one: one.cause in causes)

    def dismiss(self) -> Notice | None:
        """Take the notice that is shown away, and return it."""
        if not self._notices:
            return None
        shown = self._notices[-1]
        self._remove(lambda one: one is shown)
        return shown.notice

    def on_run_opened(self, path: str) -> None:
        self._remove(lambda one: one.cause is NoticeCause.UNATTENDED and one.notice.path == path)

    def follow(self, *, is_recording: bool) -> None:
        """Withdraw notices of what is over, and tell of runs that ended without a window."""
        if is_recording and not self._was_recording:
            self.withdraw(NoticeCause.RUN, NoticeCause.RECOVERY)
        elif self._was_recording and not is_recording:
            self.withdraw(NoticeCause.RECORDING)
        self._was_recording = is_recording
        now_s = self._sources.clock()
        if now_s - self._looked_s >= _LOOK_EVERY_S:
            self._looked_s = now_s
            self._look()

    def _look(self) -> None:
        causes = {one.cause for one in self._notices}
        if NoticeCause.UNFINISHED in causes and not self._sources.count_unfinished():
            self.withdraw(NoticeCause.UNFINISHED)
        for path, run in self._sources.read_notes().items():
            if path not in self._notes_told:
                self._notes_told.add(path)
                notice = recovery.unattended_notice(run, self._sources.today())
                self.put(NoticeCause.UNATTENDED, notice, str(path))

    def _remove(self, is_over: Callable[[CausedNotice], bool]) -> None:
        """Take notices away; a note that was read is removed."""
        for one in filter(is_over, self._notices):
            if one.cause is NoticeCause.UNATTENDED:
                remove_note(Path(one.subject))
        self._notices = [one for one in self._notices if not is_over(one)]
        self._update()

    def _update(self) -> None:
        shown = self._notices[-1].notice if self._notices else None
        self._show(shown, max(len(self._notices) - 1, 0))
