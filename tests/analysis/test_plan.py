"""Plans against simulated tests of the same noise, identified without knowledge of the truth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from synthetic import Truth, simulate_record

from analysis.identify import identify
from analysis.plan import PlannedTest, RangeUse, expected_budget, plan, smallest_pullback_m
from analysis.quantities import OtherLaw
from analysis.record import AnalysisError, GaugeUncertainty, StandMasses
from analysis.uncertainty_reduction import Measure, reduction_options, uncertainty_parts

RARE = 1e-4
RECORDS = 12
GAUGE = GaugeUncertainty(gain_relative=0.003, nonlinearity_m=5e-6, delay_s_uncertainty=2e-5, range_m=0.0165)
SECOND = replace(GAUGE, range_m=0.033)
EXACT = GaugeUncertainty(gain_relative=0.0)
SLOW = Truth(rate_hz=250.0, duration_s=8.0)
CASES = {
    "coulomb": SLOW,
    "static": SLOW.replace(friction_static=0.15),
    "coulomb+tilt": SLOW.replace(tilt_rad=1e-3, pullback_m=0.009),
}


def planned(truth, **known):
    facts = {"rate_hz": truth.rate_hz, "duration_s": truth.duration_s, "noise_m": truth.noise_m}
    return PlannedTest(parameters=truth.parameters(), **facts | known)


def made(truth, **known):
    return [identify(simulate_record(truth.replace(seed=seed), **known)) for seed in range(RECORDS)]


def friction(test):
    return expected_budget(test).results["friction_dynamic"].standard_uncertainty


@pytest.fixture(scope="module", params=CASES, ids=str)
def repeats(request):
    truth = CASES[request.param]
    exact = {"table_gauge": EXACT, "relative_gauge": EXACT, "clock_scale_uncertainty": 0.0}
    return planned(truth, **exact), request.param, made(truth)


def test_expected_uncertainty_is_that_which_tests_report(repeats):
    test, law, found = repeats
    reported = [
        one.results["friction_dynamic"].standard_uncertainty for one in found if one.model.name == law
    ]

    assert test.law.name == law
    assert len(reported) > 0.8 * RECORDS
    assert np.median(reported) == pytest.approx(friction(test), rel=0.05)


def test_expected_uncertainty_is_the_scatter_of_repeated_tests(repeats):
    test, _, found = repeats
    values = np.array([one.results["friction_dynamic"].value for one in found])

    low, high = np.sqrt(chi2.ppf([RARE, 1.0 - RARE], RECORDS) / RECORDS)
    scatter = float(np.sqrt(np.mean((values - 0.1) ** 2)))
    assert low < scatter / friction(test) < high


def test_budget_is_that_of_a_test():
    masses = StandMasses(131.6, 22.4, 0.3, 0.02, 9.81, 0.005)
    known = {"table_gauge": GAUGE, "relative_gauge": SECOND, "clock_scale_uncertainty": 5e-5}
    found = identify(simulate_record(SLOW, masses=masses, **known))
    test = planned(
        SLOW,
        **known,
        table_mass_uncertainty_kg=0.3,
        plate_mass_uncertainty_kg=0.02,
        gravity_uncertainty_m_per_s2=0.005,
    )

    def shares(budget):
        return {
            str(line.source): line.standard_uncertainty
            for line in budget
            if line.contribution_to == "friction_dynamic" and not isinstance(line.source, OtherLaw)
        }

    got, expected = shares(found.budget), shares(plan(test).budget)
    assert expected.keys() == got.keys()
    largest = max(got.values())
    for source, share in got.items():
        assert expected[source] == pytest.approx(share, rel=0.05, abs=0.005 * largest), source


def test_motion_gauges_and_rest_are_those_of_the_simulation():
    found = plan(planned(SLOW.replace(duration_s=60.0), table_gauge=GAUGE, relative_gauge=SECOND))
    times = np.arange(0.0, 8.0, 1e-4)
    table, relative = found.motion.sample_displacements(times)

    assert found.table_use.highest_m == 0.012
    assert found.table_use.lowest_m == pytest.approx(table.min(), abs=1e-6)
    assert found.relative_use.lowest_m == pytest.approx(relative.min(), abs=1e-6)
    assert found.relative_use.highest_m == pytest.approx(relative.max(), abs=1e-6)
    assert found.relative_use.share == pytest.approx(-relative.min() / 0.033, rel=1e-3)
    late, _ = found.motion.sample_displacements(np.linspace(found.rest_s, found.rest_s + 0.32, 500))
    assert np.abs(late).max() == pytest.approx(2e-5, rel=0.05)
    assert found.msk64_degree == "IX"
    assert not found.warnings


def test_plate_is_recentred_before_it_leaves_the_range_of_gauge_2():
    found = plan(planned(SLOW, relative_gauge=SECOND))
    moved, use = found.motion.residual_displacement_m, found.relative_use

    assert use.fits((found.tests_without_recentring - 1) * moved)
    assert not use.fits(found.tests_without_recentring * moved)
    assert plan(planned(SLOW)).tests_without_recentring is None
    assert RangeUse(-1.0, 2.0, 1.5).share == pytest.approx(4.0 / 3.0)


def test_what_halves_the_uncertainty_halves_it_when_planned_anew():
    noisy = SLOW.replace(noise_m=1e-4, rate_hz=100.0)
    fine = GaugeUncertainty(gain_relative=3e-4)
    test = planned(noisy, table_gauge=fine, relative_gauge=fine)
    half = 0.5 * friction(test)
    ways = {way.measure: way for way in reduction_options(test)}

    faster = test.replace(rate_hz=ways[Measure.RATE].value)
    assert friction(faster) == pytest.approx(half, rel=0.02)
    count = ways[Measure.REPEATS].value
    parts = uncertainty_parts(test)
    assert math.hypot(parts.noise / math.sqrt(count), parts.stated) <= half
    assert math.hypot(parts.noise / math.sqrt(count - 1.0), parts.stated) > half
    farther = replace(test.parameters, pullback_m=ways[Measure.PULLBACK].value)
    assert friction(test.replace(parameters=farther)) <= half
    assert ways[Measure.CALIBRATION].value is None
    assert ways[Measure.CALIBRATION].standard_uncertainty > half


def test_no_rate_is_promised_where_the_calibration_is_what_is_uncertain():
    test = planned(SLOW, table_gauge=GAUGE, relative_gauge=SECOND)
    ways = {way.measure: way for way in reduction_options(test)}

    assert ways[Measure.RATE].value is None
    assert ways[Measure.REPEATS].value is None
    assert friction(test.replace(rate_hz=20_000.0)) > 0.9 * friction(test)
    assert "No rate halves it" in str(ways[Measure.RATE].message)
    share = ways[Measure.CALIBRATION].value
    better = {
        name: replace(gauge, gain_relative=share * 0.003, nonlinearity_m=share * 5e-6)
        for name, gauge in (("table_gauge", GAUGE), ("relative_gauge", SECOND))
    }
    assert friction(test.replace(**better)) == pytest.approx(0.5 * friction(test), rel=0.03)


def test_a_plate_that_will_not_slip_is_told_with_the_pullback_that_it_takes():
    test = planned(SLOW.replace(friction_dynamic=0.6))
    found = plan(test)
    needed_m = smallest_pullback_m(test.parameters)

    assert not found.results
    assert [caution.code for caution in found.warnings] == ["no-slip"]
    assert f"{needed_m * 1e3:.2f} mm" in str(found.warnings[0].message)
    assert not reduction_options(test)
    just = replace(test.parameters, pullback_m=1.001 * needed_m)
    assert plan(test.replace(parameters=just)).motion.slip_end_s > 0.0
    less = replace(test.parameters, pullback_m=0.999 * needed_m)
    assert plan(test.replace(parameters=less)).motion.slip_end_s == 0.0


def test_what_will_spoil_a_test_is_said():
    far = SLOW.replace(pullback_m=0.02, duration_s=2.0)
    codes = {c.code for c in plan(planned(far, table_gauge=GAUGE, relative_gauge=SECOND)).warnings}
    assert codes == {"gauge-1-range", "slip-to-end"}
    short = planned(SLOW.replace(duration_s=3.5), table_gauge=GAUGE)
    assert {c.code for c in plan(short).warnings} == {"tail-too-short", "gain-not-stated"}


def test_a_negative_pullback_is_known_as_well():
    level, other = SLOW, SLOW.replace(pullback_m=-0.012)
    assert friction(planned(other)) == pytest.approx(friction(planned(level)), rel=1e-6)


def test_gauges_without_readings_and_without_noise_are_no_trouble():
    blind = replace(GAUGE, range_m=1e-7)
    codes = {c.code for c in plan(planned(SLOW, table_gauge=blind, relative_gauge=blind)).warnings}
    assert "friction-undetermined" in codes
    quiet = planned(SLOW.replace(noise_m=1e-12), table_gauge=GAUGE, relative_gauge=SECOND)
    assert friction(quiet) == pytest.approx(
        friction(planned(SLOW, table_gauge=GAUGE, relative_gauge=SECOND)), rel=0.02
    )


def test_friction_that_no_record_tells_is_refused():
    with pytest.raises(AnalysisError, match="friction_dynamic is 0"):
        planned(SLOW.replace(friction_dynamic=0.0))


@pytest.mark.parametrize("name", ["rate_hz", "duration_s", "hold_s", "noise_m"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_values_that_cannot_be_are_refused(name, value):
    with pytest.raises(AnalysisError, match=name):
        planned(SLOW, **{name: value})


@pytest.mark.parametrize(("rate_hz", "duration_s", "what"), [(1e7, 10.0, "readings"), (50.0, 1e5, "periods")])
def test_more_than_any_test_has_is_refused(rate_hz, duration_s, what):
    with pytest.raises(AnalysisError, match=f"the test would have .* {what}, "):
        PlannedTest(parameters=SLOW.parameters(), rate_hz=rate_hz, duration_s=duration_s)
