"""Changes of runs: parsing of edited fields, messages, and the undo stack."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.presenters.base import Chip, Tone, run_count_text
from app.presenters.results import sentence
from app.presenters.runs.table import parse_mass_kg
from app.presenters.runs.tasks import BatchOutcome, CopyRuns, EditRuns, RestoreRuns, TrashRuns, UndoEdits
from messages.i18n import N_, gettext, ngettext

Change = EditRuns | UndoEdits | TrashRuns | RestoreRuns | CopyRuns
_FIELD_NAMES = {
    "series": N_("series"),
    "operator": N_("operator"),
    "note": N_("note"),
    "plate_mass_kg": N_("plate mass"),
}


@dataclass(frozen=True, slots=True)
class UndoAction:
    """A task that undoes a change, and its description."""

    text: str
    task: UndoEdits | RestoreRuns


class UndoStack:
    """Changes that can be undone, the last one first."""

    def __init__(self) -> None:
        self._undos: list[UndoAction] = []

    @property
    def text(self) -> str:
        return self._undos[-1].text if self._undos else ""

    def push(self, undo: UndoAction | None) -> None:
        """Push an action, unless it is None."""
        if undo is not None:
            self._undos.append(undo)

    def pop(self) -> UndoEdits | RestoreRuns | None:
        return self._undos.pop().task if self._undos else None

    def clear(self) -> None:
        self._undos.clear()


def parse_field(field: str, text: str, all_series: Sequence[str]) -> str | float:
    """Parse the text of a field. Raises ValueError that names value and remedy."""
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
    """Sentence about a change and its runs."""
    runs = run_count_text(outcome.done)
    match change:
        case EditRuns(field=field):
            return gettext("Changed the {field} of {runs}", field=gettext(_FIELD_NAMES[field]), runs=runs)
        case UndoEdits():
            return gettext("Undone in {runs}", runs=runs)
        case TrashRuns():
            return gettext("Moved {runs} to the trash", runs=runs)
        case RestoreRuns():
            return gettext("Brought back {runs}", runs=runs)
        case CopyRuns():
            return gettext("Copied {runs} into this folder", runs=runs)


def outcome_chip(words: str, done: Sequence[str], faults: Sequence[str]) -> Chip:
    """Chip of a change: `words`, and the fault, or the number of faults if there are several."""
    if not faults:
        return Chip(words, Tone.OK)
    said = f"{words}. " if done else ""
    if len(faults) == 1:
        return Chip(said + sentence(faults[0]), Tone.BAD)
    failed = ngettext("{count} run failed: see details", "{count} runs failed: see details", len(faults))
    return Chip(said + failed, Tone.BAD)


def undo_action(change: Change, outcome: BatchOutcome, author: str) -> UndoAction | None:
    """Action that undoes a change in the runs that were changed; None if it cannot be undone."""
    done = outcome.done
    if not done:
        return None
    match change:
        case EditRuns(field=field):
            words = gettext("change of {field}", field=gettext(_FIELD_NAMES[field]))
            return UndoAction(words, UndoEdits(done, author, field))
        case TrashRuns():
            return UndoAction(
                gettext("move of {runs} to the trash", runs=run_count_text(done)), RestoreRuns(done)
            )
    return None
