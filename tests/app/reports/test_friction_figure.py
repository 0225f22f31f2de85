"""Fig. 2: bars, intervals and points are the numbers of the campaign."""

import pytest

from analysis.campaign.campaign import summarize
from analysis.campaign.contacts import friction_by_contact
from analysis.campaign.series import RunResult, SeriesKey
from analysis.quantities import Quantity
from app.reports.figures.figure_files import representative_runs
from app.reports.figures.run_figures import friction_figure
from app.reports.figures.style import print_style
from app.runs.errors import RunNotFoundError

NAMES = {"FF": "fluoroplastic on fluoroplastic", "SS": "steel on steel"}


def run(name, contact, pullback_m, adequate=True, **frictions):
    results = {f"friction_{part}": Quantity.normal(value, 1e-3, "1") for part, value in frictions.items()}
    code = f"{ {0.012: 1, 0.009: 2}[pullback_m] }{contact}M0"
    return RunResult(name, SeriesKey(code, contact, pullback_m, 22.4, 131.6), results, adequate=adequate)


RUNS = [
    run("a", "FF", 0.012, dynamic=0.1, static=0.2),
    run("b", "FF", 0.012, dynamic=0.102, static=0.2),
    run("c", "FF", 0.012, dynamic=0.11, static=0.2, adequate=False),
    run("d", "FF", 0.009, dynamic=0.12, static=0.2),
    run("e", "SS", 0.012, dynamic=0.13, static_lower=0.13, static_upper=0.15),
    run("f", "SS", 0.009, static_lower=0.3),
]
CAMPAIGN = summarize(RUNS)


@pytest.fixture(scope="module")
def axes():
    with print_style():
        return friction_figure(friction_by_contact(CAMPAIGN.rows), NAMES).axes[0]


def test_bars_are_the_means_over_series(axes):
    found = friction_by_contact(CAMPAIGN.rows)

    heights = [bar.get_height() for bar in axes.patches]
    means = [mean.value for one in found for mean in (one.static, one.dynamic)]
    assert heights == pytest.approx(means)
    assert found[0].contact == "FF"
    assert found[0].static.value == pytest.approx(0.2)
    assert found[1].static.value == pytest.approx(0.14), "the middle of the bounds"
    assert found[1].static_at_least == {"2SSM0": 0.3}


def test_every_bar_bears_its_interval(axes):
    found = friction_by_contact(CAMPAIGN.rows)
    drawn = [tuple(path.vertices[:, 1]) for lines in axes.collections for path in lines.get_paths()]

    for one in found:
        for mean in (one.static, one.dynamic):
            assert any(ends == pytest.approx(mean.interval_95, abs=1e-9) for ends in drawn), mean


def test_contacts_are_named_and_told_apart_without_colour(axes):
    labels = [label.get_text().replace("\n", " ") for label in axes.get_xticklabels()]
    shades = [sum(bar.get_facecolor()[:3]) for bar in axes.patches[:2]]

    assert labels == ["FF fluoroplastic on fluoroplastic", "SS steel on steel"]
    assert shades[1] - shades[0] > 0.3, "f_s is darker than f_d"


def test_nothing_to_show_gives_no_figure():
    with print_style():
        assert friction_figure(friction_by_contact(()), NAMES) is None


def test_the_run_that_stands_for_a_series_is_adequate_and_nearest_to_its_mean():
    assert [path.name for path in representative_runs(CAMPAIGN, RUNS)] == ["b"]
    assert [path.name for path in representative_runs(CAMPAIGN, RUNS, ["2ssm0", "1SSM0"])] == ["f", "e"]
    with pytest.raises(RunNotFoundError, match=r"9XX.*1FFM0"):
        representative_runs(CAMPAIGN, RUNS, ["9XX"])
