"""Uncertainty of f_d that runs reached: its parts, and the runs that halve it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.campaign.observed import ObservedUncertainty, observe_uncertainty, planned_sizes
from analysis.campaign.stand_effects import summarize_effects
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from tests.campaign_kit import FRICTION, friction_run
from tests.effects_kit import effect_run, mode

SHARED = 3e-3  # gain of the runs' gauges


def with_model(run, share):
    """The run with what its model leaves in the budget of f_d."""
    friction = run.results[FRICTION]
    spread = share * friction.value
    total = math.hypot(friction.standard_uncertainty, spread)
    results = run.results | {FRICTION: Quantity.normal(friction.value, total, "1")}
    return replace(
        run, results=results, budget=(*run.budget, BudgetLine(BudgetSource.MODEL, FRICTION, spread))
    )


def test_parts_are_medians_of_the_runs():
    runs = [friction_run(f"{n}", "1FFM0", 0.1, own=own) for n, own in enumerate((1e-4, 2e-4, 9e-4))]
    found = observe_uncertainty([with_model(run, 0.004) for run in runs])

    assert found.runs == 3
    assert (found.noise, found.model, found.shared) == pytest.approx((2e-3, 4e-3, SHARED))
    assert found.floor == pytest.approx(math.hypot(4e-3, SHARED))
    assert found.standard_uncertainty == pytest.approx(math.sqrt(2e-3**2 + 4e-3**2 + SHARED**2))


def test_scatter_between_repeats_is_seen():
    rng = np.random.default_rng(1)
    frictions = 0.1 * (1.0 + 0.01 * rng.standard_normal(12))
    runs = [friction_run(f"{n}", "1FFM0", friction) for n, friction in enumerate(frictions)]
    found = observe_uncertainty(runs)

    assert found.between_runs == pytest.approx(np.std(frictions, ddof=1) / 0.1, rel=0.05)
    assert observe_uncertainty(runs[:1]).between_runs is None


def test_what_the_stands_effects_leave_is_no_smaller_in_a_mean():
    runs = [with_model(effect_run(f"{n}", mode()), 0.01) for n in range(3)]
    found = observe_uncertainty(runs)

    assert found.floor == pytest.approx(math.hypot(0.01, SHARED))
    assert found.of_mean(10_000) == pytest.approx(found.floor, rel=1e-3)
    assert found.runs_to_halve is None
    assert "No number of runs halves it: 1 % would be left, which all share." in str(found.message)


@pytest.mark.parametrize(
    ("noise", "between", "model", "shared"), [(0.01, None, 0.0, 0.001), (0.004, 0.01, 0.003, 0.004)]
)
def test_the_runs_that_halve_it_do_and_one_less_does_not(noise, between, model, shared):
    found = ObservedUncertainty(5, noise, between, model, shared)
    half = 0.5 * found.standard_uncertainty

    assert found.of_mean(found.runs_to_halve) <= half * (1.0 + 1e-12)
    assert found.of_mean(found.runs_to_halve - 1) > half
    assert f"The mean of {found.runs_to_halve} runs halves it." in str(found.message)


def test_runs_without_friction_say_nothing():
    run = friction_run("a", "1FFM0", 0.1)

    assert observe_uncertainty([]) is None
    assert observe_uncertainty([replace(run, results={})]) is None


def test_sizes_of_the_stand_alone_are_planned_with_at_the_planned_pullback():
    hardening = {"spring-hardening": (0.04,)}
    shown = [mode() | hardening, mode() | hardening, mode() | hardening | {"release-ramp": (0.03,)}]
    effects = summarize_effects([effect_run(f"{n}", each) for n, each in enumerate(shown)])
    sizes = planned_sizes(effects, -0.006)

    assert set(sizes) == {
        "second_mode_mass_share",
        "second_mode_frequency_hz",
        "second_mode_damping",
        "spring_hardening",
    }
    assert sizes["spring_hardening"] == pytest.approx(0.01)
    assert sizes["second_mode_frequency_hz"] == pytest.approx(8.2)
