"""What becomes of a run that was recorded: kept with what was found, or moved to the trash and back."""

from dataclasses import dataclass, replace
from pathlib import Path

from app.presenters.analysed import AnalysedRun, Saving
from app.presenters.record.state import Decision
from app.presenters.record.tasks import BringBack, KeepRun, PutAside, Submit
from app.presenters.results import FRICTION, row, sentence
from app.presenters.screen import NO_CHIP, Chip, Tone
from app.presenters.words import tr


@dataclass(frozen=True, eq=False, slots=True)
class _Run:
    """A run that is to be decided about."""

    path: str
    note: str
    """As stored."""
    typed: str
    saving: Saving | None = None

    @property
    def new_note(self) -> str | None:
        return None if self.typed.strip() == self.note else self.typed.strip()


class Verdicts:
    """Decides about one run after another; nothing is ever deleted.

    Parameters
    ----------
    submit : callable
        Has a task done in another process.
    author : str
        Who decides, for the history of a run.
    """

    def __init__(self, submit: Submit, author: str) -> None:
        self.said: Chip = NO_CHIP
        """What became of the last one."""
        self.undo_words = ""
        self._submit = submit
        self._author = author
        self._run: _Run | None = None
        self._passed: set[str] = set()
        self._savings: dict[str, Saving | None] = {}
        self._aside = ""

    @property
    def decision(self) -> Decision | None:
        """What is to be decided now; None where nothing is."""
        return None if self._run is None else Decision(self._run.typed)

    # --- what the operator does ---

    def type_note(self, note: str) -> None:
        """Remark on the run."""
        if self._run is not None:
            self._run = replace(self._run, typed=note)

    def keep(self) -> str:
        """Store what was found in the run, and the note; its path if anything was found, else empty."""
        if self._run is None:
            return ""
        run, self._run = self._run, None
        self._submit(KeepRun(run.path, self._author, run.new_note, run.saving))
        return run.path if run.saving is not None else ""

    def put_aside(self) -> None:
        """Move the run to the trash."""
        if self._run is not None:
            run, self._run = self._run, None
            self._savings[run.path] = run.saving
            self._submit(PutAside(run.path, self._author, run.new_note))

    def pass_by(self, path: str) -> None:
        """Somebody went on before the run was identified: it is kept as soon as it is."""
        self._passed.add(path)

    def undo(self) -> None:
        """Bring back what was put aside last, and keep it."""
        if self._aside:
            self._submit(BringBack(self._aside))
            self._aside = self.undo_words = ""

    # --- what happens elsewhere ---

    def forget(self) -> None:
        """Another run has ended: what became of those before was said long ago."""
        self.said, self.undo_words, self._aside = NO_CHIP, "", ""

    def take(self, run: AnalysedRun) -> None:
        """A run was identified, and is to be decided about."""
        self._run = _Run(str(run.path), run.note, run.note, run.saving)

    def take_failure(self, path: str, note: str) -> None:
        """Nothing was found in a run, which is to be decided about all the same."""
        self._run = _Run(path, note, note)

    def take_passed(self, run: AnalysedRun) -> bool:
        """Keep a run that was passed by; False if it was not."""
        path = str(run.path)
        if path not in self._passed:
            return False
        self._passed.discard(path)
        self.said = Chip(tr("{found} Kept {name}", found=_found(run), name=run.path.stem), Tone.OK)
        self._submit(KeepRun(path, self._author, None, run.saving))
        return True

    def take_passed_failure(self, path: str) -> None:
        """Nothing was found in a run that was passed by: it stays as it is."""
        self._passed.discard(path)

    def kept(self, task: KeepRun) -> None:
        """It is stored."""
        if not self.said.text:  # more than that may have been said already
            self.said = Chip(tr("Kept {name}", name=Path(task.path).stem), Tone.OK)

    def was_put_aside(self, task: PutAside, path: str) -> None:
        """The run lies in the trash now."""
        self._aside = path
        self._savings[path] = self._savings.pop(task.path, None)
        self.undo_words = tr("Bring back {name}", name=Path(task.path).stem)
        self.said = Chip(tr("Moved {name} to the trash", name=Path(task.path).stem), Tone.WARN, path)

    def brought_back(self, task: BringBack, path: str) -> None:
        """The run lies where it lay: it is kept."""
        self.said = Chip(tr("Brought back {name}: it counts again", name=Path(path).stem), Tone.OK)
        self._submit(KeepRun(path, self._author, None, self._savings.pop(task.path, None)))

    def failed(self, message: str) -> None:
        """It could not be done; what was recorded is as it was."""
        self.said = Chip(sentence(message), Tone.BAD)


def _found(run: AnalysedRun) -> str:
    """`f_d = 0.1003 ± 0.0006.`, where it was found."""
    quantity = run.results.get(FRICTION.key)
    if quantity is None:
        return ""
    shown = row(FRICTION, quantity)
    return f"{FRICTION.symbol} = {shown.value} {shown.spread}.".replace(" .", ".")
