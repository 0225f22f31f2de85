"""The figure of one test: the whole record, its own unit, and what was found."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from reports_kit import truth_of

from analysis.identify import identify
from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.record import Record
from analysis.synthetic import simulate_readings, simulate_record
from app.cli.analysis_text import print_analysis
from app.reports.figures.record_figure import figure_title, record_caption, record_figure
from app.reports.figures.run_figures import RUN_FIGURES, RunFigureData
from app.reports.figures.style import decimate_for_print, print_style
from app.runs.saved_analyses import analysis_document


@pytest.fixture(scope="module")
def swing():
    time_s = np.arange(0.0, 12.0, 1e-3)[:-1]
    exact = simulate(OneMassDecay(0.4, 0.15, 1e-3, 0.0, 0.3), time_s).displacement_m
    return single_channel(time_s, exact + 1e-3 * np.random.default_rng(1).standard_normal(len(time_s)))


@pytest.fixture(scope="module")
def found(swing):
    return identify_one_mass(swing, unit="rad")


@pytest.mark.parametrize("count", [8001, 11_999, 12_000, 50_003])
def test_print_keeps_the_end_of_the_record(count):
    time_s = np.arange(float(count))
    shown_s, shown = decimate_for_print(time_s, time_s)

    assert (shown[0], shown[-1]) == (0.0, count - 1.0)
    assert shown_s[-1] >= count - 1 - count / 4000
    assert (np.diff(shown) >= 0.0).all()


@pytest.mark.parametrize("unit", ["rad", "V", "deg"])
def test_readings_are_drawn_in_their_unit(swing, found, unit):
    with print_style():
        reading, residual = record_figure(swing, found, unit).axes
        run = RunFigureData.from_identification(swing, found, unit)
        (alone,) = RUN_FIGURES[0].render(run).axes

    for axes in (reading, residual, alone):
        assert axes.get_ylabel().endswith(f"({unit})")
    shown_s, shown = reading.lines[0].get_data()
    assert shown.max() == pytest.approx(swing.table_displacement_m.max())
    assert shown_s[-1] == pytest.approx(swing.time_s[-1], abs=0.01)
    assert np.abs(residual.lines[0].get_ydata()).max() < 0.01


def test_metres_are_drawn_as_millimetres_and_micrometres(swing, found):
    with print_style():
        reading, residual = record_figure(swing, found).axes

    assert reading.get_ylabel().endswith("(mm)")
    assert residual.get_ylabel().endswith("(µm)")
    assert reading.lines[0].get_ydata().max() == pytest.approx(1e3 * swing.table_displacement_m.max())


def test_the_title_of_one_mass_has_its_numbers_and_the_verdict(found):
    title = figure_title("Pendulum", found)

    assert title.startswith("Pendulum\n$T$ = 400.")
    for part in ("$n$ = 0.1", "$x_k$ = 0.00", "rad", "model fits"):
        assert part in title


def test_the_misfit_is_a_share_of_the_swing(swing, found, capsys):
    share = found.model.residual_share
    assert share == pytest.approx(1e-3 / (0.5 * np.ptp(swing.table_displacement_m)), rel=0.05)
    losses = SimpleNamespace(samples=1, missing=0, damaged=0, overloaded=0, missing_estimated=0)
    document = analysis_document(Path("a.h5"), None, losses, found)
    assert document["model"]["residual_share"] == share

    print_analysis(document, "rad")
    assert f"; {100.0 * share:.2g} % of the swing is left" in capsys.readouterr().out


@pytest.fixture(scope="module")
def pushed_back():
    """A pullback test whose plate was pushed back 4.5 s after the release, with readings that are absent."""
    truth = truth_of(duration_s=6.0)
    time_s, table, relative = simulate_readings(truth)
    moved = time_s > truth.hold_s + 4.5
    relative = relative + np.where(moved, 4e-3 * np.minimum(1.0, (time_s - truth.hold_s - 4.5) / 0.2), 0.0)
    table = table.copy()
    table[300:310] = np.nan
    record = Record.from_arrays(
        time_s, table, relative, table_mass_kg=truth.table_mass_kg, plate_mass_kg=truth.plate_mass_kg
    )
    return record, identify(record)


def test_residuals_of_each_gauge_have_a_panel_over_all_that_was_fitted(pushed_back):
    record, found = pushed_back
    end_s = found.events.free_decay_end_s
    assert end_s is not None
    with print_style():
        table, of_table, relative, of_relative = record_figure(record, found).axes

    for axes in (of_table, of_relative):
        assert axes.get_ylabel() == "residual (µm)"
        assert len([line for line in axes.lines if line.get_label() == "record − simulation"]) == 1
    for axes in (table, relative):
        shown_s = axes.lines[0].get_xdata()
        assert shown_s[0] == pytest.approx(max(-1.0, record.time_s[0] - found.events.release_s), abs=0.02)
        assert shown_s[-1] > end_s - found.events.release_s
        hatched = [patch for patch in axes.patches if patch.get_hatch()]
        assert [patch.get_x() for patch in hatched] == [pytest.approx(end_s - found.events.release_s)]
    marks = [line for line in table.lines if line.get_label() == "absent or overloaded"]
    assert [len(line.get_xdata()) for line in marks] == [10]
    assert not [line for line in relative.lines if line.get_label() == "absent or overloaded"]


def test_the_caption_explains_the_marks_that_the_figure_has(pushed_back):
    record, found = pushed_back
    assert "Shaded: slip. Hatched: not fitted, after the free decay. Red marks" in record_caption(
        record, found
    )

    whole = simulate_record(truth_of(duration_s=6.0))
    caption = record_caption(whole, identify(whole))
    assert caption.endswith("over all that was fitted. Shaded: slip.")
