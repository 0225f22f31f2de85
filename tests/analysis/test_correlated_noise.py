"""Correlated noise enlarges the uncertainties; white noise does not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.identify import identify
from analysis.synthetic import Truth, simulate_record
from analysis.uncertainty import noise_variance_factor

RATE_HZ = 500.0


def correlated(count, time_s, rng):
    """Noise of standard deviation 1 with correlation time `time_s` (first-order autoregression)."""
    kept = np.exp(-1.0 / (RATE_HZ * time_s)) if time_s > 0.0 else 0.0
    white = np.sqrt(1.0 - kept**2) * rng.standard_normal(count + 500)
    return lfilter([1.0], [1.0, -kept], white)[500:]


def test_white_noise_is_seldom_called_correlated():
    rng = np.random.default_rng(1)
    times = np.arange(4000) / RATE_HZ

    factors = []
    for _ in range(400):
        noise = rng.standard_normal(len(times))
        factors.append(noise_variance_factor(noise, times, 0.08) / np.mean(noise**2))

    assert sum(factor > 1.0 for factor in factors) <= 6  # 3.5 standard deviations of a skewed chi-square


@pytest.mark.parametrize("time_s", [0.0, 0.004, 0.01])
def test_means_scatter_as_the_factor_says(time_s):
    rng = np.random.default_rng(2)
    times = np.arange(4000) / RATE_HZ

    deviation = []
    for _ in range(200):
        noise = correlated(len(times), time_s, rng)
        deviation.append(noise.mean() / np.sqrt(noise_variance_factor(noise, times, 0.08) / len(times)))

    assert np.std(deviation) == pytest.approx(1.0, abs=0.2)  # four standard deviations; uncorrected: 2 and 3


def test_period_and_damping_of_correlated_readings():
    truth = Truth(friction_dynamic=0.5, rate_hz=RATE_HZ, noise_m=0.0, duration_s=8.0)
    clean, rng = simulate_record(truth), np.random.default_rng(3)
    deviation = []
    for _ in range(40):
        gauges = [
            gauge + 2e-5 * correlated(len(gauge), 0.004, rng)
            for gauge in (clean.table_displacement_m, clean.relative_displacement_m)
        ]
        made = clean.replace(table_displacement_m=gauges[0], relative_displacement_m=gauges[1])
        found = identify(made, model="coulomb").results  # its noise is told here, not which law it followed
        period, damping = found["period_s"], found["damping_n1_per_s"]
        deviation.append((
            (period.value - truth.period_s) / period.standard_uncertainty,
            (damping.value - truth.damping_n1_per_s) / damping.standard_uncertainty,
        ))  # fmt: skip

    assert (np.std(deviation, axis=0) < 1.45).all()  # four standard deviations; uncorrected it would be 2
    assert (np.std(deviation, axis=0) > 0.55).all()
