"""Effects of a stand, found in records of an independent integrator."""

import numpy as np
import pytest
from synthetic import Truth, simulate_record

from analysis.identification import Degree
from analysis.identify import identify
from analysis.quantities import BudgetSource
from analysis.record import GaugeUncertainty
from benchmarks.real_stand import REL, RealStand, U

KINDS = {
    "release ramp": ({"release_ramp_s": 0.011}, "release-ramp", "release_ramp_s", 0.011),
    "hardening": ({"spring_hardening": 0.011}, "spring-hardening", "spring_hardening", 0.011),
    "dry friction of the stand": ({"stand_friction_m": 3e-5}, "stand-friction", "stand_friction_m", 3e-5),
    "film": ({"film_s_per_m": 1.0}, "film", "film_s_per_m", 1.0),
    "second mode": (
        {"second_mode_frequency_hz": 8.2, "second_mode_share": 0.01},
        "second-mode", "second_mode_frequency_hz", 8.2,
    ),
    "presliding": ({"presliding_m": 3e-6}, "presliding", "presliding_m", 3e-6),
}  # fmt: skip


def record_of(
    stand: RealStand,
    truth: Truth | None = None,
    *,
    creep_m_per_s: float = 0.0,
    bend: float = 0.0,
    zero_creep_m: float = 0.0,
):
    """A record with its friction: the table moves before its release, gauge 1 is bent, its zero creeps."""
    motion = stand.simulate(10.5)

    def displacements(since_s):
        state = motion.sample(since_s.clip(0.0))
        table_m = state[U] + creep_m_per_s * since_s.clip(max=0.0)
        crept_m = -zero_creep_m * np.expm1(-since_s / 6.0)
        return table_m * (1.0 + bend * (table_m / stand.pullback_m) ** 2) + crept_m, state[REL]

    return simulate_record(truth or Truth(), displacements), motion.friction_dynamic


@pytest.mark.parametrize(("changes", "effect", "name", "size"), KINDS.values(), ids=KINDS)
def test_the_effect_is_named_with_its_size_and_f_d_holds(changes, effect, name, size):
    record, friction = record_of(RealStand(**changes))
    found = identify(record)

    assert found.model.degree is Degree.STAND
    assert found.model.parts == (effect,)
    assert effect in [warning.code for warning in found.warnings]
    assert found.results[name].value == pytest.approx(size, rel=0.05)
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=2e-3)


_IN_TWO_STEPS = {
    5e-5: {"period_s": 0.2042, "damping_n1_per_s": 0.164, "release_ramp_s": 0.0155, "release_step": 0.154},
    2e-5: {"period_s": 0.2163, "damping_n1_per_s": 0.161, "release_ramp_s": 0.0177, "release_step": 0.408},
}
"""By noise (m)."""


@pytest.mark.parametrize("noise_m", _IN_TWO_STEPS)
def test_a_release_in_two_steps_does_not_pass_for_a_slow_one_behind_a_filter(noise_m):
    """f_d once was off by 1.5 to 1.9 %, by up to 22 u, and said to hold."""
    stand = RealStand(**_IN_TWO_STEPS[noise_m], release_shape="steps", friction_dynamic=0.2, pullback_m=0.006)
    record, friction = record_of(stand, Truth(noise_m=noise_m, seed=1))
    found = identify(record).results["friction_dynamic"]

    assert abs(found.value - friction) < 3.0 * found.standard_uncertainty
    assert found.standard_uncertainty < 0.02 * friction


@pytest.mark.parametrize("drag_per_m", [0.0, 0.6])
def test_waves_of_friction_along_the_track_are_within_the_uncertainty_of_f_d(drag_per_m):
    """No effect of the fit: plate and joint fit are off alike, once by 10 u."""
    stand = RealStand(plate_mass_kg=27.4, friction_wave=0.03, friction_wave_m=0.006, drag_per_m=drag_per_m)
    record, friction = record_of(stand, Truth(plate_mass_kg=27.4, noise_m=5e-6))
    found = identify(record)
    quantity = found.results["friction_dynamic"]

    assert not found.model.adequate
    assert abs(quantity.value - friction) < 3.0 * quantity.standard_uncertainty
    assert quantity.standard_uncertainty >= found.model.residual_share * quantity.value


@pytest.mark.parametrize("f_s", [None, 0.13], ids=["f_s as f_d", "f_s above f_d"])
def test_a_lag_beyond_what_is_stated_of_the_gauges_is_found(f_s):
    stated = GaugeUncertainty(gain_relative=3e-3, delay_s_uncertainty=2e-5)
    truth = Truth(rate_hz=500.0, duration_s=6.0, friction_static=f_s, lag_s=1e-3)
    found = identify(simulate_record(truth, table_gauge=stated, relative_gauge=stated))

    assert found.model.adequate
    assert "gauge-lag" in [warning.code for warning in found.warnings]
    assert set(found.model.parts) <= {"gauge-lag", "static-friction"}
    assert found.results["gauge_2_lag_s"].value == pytest.approx(1e-3, rel=0.05)
    assert found.results["friction_dynamic"].value == pytest.approx(0.1, rel=2e-3)


@pytest.mark.parametrize("gain", [1e-3, 3e-3])
def test_a_ratio_of_gauges_beyond_their_stated_gains_is_found(gain):
    """With 0.3 % both gains were fitted 2.5 % from what is stated of them, and the stand passed for ideal."""
    stated = GaugeUncertainty(gain_relative=gain, delay_s_uncertainty=2e-5)
    truth = Truth(rate_hz=500.0, duration_s=6.0)
    record = simulate_record(truth, table_gauge=stated, relative_gauge=stated)
    found = identify(record.replace(relative_displacement_m=1.05 * record.relative_displacement_m))

    assert "gauge-ratio" in [warning.code for warning in found.warnings]
    assert found.model.degree is Degree.STAND
    assert found.results["relative_gain"].value == pytest.approx(0.05, rel=0.05)
    assert found.results["friction_dynamic"].value == pytest.approx(0.1, rel=2e-3)


def test_an_ideal_stand_shows_no_effect():
    record, friction = record_of(RealStand())
    found = identify(record)

    assert (found.model.degree, found.model.parts) == (Degree.IDEAL, ())
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=1e-3)


def test_a_pull_that_goes_on_until_the_release_is_found():
    record, friction = record_of(RealStand(release_velocity_m_per_s=2e-4), creep_m_per_s=2e-4)
    found = identify(record)

    assert (found.model.degree, found.model.parts) == (Degree.STAND, ("hold-creep",))
    assert "hold-creep" in [warning.code for warning in found.warnings]
    assert found.results["hold_creep_m_per_s"].value == pytest.approx(2e-4, rel=0.05)
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=2e-3)


def test_a_zero_that_creeps_is_found():
    record, friction = record_of(RealStand(), zero_creep_m=1e-4)
    found = identify(record)

    assert (found.model.degree, found.model.parts) == (Degree.STAND, ("gauge-1-creep",))
    assert "gauge-1-creep" in [warning.code for warning in found.warnings]
    assert found.results["gauge_1_creep_m"].value == pytest.approx(1e-4, rel=0.1)
    assert found.results["gauge_1_creep_time_s"].value == pytest.approx(6.0, rel=0.2)
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=2e-3)


def test_static_friction_that_grows_with_dwell_is_found():
    record, friction = record_of(RealStand(dwell_per_decade=0.09))
    found = identify(record)

    assert found.model.degree is Degree.STAND
    assert set(found.model.parts) == {"static-friction", "dwell"}
    assert "dwell" in [warning.code for warning in found.warnings]
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=2e-3)


def test_a_soft_base_is_found_with_its_damping():
    record, friction = record_of(RealStand(base_compliance=0.02, base_mass_kg=500.0, base_damping_ratio=0.08))
    found = identify(record)

    assert (found.model.degree, found.model.parts) == (Degree.STAND, ("base",))
    assert found.results["base_compliance"].value == pytest.approx(0.02, rel=0.05)
    assert found.results["base_damping"].value == pytest.approx(0.08, rel=0.25)
    assert found.results["friction_dynamic"].value == pytest.approx(friction, rel=2e-3)


@pytest.mark.parametrize("seed", [1, 3])
def test_f_d_is_as_uncertain_as_effects_make_it_that_are_too_small_to_be_told(seed):
    truth = Truth(rate_hz=500.0, duration_s=8.0, noise_m=5e-5, seed=seed)
    record, friction = record_of(RealStand(), truth, bend=0.0015)
    found = identify(record)
    shares = {
        line.source: line.standard_uncertainty
        for line in found.budget
        if line.contribution_to == "friction_dynamic"
    }

    assert (found.model.degree, found.model.parts) == (Degree.IDEAL, ())
    assert shares[BudgetSource.MODEL] > 2.0 * shares[BudgetSource.NOISE]
    friction_dynamic = found.results["friction_dynamic"]
    assert abs(friction_dynamic.value - friction) < 2.0 * friction_dynamic.standard_uncertainty
