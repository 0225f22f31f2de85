"""Records in which a hand moves the plate or stops the table before their end."""

import numpy as np
import pytest
from synthetic import Truth, simulate_record

from analysis.identify import identify
from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.preparation.free_decay import prepare
from analysis.record import Record, StandMasses

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


def handled(*, plate: bool, table: bool, at_s: float, over_s: float, **truth) -> Record:
    """The record of a hand that puts the plate back, or stops the table, at some time; noise remains."""
    motion = TRUTH.replace(duration_s=10.0, **truth)
    free = motion.parameters().simulate(motion.duration_s + 1e-6).sample_displacements

    def displacements(since_s):
        share = np.clip((since_s + motion.hold_s - at_s) / over_s, 0.0, 1.0)
        left = 0.5 + 0.5 * np.cos(np.pi * share)
        table_m, plate_m = free(since_s)
        return table_m * left if table else table_m, plate_m * left if plate else plate_m

    return simulate_record(motion, displacements)


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


@pytest.mark.parametrize("at_s", [2.6, 4.0])
@pytest.mark.parametrize("over_s", [0.15, 1.0])
@pytest.mark.parametrize(
    "hand",
    [{"plate": True, "table": False}, {"plate": False, "table": True}, {"plate": True, "table": True}],
    ids=str,
)
def test_a_hand_that_ends_the_slip_is_found_and_said(hand, at_s, over_s):
    """The plate slips until 4.3 s: no plate at rest is moved, and no table stopped that swings freely."""
    found = identify(handled(**hand, at_s=at_s, over_s=over_s))
    assert "moved-again" in [warning.code for warning in found.warnings]
    assert at_s - 0.35 < found.events.free_decay_end_s < at_s + 0.15
    assert found.model.adequate
    friction = found.results["friction_dynamic"]
    assert abs(friction.value - 0.1) < 4.0 * friction.standard_uncertainty
    assert friction.standard_uncertainty < 1e-3


def test_a_table_stopped_without_gauge_2_is_found_and_said():
    stopped = handled(plate=False, table=True, at_s=4.0, over_s=0.15)
    found = identify(stopped.replace(relative_displacement_m=None))
    assert found.events.free_decay_end_s < 4.05
    friction = found.results["friction_dynamic"]
    assert abs(friction.value - 0.1) < 4.0 * friction.standard_uncertainty


@pytest.mark.parametrize(
    "known",
    [
        {"masses": StandMasses(131.6, 32.4)},
        {"masses": StandMasses(22.4, 131.6)},
        {"gauge_2_measures_plate": True},
    ],
    ids=str,
)
def test_what_the_record_is_wrongly_told_is_no_hand(known):
    found = identify(simulate_record(TRUTH.replace(rate_hz=500.0), **known))
    assert found.events.free_decay_end_s is None


def test_a_law_that_is_wrong_to_the_end_finds_no_hand():
    record = simulate_record(TRUTH.replace(friction_static=0.2))
    assert identify(record, model="coulomb").events.free_decay_end_s is None


def test_a_record_that_ends_in_free_decay_says_no_end_of_it():
    assert identify(simulate_record(TRUTH)).events.free_decay_end_s is None


@pytest.mark.parametrize("coulomb_m", [0.0, 5e-5])
@pytest.mark.parametrize(("at_s", "over_s"), [(2.0, 0.15), (4.0, 1.0), (6.0, 0.15)])
def test_one_mass_stopped_by_hand_keeps_period_and_damping(coulomb_m, at_s, over_s):
    time_s = np.arange(4000) / 400.0
    free = simulate(OneMassDecay(0.3, 0.12, coulomb_m, 0.1, 0.01), time_s).displacement_m
    left = 0.5 + 0.5 * np.cos(np.pi * np.clip((time_s - at_s) / over_s, 0.0, 1.0))
    noise = 1e-5 * np.random.default_rng(1).standard_normal(len(time_s))
    found = identify_one_mass(single_channel(time_s, free * left + noise))
    assert "moved-again" in [warning.code for warning in found.warnings]
    assert at_s - 1.0 < found.events.free_decay_end_s < at_s + 0.5 * over_s
    for name, truth in (("period_s", 0.3), ("damping_n_per_s", 0.12)):
        result = found.results[name]
        assert abs(result.value - truth) < 4.0 * result.standard_uncertainty
    assert found.model.adequate
