"""The table in all formats: the same numbers, read by other programs; hostile texts stay texts."""

import csv
import io
import json
import re
from dataclasses import replace

import openpyxl
import pytest

from analysis.campaign.campaign import Excluded, compare_with_published, summarize
from analysis.campaign.series import SeriesKey
from analysis.formatting import format_concise
from app.reports.table.files import as_text, write_text, write_workbook
from app.reports.table.text import (
    PublishedRowComparison,
    TableContent,
    ratio_sentence,
    row_cells,
    table_headers,
)
from app.runs.errors import RunExistsError
from config.files import published_table
from tests.campaign_kit import FRICTION, VELOCITY, run

HOSTILE = '=HYPERLINK("http://x")|a_b%&$\\'


def values(friction):
    return {
        "stiffness_n_per_m": (59_375.0, 30.0, 112.0),
        "period_s": (0.32, 4e-6, 5e-6),
        "residual_displacement_m": (-0.010265, 1e-6, 3e-5),
        FRICTION: (friction, 3e-5, 2e-4),
        VELOCITY: (0.245, 1e-5, 5e-4),
        "friction_static_lower": (friction, 3e-5, 2e-4),
        "friction_static_upper": (friction + 0.01, 3e-5, 2e-4),
    }


@pytest.fixture(scope="module")
def content():
    runs = [
        run(f"{code}-{n}.h5", code, values(0.1 + 1e-5 * n))
        for code in ("1FFM0", "1FFM1", "1SSM0")
        for n in range(3)
    ]
    runs.append(run("odd.h5", SeriesKey("", HOSTILE, 0.012, 22.4, 131.6), values(0.2)))
    campaign = summarize(runs)
    campaign = replace(campaign, excluded=(Excluded("=bad.h5", HOSTILE),))
    printed = {
        label: PublishedRowComparison(figures, ("damping",))
        for label, figures in compare_with_published(campaign.rows, published_table()).items()
    }
    return TableContent(campaign, (), (("broken.h5", "it is no run. Leave it out"),), printed)


@pytest.mark.parametrize(
    ("value", "uncertainty", "shown"),
    [
        (0.10030, 0.00064, "0.10030(64)"),
        (-10.2653, 0.0996, "-10.27(10)"),
        (59_374.95, 115.9, "59370(120)"),
        (12.34, 1.2, "12.3(1.2)"),
        (12.34, 0.996, "12.3(1.0)"),
        (1234.0, 12.0, "1234(12)"),
        (0.1, 0.0, "0.1"),
        (22.4, float("nan"), "22.4"),
    ],
)
def test_uncertainty_stands_in_parentheses(value, uncertainty, shown):
    assert format_concise(value, uncertainty) == shown


def test_every_row_of_text_is_within_the_width(content):
    for width in (80, 120):
        lines = as_text(content, "text", width, with_repeats=True).splitlines()

        assert max(len(line) for line in lines if HOSTILE not in line and "--" not in line) <= width
        assert sum(line.startswith("1FFM0") for line in lines) >= 2


def test_text_says_all_that_is_to_be_known(content):
    text = " ".join(as_text(content, "text", 80).split())

    assert "0.10001(20)" in text
    assert "0.10001..0.11001" in text
    assert "1FFM0: damping" in text
    assert f"=bad.h5: {HOSTILE}" in text
    assert "broken.h5: it is no run" in text
    assert "No effect of the plate mass on f_d is found" in text
    assert "IX: all 4 series" in text
    assert "have no series (odd.h5)" in text


def test_ratio_of_frictions_has_its_interval_and_scatter():
    runs = [
        run(f"{code}.h5", code, {"friction_static": (static, 1e-5, 0.0), FRICTION: (0.1, 1e-5, 0.0)})
        for code, static in (("1FFM0", 0.199), ("2FFM0", 0.201), ("3FFM0", 0.2))
    ]
    (sentence,) = map(ratio_sentence, summarize(runs).ratios)

    assert sentence == "FF: 2.0000(58) (95 %: 1.975 to 2.025) over 3 series with a standard deviation of 0.01"


def test_what_is_said_of_many_series_is_said_once():
    runs = [run(f"{code}.h5", code, values(0.1)) for code in ("1FFM0", "1FFM1", "1FFM2", "1FFM3", "2FFM0")]
    text = " ".join(as_text(TableContent(summarize(runs)), "text", 80).split())

    assert text.count("one run alone determined f_d") == 1
    assert "The same applies to 4 other series: 1FFM1, 1FFM2, 1FFM3, 2FFM0" in text


def test_wide_text_is_one_block(content):
    header = as_text(content, "text", 1000).splitlines()[0]

    assert re.split(r" {2,}", header) == list(table_headers())


def test_csv_holds_all_digits_and_no_formula(content):
    rows = list(csv.DictReader(io.StringIO(as_text(content, "csv", 80))))
    row, pooled = rows[1], content.campaign.rows[1].quantities[FRICTION]

    assert float(row[FRICTION]) == pooled.quantity.value
    assert float(row[f"{FRICTION}_standard_uncertainty"]) == pooled.quantity.standard_uncertainty
    assert float(row[f"{FRICTION}_low_95"]) == pooled.quantity.interval_95[0]
    assert float(row[f"{FRICTION}_birge_ratio"]) == pooled.birge_ratio
    assert float(row[f"{FRICTION}_difference"]) == pytest.approx(pooled.quantity.value - 0.1)
    assert row["flags"] == "damping"
    assert row["friction_static"] == ""
    assert rows[0]["contact"] == f"'{HOSTILE}"


def test_json_is_the_interface(content):
    document = json.loads(as_text(content, "json", 80))
    row = document["rows"][1]

    assert document["schema"] == "slipstand-table/1"
    assert [one["series"] for one in document["rows"]] == [one.label for one in content.campaign.rows]
    assert row[FRICTION].keys() >= {
        "value",
        "standard_uncertainty",
        "interval_95",
        "unit",
        "runs",
        "birge_ratio",
    }
    assert "friction_static" not in row
    assert row["published"]["flags"] == ["damping"]
    assert [effect["cause"] for effect in document["effects"]] == [
        "plate mass", "pullback", "velocity", "contact",
    ]  # fmt: skip
    assert document["excluded"] == [{"run": "=bad.h5", "reason": HOSTILE}]
    assert document["failures"] == [{"run": "broken.h5", "error": "it is no run. Leave it out"}]
    assert document["ratios"][1]["bounds"][1] == pytest.approx(1.1, rel=1e-3)


def test_numbers_that_are_not_finite_are_null_in_json():
    odd = run("a", "1FFM0", {FRICTION: (0.1, 1e-4, 1e-4)})
    odd.results[FRICTION] = replace(odd.results[FRICTION], interval_95=(float("nan"), float("nan")))
    document = json.loads(as_text(TableContent(summarize([odd])), "json", 80))

    assert document["rows"][0][FRICTION]["interval_95"] is None


def test_markdown_is_a_table_whose_texts_stay_texts(content):
    lines = as_text(content, "markdown", 80, with_repeats=True).splitlines()
    table = [line for line in lines if line.startswith("|")][: 2 + len(content.campaign.rows)]

    assert {len(re.findall(r"(?<!\\)\|", line)) for line in table} == {len(table_headers()) + 1}
    assert "f\\_d" in table[0]
    assert "## Repeats" in lines


def test_latex_escapes_what_is_no_number(content):
    text = as_text(content, "latex", 80)
    body = text.split("\\midrule\n")[1].split("\\bottomrule")[0].splitlines()

    assert len(body) == len(content.campaign.rows)
    assert {line.count(" & ") for line in body} == {len(table_headers()) - 1}
    assert r"a\_b\%\&\$\textbackslash{}" in text
    assert "$-$10.265(30)" in body[0]
    assert "0.10001--0.11001" in body[1]
    after = text.split("\\end{tabular}\n\\endgroup\n")[1].splitlines()
    assert all(line.startswith("%") for line in after)


def test_latex_row_that_begins_as_an_option_does_not_become_one():
    """After the end of a row a bracket or an asterisk belongs to it."""
    rows = [run("a.h5", SeriesKey("", name, 0.012, 22.4, 131.6), values(0.1)) for name in ("[1", "*")]
    text = as_text(TableContent(summarize(rows)), "latex", 80)

    assert "\n{[}1 12 mm" in text
    assert "\n{*} 12 mm" in text


def test_workbook_has_the_numbers_and_no_formula(content, tmp_path):
    write_workbook(content, tmp_path / "t.xlsx")
    book = openpyxl.load_workbook(tmp_path / "t.xlsx")
    numbers = book["Numbers"]
    header = [cell.value for cell in numbers[1]]

    assert book.sheetnames == ["Table 1", "Numbers", "Repeats", "Notes", "Published"]
    shown = [cell.value or "" for cell in book["Table 1"][2]]
    assert shown == list(row_cells(content.campaign.rows[0]))
    assert (
        numbers.cell(2, header.index(FRICTION) + 1).value
        == content.campaign.rows[0].quantities[FRICTION].quantity.value
    )
    assert not [cell for sheet in book for row in sheet for cell in row if cell.data_type == "f"]
    assert book["Table 1"].max_column == len(table_headers())


def test_files_are_not_overwritten_unasked(tmp_path):
    (tmp_path / "t.csv").write_text("mine", "utf-8")
    with pytest.raises(RunExistsError):
        write_text("new", tmp_path / "t.csv")
    write_text("new", tmp_path / "t.csv", replace=True)

    assert (tmp_path / "t.csv").read_text("utf-8") == "new"
