"""The runs of a folder as last listed: which lines they make, and what is known of those selected."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.presenters.runs import table
from app.presenters.runs.state import Column, MetadataForm, RunFilter, RunRow

if TYPE_CHECKING:
    from app.runs.summary import RunSummary


class RunList:
    """Runs by their paths; a line is made anew only where its run has changed."""

    def __init__(self) -> None:
        self._by_path: dict[str, RunSummary] = {}
        self._lines: dict[str, tuple[RunSummary, RunRow]] = {}

    def set_runs(self, runs: "Sequence[RunSummary]") -> None:
        """These are the runs from now on."""
        self._by_path = {run.path: run for run in runs}

    def rows(self, wanted: RunFilter, by: Column, *, descending: bool) -> tuple[RunRow, ...]:
        """Lines of the runs that are wanted, sorted by a column."""
        kept = table.select_runs(self._by_path.values(), wanted, by, descending=descending)
        return tuple(self._line(run) for run in kept)

    def metadata(self, paths: Sequence[str]) -> MetadataForm | None:
        """What may be edited of these runs; None where that is nothing."""
        return table.metadata_form([self._by_path[path] for path in paths])

    def readable(self, paths: Sequence[str]) -> tuple[str, ...]:
        """Those of these runs that can be read."""
        return tuple(path for path in paths if not self._by_path[path].fault)

    def fault(self, path: str) -> str:
        """Why a run cannot be read; empty if it can."""
        return self._by_path[path].fault

    def _line(self, run: "RunSummary") -> RunRow:
        known = self._lines.get(run.path)
        if known is None or known[0] != run:
            known = run, table.make_row(run)
            self._lines[run.path] = known
        return known[1]
