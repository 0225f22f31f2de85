"""Records in which a hand moves the plate or stops the table before their end."""

import numpy as np
import pytest
from synthetic import Truth, simulate_record

from analysis.identify import identify
from analysis.preparation.free_decay import prepare
from analysis.record import Record

TRUTH = Truth(rate_hz=250.0, duration_s=8.0, noise_m=1e-5)
TOUCHED_S = 6.0


def touched(record: Record, *, plate: bool, table: bool, over_s: float = 1.0) -> Record:
    """The record with the plate put back, or the table stopped, over some time from `TOUCHED_S` on."""
    share = np.clip((record.time_s - TOUCHED_S) / over_s, 0.0, 1.0)
    hand = 0.5 - 0.5 * np.cos(np.pi * share)
    changes = {}
    if plate:
        changes["relative_displacement_m"] = record.relative_displacement_m * (1.0 - hand)
    if table:
        changes["table_displacement_m"] = record.table_displacement_m * (1.0 - hand)
    return record.replace(**changes)


def codes(record):
    return [warning.code for warning in prepare(record).warnings]


@pytest.mark.parametrize("hand", [{"plate": True, "table": True}, {"plate": True, "table": False}], ids=str)
def test_readings_after_a_plate_is_put_back_are_not_fitted(hand):
    found = identify(touched(simulate_record(TRUTH), **hand))
    assert "moved-again" in [warning.code for warning in found.warnings]
    assert found.model.adequate
    friction = found.results["friction_dynamic"]
    assert abs(friction.value - TRUTH.friction_dynamic) < 4.0 * friction.standard_uncertainty


@pytest.mark.parametrize("over_s", [0.3, 1.0])
@pytest.mark.parametrize("with_gauge_2", [True, False])
def test_readings_after_the_table_is_stopped_are_not_fitted(over_s, with_gauge_2):
    stopped = touched(simulate_record(TRUTH), plate=False, table=True, over_s=over_s)
    if not with_gauge_2:
        stopped = stopped.replace(relative_displacement_m=None)
    decay = prepare(stopped)
    assert "moved-again" in [warning.code for warning in decay.warnings]
    assert TOUCHED_S - 1.5 < decay.table.time_s[-1] < TOUCHED_S + 0.5 * over_s


def test_a_plate_against_the_base_that_is_put_back_is_seen():
    record = touched(simulate_record(TRUTH), plate=True, table=False)
    against_base = record.relative_displacement_m + record.table_displacement_m
    against_base = record.replace(relative_displacement_m=against_base, gauge_2_measures_plate=True)
    assert "moved-again" in codes(against_base)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("noise_m", [1e-6, 5e-5])
@pytest.mark.parametrize("drift_m_per_s", [0.0, 2e-4])
def test_a_stand_left_alone_is_fitted_to_its_end(friction, noise_m, drift_m_per_s):
    sound = simulate_record(
        TRUTH.replace(
            friction_dynamic=friction, friction_static=1.2 * friction, noise_m=noise_m, duration_s=20.0
        )
    )
    drifting = sound.relative_displacement_m + drift_m_per_s * sound.time_s
    assert "moved-again" not in codes(sound.replace(relative_displacement_m=drifting))
    assert "moved-again" not in codes(sound.replace(relative_displacement_m=None))
