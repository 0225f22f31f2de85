"""Masses that contradict the motion are reported, with masses that would explain it."""

from functools import cache

import pytest
from synthetic import Truth, simulate_record

from analysis.identify import identify
from analysis.record import StandMasses


@cache
def cautions_for(given_table_kg, given_plate_kg, **truth):
    made = simulate_record(
        Truth(rate_hz=500.0, **truth), masses=StandMasses(given_table_kg, given_plate_kg, 0.3)
    )
    found = identify(made)
    return found.model, {caution.code: str(caution.message) for caution in found.warnings}


@pytest.mark.parametrize("truth", [{}, {"friction_static": 0.13, "tilt_rad": 1e-3}, {"noise_m": 1e-4}])
def test_a_wrong_table_mass_is_told_with_the_right_one(truth):
    model, cautions = cautions_for(140.0, 22.4, **truth)
    assert not model.adequate
    assert "a table of 131.6 kg" in cautions["masses-contradict-motion"]


def test_a_wrong_plate_mass_is_told_by_the_ratio():
    model, cautions = cautions_for(131.6, 32.4)
    assert not model.adequate
    assert "a table of 190." in cautions["masses-contradict-motion"]  # 131.6 * 32.4 / 22.4 = 190.35


@pytest.mark.parametrize("truth", [{}, {"friction_static": 0.13, "tilt_rad": 1e-3}, {"plate_mass_kg": 42.4}])
def test_swapped_masses_are_told(truth):
    true = Truth(**truth)
    model, cautions = cautions_for(true.plate_mass_kg, true.table_mass_kg, **truth)
    assert not model.adequate
    assert "they look swapped" in cautions["masses-contradict-motion"]


def test_a_wrong_mass_is_not_called_swapped():
    _, cautions = cautions_for(131.6, 32.4)
    assert "swapped" not in cautions["masses-contradict-motion"]


def test_another_fault_is_not_put_down_to_the_masses():
    made = simulate_record(Truth(rate_hz=500.0, lag_s=0.004))
    found = identify(made)
    assert found.model.parts == ("gauge-lag",)
    assert "masses-contradict-motion" not in [caution.code for caution in found.warnings]


@pytest.mark.parametrize("table_mass_kg", [131.6, 132.0])
def test_masses_within_what_the_record_tells_are_not_doubted(table_mass_kg):
    model, cautions = cautions_for(table_mass_kg, 22.4)
    assert model.adequate
    assert "masses-contradict-motion" not in cautions
