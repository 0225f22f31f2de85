"""The damped cosine of the stick tail, against curves of known constants."""

import numpy as np
import pytest

from analysis.preparation.channels import Channel
from analysis.preparation.free_decay import fit_tail
from analysis.preparation.oscillation import (
    damped_cosine,
    dominant_period,
    envelope_curvature,
    fit_damped_cosine,
)
from analysis.record import RecordError

TRUE = np.array([0.12, 2.0 * np.pi / 0.32, 2e-3, -1e-3, 3e-4])


def channel(noise_m=0.0, duration_s=8.0, rate_hz=500.0, seed=0, parameters=TRUE):
    time = 2.0 + np.arange(int(duration_s * rate_hz)) / rate_hz
    curve, _ = damped_cosine(parameters, time - 2.0)
    return Channel(time, curve + noise_m * np.random.default_rng(seed).standard_normal(len(time)))


def test_a_clean_curve_is_met_exactly():
    decay = fit_damped_cosine(channel(), 0.33)

    assert decay.parameters == pytest.approx(TRUE, rel=1e-9)
    assert decay.period_s == pytest.approx(0.32, rel=1e-12)
    assert decay.offset_m == pytest.approx(3e-4, rel=1e-9)


@pytest.mark.parametrize("guess_s", [0.29, 0.31, 0.33, 0.35])
def test_a_start_a_tenth_off_does_not_matter(guess_s):
    assert fit_damped_cosine(channel(2e-5), guess_s).period_s == pytest.approx(0.32, abs=2e-5)


def test_uncertainties_are_the_scatter_of_repeats():
    """Against the scatter of 300 repeats, within three standard errors of a standard deviation (12 %)."""
    decays = [fit_damped_cosine(channel(2e-5, seed=seed), 0.32) for seed in range(300)]

    period = np.array([decay.period_s for decay in decays])
    damping = np.array([decay.damping_per_s for decay in decays])
    assert period.std() == pytest.approx(decays[0].period_uncertainty_s, rel=0.13)
    assert damping.std() == pytest.approx(decays[0].damping_uncertainty_per_s, rel=0.13)
    assert abs(period.mean() - 0.32) < 3.5 * period.std() / np.sqrt(300)
    assert abs(damping.mean() - 0.12) < 3.5 * damping.std() / np.sqrt(300)


def test_uneven_times_and_gaps_are_welcome():
    whole = channel(2e-5)
    kept = np.random.default_rng(1).random(len(whole)) < 0.5
    kept[1000:1300] = False

    decay = fit_damped_cosine(Channel(whole.time_s[kept], whole.value_m[kept]), 0.32)

    assert decay.period_s == pytest.approx(0.32, abs=5.0 * decay.period_uncertainty_s)


@pytest.mark.parametrize("near_s", [0.32, 0.35], ids=["near", "of another oscillation"])
def test_a_tail_is_the_same_whatever_fit_it_began_at(near_s):
    table, other = channel(2e-5), TRUE.copy()
    other[1] = 2.0 * np.pi / near_s
    near = fit_damped_cosine(channel(2e-5, seed=1, parameters=other), near_s)
    cold = fit_tail(table, 3.0, 0.32)

    tail = fit_tail(table, 3.0, 0.32, near)

    assert tail.start_s == cold.start_s
    assert tail.parameters == pytest.approx(cold.parameters, rel=1e-9)


@pytest.mark.parametrize("period_s", [0.2, 0.47])
def test_the_spectrum_tells_the_period_to_some_per_cent(period_s):
    parameters = TRUE.copy()
    parameters[1] = 2.0 * np.pi / period_s

    assert dominant_period(channel(1e-4, parameters=parameters)) == pytest.approx(period_s, rel=0.03)


def test_a_stretch_under_a_period_is_refused():
    with pytest.raises(RecordError, match="shorter than its period"):
        fit_damped_cosine(channel(duration_s=0.25), 0.32)


def test_dry_friction_in_the_stand_bends_the_envelope():
    whole = channel()
    tau = whole.time_s - 2.0
    swing = np.sqrt(TRUE[2] ** 2 + TRUE[3] ** 2) * np.exp(-0.12 * tau) - 1e-4 * tau
    noise = 1e-5 * np.random.default_rng(2).standard_normal(len(tau))
    coulomb = Channel(whole.time_s, swing * np.cos(TRUE[1] * tau + 0.4) + noise)
    viscous = channel(1e-5)

    assert envelope_curvature(coulomb, fit_damped_cosine(coulomb, 0.32)) < -8.0
    assert abs(envelope_curvature(viscous, fit_damped_cosine(viscous, 0.32))) < 4.0


@pytest.mark.parametrize("seed", [1, 19, 28, 36])
def test_noise_over_many_periods_is_refused_and_no_crash(seed):
    """Fitted to noise, a swing may grow until it overflows."""
    time_s = np.arange(0.0, 60.0, 0.005)
    at_rest = Channel(time_s, 1e-3 * np.random.default_rng(seed).standard_normal(len(time_s)))
    with pytest.raises(RecordError, match="no damped cosine fits"):
        fit_damped_cosine(at_rest, 0.04)
