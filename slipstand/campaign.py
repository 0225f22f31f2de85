"""Many runs pooled: a row for each series, as `slipstand table` prints them."""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.campaign.campaign import Campaign
from app.reports.table.files import as_text, flat_table, table_document
from app.reports.table.text import TableContent, row_cells, table_headers
from app.runs.analysis_json import json_values
from app.runs.batch.executors import ExecutorOptions
from app.runs.campaign.collect import CollectOptions, collect_runs
from app.runs.campaign.origin import campaign_command

if TYPE_CHECKING:
    from pandas import DataFrame

_WIDTH = 1_000_000  # of lines that are not broken


@dataclass(frozen=True, eq=False, repr=False)
class PooledSeries:
    """The table of a campaign."""

    content: TableContent
    """The internal value. It may change with any version."""

    @property
    def campaign(self) -> Campaign:
        """Rows with pooled quantities, what f_d depends on, effects of the stand, warnings."""
        return self.content.campaign

    @property
    def failures(self) -> tuple[tuple[str, str], ...]:
        """Runs that gave no result, with the reason."""
        return self.content.failures

    def to_dict(self) -> dict[str, Any]:
        """The same as `slipstand table --json` prints."""
        document: dict[str, Any] = json_values(table_document(self.content))
        return document

    def to_dataframe(self) -> "DataFrame":
        """Values and uncertainties by series, a row each. Raises ImportError without pandas."""
        header, rows = flat_table(self.content)
        try:
            pandas = import_module("pandas")
        except ImportError as error:
            raise ImportError("to_dataframe needs pandas: pip install pandas") from error
        frame: DataFrame = pandas.DataFrame(list(rows), columns=list(header))
        return frame

    def __str__(self) -> str:
        return as_text(self.content, "text", _WIDTH).rstrip("\n")

    __repr__ = __str__

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(name)}</th>" for name in table_headers())
        rows = "".join(
            f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row_cells(row))}</tr>"
            for row in self.campaign.rows
        )
        warning = self.content.origin.warning
        above = f"<p><b>{escape(warning)}</b></p>" if warning else ""
        return f"{above}<table><tr>{head}</tr>{rows}</table>"


def pool(paths: str | PathLike[str] | Iterable[str | PathLike[str]]) -> PooledSeries:
    """Pool runs, given as files and folders, by series.

    The newest result that is kept in a run is taken if it still stands, else the run is identified.
    `slipstand analyze FOLDER --save` identifies many runs by all processors beforehand. Raises RunError where
    none of the runs gives a result.
    """
    given = [Path(path) for path in ([paths] if isinstance(paths, (str, PathLike)) else paths)]
    runs = collect_runs(given, CollectOptions(executor=ExecutorOptions(jobs=1)))
    runs.require_result()
    return PooledSeries(TableContent.of_runs(runs, campaign_command("table", given)))
