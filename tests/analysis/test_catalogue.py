"""The catalogue of quantities: complete, consistent, and the only place that a new column touches."""

import csv
import io
import json
import re
from dataclasses import replace

import pytest

from analysis import catalogue
from analysis.campaign.campaign import summarize
from analysis.catalogue import (
    CATALOGUE,
    MICROMETRE,
    MILLIMETRE,
    Place,
    QuantityDefinition,
    Symbol,
    TableColumn,
    Unit,
    definition,
    table_columns,
)
from analysis.quantities import Quantity
from app.presenters.campaign.state import column_titles
from app.reports.table.files import as_text
from app.reports.table.text import TableContent, row_cells, table_headers
from tests.campaign_kit import FRICTION, run

RATIO = QuantityDefinition(
    "stiffness_ratio", Symbol("q", "c"), "1", "ratio of stiffnesses", Unit("%", 100.0), column=TableColumn(99)
)


@pytest.fixture
def rows():
    def summarized():
        runs = [
            run(f"1FFM0-{n}.h5", "1FFM0", {FRICTION: (0.1, 1e-3, 0.0), "stiffness_ratio": (0.5, 1e-3, 0.0)})
            for n in range(2)
        ]
        return summarize(runs)

    return summarized


def test_every_name_stands_once_and_ends_with_its_unit():
    names = [row.name for row in CATALOGUE]
    suffixes = {
        "s": "_s",
        "1/s": "_per_s",
        "N/m": "_n_per_m",
        "m/s": "_m_per_s",
        "m/s2": "_m_per_s2",
        "m": "_m",
    }

    assert len(set(names)) == len(names)
    for row in CATALOGUE:
        assert row.unit not in suffixes or row.name.endswith(suffixes[row.unit]), row.name


def test_the_table_has_the_columns_of_the_paper_in_their_order():
    paper = (
        "series", "n", "m2 kg", "c N/m", "T s", "u_s mm", "n1 1/s", "n2 1/s", "f_s", "f_d", "v_max m/s",
        "a_max m/s²",
    )  # fmt: skip
    assert table_headers()[: len(paper)] == paper


@pytest.mark.parametrize(
    ("symbol", "text", "html", "latex", "plain"),
    [
        (Symbol("f", "d"), "f_d", "f<sub>d</sub>", "$f_d$", "f_d"),
        (Symbol("n", "1"), "n1", "n<sub>1</sub>", "$n_1$", "n₁"),
        (Symbol("v", "max"), "v_max", "v<sub>max</sub>", r"$v_{\mathrm{max}}$", "v_max"),
        (Symbol("μ", ascii="mu"), "mu", "μ", r"$\mu$", "μ"),
        (Symbol("f", "s", relation="≥"), "f_s", "f<sub>s</sub> ≥", "$f_s$", "f_s"),
    ],
)
def test_a_symbol_is_written_as_each_place_needs_it(symbol, text, html, latex, plain):
    assert (symbol.text, symbol.html, symbol.latex, symbol.plain) == (text, html, latex, plain)


def test_units_differ_by_place_where_the_catalogue_says_so():
    period = Quantity.normal(0.319942, 4.8e-5, "s")

    assert str(definition("period_s").format(period, Place.WINDOW)) == "319.942 ± 0.048 ms"
    assert str(definition("period_s").format(period, Place.TABLE)) == "0.319942 ± 0.000048 s"
    stiffness = Quantity.normal(59374.9, 116.0, "N/m")
    assert str(definition("stiffness_n_per_m").format(stiffness, Place.WINDOW)) == "59.37 ± 0.12 kN/m"
    assert str(definition("stiffness_n_per_m").format(stiffness, Place.REPORT)) == "59370 ± 120 N/m"


def test_readings_in_another_unit_keep_it():
    angle = Quantity.normal(0.0123, 1e-4, "rad")

    assert str(definition("coulomb_displacement_m").format(angle, Place.WINDOW)) == "0.01230 ± 0.00010 rad"


def test_what_is_not_in_the_catalogue_is_an_error():
    with pytest.raises(KeyError, match="colour"):
        definition("colour")


def test_a_new_column_is_one_row(monkeypatch, rows):
    from analysis.campaign import rows as pooling

    monkeypatch.setattr(catalogue, "CATALOGUE", (*CATALOGUE, RATIO))
    assert pooling.table_columns()[-1][0] is RATIO
    content = TableContent(rows())
    (row,) = content.campaign.rows

    assert table_headers()[-1] == "q_c %"
    assert row_cells(row)[-1].startswith("50.00")
    assert column_titles()[-1] == ("q_c", "%")
    for name in ("text", "markdown", "latex"):
        assert re.search(r"q\\?_c", as_text(content, name, 200))
    header, *_ = csv.reader(io.StringIO(as_text(content, "csv", 80)))
    assert "stiffness_ratio_standard_uncertainty" in header
    assert json.loads(as_text(content, "json", 80))["rows"][0]["stiffness_ratio"]["value"] == 0.5


def test_a_row_without_a_column_leaves_the_table(monkeypatch, rows):
    without = tuple(replace(row, column=None) if row.name == "period_s" else row for row in CATALOGUE)
    monkeypatch.setattr(catalogue, "CATALOGUE", without)
    content = TableContent(rows())

    assert "T s" not in table_headers()
    assert (
        len(table_columns())
        == len([row for row in CATALOGUE if row.column and not row.column.is_optional]) - 1
    )
    assert "period_s" not in as_text(content, "csv", 80)


def test_a_unit_writes_values_of_si_with_fixed_decimals() -> None:
    assert MILLIMETRE.text(0.0123, 2) == "12.30 mm"
    assert MICROMETRE.text(-0.01e-6, 1) == "0.0 µm"
    assert MILLIMETRE.number(float("nan"), 2) == "–"
    assert MICROMETRE.labelled("residual") == "residual (µm)"
