"""The studies of docs/validation.md in short: few records, bounds that chance alone rarely breaks."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from analysis.fitting.problem import GaussNewton
from analysis.laws.catalogue import FALLBACK_LAWS
from benchmarks import (
    study_coverage,
    study_garbage,
    study_live,
    study_one_mass,
    study_slow_devices,
    study_wrong_models,
)

SLOW_RATE_HZ = 450.0
RECORDS = 36
RARE = 1e-4


def slow_seeds(count):
    seeds = (seed for seed in range(1000) if study_coverage.draw(seed)[0].rate_hz < SLOW_RATE_HZ)
    return [next(seeds) for _ in range(count)]


def spread_is_one(deviation):
    """Whether the scatter of deviations (n,) over their uncertainties is one, as far as n can tell."""
    low, high = np.sqrt(chi2.ppf([RARE, 1.0 - RARE], len(deviation)) / len(deviation))
    return low < np.sqrt(np.mean(np.square(deviation))) < high


def at_least(count, total, share):
    """Whether `count` of `total` may be a sample of a share of at least `share`."""
    return count >= binom.ppf(RARE, total, share)


@pytest.fixture(scope="module", params=[False, True], ids=["noise alone", "whole budget"])
def cases(request):
    return [study_coverage.run(seed, whole=request.param) for seed in slow_seeds(RECORDS)]


def test_every_record_gives_a_result(cases):
    assert not [case.failure for case in cases if case.failure]


def test_intervals_hold_the_truth_in_95_percent(cases):
    inside, width = np.array([case.inside for case in cases]), np.array([case.width for case in cases])
    deviation = np.array([case.deviation for case in cases])
    told = np.isfinite(deviation)

    for k in range(len(study_coverage.QUANTITIES)):
        assert at_least(inside[told[:, k], k].sum(), told[:, k].sum(), 0.95)
    by_interval = (deviation / width)[told]
    assert spread_is_one(by_interval)
    assert not spread_is_one(by_interval / 1.5), "intervals too wide by half would pass"
    assert not spread_is_one(by_interval * 1.5), "intervals too narrow by half would pass"


def test_results_are_not_biased(cases):
    deviation = np.array([case.deviation for case in cases])

    mean, count = np.nanmean(deviation, axis=0), np.isfinite(deviation).sum(axis=0)
    assert (np.abs(mean) < 3.9 / np.sqrt(count)).all(), mean


def test_the_right_law_is_chosen_and_believed(cases):
    clear = [case for case in cases if case.clear]

    assert at_least(sum(case.chosen == case.law for case in clear), len(clear), 0.95)
    assert at_least(sum(case.adequate for case in cases), len(cases), 0.998)


@pytest.mark.parametrize(("seed", "whole"), [(3229, True), (3307, True), (3396, True), (100931, False)])
def test_searches_that_once_got_stuck(seed, whole):
    """At jumps of chi-square, and where few of many noisy readings hid the hold or the lowest minimum."""
    case = study_coverage.run(seed, whole=whole)

    assert case.chosen == case.law
    assert case.adequate
    assert np.nanmax(np.abs(case.deviation)) < 3.0


def test_faulty_records_are_never_believed_when_wrong():
    outcomes = [study_garbage.run(seed) for seed in slow_seeds(16)]
    assert not [outcome for outcome in outcomes if outcome.kind in ("crash", "adequate, off")]


@pytest.mark.parametrize("seed", [9556, 9676, 9998])
def test_a_gauge_without_readings_of_the_first_slips_is_no_crash(seed):
    """Where other masses were looked for, nothing was left to fit."""
    assert study_garbage.run(seed).kind not in ("crash", "adequate, off")


def test_slow_devices_give_f_d_where_a_tenth_of_the_readings_is_missing():
    outcomes = [study_slow_devices.run(seed) for seed in range(RECORDS)]
    enough = [outcome for outcome in outcomes if outcome.kind != "refused"]
    assert all("readings a swing" in outcome.detail for outcome in outcomes if outcome not in enough)
    assert not [outcome for outcome in enough if outcome.kind.endswith(("off", "crash"))]
    assert at_least(sum(outcome.kind == "adequate, right" for outcome in enough), len(enough), 0.9)


def test_a_record_without_hope_takes_no_more_work_than_others(monkeypatch):
    """No friction explains it, and which of its fits is the best depends on rounding."""
    evaluations, evaluate = [], GaussNewton.evaluate
    monkeypatch.setattr(
        GaussNewton,
        "evaluate",
        lambda form, point: evaluations.append(form.law) or evaluate(form, point),
    )

    outcome = study_garbage.run(9816)

    assert "model-inadequate" in outcome.detail
    assert outcome.kind == "no f_d, with a warning"
    assert 0 < len(evaluations) < 2000
    assert not set(FALLBACK_LAWS) & set(evaluations)


def test_stribeck_records_agree_with_the_exact_solver_without_stribeck():
    times = np.linspace(-0.1, 5.0, 400)
    table, relative = study_wrong_models.StribeckMotion(study_wrong_models.BASE, extra=0.0).displacements(
        times
    )
    exact = study_wrong_models.BASE.parameters().simulate(5.0).sample_displacements(times)
    np.testing.assert_allclose((table, relative), exact, atol=1e-11)


@pytest.mark.parametrize("effect", study_wrong_models.EFFECTS, ids=lambda effect: effect.name)
def test_unmodelled_effects_are_noticed(effect):
    outcome = study_wrong_models.run(study_wrong_models.EFFECTS.index(effect), seed=0)
    assert outcome.passed, outcome


def test_one_mass_study_runs():
    cases = [study_one_mass.run(seed) for seed in range(20)]
    assert not [case.failure for case in cases if case.failure]
    assert np.abs([case.deviation for case in cases]).max() < 4.5


@pytest.mark.parametrize("make", [study_live.exactly_known, study_live.off_its_stated_values])
def test_what_is_shown_while_a_test_runs_is_as_uncertain_as_what_is_found_then(make):
    """T and n1 were shown with a tenth to a half of their uncertainty, and off by up to 7 u."""
    stopped = [study_live.run(seed, make) for seed in slow_seeds(8)]
    told = [value for each in stopped for name, value in each.told.items() if name != "plate"]
    shown = np.array([(each.live_u / each.final_u, each.off) for each in told if np.isfinite(each.live)])

    assert len(shown) >= 0.8 * len(told)
    assert (shown[:, 0] > 0.7).all(), shown
    assert (shown[:, 0] < 1.5).all(), shown
    assert (np.abs(shown[:, 1]) < 3.9).all(), shown
