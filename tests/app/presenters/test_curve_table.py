"""Drawn curves as tables, read back as a spreadsheet reads them."""

import csv
import io

import numpy as np
import pytest

from app.presenters import curve_table
from app.presenters.curve_table import CurveTableError, TableCurve, csv_text

X = np.array([0.0, 0.1, 0.30000000000000004])


def table(*curves: TableCurve) -> list[list[str]]:
    return list(csv.reader(io.StringIO(csv_text(curves))))


def test_curves_at_the_same_x_share_its_column_and_keep_all_digits() -> None:
    curves = [TableCurve("t, s", f"u{n}, mm", X.copy(), X + n) for n in (1, 2)]
    rows = table(*curves)
    assert rows[0] == ["t, s", "u1, mm", "u2, mm"]
    assert [[float(cell) for cell in row] for row in rows[1:]] == np.column_stack((X, X + 1, X + 2)).tolist()


def test_curves_at_other_x_have_columns_of_their_own_and_ends_are_empty() -> None:
    rows = table(
        TableCurve("t, s", "a, mm", X, X), TableCurve("t, s", "b, mm", X[:2], np.array([1.0, np.nan]))
    )
    assert rows == [
        ["t, s", "a, mm", "t, s", "b, mm"],
        ["0.0", "0.0", "0.0", "1.0"],
        ["0.1", "0.1", "0.1", ""],
        ["0.30000000000000004", "0.30000000000000004", "", ""],
    ]


def test_x_may_be_names() -> None:
    assert table(TableCurve("contact", "f_d", np.array(["FF", "SS"]), X[:2]))[1:] == [
        ["FF", "0.0"],
        ["SS", "0.1"],
    ]


def test_the_part_in_view_is_taken() -> None:
    part = TableCurve("t, s", "a, mm", X, 10.0 * X).between(0.05, 0.2)
    assert (part.x.tolist(), part.y.tolist()) == ([0.1], [1.0])


def test_no_curve_and_too_many_rows_are_refused_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CurveTableError, match="there is no curve in view to save: reset the view"):
        csv_text(())
    monkeypatch.setattr(curve_table, "MOST_ROWS", 2)
    with pytest.raises(CurveTableError, match="3 rows are in view, and a table holds 2: zoom in, or export"):
        csv_text((TableCurve("t, s", "a, mm", X, X),))
