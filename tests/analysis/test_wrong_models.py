"""Errors of a wrong model: each is detected, or the right law is found."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Truth, simulate_readings, simulate_record

from analysis.identification import Degree
from analysis.identify import identify
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.record import Record, StandMasses

MASSES = StandMasses(131.6, 22.4)


def within(found, sigmas=3.0, truth=0.1):
    friction = found.results["friction_dynamic"]
    return abs(friction.value - truth) <= sigmas * friction.standard_uncertainty


def stribeck_record(velocity_m_per_s, friction_static, noise_m=2e-5):
    truth = Truth(friction_static=friction_static)
    motion = STRIBECK_TILT.solver.simulate(truth.parameters(), [velocity_m_per_s], 10.0)
    rng = np.random.default_rng(4)
    time = np.arange(11000) / 1000.0
    table, relative = motion.sample_displacements(time - 1.0003)
    return Record(
        time,
        table + noise_m * rng.standard_normal(len(time)),
        relative + noise_m * rng.standard_normal(len(time)),
        MASSES,
    )


@pytest.mark.parametrize(
    ("changes", "law"),
    [
        ({"tilt_rad": 1e-3}, "coulomb+tilt"),
        ({"friction_static": 0.12}, "static"),
        ({"friction_static": 0.2}, "static"),
    ],
)
def test_tilt_and_static_friction_are_found(changes, law):
    found = identify(simulate_record(Truth().replace(**changes)))

    assert found.model.name == law
    assert found.model.adequate
    assert within(found)


def test_stribeck_friction_is_found():
    found = identify(stribeck_record(0.005, 0.12))

    assert found.model.name == "stribeck+tilt"
    assert found.model.adequate
    assert within(found)
    assert found.results["stribeck_velocity_m_per_s"].value == pytest.approx(0.005, rel=0.1)
    assert found.results["friction_static"].value == pytest.approx(0.12, rel=0.01)


def test_stribeck_friction_fitted_by_another_law_is_called_inadequate():
    found = identify(stribeck_record(0.005, 0.12), model="coulomb")

    assert not found.model.adequate
    assert found.results["friction_dynamic"].value > 0.102


@pytest.mark.parametrize(
    ("changes", "effect"),
    [({"lag_s": 1e-3}, "gauge-lag"), ({"gain_errors": (0.0, 0.01)}, "gauge-ratio")],
    ids=["gauge 2 late", "gauge 2 gain"],
)
def test_faults_of_the_gauges_are_named(changes, effect):
    found = identify(simulate_record(Truth().replace(**changes)))

    assert (found.model.degree, found.model.parts) == (Degree.STAND, (effect,))


def test_a_common_gain_is_invisible_and_so_must_come_from_the_calibration():
    found = identify(simulate_record(Truth(gain_errors=(0.01, 0.01))))

    assert found.model.adequate
    assert found.results["friction_dynamic"].value == pytest.approx(0.101, rel=1e-3)


@pytest.mark.parametrize("name", ["table_mass_kg", "plate_mass_kg"])
def test_masses_a_hundredth_off_are_called_inadequate_and_shift_friction_by_two_thousandths_at_most(name):
    made = simulate_record(Truth())
    wrong = replace(MASSES, **{name: 1.01 * getattr(MASSES, name)})

    found = identify(made.replace(masses=wrong))

    assert not found.model.adequate
    assert found.results["friction_dynamic"].value == pytest.approx(0.1, rel=2e-3)


def test_noise_that_hums_is_not_taken_for_motion():
    time, table, relative = simulate_readings(Truth())
    hum = 5e-5 * np.sin(2.0 * np.pi * 50.0 * time + 1.0)

    found = identify(Record(time, table + hum, relative + 0.5 * hum, MASSES))

    assert within(found, 4.0)
