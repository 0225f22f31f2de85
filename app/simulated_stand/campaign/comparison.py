"""The table that was found beside what is true of it."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgspec

from analysis.campaign.columns import COLUMNS
from analysis.campaign.rows import SeriesRow
from app.simulated_stand.campaign.tests import (
    CampaignOptions,
    draw_errors,
    expected_results,
    series_parameters,
)
from config.schema import Gauges, Stand


class Comparison(msgspec.Struct, frozen=True):
    """One quantity of one series.

    Attributes
    ----------
    series, name : str
    value, standard_uncertainty : float
    interval_95 : (float, float)
    truth : float
    """

    series: str
    name: str
    value: float
    standard_uncertainty: float
    interval_95: tuple[float, float]
    truth: float

    @property
    def normalized_error(self) -> float:
        """Error in standard uncertainties."""
        return (self.value - self.truth) / self.standard_uncertainty

    @property
    def is_covered(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return self.interval_95[0] <= self.truth <= self.interval_95[1]


def series_truths(
    options: CampaignOptions, stand: Stand, gauges: Gauges, codes: Sequence[str]
) -> dict[str, Any]:
    """What is true of each series, by its code: the mean of its runs where they differ."""
    errors = draw_errors(stand, gauges, options.seed)
    return {code: expected_results(series_parameters(options, stand, errors, code), code) for code in codes}


def compare(rows: Sequence[SeriesRow], truths: Mapping[str, Mapping[str, Any]]) -> Iterator[Comparison]:
    """Every quantity of the table that was found, beside its truth."""
    for row in rows:
        truth = truths[row.series.code]
        for column in COLUMNS:
            if column.name in row.quantities:
                found = row.quantities[column.name].quantity
                low, high = found.interval_95
                yield Comparison(
                    row.series.code,
                    column.name,
                    float(found.value),
                    float(found.standard_uncertainty),
                    (float(low), float(high)),
                    float(truth[column.name]),
                )
