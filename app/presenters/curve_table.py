"""Drawn curves as a table of text, for a spreadsheet."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.message import MessageError

Floats = NDArray[np.float64]

MOST_ROWS = 500_000
"""More take seconds to write, and half of what a spreadsheet opens."""


class CurveTableError(MessageError):
    """The curves cannot be written as a table; the message says why and what to do."""


@dataclass(frozen=True, eq=False, slots=True)
class TableCurve:
    """Points (n,) of one curve, with the titles of both columns, units included; x may be names."""

    x_title: str
    title: str
    x: NDArray[Any]
    y: Floats

    def between(self, start: float, end: float) -> "TableCurve":
        """The points whose x is in a range."""
        seen = (self.x >= start) & (self.x <= end)
        return TableCurve(self.x_title, self.title, self.x[seen], self.y[seen])


def csv_text(curves: Sequence[TableCurve]) -> str:
    """Write columns with a line of titles; curves at the same x share its column. Raises CurveTableError.

    Numbers have all their digits; what is absent is empty.
    """
    if not curves:
        raise CurveTableError("there is no curve in view to save: reset the view, or open a run")
    if (rows := max(len(curve.x) for curve in curves)) > MOST_ROWS:
        raise CurveTableError(
            "{rows} rows are in view, and a table holds {most}: zoom in, or export the run",
            rows=rows,
            most=MOST_ROWS,
        )
    titles, columns = [], []
    for group in _with_common_x(curves):
        titles += [group[0].x_title, *(curve.title for curve in group)]
        columns += [_texts(group[0].x), *(_texts(curve.y) for curve in group)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(titles)
    writer.writerows(zip_longest(*columns, fillvalue=""))
    return text.getvalue()


def _with_common_x(curves: Sequence[TableCurve]) -> list[list[TableCurve]]:
    """Put neighbours that have the same x together."""
    groups: list[list[TableCurve]] = []
    for curve in curves:
        if groups and _have_common_x(groups[-1][0], curve):
            groups[-1].append(curve)
        else:
            groups.append([curve])
    return groups


def _have_common_x(one: TableCurve, other: TableCurve) -> bool:
    return one.x_title == other.x_title and np.array_equal(one.x, other.x)


def _texts(values: NDArray[Any]) -> list[str]:
    return ["" if value != value else str(value) for value in values.tolist()]
