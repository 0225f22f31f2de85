"""Summaries of campaigns: rows and their order, excluded runs, and warnings."""

import subprocess
import sys
from dataclasses import replace

import pytest

from analysis.audit import KILOGRAM_FORCE_N
from analysis.campaign.campaign import compare_with_published, summarize
from analysis.campaign.series import SeriesKey
from analysis.quantities import BudgetLine, BudgetSource, ResultWarning
from app.reports.table.text import row_cells
from config.files import published_table
from messages.message import message
from tests.campaign_kit import FRICTION, VELOCITY, friction_run, key_of, run


def three(series, friction=0.1, **fields):
    label = series if isinstance(series, str) else series.label
    return [
        friction_run(f"{label}-{number}", series, friction + 1e-4 * number, **fields) for number in (-1, 0, 1)
    ]


def codes(campaign):
    return [caution.code for caution in campaign.warnings]


def test_rows_stand_in_the_papers_order():
    wanted = list(published_table())
    runs = [one for code in reversed(wanted) for one in three(code)]

    assert [row.label for row in summarize(runs).rows] == wanted


def test_order_of_the_runs_does_not_matter():
    runs = [*three("1FFM0"), *three("1SSM0", 0.13)]
    there, back = summarize(runs), summarize(runs[::-1])

    assert there.rows[0].quantities == back.rows[0].quantities
    assert there.effects == back.effects


def test_row_pools_its_runs_and_keeps_the_mass_as_weighed():
    (row,) = summarize(three("1FFM1")).rows

    assert row.quantities[FRICTION].quantity.value == pytest.approx(0.1)
    assert row.quantities[FRICTION].runs == 3
    assert row.quantities["plate_mass_kg"].quantity.value == 27.4
    assert row.quantities["plate_mass_kg"].birge_ratio is None
    assert row.runs == ("1FFM1--1", "1FFM1-0", "1FFM1-1")
    assert "period_s" not in row.quantities
    assert row.msk64_degree == "IX"


def test_what_the_stand_alone_decides_scatters_alike_whatever_rubs():
    values = {"1FFM0": (2.1, 2.2, 2.3), "1SSM0": (3.1, 3.2, 3.3), "1SSLM0": (4.1, 4.2, 4.3)}
    runs = [
        run(f"{code}-{number}", code, {"damping_n1_per_s": (n1, 0.1, 0.0), FRICTION: (n1 / 20.0, 0.005, 0.0)})
        for code, some in values.items()
        for number, n1 in enumerate(some)
    ]
    row = summarize(runs).rows[0]

    assert row.quantities["damping_n1_per_s"].degrees_of_freedom > 2.0
    assert row.quantities[FRICTION].degrees_of_freedom == 2.0


def test_degree_whose_velocity_reaches_over_a_bound_is_both():
    (row,) = summarize([run("a", "1FFM0", {VELOCITY: (0.1601, 0.0, 0.001)})]).rows

    assert row.msk64_degree == "VIII/IX"


def test_excluded_runs_are_listed_and_do_not_count():
    runs = three("1FFM0")
    runs[1] = replace(runs[1], excluded="bumped")
    campaign = summarize(runs)

    assert campaign.rows[0].quantities[FRICTION].runs == 2
    assert [(one.run, one.reason) for one in campaign.excluded] == [("1FFM0-0", "bumped")]


def test_outlier_is_named_and_counts():
    runs = [one for code in published_table() for one in three(code)]
    runs[4] = friction_run(runs[4].name, runs[4].series, 0.12)
    row = summarize(runs).rows[1]
    said = {caution.code: str(caution.message) for caution in row.warnings}

    assert row.quantities[FRICTION].outliers == (runs[4].name,)
    assert row.quantities[FRICTION].runs == 3
    assert runs[4].name in said["outlying-run"]
    assert "--exclude" in said["outlying-run"]
    assert "f_d (Birge ratio" in said["runs-differ"]


def test_masses_that_contradict_each_other_get_a_row_each():
    key = key_of("1FFM0")
    other = replace(key, plate_mass_kg=42.4)
    campaign = summarize([*three(key), friction_run("odd", other, 0.11)])

    assert [row.label for row in campaign.rows] == [
        "1FFM0 (m2 = 22.4 kg)",
        "1FFM0 (m2 = 42.4 kg)",
    ]
    assert [len(row.runs) for row in campaign.rows] == [3, 1]


def test_masses_that_differ_by_grams_are_the_same():
    key = key_of("1FFM0")
    campaign = summarize([*three(key), friction_run("x", replace(key, plate_mass_kg=22.41), 0.1)])

    assert [row.label for row in campaign.rows] == ["1FFM0"]


def test_runs_without_a_series_are_sorted_by_what_they_are():
    key = SeriesKey("", "PTFE", 0.012, 22.4, 131.6)
    campaign = summarize([*three(key), *three("1SSM0")], known_contacts=("FF", "SS", "SSL"))

    assert [row.label for row in campaign.rows] == ["PTFE 12 mm 22.4 kg", "1SSM0"]
    assert codes(campaign) == ["no-series", "unknown-contact"]
    assert "'PTFE'" in str(campaign.warnings[1].message)


def test_unknown_contact_without_a_name_stands_last():
    campaign = summarize([*three(SeriesKey("", "", None, 22.4, 131.6)), *three("1SSM0")])

    assert campaign.rows[-1].label == "contact unknown pullback unknown 22.4 kg"


def test_several_calibrations_are_said_and_shrink_the_shared_part():
    runs = three("1FFM0")
    campaign = summarize([runs[0], replace(runs[1], calibration_id="B")])

    assert codes(campaign) == ["several-calibrations"]
    assert len(campaign.rows[0].quantities[FRICTION].common) == 2


def test_what_is_said_of_runs_is_said_once_with_their_names():
    expired = (
        ResultWarning(
            "calibration-expired", message("the calibration of gauge 1 was valid until 2025-01-01.")
        ),
    )
    campaign = summarize(three("1FFM0", warnings=expired))

    assert codes(campaign) == ["calibration-expired"]
    assert str(campaign.warnings[0].message).startswith(
        "1FFM0--1, 1FFM0-0, 1FFM0-1: the calibration of gauge 1"
    )


def test_doubts_of_a_row_are_said():
    gain = BudgetLine(BudgetSource.GAUGE_1_GAIN_NOT_STATED, FRICTION, float("nan"))
    one = friction_run("a", "1FFM0", 0.1)
    one = replace(one, adequate=False, budget=(*one.budget, gain))
    none = run("b", "2FFM0", {VELOCITY: (0.2, 1e-4, 0.0)})
    campaign = summarize([one, none])

    assert [caution.code for caution in campaign.rows[0].warnings] == [
        "not-adequate", "single-run", "gain-not-stated",
    ]  # fmt: skip
    assert [caution.code for caution in campaign.rows[1].warnings] == ["no-friction"]


def test_a_run_whose_friction_holds_without_a_model_is_marked_otherwise_than_one_without():
    holds = replace(friction_run("a", "1FFM0", 0.1), adequate=False, friction_holds=True)
    campaign = summarize([holds])

    assert next(caution.code for caution in campaign.rows[0].warnings) == "friction-holds"
    assert row_cells(campaign.rows[0])[0] == "1FFM0~"


def test_ratio_of_static_to_dynamic_friction_by_contact():
    def both(name, series, static):
        values = {"friction_static": (static, 1e-4, 3e-3 * static), FRICTION: (0.1, 1e-4, 3e-4)}
        return run(name, series, values)

    bounded = {"friction_static_lower": (0.13, 1e-4, 0.0), "friction_static_upper": (0.14, 1e-4, 0.0)}
    campaign = summarize(
        [
            both("a", "1FFM0", 0.199),
            both("b", "2FFM0", 0.201),
            both("c", "3FFM0", 0.2),
            run("d", "1SSM0", bounded | {FRICTION: (0.13, 1e-4, 0.0)}),
        ]
    )
    ff, ss = campaign.ratios

    assert (ff.contact, ff.series) == ("FF", 3)
    assert ff.ratio.value == pytest.approx(2.0)
    assert ff.ratio.standard_uncertainty == pytest.approx(0.01 / 3.0**0.5, rel=1e-3)
    assert ff.between_series == pytest.approx(0.01)
    assert (ss.ratio, ss.series) == (None, 0)
    assert ss.bounds == pytest.approx((1.0, 0.14 / 0.13))


def test_nothing_gives_an_empty_campaign():
    campaign = summarize([])

    assert campaign.rows == ()
    assert campaign.msk64_degrees == ()


def test_print_stands_beside_what_was_found():
    values = {"stiffness_n_per_m": (66_000.0, 10.0, 0.0), FRICTION: (0.11, 0.005, 0.0)}
    key = SeriesKey("9XXM0", "XX", 0.012, 22.4, 131.6)
    rows = summarize([run("a", "1FFM0", values), friction_run("b", key, 0.1)]).rows
    beside = compare_with_published(rows, published_table())
    by_name = {one.name: one for one in beside["1FFM0"]}

    assert list(beside) == ["1FFM0"]
    assert by_name[FRICTION].difference == pytest.approx(0.01)
    assert by_name[FRICTION].normalised == pytest.approx(2.0)
    assert by_name["stiffness_n_per_m"].published == pytest.approx(6667.0 * KILOGRAM_FORCE_N)
    assert by_name["plate_mass_kg"].normalised is None


def test_import_does_without_the_distributions_of_scipy():
    """They take half a second; scipy.special has the same functions."""
    code = "import sys, analysis.campaign.campaign; sys.exit('scipy.stats' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
