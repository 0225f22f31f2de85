import numpy as np
import pytest
from pair_kit import Device, decode, pair_source, wire_of
from wire_helpers import join

from drivers.clock import DELIVERY_UNCERTAINTY_S, SkewStatistics

SEEDS = 18
RATE_HZ = 50.0
SETTLED = 90


def devices(random: np.random.Generator, ppm: float) -> tuple[Device, Device]:
    """What ports deliver late is anywhere up to 1 ms, the rest of the lateness is jitter and bursts."""
    return tuple(
        Device(
            RATE_HZ,
            clock_ppm=random.uniform(-ppm, ppm),
            phase_s=random.uniform(0.0, 1 / RATE_HZ),
            latency_s=random.uniform(0.0, 1e-3),
            jitter_s=3e-4,
            bursts=0.03,
        )
        for _ in range(2)
    )


def merged(ppm: float, seed: int):
    pair = devices(np.random.default_rng(1000 + seed), ppm)
    source = pair_source(pair)
    rows = join(decode(source, wire_of(pair, duration_s=5.0, seed=seed)))
    lag_s = np.where(rows.status == 0, 1e-6 * (rows.counts[:, 1] - rows.counts[:, 0]), np.nan)
    return source.skew(SETTLED, len(rows)), lag_s[SETTLED:]


def test_the_mean_skew_is_found_as_well_as_is_said():
    errors = []
    for seed in range(SEEDS):
        skew, lag_s = merged(0.0, seed)
        errors.append((skew.mean_s - np.nanmean(lag_s)) / skew.standard_uncertainty_s)
    # chi-square with 18 degrees of freedom: 0.001 outside on either side
    assert 0.48 < np.sqrt(np.mean(np.square(errors))) < 1.55
    assert np.mean(np.abs(errors) < 1.96) >= 0.87  # of 18, one or two may be outside
    assert abs(np.mean(errors)) < 3.3 / np.sqrt(SEEDS)


def test_the_lag_of_each_moment_lies_within_what_is_said():
    inside = []
    for seed in range(SEEDS // 3):
        skew, lag_s = merged(1500.0, seed)
        stretches_s = np.nanmean(lag_s[: len(lag_s) // 12 * 12].reshape(-1, 12), axis=1)
        inside.extend(np.abs(stretches_s - skew.mean_s) < 1.96 * skew.standard_uncertainty_s)
    assert np.mean(inside) >= 0.95


def test_a_lag_that_drifts_is_uncertain_by_its_drift():
    account = SkewStatistics(100.0)
    account.add(0, np.linspace(-2e-3, 2e-3, 1000), 1e-4)
    skew = account.skew(0, 1000)
    assert skew.mean_s == pytest.approx(0.0, abs=1e-9)
    drift_s = 4e-3 / np.sqrt(12.0)
    expected_s = np.sqrt(drift_s**2 + 1e-4**2 + DELIVERY_UNCERTAINTY_S**2)
    assert skew.standard_uncertainty_s == pytest.approx(expected_s, rel=2e-3)


def test_a_lag_that_changes_within_a_swing_averages_out():
    account = SkewStatistics(100.0)
    account.add(0, np.tile([-2e-3, 2e-3], 500), 0.0)
    assert account.skew(0, 1000).standard_uncertainty_s == pytest.approx(DELIVERY_UNCERTAINTY_S, rel=0.02)


def test_only_rows_of_the_run_count():
    account = SkewStatistics(100.0)
    account.add(0, np.full(500, 3e-3), 0.0)
    account.add(500, np.full(500, 1e-3), 0.0)
    account.add(1000, np.full(10, np.nan), 0.0)
    assert account.skew(500, 1010).mean_s == pytest.approx(1e-3)
    assert account.skew(0, 1000).mean_s == pytest.approx(2e-3)
    assert account.skew(1000, 1010) is None
