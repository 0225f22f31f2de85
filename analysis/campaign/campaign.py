"""A campaign summed up: a row a series, and what was left out and why."""

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.campaign.runs import RunResult, SeriesKey
from analysis.quantities import Caution, Quantity


@dataclass(frozen=True, slots=True)
class Pooled:
    """One quantity of one series, pooled over its runs.

    Attributes
    ----------
    quantity : Quantity
        Weighted mean with what it is worth, errors that repeats share included.
    runs : int
        How many runs determined it.
    repeatable, common : float
        Parts of the standard uncertainty that repeats make smaller, and that they do not.
    between_runs : float or None
        Standard deviation from run to run beyond what the readings' noise explains; None without repeats.
    scatter : float or None
        Standard deviation of the runs' values; None without repeats.
    birge_ratio : float or None
        Root of chi-square over degrees of freedom of the runs about their mean; None without repeats.
    degrees_of_freedom : float
        Effective, of the standard uncertainty.
    outliers : tuple of str
        Runs too far from the others; they count all the same.
    """

    quantity: Quantity
    runs: int
    repeatable: float
    common: float
    between_runs: float | None
    scatter: float | None
    birge_ratio: float | None
    degrees_of_freedom: float
    outliers: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class SeriesRow:
    """A row of the table.

    Attributes
    ----------
    label : str
        The code of the series, with the masses where the series has several; unique in a campaign.
    series : SeriesKey
    quantities : dict of Pooled
        By the names of `COLUMNS`; what no run determined is absent.
    friction_static_range : (float or None, float or None)
        Largest lower and smallest upper bound of f_s; None where there is none.
    msk64_degree : str
        Of the pooled v_max; "" without one.
    runs : tuple of str
    cautions : tuple of Caution
    """

    label: str
    series: SeriesKey
    quantities: dict[str, Pooled]
    friction_static_range: tuple[float | None, float | None]
    msk64_degree: str
    runs: tuple[str, ...]
    cautions: tuple[Caution, ...] = ()


@dataclass(frozen=True, slots=True)
class Excluded:
    """A run that does not count, and why."""

    run: str
    reason: str


@dataclass(frozen=True, eq=False, slots=True)
class Campaign:
    """All that the runs say together.

    Attributes
    ----------
    rows : tuple of SeriesRow
        In the paper's order.
    excluded : tuple of Excluded
    cautions : tuple of Caution
        Of the campaign; those of a series are in its row.
    """

    rows: tuple[SeriesRow, ...]
    excluded: tuple[Excluded, ...] = ()
    cautions: tuple[Caution, ...] = ()


def summarize(runs: Sequence[RunResult]) -> Campaign:
    """Sum up runs: a row a series in the paper's order."""
    raise NotImplementedError
