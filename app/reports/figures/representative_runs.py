"""Which runs stand for a campaign in its figures."""

from collections.abc import Sequence
from pathlib import Path

from analysis.campaign.campaign import Campaign
from analysis.campaign.rows import SeriesRow
from analysis.campaign.runs import RunResult
from app.runs.errors import RunNotFoundError

PAPER_SERIES = "1FFM0"
"""Figs. 3 to 5 of the paper show a run of it."""
_FRICTION = "friction_dynamic"


def representative_runs(
    campaign: Campaign, runs: Sequence[RunResult], wanted: Sequence[str] = ()
) -> list[Path]:
    """One run of each wanted series; by default of the paper's, or else of the first that tells f_d.

    It is the run whose f_d lies nearest to that of its series, among those that a friction law explains.
    Raises RunNotFoundError for a series without a run.
    """
    rows = {row.label: row for row in campaign.rows}
    if not wanted:
        told = [label for label, row in rows.items() if _FRICTION in row.quantities] or list(rows)
        wanted = [PAPER_SERIES] if PAPER_SERIES in told else told[:1]
    by_name = {run.name: run for run in runs}
    return [Path(_nearest(_row(rows, label), by_name)) for label in dict.fromkeys(wanted)]


def _row(rows: dict[str, SeriesRow], label: str) -> SeriesRow:
    row = rows.get(label) or rows.get(label.strip().upper())
    if row is None:
        raise RunNotFoundError(f"series {label!r} has no run there. Choose from {', '.join(rows)}")
    return row


def _nearest(row: SeriesRow, runs: dict[str, RunResult]) -> str:
    if _FRICTION not in row.quantities:
        return row.runs[0]
    mean = row.quantities[_FRICTION].quantity.value

    def distance(name: str) -> tuple[bool, float]:
        run = runs[name]
        found = run.results.get(_FRICTION)
        return run.adequate is False, float("inf") if found is None else abs(found.value - mean)

    return min(row.runs, key=distance)
