"""Refits from near a minimum: they find it again, keep fixed parameters, and use the record's time."""

from dataclasses import asdict

import numpy as np
import pytest
from synthetic import CALIBRATED, Truth, simulate_record

from analysis.identify import identify
from analysis.laws.stand_parts import stand_displacements
from analysis.record import AnalysisError, StandMasses
from analysis.refit import Refitter

KNOWN = {
    "masses": StandMasses(131.6, 22.4, 0.3, 0.02, 9.81, 0.005),
    "table_gauge": CALIBRATED,
    "relative_gauge": CALIBRATED,
}


@pytest.fixture(scope="module")
def made():
    return simulate_record(Truth(friction_static=0.13, tilt_rad=1e-3, duration_s=5.0), **KNOWN)


@pytest.fixture(scope="module")
def found(made):
    return identify(made)


def test_a_refit_from_near_finds_the_minimum_again(made, found):
    start = found.parameters | {"friction_dynamic": 1.002 * found.parameters["friction_dynamic"]}

    again = Refitter(made).refit(start, model=found.model.name)

    deviation = found.results["friction_dynamic"].standard_uncertainty
    assert again.parameters["friction_dynamic"] == pytest.approx(
        found.parameters["friction_dynamic"], abs=0.02 * deviation
    )
    assert again.rms_m == pytest.approx(found.model.residual_rms_m, rel=1e-4)
    expected = found.curves(made.time_s).relative_displacement_m
    assert again.curves(made.time_s).relative_displacement_m == pytest.approx(expected, abs=1e-6)


def test_what_is_held_stays_and_the_others_follow(made, found):
    moved = found.parameters["friction_dynamic"] * 1.01
    again = Refitter(made)

    held = again.refit(
        found.parameters | {"friction_dynamic": moved}, model="static+tilt", hold="friction_dynamic"
    )

    assert held.parameters["friction_dynamic"] == moved
    alone = found.objective(np.array([moved]))[0]
    free = again.refit(found.parameters, model="static+tilt").chi_square
    assert free < held.chi_square < alone


def test_a_refit_keeps_the_effects_of_the_stand_in_the_frame_of_the_record():
    truth = Truth(tilt_rad=1e-3, duration_s=5.0)
    values = {"friction_gradient_per_m": 10.0}
    made = simulate_record(truth, stand_displacements(truth.parameters(), values, 5.1))
    turned = made.replace(
        table_displacement_m=-made.table_displacement_m, relative_displacement_m=-made.relative_displacement_m
    )
    start = asdict(truth.parameters()) | {"release_s": 1.0003, "friction_static": 0.1}
    mirrored = {name: -start[name] for name in ("pullback_m", "tilt_rad")}

    found = [
        Refitter(record).refit(
            near | {"friction_gradient_per_m": gradient}, model="coulomb+tilt", parts=["gradient"]
        )
        for record, near, gradient in ((made, start, 9.0), (turned, start | mirrored, -9.0))
    ]

    for again, gradient in zip(found, (10.0, -10.0), strict=True):
        assert again.parameters["friction_gradient_per_m"] == pytest.approx(gradient, rel=0.02)
        assert again.rms_m == pytest.approx(truth.noise_m, rel=0.05)


def test_friction_that_varies_is_moved_about_its_mean():
    truth = Truth(tilt_rad=1e-3, duration_s=5.0)
    values = {"friction_gradient_per_m": 20.0}
    made = simulate_record(truth, stand_displacements(truth.parameters(), values, 5.1))

    found = identify(made)

    assert found.model.parts == ("gradient",)
    mean = found.results["friction_dynamic"].value
    assert mean != pytest.approx(found.parameters["friction_dynamic"], rel=0.01)
    costs = found.objective(mean * np.array([0.99, 1.0, 1.01]))
    assert costs.argmin() == 1
    as_fitted = found.curves(made.time_s).relative_displacement_m
    assert found.curves_by_friction(mean, made.time_s).relative_displacement_m == pytest.approx(as_fitted)


def test_a_table_pushed_the_other_way_is_refitted_in_its_own_frame():
    truth = Truth(tilt_rad=1e-3, duration_s=5.0)
    made = simulate_record(truth)
    turned = made.replace(
        table_displacement_m=-made.table_displacement_m, relative_displacement_m=-made.relative_displacement_m
    )
    found = identify(turned)

    again = Refitter(turned).refit(found.parameters, model=found.model.name)

    assert again.parameters["pullback_m"] == pytest.approx(-0.012, rel=1e-2)
    assert again.parameters["tilt_rad"] == pytest.approx(-1e-3, rel=2e-2)
    assert again.parameters["friction_dynamic"] == pytest.approx(0.1, rel=1e-3)


def test_a_refit_begins_with_the_laws_own_parameters_as_given(made, found):
    start = found.parameters | {"stribeck_velocity_m_per_s": 0.03}

    again = Refitter(made).refit(start, model="stribeck+tilt", steps_max=1)

    assert again.parameters["stribeck_velocity_m_per_s"] == 0.03


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({}, {"model": "viscous"}, "'viscous' is unknown"),
        ({}, {"model": "coulomb", "hold": "tilt_rad"}, "'tilt_rad' cannot be held"),
        ({"release_s": None}, {"model": "coulomb"}, "lacks release_s"),
        ({}, {"model": "stribeck+tilt"}, "lacks stribeck_velocity_m_per_s"),
    ],
)
def test_what_cannot_be_refitted_is_named(made, found, change, options, words):
    start = {name: value for name, value in found.parameters.items() if name not in change}

    with pytest.raises(AnalysisError, match=words):
        Refitter(made).refit(start, **options)
