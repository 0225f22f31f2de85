"""The studies of docs/validation.md in short: few records, bounds that chance alone rarely breaks."""

import numpy as np
import pytest

from benchmarks import study_coverage, study_garbage, study_one_mass, study_wrong_models

SLOW_RATE_HZ = 450.0


def slow_seeds(count):
    seeds = (seed for seed in range(1000) if study_coverage.draw(seed)[0].rate_hz < SLOW_RATE_HZ)
    return [next(seeds) for _ in range(count)]


@pytest.mark.parametrize("whole", [False, True], ids=["noise alone", "whole budget"])
def test_intervals_and_law(whole):
    cases = [study_coverage.run(seed, whole=whole) for seed in slow_seeds(30)]
    assert not [case.failure for case in cases if case.failure]
    inside = np.mean([case.inside for case in cases], axis=0)
    assert (inside >= 0.8).all(), inside  # 95 % of 30: under 24 comes once in 3000
    deviation = np.abs([case.deviation for case in cases])
    assert deviation.max() < 4.5
    clear = [case for case in cases if case.clear]
    assert sum(case.chosen == case.law for case in clear) >= len(clear) - 4
    assert sum(case.adequate for case in cases) >= 28


def test_faulty_records_are_never_believed_when_wrong():
    outcomes = [study_garbage.run(seed) for seed in slow_seeds(30)]
    assert not [outcome for outcome in outcomes if outcome.kind in ("crash", "adequate, off")]


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
