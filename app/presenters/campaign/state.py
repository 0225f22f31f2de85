"""State of the Campaign screen."""

from dataclasses import dataclass
from enum import StrEnum

from analysis.catalogue import Place, QuantityDefinition, TableColumn, optional_columns, table_columns
from analysis.quantities import Quantity
from app.presenters.base import EMPTY_CHIP, Chip, Progress
from messages.i18n import gettext


@dataclass(frozen=True, slots=True)
class Cell:
    """Value and uncertainty as text; `hint` says which runs they are from, or why there is no value."""

    value: str = ""
    uncertainty: str = ""
    hint: str = ""


@dataclass(frozen=True, slots=True)
class TableRow:
    """Row of Table 1: a series."""

    label: str  # unique in the table
    code: str  # series code; "" for runs without one
    runs: tuple["RunRow", ...]  # runs that are included
    cells: tuple[Cell, ...]  # in the order of the columns
    status: Chip = EMPTY_CHIP  # most important warning about the series

    @property
    def is_empty(self) -> bool:
        """Whether nothing is known of the series but its name."""
        return not self.runs and not self.status.text


def row_without_runs(code: str) -> TableRow:
    empty = Cell(hint=gettext("No run of {series} yet.", series=code))
    return TableRow(code, code, (), (empty,) * len(all_columns()))


def column_titles() -> tuple[tuple[str, str], ...]:
    """Symbol and unit of each column, in the paper's order."""
    return tuple((row.symbol.plain, row.unit_at(Place.WINDOW).symbol) for row, _ in all_columns())


def all_columns() -> tuple[tuple[QuantityDefinition, TableColumn], ...]:
    """Columns of the table, then those that are hidden at first."""
    return table_columns(optional_columns())


@dataclass(frozen=True, slots=True)
class ContactBars:
    """Bars of Fig. 2 for one contact: means over its series, and the series."""

    contact: str  # code and name
    name: str
    static: Quantity | None
    """None if no series determined it."""
    dynamic: Quantity | None
    static_of_series: tuple[Quantity, ...] = ()
    dynamic_of_series: tuple[Quantity, ...] = ()
    static_at_least: tuple[float, ...] = ()
    """Lower bounds of f_s, from series without a value."""
    ratio: str = ""  # f_s over f_d as text; "" if unknown


@dataclass(frozen=True, slots=True)
class EffectRow:
    """Whether f_d depends on `cause`."""

    cause: str
    conclusion: str
    sentence: str
    is_found: bool


@dataclass(frozen=True, slots=True)
class RepeatabilityRow:
    """Repeatability of f_d in a series."""

    label: str
    runs: int
    scatter: str
    """Relative standard deviation of the runs."""
    birge_ratio: str
    status: Chip = EMPTY_CHIP
    """Outliers, or that the runs differ."""


@dataclass(frozen=True, slots=True)
class RunRow:
    """Run of the selected series, or an excluded one with its `reason`."""

    path: str
    name: str
    friction: str
    uncertainty: str = ""
    status: Chip = EMPTY_CHIP
    reason: str = ""
    can_return: bool = False
    """Excluded by an operator, not for being a duplicate file of a recording."""


@dataclass(frozen=True, slots=True)
class NextTest:
    """The recommended next test: series, reason, expected results."""

    series: str
    reason: str
    expectations: tuple[str, ...] = ()


class Product(StrEnum):
    """Product of a campaign; the value is the label."""

    TABLE = "Table"
    FIGURES = "Figures"
    REPORT = "Report"


@dataclass(frozen=True, slots=True)
class CampaignScope:
    """Which runs are gathered: those of a folder, and for which series of the stand."""

    folder: str
    all_series: tuple[str, ...]
    counts_simulated: bool = False
    """Whether simulated runs count beside others."""


@dataclass(frozen=True, slots=True)
class CampaignSummary:
    """What the runs of a folder say together."""

    rows: tuple[TableRow, ...]
    """Every series of the stand in the paper's order, then other series of the runs."""
    contacts: tuple[ContactBars, ...] = ()
    effects: tuple[EffectRow, ...] = ()
    stand_effects: tuple[Chip, ...] = ()
    """Effects of the stand; those of single runs have a plain tone."""
    repeatability: tuple[RepeatabilityRow, ...] = ()
    next_test: NextTest | None = None
    excluded: tuple[RunRow, ...] = ()
    faults: tuple[str, ...] = ()
    """A line for each run without a result."""
    warnings: tuple[str, ...] = ()  # warnings about the runs together
    unsaved_count: int = 0  # number of runs whose result is not saved in them
    simulated_count: int = 0  # number of simulated runs in the folder
    is_mixed: bool = False  # whether there are others beside these
    simulated_counts: bool = False  # whether these are among the runs

    @property
    def run_count(self) -> int:
        return sum(len(row.runs) for row in self.rows)

    @property
    def series_count(self) -> int:
        return sum(bool(row.runs) for row in self.rows)


@dataclass(frozen=True, slots=True)
class CampaignState:
    """State of the screen."""

    folder: str
    summary: CampaignSummary
    columns: tuple[tuple[str, str], ...] = ()
    """Symbol and unit of each column."""
    selected: str = ""  # label of the row whose runs are listed
    undo_text: str = ""  # change that undo would undo; empty without one
    message: Chip = EMPTY_CHIP
    written_to: str = ""
    """Folder of the product that `message` is about; empty where it is about something else."""
    progress: Progress | None = None
    is_gathered: bool = False

    @property
    def selected_runs(self) -> tuple[RunRow, ...]:
        return next((row.runs for row in self.summary.rows if row.label == self.selected), ())
