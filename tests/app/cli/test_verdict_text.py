"""What `analyze` prints of verdict, effects of the stand and friction of the plate, for each degree."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from analysis.catalogue import CATALOGUE
from analysis.identification import Degree, Events, FittedModel, Identification, ModelSelection
from analysis.motion.two_mass import PEAK_RATES
from analysis.quantities import BudgetLine, BudgetSource, Quantity, result_warning
from analysis.results.diagnosis import SENTENCES
from app.cli.analysis_text import print_analysis
from app.runs.analyze import analysis_document

FRICTION = {
    "friction_dynamic": Quantity.normal(0.1, 8.7e-5, "1"),
    "friction_dynamic_plate": Quantity.normal(0.1006, 1.8e-4, "1"),
}
IDEAL = ModelSelection(
    "coulomb+tilt", True, 2.0e-5, 2.0e-5,
    (FittedModel("coulomb", 7583610.5, 3.92e-4, 0.109), FittedModel("coulomb+tilt", 19869.6, 2.0e-5, 0.1)),
    Degree.IDEAL, (), 0.0017,
)  # fmt: skip
STAND = replace(
    IDEAL,
    degree=Degree.STAND,
    parts=("release-ramp", "film"),
    tried=(*IDEAL.tried, FittedModel("coulomb+tilt", 9869.6, 2.0e-5, 0.1, ("release-ramp", "film"))),
)
FAILED = replace(IDEAL, adequate=False, residual_rms_m=1.26e-4, residual_share=0.013)
RAMP = result_warning("release-ramp", SENTENCES["release-ramp"], size="11.006 ± 0.012 ms")
SHORT = result_warning("tail-too-short", "the stick tail is shorter than two periods.")


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]):
    def text_of(model: ModelSelection, results=FRICTION, **facts) -> str:
        found = Identification("two-mass", results, {}, model, events=Events(1.0, 2.0), **facts)
        losses = SimpleNamespace(samples=1, missing=0, damaged=0, overloaded=0, missing_estimated=0)
        print_analysis(analysis_document(Path("a.h5"), None, losses, found))
        return capsys.readouterr().out

    return text_of


def test_an_ideal_stand_is_explained_and_nothing_is_said_about_it(printed) -> None:
    said = printed(IDEAL)
    assert (
        "\n  coulomb+tilt explains the record (residual 20 µm, noise 20 µm; 0.17 % of the swing is left)"
        in said
    )
    assert "\n  f_d           0.100000 ± 0.000087\n  f_dp          0.10060 ± 0.00018\n" in said
    assert "about the stand" not in said


def test_effects_of_a_stand_are_named_with_size_and_remedy_apart_from_warnings(printed) -> None:
    said = printed(STAND, warnings=[SHORT, RAMP])
    assert "\n  coulomb+tilt on a stand with a slow release + a viscous film explains the record (" in said
    about = "  about the stand:\n    release-ramp: the release took 11.006 ± 0.012 ms: use a sharper hook.\n"
    assert f"{about}  warning tail-too-short: the stick tail" in said
    assert "warning release-ramp" not in said


def test_models_that_were_tried_stand_below_each_other(printed) -> None:
    lines = printed(STAND).splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("  tried"))
    assert lines[first : first + 3] == [
        "  tried         coulomb (BIC 7583610.5, residual 392 µm)",
        "                coulomb+tilt (BIC 19869.6, residual 20 µm)",
        "                coulomb+tilt + release-ramp + film (BIC 9869.6, residual 20 µm)",
    ]


def test_friction_that_holds_is_said_with_the_share_that_is_left(printed) -> None:
    lines = [BudgetLine(BudgetSource.MODEL, "friction_dynamic", 6e-4)]
    said = printed(replace(FAILED, degree=Degree.FRICTION), budget=lines)
    verdict = "no model explains the record (1.3 % of the swing is left), but f_d holds"
    assert (
        f"\n  {verdict}: joint fit and friction of the plate agree (residual 126 µm, noise 20 µm)\n" in said
    )
    assert "\n  ± of f_d      model 0.0006\n" in said


def test_friction_that_cannot_be_told_is_said_so(printed) -> None:
    said = printed(replace(FAILED, degree=Degree.NONE))
    assert (
        "\n  no model explains the record (1.3 % of the swing is left): f_d cannot be told (residual" in said
    )


def test_without_three_slips_there_is_no_friction_of_the_plate(printed) -> None:
    said = printed(IDEAL, {"friction_dynamic": FRICTION["friction_dynamic"]})
    assert "f_dp" not in said


def test_no_label_of_a_quantity_runs_into_its_value(printed) -> None:
    rows = [row for row in CATALOGUE if row.symbol.index != "k"]
    lines = printed(STAND, {row.name: Quantity.normal(0.1, 0.001, "1") for row in rows}).splitlines()
    assert "  zeta3         0.1000 ± 0.0010" in lines
    for row in rows:
        if not row.is_minor and not row.symbol.relation and row.name not in PEAK_RATES:
            assert any(line.startswith(f"  {row.symbol.text} ") for line in lines), row.name
