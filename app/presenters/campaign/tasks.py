"""Tasks of the Campaign screen; the worker process executes them in `work`."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from app.presenters.campaign.state import Product
from app.presenters.worker import LazyFunction
from messages.message import Message

if TYPE_CHECKING:  # the window does not load `analysis` before it needs a summary
    from analysis.campaign.campaign import Campaign
    from analysis.campaign.contacts import ContactFriction
    from analysis.quantities import Quantity

EXECUTE: Final = LazyFunction("app.presenters.campaign.work", "execute")
TARGET_REPEATS: Final = 3
"""Tests of each series that a campaign should have: the least that shows an outlier."""


@dataclass(frozen=True, slots=True)
class CollectRuns:
    """Collect and summarise the runs of a folder; with `save`, save new results in their runs."""

    folder: str
    all_series: tuple[str, ...]
    save: bool = False


@dataclass(frozen=True, slots=True)
class ExcludeRun:
    """Record in a run why it is excluded, or with an empty reason that it is not, and summarise again."""

    folder: str
    all_series: tuple[str, ...]
    path: str
    reason: str
    author: str


@dataclass(frozen=True, slots=True)
class UndoExclusion:
    """Undo the last exclusion or inclusion of a run, and summarise again."""

    folder: str
    all_series: tuple[str, ...]
    path: str
    author: str


@dataclass(frozen=True, slots=True)
class WriteProduct:
    """Write a product of the campaign to a file or folder."""

    folder: str
    product: Product
    target: str


@dataclass(frozen=True, slots=True)
class SimulateCampaign:
    """Simulate a campaign into a new folder below `folder`."""

    folder: str
    repeats: int = TARGET_REPEATS


CampaignTask = CollectRuns | ExcludeRun | UndoExclusion | WriteProduct | SimulateCampaign


@dataclass(frozen=True, eq=False, slots=True)
class PlannedTest:
    """Expected results of one more test."""

    series: str
    runs: int
    """Number of existing runs."""
    friction: "Quantity | None"
    """With the uncertainty of a single test."""
    pooled_friction: "Quantity | None"
    """Of the existing runs."""
    residual_displacement_m: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class CampaignRun:
    """Path, friction and adequacy of a run."""

    path: str
    friction: "Quantity | None"
    adequate: bool | None


@dataclass(frozen=True, eq=False, slots=True)
class CampaignData:
    """Summary of the runs of a folder."""

    campaign: "Campaign"
    contacts: "tuple[ContactFriction, ...]"
    contact_names: dict[str, str]
    """By code of the contact."""
    runs: dict[str, CampaignRun]
    """By path."""
    failures: tuple[tuple[str, Message], ...]
    """Path, and why there is no result."""
    warnings: tuple[Message, ...]
    excluded_by_operator: frozenset[str]
    """Paths of runs that can be included again."""
    unsaved_count: int
    """Number of runs whose result is not saved in them."""
    next_test: PlannedTest | None
