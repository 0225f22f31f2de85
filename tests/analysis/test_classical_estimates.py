"""The paper's own estimates, and the budget checked by Monte Carlo draws."""

import numpy as np
import pytest
from synthetic import CALIBRATED, Truth, simulate_record

from analysis.classical_estimates import estimate_classically, zero_crossings
from analysis.identify import identify
from analysis.motion.two_mass import TwoMassParameters
from analysis.record import RecordError, StandMasses
from benchmarks.reference_solvers import integrate_with_events


def test_classical_figures_stand_beside_the_fitted_ones():
    made = simulate_record(Truth())

    found = estimate_classically(made, identify(made))

    assert found.period_s == pytest.approx(0.32, abs=5e-5)
    assert found.log_decrement == pytest.approx(0.12 * 0.32, abs=5.0 * found.log_decrement_uncertainty)
    assert found.cycles > 15
    assert found.friction_by_paper_method == pytest.approx(0.1, abs=1e-3)


def test_the_residual_displacement_allows_several_frictions_and_the_true_one_is_among_them():
    made = simulate_record(Truth(friction_static=0.2))

    allowed = estimate_classically(made, identify(made)).friction_candidates

    assert len(allowed) > 2
    assert min(abs(friction - 0.1) for friction in allowed) < 3e-4


def test_every_friction_that_the_residual_displacement_allows_leads_there_by_an_integrator_too():
    made = simulate_record(Truth())
    found = identify(made)
    fitted = found.parameters
    measured = found.results["residual_displacement_m"].value

    checks = estimate_classically(made, found)

    for friction in checks.friction_candidates[::3]:
        stand = TwoMassParameters(
            table_mass_kg=fitted["table_mass_kg"],
            plate_mass_kg=fitted["plate_mass_kg"],
            stiffness_n_per_m=fitted["stiffness_n_per_m"],
            damping_coefficient_kg_per_s=fitted["damping_coefficient_kg_per_s"],
            friction_dynamic=friction,
            pullback_m=fitted["pullback_m"],
        )
        u1, _, u2, _ = integrate_with_events(stand, 10.0, rtol=1e-9, atol=1e-12).sample(np.array([9.9]))[:, 0]
        assert u2 - u1 == pytest.approx(measured, abs=2e-5)


def test_the_residual_displacement_wanders_with_friction_as_the_paper_found():
    made = simulate_record(Truth())

    residuals = estimate_classically(made, identify(made)).residual_displacement_m
    turns = np.count_nonzero(np.diff(np.sign(np.diff(residuals))))

    assert 6 <= turns <= 27


def test_the_papers_procedure_is_misled_by_a_tilt():
    made = simulate_record(Truth(tilt_rad=1e-3))

    assert estimate_classically(made, identify(made)).friction_by_paper_method > 0.105


def test_there_is_nothing_to_check_without_slip():
    made = simulate_record(Truth(friction_dynamic=0.6))

    with pytest.raises(RecordError, match="nothing slipped"):
        estimate_classically(made, identify(made))


def test_crossings_of_a_polygon():
    assert zero_crossings(np.array([0.0, 1.0, 2.0, 3.0]), np.array([-1.0, 1.0, 1.0, -3.0])) == pytest.approx(
        (0.5, 2.25)
    )


def test_drawing_confirms_the_budget():
    made = simulate_record(
        Truth(rate_hz=250.0, friction_static=0.13),
        masses=StandMasses(131.6, 22.4, 0.3, 0.02, 9.81, 0.005),
        table_gauge=CALIBRATED,
        relative_gauge=CALIBRATED,
        clock_scale_uncertainty=1e-5,
    )
    seen = []

    found = identify(made, monte_carlo=150, progress=lambda _share, what: seen.append(what))
    drawn = found.monte_carlo

    assert drawn.refits == 150
    for name in ("friction_dynamic", "friction_static", "pullback_m", "period_s", "damping_n1_per_s"):
        budget = found.results[name]
        assert drawn.linear[name].standard_uncertainty == pytest.approx(budget.standard_uncertainty, rel=0.02)
        assert drawn.full[name].standard_uncertainty == pytest.approx(budget.standard_uncertainty, rel=0.25)
        assert drawn.agrees[name]
        assert 0.0 < drawn.tolerances[name] < budget.standard_uncertainty
    assert any("150 of 150" in str(what) for what in seen)


def test_without_refits_only_the_linearised_fit_is_drawn():
    drawn = identify(simulate_record(Truth(rate_hz=250.0)), monte_carlo=0).monte_carlo

    assert drawn.refits == 0
    assert drawn.full == {}
    assert drawn.agrees["friction_dynamic"]
