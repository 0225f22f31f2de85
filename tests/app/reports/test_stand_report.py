"""Report and figures of a run of a stand that is not ideal."""

from dataclasses import replace

import numpy as np
import pytest
from reports_kit import truth_of, write_run

from analysis.identification import Degree
from analysis.laws.stand_parts import stand_displacements
from analysis.plate.trends import trend_with_position, trend_with_time, trend_with_velocity
from app.reports.figures.plate_figures import PLATE_FIGURES
from app.reports.figures.run_figures import RunFigureData
from app.reports.figures.style import print_style
from app.reports.test_report.run_report import run_sections
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import analyze_run
from app.runs.reader import compute_fingerprint


@pytest.fixture(scope="module")
def analysis(tmp_path_factory):
    truth = truth_of(tilt_rad=1e-3, seed=4)
    effects = {"release_ramp_s": 0.011, "film_s_per_m": 1.0}
    motion = stand_displacements(truth.parameters(), effects, truth.duration_s + 1e-3)
    path = tmp_path_factory.mktemp("runs") / "run.h5"
    write_run(path, displacements=motion, tilt_rad=1e-3, seed=4)
    return analyze_run(path, AnalysisRequest())


def sections_of(analysis, **changes):
    model = replace(analysis.identification.model, **changes)
    found = replace(analysis.identification, model=model)
    changed = replace(analysis, identification=found)
    sections = run_sections(changed, compute_fingerprint(analysis.run.path), "slipstand report")
    return {section.title: section.blocks for section in sections}


@pytest.fixture(scope="module")
def sections(analysis):
    return sections_of(analysis)


def test_the_verdict_names_the_effects_and_the_section_about_the_stand_their_sizes(analysis, sections):
    conclusion = sections["Result"][1]
    assert analysis.identification.model.degree is Degree.STAND
    assert conclusion.tone == "ok"
    assert "on a stand with a viscous film + a slow release" in conclusion.text
    about = sections["About the stand"][0].texts
    ramp = analysis.identification.results["release_ramp_s"]
    assert abs(ramp.value - 0.011) < 4.0 * ramp.standard_uncertainty
    assert any(text.startswith("The release took 1") and text.endswith("(release-ramp)") for text in about)
    assert any(text.endswith("(film)") for text in about)
    assert not any("(film)" in text for text in getattr(sections["Warnings"][0], "texts", ()))


def test_models_are_told_apart_by_their_effects(analysis, sections):
    _, _, tried = sections["Results"]
    names = [row[0] for row in tried.rows]
    assert len(set(names)) == len(names)
    assert any(name.startswith("coulomb+tilt with a viscous film, a slow release") for name in names)


@pytest.mark.parametrize(
    ("degree", "tone", "verdict"),
    [
        (Degree.FRICTION, "warn", "but f_d holds: joint fit and friction of the plate agree (residual "),
        (Degree.NONE, "bad", ": f_d cannot be told (residual "),
    ],
)
def test_a_model_that_fails_says_how_far(analysis, degree, tone, verdict):
    sections = sections_of(analysis, degree=degree, adequate=False, residual_share=0.0025)
    conclusion = sections["Result"][1]
    assert conclusion.tone == tone
    assert conclusion.text.startswith("No model explains the record (0.25 % of the swing is left)")
    assert verdict in conclusion.text
    below = sections["Result"][2].text
    assert ("no expanded uncertainty is stated" in below) == (degree is Degree.NONE)
    assert ("k = 2" in below) == (degree is Degree.FRICTION)


def test_figures_by_slip_show_the_trends_of_the_plate(analysis):
    found = analysis.identification
    run = RunFigureData.from_identification(analysis.record, found)
    by_velocity, by_position = trend_with_velocity(found.plate), trend_with_position(found.plate)
    expected = {
        "fd-velocity": (1e3, by_velocity, "per 100 mm/s, zero outside 95 %"),
        "fd-position": (1e3, by_position, "per mm, zero "),
        "fd-time": (1.0, trend_with_time(found.plate, run.release_s), "per s, zero within 95 %"),
    }
    for figure in PLATE_FIGURES:
        scale, trend, said = expected[figure.number]
        with print_style():
            (axes,) = figure.render(run).axes
        (points,) = axes.containers
        low, high = trend.value_range()
        whole = (trend.friction - trend.half_width_95 >= low) & (trend.friction + trend.half_width_95 <= high)
        assert whole.sum() >= len(whole) - 1
        assert points[0].get_xdata() == pytest.approx(scale * trend.at[whole])
        assert points[0].get_ydata() == pytest.approx(trend.friction[whole])
        ends = np.array([path.vertices[:, 1] for path in points[2][0].get_paths()])
        assert ends[:, 1] - ends[:, 0] == pytest.approx(2.0 * trend.half_width_95[whole])
        assert said in axes.get_legend().get_texts()[0].get_text()
        low, high = axes.get_ylim()
        assert low < trend.level < high
    assert by_velocity.slope == pytest.approx(0.1, abs=4.0 * by_velocity.slope_standard_uncertainty)
