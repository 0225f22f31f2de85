"""Changes of runs that the Runs screen offers: tasks, messages, and how they are undone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.presenters import number_text
from app.presenters.base import Chip, Tone, run_count_text
from app.presenters.results import sentence
from app.presenters.runs.state import METADATA_FIELDS
from app.presenters.worker import LazyModule
from messages.i18n import N_, gettext, ngettext

if TYPE_CHECKING:
    from app.presenters.runs import tasks
    from app.runs import edits, file_operations
else:
    tasks = LazyModule("app.presenters.runs.tasks")
    edits = LazyModule("app.runs.edits")
    file_operations = LazyModule("app.runs.file_operations")

Paths = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """A change of runs: `function(path, *arguments)` for each of them, as `tasks.change_runs` does it."""

    paths: Paths
    function: Callable[..., object]
    arguments: tuple[Any, ...]
    progress: str
    text: Callable[[str], str]  # makes the message of the name or the number of the changed runs
    undo: Callable[[Paths], "Change"] | None = None
    """Makes the change that undoes this one in the runs that were changed."""
    undone_text: str = ""  # description of the change that this one undoes


def edit(paths: Paths, field: str, value: object, author: str) -> Change:
    name = gettext(METADATA_FIELDS[field].name)
    return Change(
        paths,
        tasks.edit,
        (field, value, author),
        gettext("Editing"),
        lambda runs: gettext("Changed the {field} of {runs}", field=name, runs=runs),
        lambda done: Change(
            done,
            edits.undo_edit,
            (author, (field,)),
            gettext("Undoing"),
            lambda runs: gettext("Undone in {runs}", runs=runs),
            undone_text=gettext("change of {field}", field=name),
        ),
    )


def trash(paths: Paths) -> Change:
    return Change(
        paths,
        file_operations.move_to_trash,
        (),
        gettext("Moving to the trash"),
        lambda runs: gettext("Moved {runs} to the trash", runs=runs),
        lambda done: _undoing(
            restore(done), gettext("move of {runs} to the trash", runs=run_count_text(done))
        ),
    )


def restore(paths: Paths) -> Change:
    return Change(
        paths,
        file_operations.restore_from_trash,
        (),
        gettext("Bringing back"),
        lambda runs: gettext("Brought back {runs}", runs=runs),
        lambda done: _undoing(
            trash(done), gettext("return of {runs} from the trash", runs=run_count_text(done))
        ),
    )


def delete(paths: Paths) -> Change:
    """Deletion of trashed runs for ever."""
    return Change(
        paths,
        file_operations.delete_from_trash,
        (),
        gettext("Deleting"),
        lambda runs: gettext("Deleted {runs}", runs=runs),
    )


def _undoing(change: Change, undone_text: str) -> Change:
    """Make a change one that undoes another, and is not undone itself."""
    return replace(change, undo=None, undone_text=undone_text)


def copy(paths: Paths, folder: str) -> Change:
    return Change(
        paths,
        file_operations.copy_run_into,
        (Path(folder),),
        gettext("Copying"),
        lambda runs: gettext("Copied {runs} into this folder", runs=runs),
    )


def parse_field(field: str, text: str, all_series: Sequence[str]) -> str | float:
    """Parse the text of a field. Raises ValueError that names value and remedy."""
    text = text.strip()
    if field == "plate_mass_kg":
        mass_kg = number_text.parse_number(text)
        if mass_kg is None or not mass_kg > 0.0:
            raise ValueError(
                gettext(
                    "Plate mass {text!r} is not a number above 0: write it in kg, for example 22.4", text=text
                )
            )
        return mass_kg
    if field != "series":
        return text
    if text.upper() not in all_series:
        example = all_series[0] if all_series else "1FFM0"
        template = N_("Series {text!r} is not one of this stand: write one like {example}")
        raise ValueError(gettext(template, text=text, example=example))
    return text.upper()


def outcome_chip(words: str, done: Sequence[str], faults: Sequence[str]) -> Chip:
    """Chip of a change: `words`, and the fault, or the number of faults if there are several."""
    if not faults:
        return Chip(words, Tone.OK)
    if len(faults) == 1:
        failed = sentence(faults[0])
    else:
        failed = ngettext("{count} run failed: see details", "{count} runs failed: see details", len(faults))
    return Chip(f"{words}. {failed}" if done else failed, Tone.BAD)
