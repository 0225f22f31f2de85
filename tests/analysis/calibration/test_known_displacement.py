"""A gauge against a known displacement: tolerance by JCGM 100, and how often a sound gauge passes."""

import math

import numpy as np
import pytest

from analysis.calibration.known_displacement import (
    CalibrationClaim,
    DisplacementCheck,
    MeanReading,
    ReferenceDisplacement,
    check_displacement,
)
from analysis.calibration.points import CalibrationError

CLAIM = CalibrationClaim(gain_relative=0.002, nonlinearity_m=6e-6, repeatability_m=2e-6)
BLOCK = ReferenceDisplacement(0.010, 3e-6)


def checked(
    moved_m: float,
    rest_m: float = 0.0,
    reference: ReferenceDisplacement = BLOCK,
    claim: CalibrationClaim = CLAIM,
) -> DisplacementCheck:
    return check_displacement(
        MeanReading(rest_m, 20e-6, 2000), MeanReading(rest_m + moved_m, 20e-6, 2000), reference, claim
    )


def test_the_combined_uncertainty_is_that_of_a_sum_by_hand() -> None:
    parts_m = [
        0.002 * 0.010,
        3e-6,
        20e-6 / math.sqrt(2000) * math.sqrt(2.0),
        6e-6 / math.sqrt(3.0) * math.sqrt(2.0),
        2e-6 * math.sqrt(2.0),
    ]
    found = checked(0.010)
    assert found.standard_uncertainty_m == pytest.approx(math.sqrt(sum(u * u for u in parts_m)), rel=1e-12)
    assert [line.standard_uncertainty for line in found.budget] == pytest.approx(parts_m)
    assert found.tolerance_m == 2.0 * found.standard_uncertainty_m
    assert found.warnings == ()


def test_just_within_passes_and_just_beyond_fails() -> None:
    tolerance_m = checked(0.010).tolerance_m
    assert checked(0.010 + 0.999 * tolerance_m).passed
    assert not checked(0.010 + 1.001 * tolerance_m).passed
    assert not checked(0.010 - 1.001 * tolerance_m).passed


@pytest.mark.parametrize("rest_m", [-0.02, 0.0, 0.5])
def test_where_the_gauge_rests_does_not_count(rest_m: float) -> None:
    assert checked(0.010_01, rest_m).deviation_m == pytest.approx(10e-6, abs=1e-15)


def test_a_sound_gauge_passes_in_95_of_100() -> None:
    """With every source drawn as it is stated, non-linearity even within its bounds (JCGM 100, 4.3.7)."""
    random, tries = np.random.default_rng(4), 4000
    passed = 0
    for _ in range(tries):
        true_m = 0.010 + 3e-6 * random.standard_normal()
        means_m = [
            place_m * (1.0 + gain)
            + 6e-6 * random.uniform(-1.0, 1.0)
            + 2e-6 * random.standard_normal()
            + 20e-6 / math.sqrt(2000) * random.standard_normal()
            for gain in [0.002 * random.standard_normal()]
            for place_m in (0.0, true_m)
        ]
        rest, moved = (MeanReading(mean_m, 20e-6, 2000) for mean_m in means_m)
        passed += check_displacement(rest, moved, BLOCK, CLAIM).passed
    assert 0.945 <= passed / tries <= 0.965


def test_a_shunt_does_not_ask_how_straight_the_gauge_is() -> None:
    found = checked(0.010, reference=ReferenceDisplacement(0.010, 0.0, is_electric=True))
    assert {str(line.source) for line in found.budget} == {
        "gain of the calibration", "known displacement", "readings"
    }  # fmt: skip


def test_creep_counts_as_an_even_distribution() -> None:
    still, creeping = MeanReading(0.0, 1e-6, 100), MeanReading(0.0, 1e-6, 100, creep_m=12e-6)
    assert still.standard_uncertainty_m == pytest.approx(1e-7)
    assert creeping.standard_uncertainty_m == pytest.approx(math.hypot(1e-7, 12e-6 / math.sqrt(12.0)))


def test_what_is_not_stated_is_said() -> None:
    found = checked(0.010, reference=ReferenceDisplacement(0.010), claim=CalibrationClaim())
    assert [caution.code for caution in found.warnings] == ["not-stated", "not-stated"]
    assert sum(math.isnan(line.standard_uncertainty) for line in found.budget) == 2
    assert math.isfinite(found.tolerance_m)


def test_a_blunt_check_and_a_turned_gauge_are_said() -> None:
    blunt = checked(0.0001, reference=ReferenceDisplacement(0.0001, 5e-6))
    assert [caution.code for caution in blunt.warnings] == ["check-blunt"]
    turned = checked(-0.010)
    assert [caution.code for caution in turned.warnings] == ["other-way"]
    assert not turned.passed


@pytest.mark.parametrize("measured_m", [0.0, 2e-6, -5e-5])
def test_a_gauge_that_was_not_moved_is_no_failed_check(measured_m: float) -> None:
    with pytest.raises(CalibrationError, match=r"of \+10 mm: it was not moved, or it does not read"):
        checked(measured_m)


@pytest.mark.parametrize("displacement_m", [0.0, math.nan, math.inf])
def test_a_displacement_that_checks_nothing_is_refused(displacement_m: float) -> None:
    with pytest.raises(CalibrationError, match="checks nothing"):
        ReferenceDisplacement(displacement_m)


def test_readings_that_are_none_are_refused() -> None:
    with pytest.raises(CalibrationError, match="from 1 samples is none"):
        check_displacement(MeanReading(0.0, 0.0, 1), MeanReading(0.01, 0.0, 9), BLOCK, CLAIM)
    with pytest.raises(CalibrationError, match="a reading of nan m"):
        check_displacement(MeanReading(math.nan, 0.0, 9), MeanReading(0.01, 0.0, 9), BLOCK, CLAIM)
    with pytest.raises(CalibrationError, match="uncertainty -1 m"):
        ReferenceDisplacement(0.01, -1.0)
