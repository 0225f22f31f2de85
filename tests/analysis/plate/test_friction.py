"""Friction from the plate alone, against exact records."""

import numpy as np
import pytest

from analysis.plate.friction import PlateFriction, estimate_plate_friction
from analysis.preparation.free_decay import prepare
from analysis.record import GaugeUncertainty, Record
from analysis.synthetic import Truth, simulate_record

_TRUTH = Truth(friction_static=0.12, tilt_rad=1e-3)


def _estimate(record: Record) -> PlateFriction:
    found = estimate_plate_friction(record, prepare(record))
    assert found is not None
    return found


def test_a_clean_record_gives_friction_to_two_tenths_of_a_percent() -> None:
    many = [_estimate(simulate_record(_TRUTH.replace(seed=seed))) for seed in range(5)]
    assert np.median([found.standard_uncertainty for found in many]) < 2e-4
    found = many[0]
    assert found.friction_dynamic == pytest.approx(0.1, abs=3.0 * found.standard_uncertainty)
    assert found.tilt_rad == pytest.approx(1e-3, abs=3.0 * found.tilt_standard_uncertainty_rad)
    assert not any(variation.is_significant for variation in found.variation.values())


def test_the_lag_of_gauge_2_is_found_and_does_not_bias_friction() -> None:
    found = _estimate(simulate_record(_TRUTH.replace(lag_s=3e-3)))
    assert found.lag_s == pytest.approx(3e-3, abs=4.0 * found.lag_standard_uncertainty_s)
    assert found.friction_dynamic == pytest.approx(0.1, abs=3.0 * found.standard_uncertainty)


def test_uncertainty_covers() -> None:
    """Rms of error over uncertainty lies within 0.8 and 1.2, at any noise and rate."""
    random = np.random.default_rng(1)
    scores = []
    for seed in range(36):
        noise_m, rate_hz = [(2e-5, 1000.0), (5e-6, 500.0), (5e-5, 2000.0)][seed % 3]
        truth = _TRUTH.replace(
            seed=seed, noise_m=noise_m, rate_hz=rate_hz, friction_static=random.uniform(0.1, 0.15)
        )
        found = _estimate(simulate_record(truth))
        scores.append((found.friction_dynamic - 0.1) / found.standard_uncertainty)
    assert 0.75 < np.sqrt(np.mean(np.square(scores))) < 1.25


def test_a_record_without_its_start_serves() -> None:
    found = _estimate(simulate_record(_TRUTH.replace(hold_s=-0.25)))
    assert found.friction_dynamic == pytest.approx(0.1, abs=3.0 * found.standard_uncertainty)


def test_a_stated_lag_makes_the_estimate_sharper() -> None:
    stated = GaugeUncertainty(gain_relative=1e-3, delay_s=1e-3, delay_s_uncertainty=2e-5)
    record = simulate_record(_TRUTH.replace(lag_s=1e-3), relative_gauge=stated)
    assert _estimate(record).standard_uncertainty < _estimate(simulate_record(_TRUTH)).standard_uncertainty


def test_too_few_slips_give_nothing() -> None:
    record = simulate_record(_TRUTH.replace(friction_dynamic=0.45, friction_static=0.46))
    assert estimate_plate_friction(record, prepare(record)) is None
