"""State of the Runs screen."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from app.presenters.base import EMPTY_CHIP, Chip, Progress, Tone
from app.presenters.results import ResultRow
from messages.i18n import N_


class Column(StrEnum):
    """Columns of the table; the value is the title. The order of the screen is that of `USUAL_COLUMNS`."""

    NAME = N_("Run")
    DATE = N_("Recorded")
    SERIES = N_("Series")
    FRICTION = "f_d"
    VERDICT = N_("Model")
    NOTE = N_("Note")
    OPERATOR = N_("Operator")
    DURATION = N_("Length, s")
    ENDED = N_("Ended")
    PERIOD = "T, ms"
    DAMPING = "n₁, 1/s"
    SOURCE = N_("Source")
    TEMPERATURE = "°C"
    FILE = N_("File")


USUAL_COLUMNS = (
    Column.DATE,
    Column.SERIES,
    Column.NAME,
    Column.FRICTION,
    Column.PERIOD,
    Column.DAMPING,
    Column.VERDICT,
    Column.SOURCE,
    Column.TEMPERATURE,
    Column.NOTE,
)
"""Those that are shown until others are chosen; time and series are said once."""
COLUMN_HINTS = {
    Column.NAME: N_("number of the run in its series, or the name of the file"),
    Column.PERIOD: N_("period of the joint motion"),
    Column.DAMPING: N_("damping of the joint motion"),
    Column.SOURCE: N_("recorded from a stand, simulated, or imported"),
    Column.TEMPERATURE: N_("temperature"),
    Column.FRICTION: N_("dynamic friction coefficient"),
    Column.FILE: N_("name of the file"),
    Column.VERDICT: N_("whether the model explains the record"),
}
"""What titles mean that do not say it."""


class StatusFilter(StrEnum):
    """Condition on the state of a run; the value is the label."""

    ALL = N_("All runs")
    STALE = N_("Stale results")
    NOT_ANALYSED = N_("Not analysed")
    NOT_FITTING = N_("Model does not fit")
    FAULTY = N_("Cannot be read")


@dataclass(frozen=True, slots=True)
class RunFilter:
    """Filter of the table; empty text or series match every run."""

    text: str = ""
    series: str = ""
    status: StatusFilter = StatusFilter.ALL


@dataclass(frozen=True, slots=True)
class RunRow:
    """Row of the table: a text for each `Column`, and tone and hint of the verdict."""

    path: str
    cells: tuple[str, ...]
    results: Mapping[Column, ResultRow] = field(default_factory=dict)
    """Quantities that columns show, with uncertainties and units."""
    tone: Tone = Tone.PLAIN
    hint: str = ""


@dataclass(frozen=True, slots=True)
class MetadataField:
    """An editable field: its title, its hint, and its name in a sentence."""

    title: str
    hint: str
    name: str


METADATA_FIELDS = {
    "series": MetadataField(
        N_("Series"),
        N_("Series code, for example 1FFM0: it brings its pullback and plate mass"),
        N_("series"),
    ),
    "plate_mass_kg": MetadataField(
        N_("Plate mass, kg"), N_("Mass of the upper plate with its weights"), N_("plate mass")
    ),
    "operator": MetadataField(N_("Operator"), N_("Who recorded"), N_("operator")),
    "note": MetadataField(N_("Note"), N_("A remark kept with the run"), N_("note")),
}


@dataclass(frozen=True, slots=True)
class MetadataForm:
    """Metadata of the selected runs, as typed, by `METADATA_FIELDS`."""

    texts: dict[str, str]  # empty in fields of `mixed`
    mixed: frozenset[str] = frozenset()  # fields in which the runs differ


Span = tuple[float, float]


@dataclass(frozen=True, eq=False, slots=True)
class Trace:
    """One run of the overlay: both gauges (mm), (n,) each, decimated for drawing; NaN breaks the line."""

    name: str
    time_s: NDArray[np.float64]
    """From release; from the start of the record where no release is known."""
    table: NDArray[np.float64]
    relative: NDArray[np.float64] | None
    path: str = ""

    @property
    def is_decimated(self) -> bool:
        """Tell whether lowest and highest readings of spans stand for the rows."""
        return len(self.time_s) > 1 and bool(self.time_s[0] == self.time_s[1])

    def with_part(self, part: "Trace") -> "Trace":
        """The same with a finer part in its place."""
        if not len(part.time_s):
            return self
        before = self.time_s < part.time_s[0]
        after = self.time_s > part.time_s[-1]

        def joined(values: NDArray[np.float64], finer: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.concatenate((values[before], finer, values[after]))

        relative = None
        if self.relative is not None and part.relative is not None:
            relative = joined(self.relative, part.relative)
        time_s, table = joined(self.time_s, part.time_s), joined(self.table, part.table)
        return Trace(self.name, time_s, table, relative, self.path)


@dataclass(frozen=True, eq=False, slots=True)
class Overlay:
    """The selected runs, overlaid; `message` says which are not drawn, and why."""

    traces: tuple[Trace, ...] = ()
    time_label: str = ""
    unit: str = "mm"
    message: str = ""

    def with_parts(self, parts: tuple[Trace, ...]) -> "Overlay":
        """The same with finer parts of its runs, by their paths."""
        finer = {part.path: part for part in parts}
        traces = (
            trace.with_part(finer[trace.path]) if trace.path in finer else trace for trace in self.traces
        )
        return replace(self, traces=tuple(traces))


@dataclass(frozen=True, slots=True)
class SizeQuestion:
    """Whether displacements of an unlikely size are right."""

    text: str
    unit: str = ""
    """In which the size would be likely, as the form has it; empty where it would be in none."""
    symbol: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class ImportPreview:
    """The record of a file as it would be imported, and its length and rate as text."""

    overlay: Overlay
    summary: str
    question: SizeQuestion | None = None
    """What is to be answered before the import."""


@dataclass(frozen=True, slots=True)
class ImportOutcome:
    """Paths of imported runs, a line of text for each, and a line for each file that failed."""

    runs: tuple[str, ...]
    rows: tuple[str, ...]
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class BatchOutcome:
    """Paths of the runs that were processed, and a line for each that failed."""

    done: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


ANALYSING = N_("Analysing {name}, {number} of {all}")


@dataclass(frozen=True, slots=True)
class RunAnalysed:
    """A run has been analysed; `fault` says in one line why it failed."""

    path: str
    is_up_to_date: bool = False
    fault: str = ""


@dataclass(frozen=True, slots=True)
class RunsState:
    """State of the screen."""

    folder: str = ""
    in_trash: bool = False
    """Whether the runs are those in the trash of the folder."""
    rows: tuple[RunRow, ...] = ()
    """Runs that match the filter, sorted."""
    total: int = 0  # number of runs in the folder
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
    """Outcome of the last work; `details` holds a line for each fault."""
    details: tuple[str, ...] = ()
    undo_text: str = ""
    """Change that undo would undo; empty without one."""
