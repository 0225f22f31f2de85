"""Plans with effects of the stand."""

import math

import pytest
from synthetic import Truth

from analysis.motion.two_mass import TwoMassParameters
from analysis.plan import PlannedTest, expected_budget, plan
from analysis.quantities import BudgetSource
from analysis.record import GaugeUncertainty
from analysis.uncertainty_reduction import Measure, reduction_options, uncertainty_parts
from app.simulated_stand.motion import simulate_stand

GAUGE = GaugeUncertainty(gain_relative=0.003, delay_s_uncertainty=2e-5, range_m=0.02)
EXACT = GaugeUncertainty(gain_relative=0.0)
PARAMETERS: TwoMassParameters = Truth().parameters()
MODE = {"second_mode_mass_share": 0.03, "second_mode_frequency_hz": 8.0, "second_mode_damping": 0.01}


def planned(effects=(), parameters=PARAMETERS, **facts):
    gauges = {"table_gauge": GAUGE, "relative_gauge": GAUGE}
    return PlannedTest(parameters=parameters, effects=dict(effects), rate_hz=250.0, **gauges | facts)


def noise(test):
    return uncertainty_parts(test).noise


def test_motion_is_that_of_the_stand():
    found = plan(planned(MODE)).motion
    true = simulate_stand(PARAMETERS, MODE, found.duration_s)

    assert found.residual_displacement_m == true.residual_displacement_m
    assert found.residual_displacement_m != plan(planned()).motion.residual_displacement_m


@pytest.mark.parametrize(
    ("effects", "name"),
    [
        ({"release_ramp_s": 1e-4}, "release-ramp"),
        ({"gauge_2_lag_s": 0.0}, "gauge-lag"),
        ({"relative_gain": 0.0}, "gauge-ratio"),
        ({"spring_hardening": 0.0}, "spring-hardening"),
        ({"gauge_filter_hz": 1e3}, "filter"),
    ],
    ids=str,
)
def test_an_effect_that_must_be_fitted_too_costs_certainty(effects, name):
    """Of two nested models with nearly the same motion the one with more parameters tells less of each."""
    exact = {"table_gauge": EXACT, "relative_gauge": EXACT}
    test, ideal = planned(effects, **exact), planned(**exact)

    assert [effect.name for effect in test.stand_effects] == [name]
    assert noise(ideal) * 0.999 < noise(test) < 10.0 * noise(ideal)


def test_a_fitted_lag_takes_the_place_of_the_stated_one():
    lines = expected_budget(planned({"gauge_2_lag_s": 1e-3})).lines

    assert BudgetSource.GAUGE_2_LAG in {line.source for line in expected_budget(planned()).lines}
    assert BudgetSource.GAUGE_2_LAG not in {line.source for line in lines}


def test_sizes_rise_with_the_pullback_as_the_effects_do():
    sizes = {"spring_hardening": 0.04, "spring_asymmetry": 0.04, "gauge_2_lag_s": 1e-3}
    test = planned(sizes, effects_pullback_m=2.0 * PARAMETERS.pullback_m)

    assert test.stand_values == pytest.approx(
        {"spring_hardening": 0.01, "spring_asymmetry": 0.02, "gauge_2_lag_s": 1e-3}
    )


def test_a_corner_is_the_filter_that_rounds_as_much():
    corner_hz = 20.0
    values = planned({"gauge_filter_hz": corner_hz}).stand_values

    # an RC filter without its delay keeps half the square of its time constant
    assert values == pytest.approx({"filter_s2": 0.5 * (1.0 / (2.0 * math.pi * corner_hz)) ** 2})


def test_half_the_sizes_of_an_effect_plan_nothing():
    assert planned({"second_mode_mass_share": 0.03}).stand_effects == ()


def test_the_side_of_the_pull_does_not_matter():
    effects = {"spring_asymmetry": 0.02}
    there = planned(effects)
    back = planned(
        {"spring_asymmetry": -0.02},
        parameters=Truth(pullback_m=-PARAMETERS.pullback_m).parameters(),
    )

    assert noise(back) == pytest.approx(noise(there), rel=1e-6)


def test_the_spread_of_models_is_part_of_the_uncertainty_and_no_repeats_reduce_it():
    plain, spread = planned(MODE), planned(MODE, model_spread=0.05)
    with_spread = expected_budget(spread).results["friction_dynamic"].standard_uncertainty
    without = expected_budget(plain).results["friction_dynamic"].standard_uncertainty
    options = {option.measure: option for option in reduction_options(spread)}

    assert with_spread == pytest.approx(math.hypot(without, 0.05 * PARAMETERS.friction_dynamic))
    assert options[Measure.REPEATS].value is None
    assert "levelling and the model of the stand" in str(options[Measure.REPEATS].message)
