"""What the Campaign screen shows, as values."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from app.presenters.base import EMPTY_CHIP, Chip, Progress


@dataclass(frozen=True, slots=True)
class Cell:
    """A quantity of a series: value and uncertainty as text; `hint` says where from, or what is missing."""

    value: str = ""
    uncertainty: str = ""
    hint: str = ""


@dataclass(frozen=True, slots=True)
class TableRow:
    """A series of Table 1.

    Attributes
    ----------
    label : str
        Unique in the table.
    code : str
        Series code; "" for runs without one.
    runs : int
        That count.
    cells : tuple of Cell
        In the order of the columns.
    mark : Chip
        What must be known of the series; empty where nothing.
    """

    label: str
    code: str
    runs: int
    cells: tuple[Cell, ...]
    status: Chip = EMPTY_CHIP


@dataclass(frozen=True, slots=True)
class Bar:
    """A value with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ContactBars:
    """Fig. 2 of one contact: means over the series, and the series themselves.

    Attributes
    ----------
    contact, name : str
        Code, and what it stands for.
    static, dynamic : Bar or None
        None where no series determined it.
    static_of_series, dynamic_of_series : tuple of Bar
    static_at_least : tuple of float
        Of series that bound f_s from below alone.
    ratio : str
        f_s over f_d as text; "" where not known.
    """

    contact: str
    name: str
    static: Bar | None
    dynamic: Bar | None
    static_of_series: tuple[Bar, ...] = ()
    dynamic_of_series: tuple[Bar, ...] = ()
    static_at_least: tuple[float, ...] = ()
    ratio: str = ""


@dataclass(frozen=True, slots=True)
class EffectRow:
    """Whether f_d depends on something: in a word and in a sentence."""

    cause: str
    conclusion: str
    sentence: str
    is_found: bool


@dataclass(frozen=True, slots=True)
class RepeatabilityRow:
    """How well the f_d of a series repeats.

    Attributes
    ----------
    label : str
    runs : int
    scatter : str
        Standard deviation of the runs, relative.
    birge : str
    mark : Chip
        Outliers by name, or that the runs differ.
    """

    label: str
    runs: int
    scatter: str
    birge_ratio: str
    status: Chip = EMPTY_CHIP


@dataclass(frozen=True, slots=True)
class RunRow:
    """A run of the chosen series, or one that is left out (`reason`)."""

    path: str
    name: str
    friction: str
    uncertainty: str = ""
    status: Chip = EMPTY_CHIP
    reason: str = ""
    can_return: bool = False
    """Left out by somebody, and can be taken in again; not so the second file of a recording."""


@dataclass(frozen=True, slots=True)
class NextTest:
    """Which test to make next: the series, why that one, and what to expect of it."""

    series: str
    reason: str
    expectations: tuple[str, ...] = ()


class Product(StrEnum):
    """What can be written of a campaign; the value is how it is called."""

    TABLE = "Table"
    FIGURES = "Figures"
    REPORT = "Report"


@dataclass(frozen=True, slots=True)
class CampaignState:
    """The whole screen.

    Attributes
    ----------
    folder : str
    columns : tuple of (str, str)
        Symbol and unit of each column.
    rows : tuple of TableRow
        Every series of the stand in the paper's order, and others that the runs have.
    runs, series : int
        That count.
    contacts, effects, spread, next_test
        See there.
    chosen : str
        Label of the row whose runs are `of_chosen`.
    left_out : tuple of RunLine
    faults : tuple of str
        Runs without a result, a line each.
    notes : tuple of str
        What must be known of the runs together.
    unsaved : int
        Runs whose result is not kept in them.
    undo : str
        What undoing would take back.
    is_gathered : bool
    """

    folder: str = ""
    columns: tuple[tuple[str, str], ...] = ()
    rows: tuple[TableRow, ...] = ()
    runs: int = 0
    series: int = 0
    contacts: tuple[ContactBars, ...] = ()
    effects: tuple[EffectRow, ...] = ()
    repeatability: tuple[RepeatabilityRow, ...] = ()
    next_test: NextTest | None = None
    selected: str = ""
    selected_runs: tuple[RunRow, ...] = ()
    excluded: tuple[RunRow, ...] = ()
    faults: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    unsaved_count: int = 0
    undo_text: str = ""
    message: Chip = EMPTY_CHIP
    progress: Progress | None = None
    is_gathered: bool = False


class CampaignEvents(Protocol):
    """What the Campaign screen tells its presenter."""

    def refresh(self) -> None:
        """Gather the folder again."""

    def choose_folder(self, folder: str) -> None:
        """Gather another folder."""

    def cancel(self) -> None:
        """Give up what goes on."""

    def select_series(self, label: str) -> None:
        """Show the runs of a row."""

    def open_row(self, label: str) -> None:
        """Show the runs of a row on the Runs screen."""

    def open_run(self, path: str) -> None:
        """Show a run on Identify."""

    def exclude_run(self, path: str, reason: str) -> None:
        """A run does not count, from now on."""

    def include_run(self, path: str) -> None:
        """A run that was left out counts again."""

    def undo(self) -> None:
        """Take back the last leaving out or taking in."""

    def save_results(self) -> None:
        """Keep new results in their runs."""

    def export(self, product: Product, target: str) -> None:
        """Write something of the campaign to a file or folder."""

    def simulate_campaign(self, folder: str) -> None:
        """Simulate a whole campaign into a folder, and show it."""

    def show_record(self) -> None:
        """Go and record."""
