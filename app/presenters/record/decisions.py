"""Decisions about recorded runs, and the tasks by which run files follow them (`record.tasks`)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.results import FRICTION, make_row, sentence
from app.runs.next_tests import NextTests
from messages.i18n import gettext
from messages.message import Message

# --- tasks for the worker process --------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LoadPlan:
    """Read the stored plan of a folder, and count its completed runs."""

    folder: str


@dataclass(frozen=True, slots=True)
class LoadedPlan:
    """Answer to `LoadPlan`."""

    tests: NextTests
    completed: tuple[tuple[str, str], ...] = ()
    """Path and series of each completed run."""


@dataclass(frozen=True, slots=True)
class CountCompletedRuns:
    """List the completed runs of a folder; the answer is as `LoadedPlan.completed`."""

    folder: str


@dataclass(frozen=True, slots=True)
class SavePlan:
    """Store plan and choices."""

    folder: str
    tests: NextTests


@dataclass(frozen=True, slots=True)
class KeepRun:
    """Store the note of a run if it has changed, and its analysis if it `has_results`."""

    path: str
    author: str
    note: str | None = None
    has_results: bool = False


@dataclass(frozen=True, slots=True)
class MoveToTrash:
    """Move a run to the trash, with a note if one was typed; the answer is its path there."""

    path: str
    author: str
    note: str | None = None


@dataclass(frozen=True, slots=True)
class RestoreFromTrash:
    """Move a run out of the trash; the answer is its path."""

    path: str


RecordTask = LoadPlan | CountCompletedRuns | SavePlan | KeepRun | MoveToTrash | RestoreFromTrash


# --- decisions ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """A run that is or was decided about."""

    path: str
    note: str | None
    """As stored; None where that is uncertain."""
    edited_note: str
    results_text: str = ""
    """Main result in words, for messages."""
    has_results: bool = False

    @classmethod
    def of(cls, run: AnalysedRun) -> "RecordedRun":
        return cls(str(run.path), run.note, run.note, _results_text(run), has_results=True)

    @property
    def name(self) -> str:
        return Path(self.path).stem

    @property
    def note_to_store(self) -> str | None:
        """Edited note; None where it is stored already."""
        return None if self.edited_note.strip() == self.note else self.edited_note.strip()

    @property
    def storing_message(self) -> Chip:
        return Chip(f"{self.results_text} {gettext('Keeping {name}', name=self.name)}".strip())

    @property
    def stored_message(self) -> Chip:
        return Chip(f"{self.results_text} {gettext('Kept {name}', name=self.name)}".strip(), Tone.OK)


@dataclass(frozen=True, slots=True)
class RunDecisions:
    """Decisions about recorded runs, one after another; the last one can be undone. No file is deleted."""

    pending: RecordedRun | None = None
    """Waits for the decision."""
    message: Chip = EMPTY_CHIP
    """Outcome of the last decision."""
    last: RecordedRun | None = None
    """Decided about last."""
    trash_path: str = ""
    """Where `last` lies in the trash; empty if it does not."""
    is_moving: bool = False
    """`last` is being moved to the trash."""
    restoring: RecordedRun | None = None
    """Is being moved out of the trash."""
    to_keep: frozenset[str] = frozenset()
    """Paths of runs to keep once they are identified: the operator went on before."""
    storing: Mapping[str, RecordedRun] = field(default_factory=dict)
    """Runs that are being kept, by path."""

    def undo_text(self, *, is_free: bool) -> str:
        """What undo does; a kept run is decided about again only if the screen `is_free`."""
        if self.last is None or self.is_moving:
            return ""
        if self.trash_path:
            return gettext("Bring back {name}", name=self.last.name)
        return gettext("Decide again about {name}", name=self.last.name) if is_free else ""

    def with_note(self, note: str) -> "RunDecisions":
        if self.pending is None:
            return self
        return replace(self, pending=replace(self.pending, edited_note=note))

    def without_last(self) -> "RunDecisions":
        """Drop message and undo: another run has ended."""
        return replace(self, message=EMPTY_CHIP, last=None, trash_path="")

    def decided(self) -> "RunDecisions":
        """Take the pending run as decided about."""
        if self.pending is None:
            return self
        return replace(self, pending=None, last=self.pending, trash_path="")

    def moving(self, run: RecordedRun) -> "RunDecisions":
        message = Chip(gettext("Moving {name} to the trash", name=run.name))
        return replace(self, is_moving=True, message=message)

    def keeping(self, run: RecordedRun) -> "RunDecisions":
        return replace(self, storing={**self.storing, run.path: run}, message=run.storing_message)

    def undone(self) -> "RunDecisions":
        return replace(self, last=None, trash_path="")

    def again(self, run: RecordedRun) -> "RunDecisions":
        """Ask about a run once more; its note may or may not have been stored."""
        return replace(self, pending=replace(run, note=None), message=EMPTY_CHIP)

    def after_keeping(self, task: KeepRun) -> "RunDecisions":
        """A run is kept; a newer message stays."""
        storing = dict(self.storing)
        run = storing.pop(task.path, None)
        message = run.stored_message if run and self.message == run.storing_message else self.message
        return replace(self, storing=storing, message=message)

    def after_moving(self, task: MoveToTrash, trash_path: str) -> "RunDecisions":
        is_last = self.last is not None and self.last.path == task.path
        message = Chip(gettext("Moved {name} to the trash", name=Path(task.path).stem), Tone.WARN, trash_path)
        path = trash_path if is_last else self.trash_path
        return replace(self, is_moving=False, trash_path=path, message=message)

    def after_failure(self, task: RecordTask, message: Message) -> "RunDecisions":
        """A task failed; the files are as they were."""
        is_moving = self.is_moving and not isinstance(task, MoveToTrash)
        return replace(self, is_moving=is_moving, message=Chip(sentence(message), Tone.BAD))


def _results_text(run: AnalysedRun) -> str:
    """`f_d = 0.1003 ± 0.0006.`; empty without f_d."""
    quantity = run.results.get(FRICTION.name)
    if quantity is None:
        return ""
    shown = make_row(FRICTION, quantity)
    return f"{shown.symbol} = {shown.value} {shown.uncertainty_text}".strip() + "."
