"""What was changed in runs, and how it is taken back: what is typed as a value, words, and the way back."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.presenters.base import Chip, Tone
from app.presenters.batch_text import run_count_text
from app.presenters.results import sentence
from app.presenters.runs.table import parse_mass_kg
from app.presenters.runs.tasks import BatchOutcome, CopyRuns, EditRuns, RestoreRuns, TrashRuns, UndoEdits
from messages.i18n import N_, gettext, ngettext

Change = EditRuns | UndoEdits | TrashRuns | RestoreRuns | CopyRuns
_NAMES = {
    "series": N_("series"),
    "operator": N_("operator"),
    "note": N_("note"),
    "plate_mass_kg": N_("plate mass"),
}


@dataclass(frozen=True, slots=True)
class UndoAction:
    """How a change is taken back, and how that is called."""

    text: str
    task: UndoEdits | RestoreRuns


class UndoStack:
    """The changes that can be taken back, the last one first."""

    def __init__(self) -> None:
        self._undos: list[UndoAction] = []

    @property
    def text(self) -> str:
        """What would be taken back; empty where there is nothing."""
        return self._undos[-1].text if self._undos else ""

    def push(self, undo: UndoAction | None) -> None:
        """Remember a way back, if there is one."""
        if undo is not None:
            self._undos.append(undo)

    def pop(self) -> UndoEdits | RestoreRuns | None:
        """What is to be done to take the last change back."""
        return self._undos.pop().task if self._undos else None

    def clear(self) -> None:
        """There is no way back."""
        self._undos.clear()


def parse_field(field: str, text: str, all_series: Sequence[str]) -> str | float:
    """What was typed for a field, as a value. Raises ValueError with words for the operator."""
    text = text.strip()
    if field == "plate_mass_kg":
        return parse_mass_kg(text)
    if field != "series":
        return text
    if text.upper() not in all_series:
        example = all_series[0] if all_series else "1FFM0"
        raise ValueError(
            gettext(
                "Series {text!r} is not one of this stand: write one like {example}",
                text=text,
                example=example,
            )
        )
    return text.upper()


def change_text(change: Change, outcome: BatchOutcome) -> str:
    """What was done, with the runs that it was done to."""
    runs = run_count_text(outcome.done)
    match change:
        case EditRuns(field=field):
            return gettext("Changed the {field} of {runs}", field=gettext(_NAMES[field]), runs=runs)
        case UndoEdits():
            return gettext("Undone in {runs}", runs=runs)
        case TrashRuns():
            return gettext("Moved {runs} to the trash", runs=runs)
        case RestoreRuns():
            return gettext("Brought back {runs}", runs=runs)
        case CopyRuns():
            return gettext("Copied {runs} into this folder", runs=runs)


def outcome_chip(words: str, done: Sequence[str], faults: Sequence[str]) -> Chip:
    """Say what was done, in `words`, and what it failed for: the fault itself where it is one."""
    if not faults:
        return Chip(words, Tone.OK)
    said = f"{words}. " if done else ""
    if len(faults) == 1:
        return Chip(said + sentence(faults[0]), Tone.BAD)
    failed = ngettext("{count} run failed: see details", "{count} runs failed: see details", len(faults))
    return Chip(said + failed, Tone.BAD)


def undo_action(change: Change, outcome: BatchOutcome, author: str) -> UndoAction | None:
    """How `author` takes it back in the runs that it was done to; None where there is no way."""
    done = outcome.done
    if not done:
        return None
    match change:
        case EditRuns(field=field):
            words = gettext("change of {field}", field=gettext(_NAMES[field]))
            return UndoAction(words, UndoEdits(done, author, field))
        case TrashRuns():
            return UndoAction(
                gettext("move of {runs} to the trash", runs=run_count_text(done)), RestoreRuns(done)
            )
    return None
