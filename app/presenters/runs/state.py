"""What the Runs screen shows, as values."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.presenters.base import EMPTY_CHIP, Chip, Progress, Tone
from messages.i18n import N_


class Column(StrEnum):
    """The columns of the table, in their order; the value is the title."""

    NAME = N_("Run")
    DATE = N_("Recorded")
    SERIES = N_("Series")
    FRICTION = "f_d"
    VERDICT = N_("Model")
    NOTE = N_("Note")
    OPERATOR = N_("Operator")
    DURATION = N_("Length, s")
    ENDED = N_("Ended")


class StatusFilter(StrEnum):
    """Which runs are wanted, beside series and words."""

    ALL = N_("All runs")
    STALE = N_("Stale results")
    NOT_ANALYSED = N_("Not analysed")
    NOT_FITTING = N_("Model does not fit")
    FAULTY = N_("Cannot be read")


@dataclass(frozen=True, slots=True)
class RunFilter:
    """What the operator looks for; empty words or series take everything."""

    text: str = ""
    series: str = ""
    status: StatusFilter = StatusFilter.ALL


@dataclass(frozen=True, slots=True)
class RunRow:
    """A line of the table: a text for each `Column`, and the tone and hint of the verdict."""

    path: str
    cells: tuple[str, ...]
    tone: Tone = Tone.PLAIN
    hint: str = ""


@dataclass(frozen=True, slots=True)
class MetadataForm:
    """What may be edited of the selected runs, as typed.

    Of several runs only what they agree on is shown; `mixed` names the fields in which they differ.
    """

    series: str = ""
    operator: str = ""
    note: str = ""
    plate_mass_kg: str = ""
    mixed: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False, slots=True)
class Trace:
    """One run of the overlay: both gauges (mm), condensed for drawing; NaN breaks the line.

    Attributes
    ----------
    name : str
    time_s : (n,) float64
        From release; from the start of the record where no release is known.
    table : (n,) float64
    relative : (n,) float64 or None
    """

    name: str
    time_s: NDArray[np.float64]
    table: NDArray[np.float64]
    relative: NDArray[np.float64] | None


@dataclass(frozen=True, eq=False, slots=True)
class Overlay:
    """The selected runs, drawn over one another; `words` says what is not drawn, and why."""

    traces: tuple[Trace, ...] = ()
    time_label: str = ""
    unit: str = "mm"
    message: str = ""


@dataclass(frozen=True, slots=True)
class RunsState:
    """The whole screen.

    `rows` are those wanted, sorted; `total` counts all of the folder. `undo` says what undoing would take
    back, empty where there is nothing. `message` tells what came of the last work, `details` each fault.
    """

    folder: str = ""
    rows: tuple[RunRow, ...] = ()
    total: int = 0
    is_listed: bool = False
    all_series: tuple[str, ...] = ()
    filter: RunFilter = RunFilter()
    sorted_by: Column = Column.DATE
    descending: bool = True
    selected: tuple[str, ...] = ()
    metadata: MetadataForm | None = None
    overlay: Overlay | None = None
    progress: Progress | None = None
    message: Chip = EMPTY_CHIP
    details: tuple[str, ...] = ()
    undo_text: str = ""


class RunsEvents(Protocol):
    """What the Runs screen tells its presenter."""

    def refresh(self) -> None:
        """Look into the folder again."""

    def choose_folder(self, folder: str) -> None:
        """Show the runs of another folder."""

    def set_filter(self, wanted: RunFilter) -> None:
        """Show only these runs."""

    def sort_by(self, column: Column) -> None:
        """Sort by a column; by the same again, the other way round."""

    def select(self, paths: tuple[str, ...]) -> None:
        """These runs are selected."""

    def open_selected(self) -> None:
        """Show the first selected run on Identify."""

    def edit(self, field: str, text: str) -> None:
        """Give a field of `Facts` a new value in all selected runs."""

    def undo(self) -> None:
        """Take back the last edit, or bring back what was put into the trash."""

    def trash(self) -> None:
        """Put the selected runs aside."""

    def analyse(self, *, anew: bool = False) -> None:
        """Identify the selected runs and keep the results in them; what is up to date only when `anew`."""

    def cancel(self) -> None:
        """Give up the work that goes on; what is done stays."""

    def add_files(self, paths: tuple[str, ...]) -> bool:
        """Files were dropped on the screen or chosen; True where some wait to be imported."""
