"""How many rows a run has, as what they came, and which of them are held in the end."""

from collections import deque
from collections.abc import Callable
from dataclasses import fields

import numpy as np

from app.acquisition.stream.calibration import CalibratedBlock
from drivers.samples import INCOMPLETE, Losses, SampleStatus

_OVERLOAD = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
_COUNTED_BY_ROW = ("samples", "missing", "missing_estimated", "damaged", "overloaded")


class SampleStatistics:
    """Counts the rows of one run; together they are all its samples, each counted once as what it is."""

    def __init__(self) -> None:
        self._losses = Losses()
        self._absent = 0

    def add(self, rows: CalibratedBlock) -> None:
        """Count rows by their flags."""
        self._count(rows, 1)

    def remove(self, rows: CalibratedBlock) -> None:
        """Count rows no more that were added before."""
        self._count(rows, -1)

    def _count(self, rows: CalibratedBlock, sign: int) -> None:
        self._losses.samples += sign * len(rows)
        if not rows.status.any():
            return
        self._losses.damaged += sign * int(np.count_nonzero(rows.status & SampleStatus.DAMAGED))
        self._losses.overloaded += sign * int(np.count_nonzero(rows.status & _OVERLOAD))
        self._absent += sign * int(np.count_nonzero(rows.status & INCOMPLETE))

    def add_losses(self, added: Losses) -> None:
        """Take what a read added beside its rows: how many of the missing ones are only estimated, ..."""
        self._losses.missing_estimated += added.missing_estimated
        for field in fields(Losses):
            if field.name not in _COUNTED_BY_ROW:
                total = getattr(self._losses, field.name) + getattr(added, field.name)
                setattr(self._losses, field.name, total)

    def losses(self) -> Losses:
        """The account until now."""
        counted = {field.name: getattr(self._losses, field.name) for field in fields(Losses)}
        if self._absent:  # the first and the last read may have lost samples that are not of this run
            counted["missing_estimated"] = min(self._losses.missing_estimated, self._absent)
        # A device without time and sequence has no rows for what the rate says is lacking.
        counted["missing"] = max(0, self._absent - counted["missing_estimated"])
        return Losses(**counted)


class UncommittedRows:
    """Rows of a run that its journal may not have yet: where that fails, only the run file can have them.

    Parameters
    ----------
    held_index : callable
        Tells before which sample the journal has all.
    """

    def __init__(self, held_index: Callable[[], int]) -> None:
        self._held_index = held_index
        self._rows: deque[CalibratedBlock] = deque()

    def add(self, rows: CalibratedBlock) -> None:
        """Keep the rows that come next, and forget those that the journal has by now."""
        self._rows.append(rows)
        held_index = self._held_index()
        while self._rows and self._rows[0].end_index <= held_index:
            self._rows.popleft()

    def lost_after(self, stored_index: int) -> list[CalibratedBlock]:
        """Rows that are nowhere, where the run file has all before sample `stored_index`."""
        held_index = max(stored_index, self._held_index())
        rest = (rows.between(held_index, rows.end_index) for rows in self._rows)
        return [rows for rows in rest if len(rows)]
