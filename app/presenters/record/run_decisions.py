"""What becomes of a run that was recorded: kept with what was found, or in the trash; and back again."""

from dataclasses import dataclass, replace
from pathlib import Path

from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from app.presenters.record.state import PendingDecision
from app.presenters.record.tasks import KeepRun, MoveToTrash, RecordTask, RestoreFromTrash, Submit
from app.presenters.results import FRICTION, make_row, sentence
from messages.i18n import gettext


@dataclass(frozen=True, slots=True)
class _Run:
    """A run that is to be decided about."""

    path: str
    note: str | None
    """As stored; None where that is not known for sure."""
    typed: str
    found: str = ""
    """What was found in it, in words."""
    is_analysed: bool = False

    @property
    def name(self) -> str:
        return Path(self.path).stem

    @property
    def new_note(self) -> str | None:
        return None if self.typed.strip() == self.note else self.typed.strip()


class RunDecisions:
    """Decides about one run after another, and takes the last decision back; nothing is ever deleted.

    Parameters
    ----------
    submit : callable
        Has a task done in another process.
    author : str
        Who decides, for the history of a run.
    """

    def __init__(self, submit: Submit, author: str) -> None:
        self.status: Chip = EMPTY_CHIP
        """What became of the last one."""
        self._submit = submit
        self._author = author
        self._run: _Run | None = None
        self._passed: set[str] = set()
        self._storing: dict[str, tuple[Chip, Chip]] = {}
        self._last: _Run | None = None
        """Decided about last."""
        self._trashed = ""
        """Where it lies if it was moved to the trash."""
        self._is_moving = False
        """It is on its way there."""
        self._returning: _Run | None = None
        """On its way back from there."""

    @property
    def decision(self) -> PendingDecision | None:
        """What is to be decided now; None where nothing is."""
        return None if self._run is None else PendingDecision(self._run.typed)

    def undo_text(self, *, is_free: bool) -> str:
        """What can be taken back; without `is_free` there is no room to decide about a run again."""
        if self._last is None or self._is_moving:
            return ""
        if self._trashed:
            return gettext("Bring back {name}", name=self._last.name)
        return gettext("Decide again about {name}", name=self._last.name) if is_free else ""

    # --- what the operator does ---

    def set_note(self, note: str) -> None:
        """Remark on the run."""
        if self._run is not None:
            self._run = replace(self._run, typed=note)

    def keep(self) -> str:
        """Store what was found in the run, and the note; its path if anything was found, else empty."""
        run = self._decided()
        if run is None:
            return ""
        self._store(run)
        return run.path if run.is_analysed else ""

    def move_to_trash(self) -> None:
        """Move the run to the trash."""
        run = self._decided()
        if run is not None:
            self._is_moving = True
            self.status = Chip(gettext("Moving {name} to the trash", name=run.name))
            self._submit(MoveToTrash(run.path, self._author, run.new_note))

    def keep_when_identified(self, path: str) -> None:
        """Somebody went on before the run was identified: it is kept as soon as it is."""
        self._passed.add(path)

    def undo(self) -> bool:
        """Take the last decision back; False where the run has to be brought back first, or there is none."""
        if self._is_moving:
            return False
        run, trashed = self._last, self._trashed
        self._last, self._trashed = None, ""
        if run is None:
            return False
        if trashed:
            self._returning = run
            self._submit(RestoreFromTrash(trashed))
            return False
        self._decide_again(run)
        return True

    # --- what happens elsewhere ---

    def clear_last(self) -> None:
        """Another run has ended: what became of those before was said long ago."""
        self.status, self._last, self._trashed = EMPTY_CHIP, None, ""

    def set_run(self, run: AnalysedRun) -> None:
        """A run was identified, and is to be decided about."""
        self._run = _Run(str(run.path), run.note, run.note, _found(run), is_analysed=True)

    def set_failed_run(self, path: str, note: str) -> None:
        """Nothing was found in a run, which is to be decided about all the same."""
        self._run = _Run(path, note, note)

    def on_late_result(self, run: AnalysedRun) -> bool:
        """Keep a run that was passed by; False if it was not."""
        path = str(run.path)
        if path not in self._passed:
            return False
        self._passed.discard(path)
        self._last, self._trashed = None, ""
        self._store(_Run(path, run.note, run.note, _found(run), is_analysed=True))
        return True

    def on_late_failure(self, path: str) -> None:
        """Nothing was found in a run that was passed by: it stays as it is."""
        self._passed.discard(path)

    def on_kept(self, task: KeepRun) -> None:
        """It is stored."""
        storing, stored = self._storing.pop(task.path, (EMPTY_CHIP, EMPTY_CHIP))
        if self.status == storing:  # something else may have been said meanwhile
            self.status = stored

    def on_moved_to_trash(self, task: MoveToTrash, path: str) -> None:
        """The run lies in the trash now."""
        self._is_moving = False
        if self._last is not None and self._last.path == task.path:
            self._trashed = path
        self.status = Chip(gettext("Moved {name} to the trash", name=Path(task.path).stem), Tone.WARN, path)

    def on_restored(self, path: str, *, is_free: bool) -> bool:
        """The run lies where it lay: to be decided about if there is room, which is told; else kept."""
        run, self._returning = self._returning, None
        if run is None:
            return False
        run = replace(run, path=path)
        if is_free:
            self._decide_again(run)
            self.status = Chip(gettext("Brought back {name}", name=run.name), Tone.OK)
        else:
            self._store(run)
            self.status = Chip(gettext("Brought back {name}: it counts again", name=run.name), Tone.OK)
        return is_free

    def on_failed(self, task: RecordTask, message: str) -> None:
        """It could not be done; what was recorded is as it was."""
        if isinstance(task, MoveToTrash):
            self._is_moving = False
        self.status = Chip(sentence(message), Tone.BAD)

    # --- inside ---

    def _decided(self) -> _Run | None:
        run, self._run = self._run, None
        if run is not None:
            self._last, self._trashed = run, ""
        return run

    def _decide_again(self, run: _Run) -> None:
        """Its note may have been written, or may not have been."""
        self._run, self.status = replace(run, note=None), EMPTY_CHIP

    def _store(self, run: _Run) -> None:
        storing = Chip(_joined(run.found, gettext("Keeping {name}", name=run.name)))
        stored = Chip(_joined(run.found, gettext("Kept {name}", name=run.name)), Tone.OK)
        self._storing[run.path] = storing, stored
        self.status = storing
        self._submit(KeepRun(run.path, self._author, run.new_note, run.is_analysed))


def _joined(found: str, said: str) -> str:
    return f"{found} {said}".strip()


def _found(run: AnalysedRun) -> str:
    """`f_d = 0.1003 ± 0.0006.`, where it was found."""
    quantity = run.results.get(FRICTION.key)
    if quantity is None:
        return ""
    shown = make_row(FRICTION, quantity)
    return f"{FRICTION.symbol} = {shown.value} {shown.uncertainty_text}.".replace(" .", ".")
