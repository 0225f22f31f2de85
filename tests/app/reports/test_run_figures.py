"""Figs. 3a to 5b draw the recorded samples and the exact motion, the same bytes each time."""

import dataclasses

import numpy as np
import pytest
from matplotlib.markers import CARETDOWN, CARETUP
from reports_kit import truth_of

from analysis.identification import Events, Identification, ModelSelection
from analysis.identify import identify
from analysis.laws.stand_parts import stand_displacements
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.synthetic import simulate_record
from app.reports.figures.plate_figures import PLATE_FIGURES
from app.reports.figures.run_figures import RUN_FIGURES, RunFigureData
from app.reports.figures.style import FORMATS, print_style, save_figure

TRUTH = truth_of()
FIGURES = {one.number: one for one in RUN_FIGURES}


@pytest.fixture(scope="module")
def made():
    return simulate_record(TRUTH)


@pytest.fixture(scope="module")
def found(made):
    return identify(made)


@pytest.fixture(scope="module")
def drawn(made, found):
    return RunFigureData.from_identification(made, found)


def curves(number, run):
    """Label, times and values of the curves of a figure."""
    with print_style():
        (axes,) = FIGURES[number].render(run).axes
    return {str(line.get_label()).split(",")[0]: line.get_data() for line in axes.lines}


def test_experiment_is_the_record_from_the_rest_position(drawn):
    table, relative = TRUTH.parameters().simulate(7.0).sample_displacements(drawn.time_s)

    time_s, shown_mm = curves("3a", drawn)["experiment"]
    assert np.sqrt(np.mean((shown_mm - 1e3 * table) ** 2)) == pytest.approx(1e3 * TRUTH.noise_m, rel=0.1)
    _, shown_mm = curves("4a", drawn)["experiment"]
    assert np.sqrt(np.mean((shown_mm - 1e3 * relative) ** 2)) == pytest.approx(1e3 * TRUTH.noise_m, rel=0.1)
    assert time_s[0] == pytest.approx(-0.75 * TRUTH.period_s, abs=0.01)
    assert time_s[-1] == pytest.approx(drawn.slip_end_s + 5.0 * TRUTH.period_s, abs=0.01)


def test_simulation_is_the_exact_motion(drawn):
    exact = TRUTH.parameters().simulate(7.0)

    for number, label, column, scale, tolerance in (
        ("3a", "simulation", "table_displacement_m", 1e3, 0.02),
        ("3b", "table $u_1$", "table_displacement_m", 1e3, 0.02),
        ("4a", "simulation", "relative_displacement_m", 1e3, 0.02),
        ("4b", "$v_1$", "table_velocity_m_per_s", 1.0, 1e-3),
        ("4b", "$v_2$", "plate_velocity_m_per_s", 1.0, 1e-3),
    ):
        time_s, shown = curves(number, drawn)[label]
        assert np.abs(shown - scale * getattr(exact.sample(time_s), column)).max() < tolerance, (
            number,
            label,
        )
    time_s, shown = curves("3b", drawn)["plate $u_2$"]
    table, relative = exact.sample_displacements(time_s)
    assert np.abs(shown - 1e3 * (table + relative)).max() < 0.02


def test_acceleration_of_the_plate_is_plus_or_minus_friction_while_it_slides(drawn):
    time_s, plate = curves("5a", drawn)["$a_2$"]
    first_slip = (time_s > 0.002) & (time_s < 0.1)

    assert plate[first_slip] == pytest.approx(-0.1 * 9.81, rel=0.01)
    time_s, relative = curves("5b", drawn)["$a_2 - a_1$"]
    assert np.abs(relative[time_s > drawn.slip_end_s]).max() == 0.0


def test_largest_rates_stand_in_the_legend_with_uncertainty(drawn, found):
    with print_style():
        (axes,) = FIGURES["4b"].render(drawn).axes
    label = axes.get_legend().get_texts()[0].get_text()

    value = found.results["table_velocity_max_m_per_s"].value
    assert "±" in label
    assert float(label.split("most ")[1].split("\u00a0")[0]) == pytest.approx(value, abs=1e-4)


def test_reversed_gauges_draw_the_same_motion(drawn):
    turned = simulate_record(TRUTH)
    turned = turned.replace(relative_displacement_m=-turned.relative_displacement_m)
    reversed_run = RunFigureData.from_identification(turned, identify(turned))

    assert np.abs(reversed_run.relative_m - drawn.relative_m).max() < 5e-6


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_gauge_2_against_the_base_draws_the_relative_motion(side, drawn):
    made = simulate_record(TRUTH)
    against_base = made.relative_displacement_m + made.table_displacement_m
    made = made.replace(relative_displacement_m=side * against_base, gauge_2_measures_plate=True)
    run = RunFigureData.from_identification(made, identify(made))

    _, exact = TRUTH.parameters().simulate(7.0).sample_displacements(run.time_s)
    assert np.sqrt(np.mean((run.relative_m - exact) ** 2)) == pytest.approx(
        2.0**0.5 * TRUTH.noise_m, rel=0.15
    )


def test_run_without_slip_shows_the_record_alone():
    made = simulate_record(truth_of(friction_dynamic=0.8))
    still = RunFigureData.from_identification(made, identify(made))

    with print_style():
        shown = [one.number for one in RUN_FIGURES if one.render(still) is not None]
    assert shown == ["3a", "4a"]
    assert curves("3a", still).keys() == {"experiment"}


def test_run_without_gauge_2_shows_the_simulated_slip():
    made = simulate_record(TRUTH, relative_displacement_m=None)
    alone = RunFigureData.from_identification(made, identify(made))

    assert curves("4a", alone).keys() == {"simulation"}


def test_stribeck_friction_is_drawn_with_its_own_motion(made, drawn):
    own = {"release_s": 1.0, "stribeck_velocity_m_per_s": 0.005}
    found = Identification(
        "two-mass",
        {},
        model=ModelSelection("stribeck+tilt", adequate=True, residual_rms_m=2e-5, noise_rms_m=2e-5),
        parameters=dataclasses.asdict(truth_of(friction_static=0.12).parameters()) | own,
        events=Events(1.0, 4.0),
    )
    run = RunFigureData.from_identification(made, found)

    exact = STRIBECK_TILT.solver.simulate(truth_of(friction_static=0.12).parameters(), [0.005], 6.0)
    _, relative = exact.sample_displacements(run.motion.time_s)
    assert run.motion.relative_displacement_m == pytest.approx(relative, abs=1e-9)


def test_a_run_of_a_stand_with_effects_is_drawn_with_their_motion():
    displacements = stand_displacements(TRUTH.parameters(), {"release_ramp_s": 0.01}, 7.0)
    made = simulate_record(TRUTH, displacements)

    found = identify(made)
    run = RunFigureData.from_identification(made, found)

    assert found.model.parts == ("release-ramp",)
    assert found.parameters["release_ramp_s"] == pytest.approx(0.01, abs=5e-4)
    expected = displacements(run.motion.time_s)[1]
    assert run.motion.relative_displacement_m == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("ending", FORMATS)
def test_figures_repeat_to_the_byte_and_bear_no_date(ending, drawn, tmp_path):
    for name in ("first", "second"):
        with print_style():
            save_figure(FIGURES["3a"].render(drawn), tmp_path / f"{name}.{ending}")
    first = (tmp_path / f"first.{ending}").read_bytes()

    assert first == (tmp_path / f"second.{ending}").read_bytes()
    for word in (b"Date", b"matplotlib.org", b"Matplotlib v"):
        assert word not in first


def test_friction_by_slip_shows_each_slip_with_its_interval_and_the_slope(drawn, found):
    for figure in PLATE_FIGURES:
        with print_style():
            (axes,) = figure.render(drawn).axes
        (points,) = axes.containers
        beyond = axes.collections[-1].get_paths()
        assert len(points[0].get_xdata()) + len(beyond) == len(found.plate.friction)
        assert "95 %" in axes.get_legend().get_texts()[0].get_text()
    time_s = points[0].get_xdata()
    assert 0.0 < time_s[0] < time_s[-1] < drawn.slip_end_s
    assert PLATE_FIGURES[0].render(dataclasses.replace(drawn, plate=None)) is None


def test_an_interval_of_a_slip_beyond_the_axes_ends_in_an_arrow_within_them(drawn, found):
    wide = found.plate.friction_standard_uncertainty.copy()
    wide[-1] = 50.0 * wide.max()
    plate = dataclasses.replace(found.plate, friction_standard_uncertainty=wide)
    for figure in PLATE_FIGURES:
        with print_style():
            (axes,) = figure.render(dataclasses.replace(drawn, plate=plate)).axes
        low, high = axes.get_ylim()
        (points,) = axes.containers
        assert len(points[0].get_xdata()) == len(wide) - 1
        drawn_bars = [path.vertices[:, 1] for bars in axes.collections[1:] for path in bars.get_paths()]
        assert all(low <= bar.min() and bar.max() <= high for bar in drawn_bars)
        arrows = {line.get_marker(): line.get_ydata() for line in axes.lines}
        assert list(arrows[CARETUP]) == [high]
        assert list(arrows[CARETDOWN]) == [low]
