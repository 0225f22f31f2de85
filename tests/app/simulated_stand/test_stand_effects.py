"""Effects of the simulated stand: against an independent integrator, and gauges against what they state."""

from pathlib import Path

import numpy as np
import pytest

from analysis.laws.stand_parts import STAND_PARAMETERS
from analysis.motion.two_mass import TwoMassParameters
from app.simulated_stand.effects import (
    EFFECTS,
    GAUGE_EFFECTS,
    MOTION_EFFECTS,
    STRIBECK,
    EffectError,
    gauge_values,
    motion_values,
    parse_effects,
)
from app.simulated_stand.gauge_chain import GaugeChain, RcFilter
from app.simulated_stand.motion import RepeatedPullback, released_motion, simulate_stand, stand_truth
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from app.simulated_stand.signal import StandSignal
from benchmarks.real_stand import REL, RealStand, U
from config.files import load_gauges, load_stand

PARAMETERS = TwoMassParameters.from_free_decay(
    period_s=0.32, damping_n1_per_s=0.12, table_mass_kg=131.6, plate_mass_kg=22.4, friction_dynamic=0.1,
    friction_static=0.12, pullback_m=0.012,
)  # fmt: skip
TIMES_S = np.linspace(0.0, 3.0, 601)
RATE_HZ = 1000.0


def test_the_guide_lists_every_effect_with_unit_range_and_parameter():
    guide = (Path(__file__).parents[3] / "docs/how-to/simulate-a-real-stand.md").read_text()
    for name, effect in EFFECTS.items():
        assert f"| `{name}` | {effect.unit} | {effect.low:g} to {effect.high:g} |" in guide
        assert f"`{effect.parameter}` |" in guide


def moving(time_s):
    return 0.012 * np.cos(20.0 * time_s), 0.003 * np.sin(20.0 * time_s)


def test_effects_are_those_of_the_analysis():
    own = {parameter.name: parameter for parameter in STAND_PARAMETERS.values()}
    for effect in MOTION_EFFECTS.values():
        if effect.parameter != STRIBECK:
            known = own[effect.parameter]
            assert (effect.unit, effect.low, effect.high) == (known.unit, known.lower, known.upper)
    assert len({effect.parameter for effect in EFFECTS.values()}) == len(EFFECTS)


@pytest.mark.parametrize(
    ("effects", "real"),
    [
        ({"release-ramp": 0.01}, {"release_ramp_s": 0.01}),
        ({"spring-hardening": 0.02, "film": 0.8}, {"spring_hardening": 0.02, "film_s_per_m": 0.8}),
        ({"stribeck": 0.02}, {"stribeck_m_per_s": 0.02}),
    ],
)
def test_the_motion_is_that_of_an_independent_integrator(effects, real):
    motion = simulate_stand(PARAMETERS, motion_values(effects), 3.0)
    stand = RealStand(friction_static_ratio=1.2, **real)
    state = stand.simulate(3.0).sample(TIMES_S)
    table, relative = motion.sample_displacements(TIMES_S)
    np.testing.assert_allclose(table, state[U], atol=2e-6)
    np.testing.assert_allclose(relative, state[REL], atol=2e-6)


def test_a_filter_passes_half_the_power_at_its_corner_in_blocks_of_any_length():
    time_s = np.arange(20_000) / RATE_HZ
    wave = np.sin(2.0 * np.pi * 30.0 * time_s)
    whole = RcFilter(30.0, RATE_HZ).filter(wave)
    parts = RcFilter(30.0, RATE_HZ)
    blocks = np.concatenate([parts.filter(wave[at : at + 7]) for at in range(0, len(wave), 7)])
    np.testing.assert_allclose(blocks, whole, atol=1e-12)
    assert np.mean(whole[2000:] ** 2) == pytest.approx(0.25, rel=0.01)
    ramp = RcFilter(30.0, RATE_HZ).filter(time_s)
    assert (time_s - ramp)[-1] == pytest.approx(1.0 / (2.0 * np.pi * 30.0), rel=1e-9)


def test_lag_gain_cross_talk_and_bend_are_as_large_as_chosen():
    time_s = np.arange(500) / RATE_HZ
    table_m, relative_m = moving(time_s)
    late = GaugeChain({"gauge_2_lag_s": 2e-3}, 0.012, RATE_HZ).read(moving, time_s)
    np.testing.assert_array_equal(late, (table_m, moving(time_s - 2e-3)[1]))
    values = {"relative_gain": 0.02, "cross_talk": 0.01, "gauge_1_bend": 0.005}
    mixed, _ = GaugeChain({"cross_talk_1": 0.02}, 0.012, RATE_HZ).read(moving, time_s)
    np.testing.assert_allclose(mixed, table_m + 0.02 * relative_m, rtol=1e-12)
    table, relative = GaugeChain(values, 0.012, RATE_HZ).read(moving, time_s)
    np.testing.assert_allclose(relative, 1.02 * (relative_m + 0.01 * table_m), rtol=1e-12)
    assert np.abs(table - table_m).max() == pytest.approx(0.005 * 0.012)
    creeping = GaugeChain({"gauge_2_creep_m": 1e-4}, 0.012, RATE_HZ)
    crept = np.concatenate([creeping.read(moving, part)[1] for part in np.split(time_s, 5)]) - relative_m
    np.testing.assert_allclose(crept, 1e-4 * -np.expm1(-time_s / 10.0), atol=1e-15)
    _, plate = GaugeChain({}, 0.012, RATE_HZ, is_absolute=True).read(moving, time_s)
    np.testing.assert_array_equal(plate, relative_m + table_m)


def test_the_stand_shows_its_effects_however_its_samples_are_taken():
    effects = {"release-ramp": 0.02, "gauge-1-filter": 20.0, "gauge-2-lag": 0.003}
    timetable = Timetable(rest_s=1.0, pull_s=2.0, hold_s=1.5, decay_s=8.0, recentre_s=1.0)
    true = stand_truth(SimulatedStandOptions(), load_stand())

    def counts(effects, at_once):
        options = SimulatedStandOptions(effects=effects, noise_m=0.0)
        motion = RepeatedPullback(true.pullback_m, released_motion(true, timetable, effects), timetable)
        signal = StandSignal(motion, load_gauges(), options, RATE_HZ)
        return np.concatenate([signal.take(at_once)[0] for _ in range(6000 // at_once)])

    real = counts(effects, 6000)
    np.testing.assert_array_equal(counts(effects, 5), real)
    release = int(timetable.release_s * RATE_HZ)
    np.testing.assert_array_equal(real[:1000], counts({}, 6000)[:1000])
    assert np.abs(real - counts({}, 6000))[release:].max() * 2e-9 > 1e-4


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"release-rampe": "1"}, "effect 'release-rampe' is not known: choose from release-ramp"),
        ({"release-ramp": "10"}, "effect release-ramp = 10 s is out of range: give 0 to 0.06"),
        ({"release-ramp": "nan"}, "effect release-ramp = nan s is out of range"),
        ({"film": "much"}, "effect film 'much' is not a number. Give one in the unit s/m"),
    ],
)
def test_an_effect_that_cannot_be_is_refused(given, said):
    with pytest.raises(EffectError, match=said.replace("(", r"\(")):
        parse_effects(given)


def test_a_second_mode_has_a_frequency_and_effects_are_told_apart():
    given = {"second-mode": 0.02, "cross-talk": 0.01, "second-mode-damping": 0.05}
    assert motion_values(given) == {
        "second_mode_frequency_hz": 8.0, "second_mode_damping": 0.05, "second_mode_mass_share": 0.02
    }  # fmt: skip
    assert gauge_values(given) == {"cross_talk": 0.01}
    assert motion_values({"base": 0.01, "base-damping": 0.1}) == {
        "base_compliance": 0.01, "base_frequency_hz": 12.0, "base_damping": 0.1
    }  # fmt: skip
    assert EFFECTS.keys() == MOTION_EFFECTS.keys() | GAUGE_EFFECTS.keys()
