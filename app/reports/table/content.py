"""What a table says: the campaign, the print beside it, and what could not be taken."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from analysis.campaign.campaign import Campaign
from analysis.campaign.published import PublishedComparison
from analysis.campaign.rows import SeriesRow
from analysis.quantities import ResultWarning


@dataclass(frozen=True, slots=True)
class PublishedRowComparison:
    """A row of the published table: its figures beside those found, and what the audit says of it."""

    figures: tuple[PublishedComparison, ...]
    flags: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class TableContent:
    """All that goes into a table.

    Attributes
    ----------
    campaign : Campaign
    cautions : tuple of Caution
        What must be known beside what the campaign and its rows say themselves.
    failures : tuple of (str, str)
        Runs that gave no result, and why.
    published : dict of Printed or None
        By the labels of the rows; None where it was not asked for.
    """

    campaign: Campaign
    warnings: tuple[ResultWarning, ...] = ()
    failures: tuple[tuple[str, str], ...] = ()
    published: Mapping[str, PublishedRowComparison] | None = field(default=None)

    def all_warnings(self) -> list[ResultWarning]:
        """Those of the runs together, then of the campaign, then row by row."""
        of_rows = [caution for row in self.campaign.rows for caution in row.warnings]
        return [*self.warnings, *self.campaign.warnings, *of_rows]


def has_inadequate_run(row: SeriesRow) -> bool:
    """Tell whether no friction law explains one of the row's runs."""
    return any(caution.code == "not-adequate" for caution in row.warnings)
